//! The constrained update: sound over ten thousand steps, blind to the mismatch, and at what price.

use inekf::filter::{Additive, Belief, Constrained, GainRule, InertialSide, Left, Right};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{
    Declared, ImuIncrement, ImuNoise, InertialMismatch, InertialScale, InertialState, MeanMismatch,
    Motion, NavState, OutputMismatch, Points, Pose, ProcessColumns, SpatialPair,
};
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};

use crate::common::{GRAVITY_W, any_belief, any_input, any_pose, assert_within, seeded};
use crate::drive::{LEVER_ARMS_B, Run, SILENT, STEPS_PER_FIX, ZOH, fixes_of, linearised};
use crate::fault::{ACCEL_SCALE, Fault, GYRO_SCALE, SCALE, accel_bias, every_kind, gyro_bias};

fn dense<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, a.as_slice())
}

fn assert_sound_over_ten_thousand_steps<G, S, T, const D: usize>(
    declared: &[T],
    outputs: &[Declared<OutputMismatch>],
    expected_ranks: [usize; 7],
    seed: u64,
) where
    G: InertialState<D> + Pose<D, 3>,
    S: InertialSide,
    T: MeanMismatch,
    ImuIncrement: Motion<D, 3, Mismatch = T, Noise = ImuNoise>,
{
    let mut run = Run::<G, S, T, D>::start(declared, 1.0, seed);
    let mut ranks = [0_usize; 7];
    for k in 0..10_000 / STEPS_PER_FIX {
        run.drive(|actual| *actual);
        let fixes: SpatialPair = run.fixes(LEVER_ARMS_B);
        let rule = run.rule(outputs, &fixes);
        let at = linearised(&run.belief, &fixes);
        let constraints = rule.constraints(&at).expect("room");
        let l = rule.gain(&run.belief.covariance, &at).expect("solvable");
        for (delta, t) in constraints.columns() {
            let scale = t.amax().max((l.abs() * delta.abs()).amax());
            let off = (l * delta - t).amax();
            assert!(off <= 1e-12 * scale, "fix {k}: {off:e} of {scale:e}");
        }
        ranks[constraints.rank().expect("solvable")] += 1;

        let (p, h) = (dense(run.belief.covariance.matrix()), dense(&at.h));
        let kept = DMatrix::identity(D, D) - dense(&l) * h;
        let joseph = &kept * p * kept.transpose() + dense(&(l * at.noise * l.transpose()));
        let joseph = SMatrix::<f64, D, D>::from_column_slice(joseph.as_slice());
        run.fuse(&fixes, &rule).expect("an update");
        let after = *run.belief.covariance.matrix();
        let bound = 1e-12 * joseph.amax();
        assert_within(&format!("Joseph, fix {k}"), &after, &joseph, bound);
        assert_eq!(after, after.transpose(), "fix {k}");
        let eigenvalues = dense(&after).symmetric_eigenvalues();
        assert!(
            eigenvalues.min() > -1e-13 * eigenvalues.max(),
            "fix {k}: {eigenvalues}"
        );
    }
    assert_eq!(ranks, expected_ranks);
    let covariance = run.belief.left_covariance();
    let off = run.belief.mean.pose().between(&run.vehicle.truth).log();
    for i in 0..9 {
        let sigma = covariance.matrix()[(i, i)].sqrt();
        assert!(off[i].abs() < 5.0 * sigma, "{i}: {off} with {sigma}");
    }
}

#[test]
fn the_constraints_hold_over_ten_thousand_steps_left() {
    let declared = [GYRO_SCALE, accel_bias(Vector3::x())];
    let outputs = [Declared::hard(SCALE)];
    // Standing a fifth of the time, which takes the gyroscope's scale out.
    let ranks = [0, 0, 500, 2000, 0, 0, 0];
    assert_sound_over_ten_thousand_steps::<SE23, Left, _, 9>(&declared, &outputs, ranks, 511);
}

#[test]
fn the_constraints_hold_over_ten_thousand_steps_right() {
    let declared = [gyro_bias(Vector3::z()), accel_bias(Vector3::x())];
    let ranks = [0, 0, 2500, 0, 0, 0, 0];
    assert_sound_over_ten_thousand_steps::<SE23, Right, _, 9>(&declared, &[], ranks, 512);
}

#[test]
fn the_constraints_hold_over_ten_thousand_steps_additive() {
    let declared = [GYRO_SCALE, ACCEL_SCALE];
    let ranks = [0, 500, 2000, 0, 0, 0, 0];
    assert_sound_over_ten_thousand_steps::<SE23, Additive, _, 9>(&declared, &[], ranks, 513);
}

#[test]
fn the_constraints_hold_over_ten_thousand_steps_beside_biases() {
    let declared = [InertialScale::Gyro, InertialScale::Accel];
    let ranks = [0, 500, 2000, 0, 0, 0, 0];
    assert_sound_over_ten_thousand_steps::<NavState, Left, _, 15>(&declared, &[], ranks, 514);
}

/// The errors right after each update of a drive of 20 s whose sensors have the mismatch `m`, with `share` of the
/// noise; constrained or not.
fn errors<G, S, T, const D: usize, const K: usize, const M: usize>(
    mismatch: T,
    m: f64,
    share: f64,
    is_constrained: bool,
) -> Vec<SVector<f64, 9>>
where
    G: InertialState<D> + Pose<D, 3>,
    S: InertialSide,
    T: Fault,
    ImuIncrement: Motion<D, 3, Mismatch = T, Noise = ImuNoise>,
{
    let declared = [mismatch];
    let declared = if is_constrained { &declared[..] } else { &[] };
    let mut run = Run::<G, S, T, D>::start(declared, share, 521);
    let mut lever_arms_b = [Vector3::zeros(); K];
    lever_arms_b.copy_from_slice(&LEVER_ARMS_B[..K]);
    let after_fix = |_| {
        run.drive(|actual| mismatch.measured(actual, m));
        let fixes: Points<K, 3, M> = run.fixes(lever_arms_b);
        let rule = run.rule(&[], &fixes);
        run.fuse(&fixes, &rule).expect("an update");
        run.belief.mean.pose().between(&run.vehicle.truth).log()
    };
    (0..100).map(after_fix).collect()
}

/// That the constrained filter's error stays where it is when the sensors go wrong by m, and the other's does not.
fn assert_invariant<G, S, T, const D: usize, const K: usize, const M: usize>(mismatch: T, m: f64)
where
    G: InertialState<D> + Pose<D, 3>,
    S: InertialSide,
    T: Fault,
    ImuIncrement: Motion<D, 3, Mismatch = T, Noise = ImuNoise>,
{
    let moved = |m: f64, share: f64, is_constrained: bool| {
        let errors = |m: f64| errors::<G, S, T, D, K, M>(mismatch, m, share, is_constrained);
        let (with, without) = (errors(m), errors(0.0));
        let squares = with
            .iter()
            .zip(&without)
            .map(|(a, b)| (a - b).norm_squared());
        (squares.sum::<f64>() / with.len() as f64).sqrt()
    };
    // Without noise and with next to no mismatch, to first order: not at all.
    let tiny = 1e-6 * m;
    let (constrained, plain) = (moved(tiny, 0.0, true), moved(tiny, 0.0, false));
    assert!(constrained < 1e-4 * plain, "{constrained:e} of {plain:e}");
    // With noise, little: the columns are those of the estimate, which is wrong by the noise.
    let (constrained, plain) = (moved(m, 0.2, true), moved(m, 0.2, false));
    assert!(constrained < 0.1 * plain, "{constrained:e} of {plain:e}");
}

fn assert_every_kind_invariant<S: InertialSide>() {
    for (mismatch, m) in every_kind().into_iter().zip([0.01, 0.1, 0.01, 0.01]) {
        assert_invariant::<SE23, S, _, 9, 2, 6>(mismatch, m);
    }
    // What a single source tells.
    assert_invariant::<SE23, S, _, 9, 1, 3>(accel_bias(Vector3::x()), 0.1);
    assert_invariant::<SE23, S, _, 9, 1, 3>(ACCEL_SCALE, 0.01);
    // Beside states for the biases.
    for scale in [InertialScale::Gyro, InertialScale::Accel] {
        assert_invariant::<NavState, S, _, 15, 2, 6>(scale, 0.01);
    }
}

#[test]
fn the_estimate_does_not_see_the_mismatch_left() {
    assert_every_kind_invariant::<Left>();
}

#[test]
fn the_estimate_does_not_see_the_mismatch_right() {
    assert_every_kind_invariant::<Right>();
}

#[test]
fn the_estimate_does_not_see_the_mismatch_additive() {
    assert_every_kind_invariant::<Additive>();
}

#[test]
fn left_and_right_have_one_gain() {
    let mut rng = seeded(531);
    let fixes: SpatialPair = fixes_of(LEVER_ARMS_B);
    for _ in 0..20 {
        let left: Belief<SE23, Left, 9> = any_belief(any_pose(&mut rng), 0.1, &mut rng);
        let right = left.to_right();
        let declared = [gyro_bias(Vector3::y()), ACCEL_SCALE].map(Declared::hard);
        let mut columns = ProcessColumns::new(&declared).expect("room");
        for _ in 0..2 {
            let input = any_input(&mut rng);
            let increment = ImuIncrement::new(&input, &GRAVITY_W, 0.3, ZOH);
            columns.advance(&increment, &SILENT);
        }
        let of_left = Constrained::new(&left, &columns, &[], &fixes)
            .gain(&left.covariance, &linearised(&left, &fixes));
        let of_right = Constrained::new(&right, &columns, &[], &fixes)
            .gain(&right.covariance, &linearised(&right, &fixes));
        let expected = left.mean.adjoint() * of_left.expect("solvable");
        let of_right = of_right.expect("solvable");
        assert_within("L", &of_right, &expected, 1e-9 * expected.amax());
    }
}

/// Standard deviations of attitude (rad) and velocity (m/s), the largest of three, after a drive of 20 s with unknown
/// biases; `None` if the filter was refused an update on the way.
fn left_unknown<const K: usize, const M: usize>(
    declared: &[InertialMismatch],
    lever_arms_b: [Vector3<f64>; K],
) -> Option<[f64; 2]> {
    let mut run = Run::<SE23, Left, _, 9>::start(declared, 1.0, 541);
    for _ in 0..100 {
        run.drive(|actual| *actual);
        let fixes: Points<K, 3, M> = run.fixes(lever_arms_b);
        let rule = run.rule(&[], &fixes);
        run.fuse(&fixes, &rule).ok()?;
    }
    let sigmas = run.belief.covariance.matrix().diagonal().map(f64::sqrt);
    let largest = |first| sigmas.fixed_rows::<3>(first).amax();
    Some([largest(0), largest(3)])
}

#[test]
fn an_unknown_turn_takes_two_sources_and_a_push_takes_the_velocity() {
    let turning = [Vector3::x(), Vector3::y(), Vector3::z()].map(gyro_bias);
    let [attitude, _] = left_unknown::<2, 6>(&turning, LEVER_ARMS_B).expect("two see it");
    assert!(attitude < 0.04, "{attitude} rad with two sources");
    assert_eq!(left_unknown::<1, 3>(&turning, [Vector3::zeros()]), None);
    let about_z = &turning[2..];
    let [attitude, _] = left_unknown::<2, 6>(about_z, LEVER_ARMS_B).expect("two see it");
    assert!(attitude < 0.02, "{attitude} rad with two sources");
    let [attitude, _] = left_unknown::<1, 3>(about_z, [Vector3::zeros()]).expect("solvable");
    assert!(
        attitude > 3.0,
        "{attitude} rad from where it is: nothing is known"
    );
    let pushed = [accel_bias(Vector3::x())];
    let [_, velocity] = left_unknown::<1, 3>(&pushed, [Vector3::zeros()]).expect("solvable");
    assert!((1.0..4.0).contains(&velocity), "{velocity} m/s");
    let [_, velocity] = left_unknown::<1, 3>(&[], [Vector3::zeros()]).expect("solvable");
    assert!(velocity < 0.05, "{velocity} m/s if nothing is unknown");
}
