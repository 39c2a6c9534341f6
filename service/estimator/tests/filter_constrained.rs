//! The constraint algebra: `L Delta = T` and a sound covariance whatever the vehicle does, the textbook form of
//! (22) where it exists, what is dropped, what is refused, and the soft form between Kalman and hard.

mod common;

use common::{
    any_rotation, assert_close, assert_within, covariance_of_scale, noise_of_scale, normal, seeded,
};
use inekf::filter::{
    Additive, Belief, Constrained, Constraints, Covariance, GainRule, Gate, Kalman, Left,
    Linearised, Right, Side, UpdateError, UpdateOptions, Verdict, propagate_odometry, update_with,
};
use inekf::lie::{LieGroup, SE2, SE3, SO2, SO3};
use inekf::model::{
    Columns, Declared, Observation, OdometryStep, OutputMismatch, PlanarFix, PlanarPair, PointFix,
    Points, Pose, ProcessColumns, ProcessMismatch, RigidPose, SpatialPair,
};
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;

const SCALE: OutputMismatch = OutputMismatch::MeasurementScale { source: 1 };
const TURNED: OutputMismatch = OutputMismatch::MeasurementRotation {
    source: 0,
    axis_w: None,
};

fn hard_way<const D: usize>() -> ProcessColumns<D> {
    ProcessColumns::new(&[Declared::hard(ProcessMismatch::OdometryScale)]).expect("room")
}

fn linearised<G, S, O, const D: usize, const M: usize>(
    belief: &Belief<G, S, D>,
    observation: &O,
) -> Linearised<G, D, M>
where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
{
    let noise = observation.noise();
    Linearised::at(belief, observation, &belief.mean, &SVector::zeros(), &noise).expect("regular")
}

fn dense<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, a.as_slice())
}

/// Delta and T side by side.
fn columns<const D: usize, const M: usize>(
    constraints: &Constraints<D, M>,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (delta, t): (Vec<_>, Vec<_>) = constraints
        .columns()
        .map(|(delta, t)| (dense(delta), dense(t)))
        .unzip();
    let join = |parts: Vec<DMatrix<f64>>| {
        DMatrix::from_fn(parts[0].nrows(), parts.len(), |row, column| {
            parts[column][row]
        })
    };
    (join(delta), join(t))
}

/// Fails unless every column of `L Delta` is that of T, to `tolerance` of the larger of T and what L sums up. The
/// three columns of a rotation in space, from the third on, have one scale: each is a part of a whole.
fn assert_satisfied(
    what: &str,
    l: &DMatrix<f64>,
    delta: &DMatrix<f64>,
    t: &DMatrix<f64>,
    tolerance: f64,
) {
    let scale = |j: usize| {
        t.column(j)
            .amax()
            .max((l.abs() * delta.column(j).abs()).amax())
    };
    let rotation = (2..delta.ncols()).map(scale).fold(0.0, f64::max);
    for j in 0..delta.ncols() {
        let off = (l * delta.column(j) - t.column(j)).amax();
        let scale = if j < 2 { scale(j) } else { rotation };
        assert!(
            off <= tolerance * scale,
            "{what}, column {j}: off by {off:e} of {scale:e}"
        );
    }
}

/// A body that circles through the origin, standing still at times, with odometry of both kinds of noise.
struct Vehicle {
    truth: SE3,
    way: f64,
}

impl Vehicle {
    fn step(&mut self, k: usize, rng: &mut ChaCha8Rng) -> (OdometryStep<SE3>, SMatrix<f64, 6, 6>) {
        let speed = if k % 500 < 60 { 0.0 } else { 1.0 };
        self.way += 0.05 * speed;
        let mut increment = SVector::<f64, 6>::zeros();
        increment[0] = 0.01 * speed * (0.3 * self.way).sin();
        increment[2] = 0.05 * speed;
        increment[3] = speed;
        increment[5] = 0.1 * speed * self.way.cos();
        self.truth = OdometryStep::<SE3>::new(&increment, 0.1).apply(&self.truth);
        let sigmas = SVector::<f64, 6>::from_column_slice(&[1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2]);
        let q = SMatrix::from_diagonal(&sigmas.component_mul(&sigmas));
        let measured = increment + sigmas.component_mul(&normal::<6, 1>(rng));
        (OdometryStep::new(&measured, 0.1), q)
    }

    fn fixes(&self, rng: &mut ChaCha8Rng) -> SpatialPair {
        Points::new([0, 1].map(|source| PointFix {
            position_w: self.truth.position * [1.0, 1.03][source] + normal::<3, 1>(rng),
            covariance_w: Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 2.0)),
            lever_arm_b: Vector3::zeros(),
            scale_error: 0.0,
        }))
    }
}

fn assert_sound_over_ten_thousand_steps<S: Side>(seed: u64) {
    let mut rng = seeded(seed);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    let mut way = hard_way::<6>();
    let truth = SE3::identity();
    let mut vehicle = Vehicle { truth, way: 0.0 };
    let prior =
        Covariance::from_variances(&SVector::from_fn(|i, _| if i < 3 { 1e-4 } else { 1.0 }));
    let mut belief = Belief::<SE3, S, 6>::from_left_covariance(truth, prior);
    let mut ranks = [0_usize; 7];
    for k in 0..10_000 {
        let (step, q) = vehicle.step(k, &mut rng);
        belief = propagate_odometry(&belief, &step, &q);
        way.advance(&step, &q);
        let fixes = vehicle.fixes(&mut rng);
        let rule = Constrained::new(&belief, &way, &outputs, &fixes);
        let at = linearised(&belief, &fixes);
        let constraints = rule.constraints(&at).expect("room");
        let (delta, t) = columns(&constraints);
        let l = dense(&rule.gain(&belief.covariance, &at).expect("solvable"));
        assert_satisfied(&format!("step {k}"), &l, &delta, &t, 1e-12);
        ranks[constraints.rank().expect("solvable")] += 1;

        let p = dense(belief.covariance.matrix());
        let (h, n) = (dense(&at.h), dense(&at.noise));
        let kept = DMatrix::identity(6, 6) - &l * &h;
        let joseph = &kept * &p * kept.transpose() + &l * n * l.transpose();
        let correction =
            update_with(&mut belief, &fixes, &rule, &UpdateOptions::PLAIN).expect("an update");
        assert_eq!(correction.verdict, Verdict::Accepted);
        way.reset();
        let after = *belief.covariance.matrix();
        let joseph = SMatrix::<f64, 6, 6>::from_column_slice(joseph.as_slice());
        assert_within(
            &format!("Joseph, step {k}"),
            &after,
            &joseph,
            1e-12 * joseph.amax(),
        );
        assert_eq!(after, after.transpose(), "step {k}");
        let eigenvalues = after.symmetric_eigenvalues();
        assert!(
            eigenvalues.min() > -1e-13 * eigenvalues.max(),
            "step {k}: {eigenvalues}"
        );
    }
    assert!(
        ranks[3] > 500,
        "standing still takes the odometry's column out"
    );
    assert!(ranks[4] > 5000, "moving, all count, and a rotation for two");
    assert_eq!(ranks[3] + ranks[4], 10_000);
    let off = (belief.mean.position - vehicle.truth.position).norm();
    assert!(
        off < 5.0 * belief.covariance.matrix().trace().sqrt().max(1.0),
        "off by {off} m"
    );
}

#[test]
fn the_constraints_hold_over_ten_thousand_steps_left() {
    assert_sound_over_ten_thousand_steps::<Left>(301);
}

#[test]
fn the_constraints_hold_over_ten_thousand_steps_additive() {
    assert_sound_over_ten_thousand_steps::<Additive>(302);
}

/// A belief, a way and two fixes in the plane with nothing special about them.
fn any_case<S: Side>(rng: &mut ChaCha8Rng) -> (Belief<SE2, S, 3>, OdometryStep<SE2>, PlanarPair) {
    let chi = SE2 {
        rotation: SO2::from_angle(3.0 * normal::<1, 1>(rng).x),
        position: 40.0 * normal::<2, 1>(rng),
    };
    let p = covariance_of_scale(&Vector3::new(0.05, 2.0, 3.0), rng);
    let pair = Points::new(core::array::from_fn(|_| PointFix {
        position_w: chi.position + 2.0 * normal::<2, 1>(rng),
        covariance_w: noise_of_scale(&Vector2::new(3.0, 2.0), rng),
        lever_arm_b: normal::<2, 1>(rng),
        scale_error: 0.0,
    }));
    let step = OdometryStep::new(&normal::<3, 1>(rng), 0.1);
    (Belief::from_left_covariance(chi, p), step, pair)
}

fn after<G: RigidPose<D, N>, const D: usize, const N: usize>(
    declared: &[Declared<ProcessMismatch>],
    step: &OdometryStep<G>,
) -> ProcessColumns<D> {
    let mut way = ProcessColumns::new(declared).expect("room");
    way.advance(step, &SMatrix::zeros());
    way
}

#[test]
fn the_gain_and_covariance_are_those_of_the_paper() {
    let mut rng = seeded(303);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    for _ in 0..100 {
        let (belief, step, pair) = any_case::<Left>(&mut rng);
        let way = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
        let rule = Constrained::new(&belief, &way, &outputs, &pair);
        let at = linearised(&belief, &pair);
        let (delta, t) = columns(&rule.constraints(&at).expect("room"));
        // (22), with an inverse of Psi.
        let (p, h) = (dense(belief.covariance.matrix()), dense(&at.h));
        let s = &h * &p * h.transpose() + dense(&at.noise);
        let s_inverse = s.clone().try_inverse().expect("regular");
        let k = &p * h.transpose() * &s_inverse;
        let gamma = &t - &k * &delta;
        let psi_inverse = (delta.transpose() * &s_inverse * &delta)
            .try_inverse()
            .expect("regular");
        let l = &k + &gamma * &psi_inverse * delta.transpose() * &s_inverse;
        let p_after = &p - &k * s * k.transpose() + &gamma * psi_inverse * gamma.transpose();

        let gain = rule.gain(&belief.covariance, &at).expect("solvable");
        let l = SMatrix::<f64, 3, 4>::from_column_slice(l.as_slice());
        assert_within("L", &gain, &l, 1e-9 * l.amax());
        let mut posterior = belief;
        let correction =
            update_with(&mut posterior, &pair, &rule, &UpdateOptions::PLAIN).expect("an update");
        assert_within("xi", &correction.xi, &(l * at.residual), 1e-8 * l.amax());
        let p_after = SMatrix::<f64, 3, 3>::from_column_slice(p_after.as_slice());
        assert_within(
            "P",
            posterior.covariance.matrix(),
            &p_after,
            1e-8 * p_after.amax(),
        );
    }
}

#[test]
fn the_correction_does_not_see_the_mismatch() {
    let mut rng = seeded(304);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    for _ in 0..20 {
        let (belief, step, pair) = any_case::<Right>(&mut rng);
        let way = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
        let correct = |pair: &PlanarPair| {
            let rule = Constrained::new(&belief, &way, &outputs, pair);
            update_with(&mut belief.clone(), pair, &rule, &UpdateOptions::PLAIN).expect("an update")
        };
        let mut wrong = pair;
        wrong.fixes[1].position_w += belief.mean.position * 0.07;
        let seen = pair.fixes[0].expected_w(&belief.mean);
        wrong.fixes[0].position_w += Vector2::new(seen.y, -seen.x) * -0.04;
        let (a, b) = (correct(&pair), correct(&wrong));
        assert_close("xi", &a.xi, &b.xi, 1e-9);
        assert!((a.nis - b.nis).abs() < 1e-8 * a.nis.max(1.0));
        assert_eq!((a.degrees, b.degrees), (1, 1));
    }
}

#[test]
fn left_and_right_have_one_gain() {
    let mut rng = seeded(305);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    for _ in 0..20 {
        let (left, step, pair) = any_case::<Left>(&mut rng);
        let right = left.to_right();
        let way = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
        let of_left = Constrained::new(&left, &way, &outputs, &pair)
            .gain(&left.covariance, &linearised(&left, &pair));
        let of_right = Constrained::new(&right, &way, &outputs, &pair)
            .gain(&right.covariance, &linearised(&right, &pair));
        let expected = left.mean.adjoint() * of_left.expect("solvable");
        assert_within(
            "L",
            &of_right.expect("solvable"),
            &expected,
            1e-9 * expected.amax(),
        );
    }
}

#[test]
fn columns_without_size_are_dropped() {
    let mut rng = seeded(306);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    let (mut belief, step, mut pair) = any_case::<Left>(&mut rng);
    belief.mean.position = Vector2::zeros();
    pair.fixes
        .iter_mut()
        .for_each(|fix| fix.lever_arm_b = Vector2::zeros());
    let gain = |way: &ProcessColumns<3>, outputs: &[Declared<OutputMismatch>]| {
        let at = linearised(&belief, &pair);
        Constrained::new(&belief, way, outputs, &pair)
            .gain(&belief.covariance, &at)
            .expect("solvable")
    };
    let moved = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
    assert_eq!(
        gain(&moved, &outputs),
        gain(&moved, &[]),
        "at the origin the fixes' columns vanish"
    );
    let kalman = Kalman
        .gain(&belief.covariance, &linearised(&belief, &pair))
        .expect("regular");
    assert_within(
        "standing at the origin",
        &gain(&hard_way(), &outputs),
        &kalman,
        1e-14 * kalman.amax(),
    );
}

#[test]
fn a_small_column_counts_as_much_as_a_large_one() {
    let mut rng = seeded(307);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    for (way_m, far_m) in [(1e-3, 1e6), (1e3, 1e-3), (1e-6, 1e4)] {
        let (mut belief, _, pair) = any_case::<Left>(&mut rng);
        belief.mean.position *= far_m / belief.mean.position.norm();
        let step = OdometryStep::<SE2>::new(&Vector3::new(0.01, way_m, 0.1 * way_m), 0.1);
        let way = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
        let rule = Constrained::new(&belief, &way, &outputs, &pair);
        let at = linearised(&belief, &pair);
        let constraints = rule.constraints(&at).expect("room");
        assert_eq!(constraints.rank(), Ok(3), "{way_m} m beside {far_m} m");
        let (delta, t) = columns(&constraints);
        let l = rule.gain(&belief.covariance, &at).expect("solvable");
        assert_satisfied(
            &format!("{way_m} m beside {far_m} m"),
            &dense(&l),
            &delta,
            &t,
            1e-12,
        );
    }
}

#[test]
fn constraints_without_a_solution_are_refused() {
    let mut rng = seeded(308);
    let (mut belief, step, pair) = any_case::<Left>(&mut rng);
    let single: PlanarFix = Points::new([pair.fixes[0]]);
    let all = [OutputMismatch::MeasurementScale { source: 0 }, TURNED].map(Declared::hard);
    let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
    let way = after(&declared, &step);
    let before = belief;
    let rule = Constrained::new(&belief, &way, &all, &single);
    let refused = update_with(&mut belief, &single, &rule, &UpdateOptions::PLAIN);
    assert_eq!(refused, Err(UpdateError::UnsolvableConstraints));
    assert_eq!(belief, before);
    let reason = UpdateError::UnsolvableConstraints.to_string();
    assert!(
        reason.contains("not enough independent outputs"),
        "{reason}"
    );

    // The same at start-up, where nothing has moved yet.
    let way = ProcessColumns::in_general_position::<SE2, 2>(&declared).expect("room");
    let none = ProcessColumns::<_, ProcessMismatch>::new(&[]).expect("room");
    let check = Constrained::check::<SE2>;
    assert_eq!(
        check(&way, &all, &single),
        Err(UpdateError::UnsolvableConstraints)
    );
    assert_eq!(check(&way, &all[..1], &single), Ok(2));
    assert_eq!(check(&none, &all, &single), Ok(2));
    assert_eq!(
        Constrained::check::<SE2>(&way, &[SCALE, TURNED].map(Declared::hard), &pair),
        Ok(3)
    );
    let missing = Constrained::check::<SE2>(&none, &[Declared::hard(SCALE)], &single);
    assert_eq!(
        missing,
        Err(UpdateError::NoSuchSource {
            source: 1,
            sources: 1
        })
    );
    // With a sigma it is no constraint, but an uncertainty.
    let soft = [Declared::soft(ProcessMismatch::OdometryScale, 0.1)];
    let way = ProcessColumns::in_general_position::<SE2, 2>(&soft).expect("room");
    assert_eq!(check(&way, &all, &single), Ok(2));
}

/// Where the steps lead if way and turn are longer than measured by these shares.
fn led<'a>(
    start: SE2,
    steps: impl Iterator<Item = &'a Vector3<f64>>,
    [way, turn]: [f64; 2],
) -> SE2 {
    steps.fold(start, |chi, step| {
        let rotation = SO2::from_angle(step.x * (1.0 + turn));
        SE2 {
            rotation: chi.rotation * rotation,
            position: chi.position + chi.rotation.rotate(&(step.yz() * (1.0 + way))),
        }
    })
}

#[test]
fn a_wrong_scale_of_way_and_turn_is_taken_back_whatever_the_prior() {
    const SMALL: f64 = 1e-5;
    let mut rng = seeded(313);
    let declared = [
        ProcessMismatch::OdometryScale,
        ProcessMismatch::OdometryTurnScale,
    ];
    let declared = declared.map(Declared::hard);
    for _ in 0..100 {
        let (mut belief, _, mut pair) = any_case::<Left>(&mut rng);
        // Well below pi, beyond which a rotation is a smaller one to the other side.
        let steps: [Vector3<f64>; 5] = core::array::from_fn(|_| 0.5 * normal(&mut rng));
        let mut way = ProcessColumns::new(&declared).expect("room");
        for step in &steps {
            way.advance(&OdometryStep::<SE2>::new(step, 0.1), &SMatrix::zeros());
        }
        let wrong = SMALL * normal::<2, 1>(&mut rng);
        let truth = led(belief.mean, steps.iter(), wrong.into());
        belief.mean = led(belief.mean, steps.iter(), [0.0; 2]);
        for fix in &mut pair.fixes {
            fix.position_w = fix.expected_w(&truth);
        }

        let rule = Constrained::new(&belief, &way, &[], &pair);
        let at = linearised(&belief, &pair);
        let constraints = rule.constraints(&at).expect("room");
        assert_eq!(constraints.rank(), Ok(2));
        let (delta, t) = columns(&constraints);
        let l = dense(&rule.gain(&belief.covariance, &at).expect("solvable"));
        assert_satisfied("way and turn", &l, &delta, &t, 1e-12);
        let (p, h) = (dense(belief.covariance.matrix()), dense(&at.h));
        let kept = DMatrix::identity(3, 3) - &l * &h;
        let joseph = &kept * p * kept.transpose() + &l * dense(&at.noise) * l.transpose();
        let joseph = SMatrix::<f64, 3, 3>::from_column_slice(joseph.as_slice());

        let before = belief.mean.inverse().compose(&truth).log().norm();
        update_with(&mut belief, &pair, &rule, &UpdateOptions::PLAIN).expect("an update");
        let after = belief.mean.inverse().compose(&truth).log().norm();
        assert!(after < 1e-3 * before, "{before:e} before, {after:e} after");
        let p = belief.covariance.matrix();
        assert_within("Joseph", p, &joseph, 1e-12 * joseph.amax());
    }
    let single: PlanarFix = Points::new([any_case::<Left>(&mut rng).2.fixes[0]]);
    let way = ProcessColumns::in_general_position::<SE2, 2>(&declared).expect("room");
    assert_eq!(Constrained::check::<SE2>(&way, &[], &single), Ok(2));
}

/// `pair` with its residuals scaled so that their normalised square, as `judged` finds it, is `nis`.
fn with_nis<S: Side>(
    belief: &Belief<SE2, S, 3>,
    pair: &PlanarPair,
    nis: f64,
    judged: impl Fn(&PlanarPair) -> f64,
) -> PlanarPair {
    let factor = (nis / judged(pair)).sqrt();
    let mut scaled = *pair;
    for fix in &mut scaled.fixes {
        let expected = fix.expected_w(&belief.mean);
        fix.position_w = expected + (fix.position_w - expected) * factor;
    }
    scaled
}

#[test]
fn the_gate_is_that_of_what_the_constraints_leave() {
    let mut rng = seeded(314);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    let options = UpdateOptions {
        gate: Gate::of_probability(0.99),
        ..UpdateOptions::PLAIN
    };
    for _ in 0..20 {
        let (belief, step, pair) = any_case::<Left>(&mut rng);
        let way = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
        let constrained = |pair: &PlanarPair, options: &UpdateOptions| {
            let rule = Constrained::new(&belief, &way, &outputs, pair);
            update_with(&mut belief.clone(), pair, &rule, options).expect("an update")
        };
        let plain = |pair: &PlanarPair, options: &UpdateOptions| {
            update_with(&mut belief.clone(), pair, &Kalman, options).expect("an update")
        };
        // Of four outputs the constraints leave one. Quantiles of 0.99 from tables, for one and for four.
        let nis = |pair: &PlanarPair| constrained(pair, &UpdateOptions::PLAIN).nis;
        for (target, verdict) in [(6.634, Verdict::Accepted), (6.636, Verdict::Gated)] {
            let pair = with_nis(&belief, &pair, target, nis);
            let judged = constrained(&pair, &options);
            assert_eq!((judged.verdict, judged.degrees), (verdict, 1));
        }
        let nis = |pair: &PlanarPair| plain(pair, &UpdateOptions::PLAIN).nis;
        for (target, verdict) in [(13.276, Verdict::Accepted), (13.278, Verdict::Gated)] {
            let pair = with_nis(&belief, &pair, target, nis);
            let judged = plain(&pair, &options);
            assert_eq!((judged.verdict, judged.degrees), (verdict, 4));
        }
    }
}

#[test]
fn in_space_a_rotation_takes_two_of_three() {
    let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
    let way = ProcessColumns::in_general_position::<SE3, 3>(&declared).expect("room");
    let fix = PointFix {
        position_w: Vector3::zeros(),
        covariance_w: Matrix3::identity(),
        lever_arm_b: Vector3::new(0.3, 0.1, -0.2),
        scale_error: 0.0,
    };
    let single = Points::<1, 3, 3>::new([fix]);
    let turned = Declared::hard(TURNED);
    let scaled = Declared::hard(OutputMismatch::MeasurementScale { source: 0 });
    assert_eq!(Constrained::check::<SE3>(&way, &[turned], &single), Ok(3));
    let refused = Constrained::check::<SE3>(&way, &[turned, scaled], &single);
    assert_eq!(refused, Err(UpdateError::UnsolvableConstraints));
    // On the axes one of the three columns vanishes, and the other two are as long as each other.
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let mut fix = fix;
        fix.lever_arm_b = Vector3::zeros();
        let mean = SE3 {
            rotation: any_rotation(&mut seeded(309)),
            position: axis * 1e5,
        };
        let belief =
            Belief::<SE3, Left, 6>::new(mean, Covariance::from_variances(&SVector::repeat(1.0)));
        let points = Points::<1, 3, 3>::new([fix]);
        let outputs = [turned];
        let none = ProcessColumns::<_, ProcessMismatch>::new(&[]).expect("room");
        let rule = Constrained::new(&belief, &none, &outputs, &points);
        let constraints = rule
            .constraints(&linearised(&belief, &points))
            .expect("room");
        assert_eq!(constraints.rank(), Ok(2));
    }
}

#[test]
fn there_is_room_for_sixteen_columns() {
    let mut constraints = Constraints::<3, 4>::default();
    let one = Columns::one(SVector::<f64, 4>::repeat(1.0));
    let none = Columns::one(Vector3::zeros());
    for _ in 0..16 {
        constraints.push(&one, &none, f64::INFINITY).expect("room");
    }
    let refused = constraints.push(&one, &none, f64::INFINITY);
    assert_eq!(refused, Err(UpdateError::TooManyConstraints));
    assert_eq!(constraints.rank(), Ok(1));
}

/// The posterior of `(xi + T m, m)` with `m ~ N(0, sigma^2)` as a dense Kalman filter: gain and covariance of the
/// first part.
fn marginal(
    p: &DMatrix<f64>,
    h: &DMatrix<f64>,
    n: &DMatrix<f64>,
    (delta, t): &(DMatrix<f64>, DMatrix<f64>),
    sigmas: &[f64],
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (d, c) = t.shape();
    let m = DMatrix::from_fn(
        c,
        c,
        |i, j| if i == j { sigmas[i] * sigmas[i] } else { 0.0 },
    );
    let mut joint = DMatrix::zeros(d + c, d + c);
    joint
        .view_mut((0, 0), (d, d))
        .copy_from(&(p + t * &m * t.transpose()));
    joint.view_mut((0, d), (d, c)).copy_from(&(t * &m));
    joint
        .view_mut((d, 0), (c, d))
        .copy_from(&(&m * t.transpose()));
    joint.view_mut((d, d), (c, c)).copy_from(&m);
    let mut h_joint = DMatrix::zeros(h.nrows(), d + c);
    h_joint.view_mut((0, 0), h.shape()).copy_from(h);
    h_joint
        .view_mut((0, d), delta.shape())
        .copy_from(&(delta - h * t));
    let s = &h_joint * &joint * h_joint.transpose() + n;
    let k = &joint * h_joint.transpose() * s.try_inverse().expect("regular");
    let posterior = &joint - &k * &h_joint * &joint;
    (
        k.rows(0, d).into_owned(),
        posterior.view((0, 0), (d, d)).into_owned(),
    )
}

#[test]
fn a_soft_constraint_is_an_unknown_with_a_variance() {
    let mut rng = seeded(310);
    for _ in 0..50 {
        let (belief, step, pair) = any_case::<Left>(&mut rng);
        let way = after(
            &[Declared::soft(ProcessMismatch::OdometryScale, 0.1)],
            &step,
        );
        let outputs = [Declared::soft(SCALE, 0.07), Declared::soft(TURNED, 0.03)];
        let rule = Constrained::new(&belief, &way, &outputs, &pair);
        let at = linearised(&belief, &pair);
        let delta_t = columns(&rule.constraints(&at).expect("room"));
        let p = dense(belief.covariance.matrix());
        let (l, p_after) = marginal(
            &p,
            &dense(&at.h),
            &dense(&at.noise),
            &delta_t,
            &[0.1, 0.07, 0.03],
        );
        let mut posterior = belief;
        let gain = rule.gain(&belief.covariance, &at).expect("regular");
        let correction =
            update_with(&mut posterior, &pair, &rule, &UpdateOptions::PLAIN).expect("an update");
        assert_eq!(correction.degrees, 4);
        assert_close(
            "gain",
            &gain,
            &SMatrix::from_column_slice(l.as_slice()),
            1e-10,
        );
        let p_after = SMatrix::<f64, 3, 3>::from_column_slice(p_after.as_slice());
        assert_close("P", posterior.covariance.matrix(), &p_after, 1e-10);
    }
}

#[test]
fn between_nothing_and_everything_unknown_lie_kalman_and_hard() {
    let mut rng = seeded(311);
    let (belief, step, pair) = any_case::<Left>(&mut rng);
    let at = linearised(&belief, &pair);
    let gain = |sigma: f64| {
        let way = after(
            &[Declared::soft(ProcessMismatch::OdometryScale, sigma)],
            &step,
        );
        let outputs = [SCALE, TURNED].map(|mismatch| Declared::soft(mismatch, sigma));
        Constrained::new(&belief, &way, &outputs, &pair)
            .gain(&belief.covariance, &at)
            .expect("regular")
    };
    let hard = gain(f64::INFINITY);
    let kalman = Kalman.gain(&belief.covariance, &at).expect("regular");
    assert_within("sigma of 0", &gain(0.0), &kalman, 1e-13 * kalman.amax());
    let mut last = f64::INFINITY;
    for sigma in [10.0, 100.0, 1000.0] {
        let off = (gain(sigma) - hard).amax() / hard.amax();
        assert!(off < 0.02 * last, "sigma {sigma}: {off:e} after {last:e}");
        last = off;
    }
    assert!(last < 1e-5, "{last:e}");
}

#[test]
fn an_iterated_constrained_update_ends_where_its_correction_vanishes() {
    let mut rng = seeded(312);
    let outputs = [SCALE, TURNED].map(Declared::hard);
    for _ in 0..20 {
        let (belief, step, pair) = any_case::<Left>(&mut rng);
        let way = after(&[Declared::hard(ProcessMismatch::OdometryScale)], &step);
        let rule = Constrained::new(&belief, &way, &outputs, &pair);
        let options = UpdateOptions {
            iterations: 100,
            tolerance: 1e-12,
            ..UpdateOptions::ITERATED
        };
        let mut posterior = belief;
        let correction = update_with(&mut posterior, &pair, &rule, &options).expect("an update");
        assert!(correction.iterations < 100, "settles");
        let noise = Observation::<SE2, 3, 4>::noise(&pair);
        let at = Linearised::at(&belief, &pair, &posterior.mean, &correction.xi, &noise)
            .expect("regular");
        let gain = rule.gain(&belief.covariance, &at).expect("solvable");
        let again = gain * (at.residual + at.h * correction.xi);
        assert_close("fixed point", &again, &correction.xi, 1e-8);
        let delta_t = columns(&rule.constraints(&at).expect("room"));
        assert_satisfied("at the end", &dense(&gain), &delta_t.0, &delta_t.1, 1e-12);
    }
}

#[test]
fn a_fix_far_from_the_origin_of_the_wheel_still_counts() {
    // One source whose frame is turned: what it says along the line of sight is kept.
    let mean = SE3 {
        rotation: SO3::identity(),
        position: Vector3::new(100.0, 0.0, 0.0),
    };
    let mut belief =
        Belief::<SE3, Left, 6>::new(mean, Covariance::from_variances(&SVector::repeat(1.0)));
    let points = Points::<1, 3, 3>::new([PointFix {
        position_w: Vector3::new(102.0, 7.0, -9.0),
        covariance_w: Matrix3::identity(),
        lever_arm_b: Vector3::zeros(),
        scale_error: 0.0,
    }]);
    let outputs = [Declared::hard(TURNED)];
    let none = ProcessColumns::<_, ProcessMismatch>::new(&[]).expect("room");
    let rule = Constrained::new(&belief, &none, &outputs, &points);
    let correction =
        update_with(&mut belief, &points, &rule, &UpdateOptions::PLAIN).expect("an update");
    assert_eq!(correction.degrees, 1);
    assert!((correction.nis - 2.0).abs() < 1e-12, "2 m of sigma sqrt(2)");
    assert_close(
        "position",
        &belief.mean.position_w(),
        &Vector3::new(101.0, 0.0, 0.0),
        1e-12,
    );
}
