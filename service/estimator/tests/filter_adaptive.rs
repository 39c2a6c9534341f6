//! The parts of the adaptive filter against what they must reduce to: one mode is an augmented filter, the white part
//! is noise through a numerical derivative, weights are densities written out, merging has the moments of samples.

mod common;

use common::section7::{Law, Run, odometry_noise, start_variances};
use common::{assert_close, derivative_at_zero, normal, seeded};
use inekf::filter::adaptive::mixture::merged;
use inekf::filter::{
    Adaptive, Belief, Covariance, Expected, Gate, Left, Mode, STANDARD_MODES, Switching,
    UpdateOptions, Verdict, propagate_augmented, standard_modes, update,
};
use inekf::lie::{LieGroup, SE2, SO2};
use inekf::model::{
    Augmented, Declared, Observation, OdometryStep, OutputMismatch, PlanarFix, PlanarPair,
    PointFix, ProcessMismatch, Unknowns,
};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use rand::RngExt;

type State = Augmented<SE2, 3, 3, 6>;
type Bank<const S: usize> = Adaptive<SE2, 3, 3, 6, S>;
type Tangent = SVector<f64, 6>;

const PROCESS: [ProcessMismatch; 1] = [ProcessMismatch::OdometryScale];
const OUTPUTS: [OutputMismatch; 2] = [
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    },
];
const DT_S: f64 = 0.1;

fn unknowns() -> Unknowns {
    Unknowns::new::<2, 3>(&PROCESS, &OUTPUTS).expect("three parameters")
}

fn state(theta: f64, x: f64, y: f64, parameters: [f64; 3]) -> State {
    let pose = SE2 {
        rotation: SO2::from_angle(theta),
        position: Vector2::new(x, y),
    };
    Augmented::new(pose, parameters.into())
}

fn step() -> OdometryStep<SE2> {
    OdometryStep::new(&Vector3::new(0.05, 1.2, -0.1), DT_S)
}

fn q() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1e-6, 2e-4, 3e-4))
}

fn fix(position_w: Vector2<f64>) -> PointFix<2> {
    PointFix {
        position_w,
        covariance_w: Matrix2::new(9.0, 1.0, 1.0, 4.0),
        lever_arm_b: Vector2::new(0.7, -0.3),
        scale_error: 0.0,
    }
}

fn prior() -> Belief<SE2, Left, 3> {
    let variances = Vector3::new(0.01, 4.0, 4.0);
    let mean = state(0.1, 11.0, 9.0, [0.0; 3]).pose;
    Belief::new(mean, Covariance::from_variances(&variances))
}

/// One mode for ever, with a walk and these white parts.
fn mode(entry: f64, walk: f64, white: [f64; 3]) -> Mode<3> {
    Mode {
        entry_sigma: Vector3::repeat(entry),
        walk_sigma: Vector3::repeat(walk),
        white_sigma: white.into(),
        white_interval_s: 0.2,
    }
}

fn never<const S: usize>(initial: [f64; S]) -> Switching<S> {
    Switching {
        initial,
        rates_hz: [[0.0; S]; S],
    }
}

/// The augmented belief with which a mode of this entry begins.
fn entered(entry: f64) -> Belief<State, Left, 6> {
    let mut variances = Tangent::repeat(entry * entry);
    variances
        .fixed_rows_mut::<3>(0)
        .copy_from(&prior().covariance.matrix().diagonal());
    let mean = Augmented::new(prior().mean, Vector3::zeros());
    Belief::new(mean, Covariance::from_variances(&variances))
}

#[test]
fn a_bank_of_one_mode_is_an_augmented_filter() {
    let mut rng = seeded(1);
    let modes = [mode(0.1, 0.02, [0.0; 3])];
    let mut bank = Bank::new(&prior(), modes, never([1.0]), UpdateOptions::PLAIN);
    let mut belief = entered(0.1);
    let mut noise = SMatrix::<f64, 6, 6>::from_diagonal_element(0.02 * 0.02 * DT_S);
    noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&q());
    for _ in 0..50 {
        bank.advance(&unknowns(), &step(), &q());
        belief = propagate_augmented(&belief, &unknowns(), &step(), &noise);
        let seen = belief.mean.pose.position + 2.0 * normal::<2, 1>(&mut rng);
        let pair = PlanarPair::new([fix(seen), fix(seen * 1.05)]);
        let pair = unknowns().observe(pair);
        assert_eq!(bank.update(&pair), Ok(Verdict::Accepted));
        update(&mut belief, &pair, &UpdateOptions::PLAIN).expect("an update");
        let estimate = bank.estimate();
        let apart = estimate.mean.inverse().compose(&belief.mean).log();
        assert!(apart.norm() < 1e-9, "{apart}");
        assert_close(
            "P",
            estimate.covariance.matrix(),
            belief.covariance.matrix(),
            1e-9,
        );
    }
}

/// The white part moves the pose as a change of the parameters does: here by the derivative of the step as it is
/// meant, `chi (Omega, (1 + m) u)`.
#[test]
fn the_white_part_of_the_motion_is_noise_on_its_parameter() {
    let white = [0.3, 0.2, 0.1];
    let mut bank = Bank::new(
        &prior(),
        [mode(0.0, 0.0, white)],
        never([1.0]),
        UpdateOptions::PLAIN,
    );
    bank.advance(&unknowns(), &step(), &q());
    let kappa = step().kappa;
    let by_scale = derivative_at_zero(|m: &SVector<f64, 1>| {
        let longer = SE2 {
            position: kappa.position * (1.0 + m.x),
            ..kappa
        };
        kappa.inverse().compose(&longer).log()
    });
    let f = kappa.inverse().adjoint();
    // Only the odometry's scale acts on the motion; a draw lasts for two steps.
    let expected = f * prior().covariance.matrix() * f.transpose()
        + q()
        + by_scale * by_scale.transpose() * (0.3 * 0.3 * 0.2 / DT_S);
    let of_pose = bank.estimate().covariance.matrix().fixed_view::<3, 3>(0, 0) * 1.0;
    assert_close("P", &of_pose, &expected, 1e-7);
}

/// Two modes that never switch: their weights stand as the densities of the innovation, written out.
#[test]
fn weights_are_the_likelihoods_of_the_modes() {
    let modes = [mode(0.02, 0.0, [0.0; 3]), mode(0.05, 0.0, [0.1, 0.2, 0.3])];
    let initial = [0.3, 0.7];
    let mut bank = Bank::new(&prior(), modes, never(initial), UpdateOptions::PLAIN);
    let pair = PlanarPair::new([fix(Vector2::new(14.0, 8.0)), fix(Vector2::new(12.0, 11.0))]);
    let seen = unknowns().observe(pair);
    let mut densities = [0.0; 2];
    for (j, entry) in [0.02, 0.05].into_iter().enumerate() {
        let belief = entered(entry);
        let h: SMatrix<f64, 4, 6> = seen.left_jacobian(&belief.mean);
        let z: SVector<f64, 4> = seen.residual(&belief.mean);
        let mut white = SMatrix::<f64, 6, 6>::zeros();
        for k in 0..3 {
            white[(3 + k, 3 + k)] = modes[j].white_sigma[k].powi(2);
        }
        let r: SMatrix<f64, 4, 4> = Observation::<State, 6, 4>::noise(&seen);
        let s = h * (belief.covariance.matrix() + white) * h.transpose() + r;
        let square = z.dot(&(s.try_inverse().expect("regular") * z));
        densities[j] = initial[j] * (-0.5 * square).exp() / s.determinant().sqrt();
    }
    bank.update(&seen).expect("an update");
    let total: f64 = densities.iter().sum();
    for (weight, density) in bank.weights().iter().zip(densities) {
        assert!((weight - density / total).abs() < 1e-12, "{weight}");
    }
}

/// Sources that come one at a time have the rows of the stack.
#[test]
fn one_source_is_a_part_of_the_stack() {
    let at = state(0.9, 15.0, 6.0, [0.03, -0.08, 0.04]);
    let fixes = [fix(Vector2::new(14.0, 8.0)), fix(Vector2::new(12.0, 11.0))];
    let stack = unknowns().observe(PlanarPair::new(fixes));
    let h: SMatrix<f64, 4, 6> = stack.left_jacobian(&at);
    let z: SVector<f64, 4> = stack.residual(&at);
    for (source, fix) in fixes.into_iter().enumerate() {
        let alone = unknowns().observe_from(source, PlanarFix::new([fix]));
        let h_alone: SMatrix<f64, 2, 6> = alone.left_jacobian(&at);
        let z_alone: SVector<f64, 2> = alone.residual(&at);
        assert_eq!(h_alone, h.fixed_view::<2, 6>(2 * source, 0));
        assert_eq!(z_alone, z.fixed_rows::<2>(2 * source));
    }
    assert!(h[(0, 5)] != 0.0 && h[(2, 4)] != 0.0 && h[(0, 4)] == 0.0);
}

#[test]
fn merging_has_the_moments_of_samples() {
    let mut rng = seeded(3);
    let weights = [0.2, 0.5, 0.3];
    let beliefs: [Belief<State, Left, 6>; 3] = [
        state(0.5, 10.0, 5.0, [0.0; 3]),
        state(0.62, 10.3, 4.8, [0.1, 0.0, 0.02]),
        state(0.55, 9.7, 5.4, [-0.1, 0.05, 0.0]),
    ]
    .map(|mean| {
        let root = 0.05 * normal::<6, 6>(&mut rng);
        Belief::new(mean, Covariance::from_upper(root * root.transpose()))
    });
    let all = merged(&weights, &beliefs).expect("positive weights");
    let roots = beliefs.map(|belief| {
        let factor = belief.covariance.matrix().cholesky();
        factor.expect("a regular covariance").l()
    });
    let count = 100_000;
    let (mut mean, mut second) = (Tangent::zeros(), SMatrix::<f64, 6, 6>::zeros());
    for _ in 0..count {
        let i = match rng.random_range(0.0..1.0) {
            pick if pick < 0.2 => 0,
            pick if pick < 0.7 => 1,
            _ => 2,
        };
        let off = State::exp(&(roots[i] * normal::<6, 1>(&mut rng)));
        let sample = beliefs[i].mean.compose(&off);
        let error = all.mean.inverse().compose(&sample).log();
        mean += error / count as f64;
        second += error * error.transpose() / count as f64;
    }
    let size = all.covariance.matrix().norm();
    assert!(mean.norm() < 0.03 * size.sqrt(), "{mean}");
    assert!((second - all.covariance.matrix()).norm() < 0.05 * size);
    // The order of the components, and so the running sum, does not matter.
    let backwards = [beliefs[2], beliefs[1], beliefs[0]];
    let reversed = merged(&[weights[2], weights[1], weights[0]], &backwards).expect("weights");
    assert_close(
        "P",
        reversed.covariance.matrix(),
        all.covariance.matrix(),
        1e-12,
    );
    assert!(merged(&[0.0; 3], &beliefs).is_none());
}

fn standard_bank() -> Bank<STANDARD_MODES> {
    let expected = [true, false, false].map(|of_motion| Expected {
        sigma: 0.05,
        burst_sigma: 0.1,
        of_motion,
    });
    let (modes, switching) = standard_modes(&expected, DT_S);
    let options = UpdateOptions {
        gate: Gate::at(30.0),
        ..UpdateOptions::ITERATED
    };
    Bank::new(&prior(), modes, switching, options)
}

#[test]
fn the_standard_chain_is_one() {
    let expected = [Expected {
        sigma: 0.05,
        burst_sigma: 0.1,
        of_motion: true,
    }];
    let (_, switching) = standard_modes(&expected, DT_S);
    assert!((switching.initial.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let rates = switching.rates_hz.iter().flatten();
    assert!(rates.into_iter().all(|rate| *rate >= 0.0));
}

#[test]
fn weights_stay_a_distribution_and_what_is_refused_changes_nothing() {
    let mut bank = standard_bank();
    let mut chi = bank.estimate().mean.pose;
    for k in 0..2000 {
        let way_m = if k % 400 < 200 { 1.0 } else { 0.0 };
        let step = OdometryStep::<SE2>::new(&Vector3::new(0.01, way_m, 0.0), DT_S);
        chi = step.apply(&chi);
        bank.advance(&unknowns(), &step, &q());
        let antenna = chi.position + chi.rotation.rotate(&Vector2::new(0.7, -0.3));
        let seen = unknowns().observe(PlanarPair::new([fix(antenna), fix(antenna)]));
        assert_eq!(bank.update(&seen), Ok(Verdict::Accepted));
        assert!((bank.weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(bank.estimate().is_plausible());
    }
    let before = bank;
    let at = |x_m: f64| {
        let fix = fix(Vector2::new(x_m, 0.0));
        unknowns().observe_from(0, PlanarFix::new([fix]))
    };
    assert_eq!(bank.update(&at(1e6)), Ok(Verdict::Gated));
    assert_eq!(bank, before);
    assert!(bank.update(&at(f64::NAN)).is_err());
    assert_eq!(bank, before);
}

/// The gate asks whether any mode can explain a fix: a fix beyond that of a mode without mismatch is accepted if a
/// mode with one foretells it, and moves the weight there.
#[test]
fn what_one_mode_explains_is_no_outlier() {
    let modes = [mode(0.0, 0.0, [0.0; 3]), mode(0.5, 0.0, [0.0; 3])];
    let options = UpdateOptions {
        gate: Gate::at(30.0),
        ..UpdateOptions::PLAIN
    };
    let far = prior().mean.position * 3.0;
    let seen = unknowns().observe_from(1, PlanarFix::new([fix(far)]));
    let mut sure = Bank::new(&prior(), [modes[0]], never([1.0]), options);
    assert_eq!(sure.update(&seen), Ok(Verdict::Gated));
    let mut open = Bank::new(&prior(), modes, never([0.9, 0.1]), options);
    assert_eq!(open.update(&seen), Ok(Verdict::Accepted));
    assert!(open.weights()[1] > 0.999, "{:?}", open.weights());
}

/// Entering a mode forgets the mismatches, and keeps what is known of the pose.
#[test]
fn a_mode_that_is_entered_draws_its_mismatches_anew() {
    let mut rng = seeded(5);
    let fast = Switching {
        initial: [1.0, 0.0],
        rates_hz: [[0.0, 1e6], [0.0, 0.0]],
    };
    let modes = [mode(0.2, 0.0, [0.0; 3]), mode(0.07, 0.0, [0.0; 3])];
    let mut bank = Bank::new(&prior(), modes, fast, UpdateOptions::PLAIN);
    bank.advance(&unknowns(), &step(), &q());
    let fixes = [(); 2].map(|()| fix(prior().mean.position * 1.1 + normal::<2, 1>(&mut rng)));
    bank.update(&unknowns().observe(PlanarPair::new(fixes)))
        .expect("an update");
    let before = bank.estimate();
    assert!(before.mean.parameters.norm() > 1e-3);
    // Standing still without noise: the pose must not move, and the first mode is left for good.
    let still = OdometryStep::<SE2>::new(&Vector3::zeros(), DT_S);
    bank.advance(&unknowns(), &still, &Matrix3::zeros());
    assert!(bank.weights()[1] > 0.999_999, "{:?}", bank.weights());
    let after = bank.estimate();
    assert!(after.mean.parameters.norm() < 1e-6);
    let apart = before.mean.pose.inverse().compose(&after.mean.pose).log();
    assert!(apart.norm() < 1e-6, "{apart}");
    let (p, before) = (after.covariance.matrix(), before.covariance.matrix());
    let of_pose = |p: &SMatrix<f64, 6, 6>| p.fixed_view::<3, 3>(0, 0).into_owned();
    assert_close("P_xx", &of_pose(p), &of_pose(before), 1e-6);
    let of_mismatches = p.fixed_view::<3, 3>(3, 3).into_owned();
    assert_close(
        "P_ee",
        &of_mismatches,
        &(Matrix3::identity() * (0.07 * 0.07)),
        1e-6,
    );
}

/// A bank of the standard modes for the odometry's scale and these other mismatches of sigma zero, over one run of
/// \[LC\] VII: weights, estimate of the pose, its covariance, estimate and variance of the scale.
fn with_silent<const P: usize, const D: usize>(
    silent: &[ProcessMismatch],
    outputs: &[OutputMismatch],
) -> ([f64; STANDARD_MODES], SE2, Matrix3<f64>, [f64; 2]) {
    let soft = |mismatch: &ProcessMismatch| Declared::soft(*mismatch, 0.0);
    let mut process = vec![Declared::soft(ProcessMismatch::OdometryScale, 0.08)];
    process.extend(silent.iter().map(soft));
    let outputs: Vec<_> = outputs.iter().map(|it| Declared::soft(*it, 0.0)).collect();
    let (unknowns, sigmas) = Unknowns::declared::<2, P>(&process, &outputs).expect("room for all");
    let (modes, switching) =
        standard_modes(&Expected::of(&unknowns, &sigmas, &(sigmas * 3.0)), DT_S);
    let run = Run::draw(3, Law::Bursts);
    let prior = Belief::new(run.start, Covariance::from_variances(&start_variances()));
    let mut bank: Adaptive<SE2, 3, P, D, STANDARD_MODES> =
        Adaptive::new(&prior, modes, switching, UpdateOptions::ITERATED);
    for (step, pair) in run.steps.iter().zip(&run.pairs).take(100) {
        bank.advance(&unknowns, step, &odometry_noise());
        assert_eq!(bank.update(&unknowns.observe(*pair)), Ok(Verdict::Accepted));
    }
    let estimate = bank.estimate();
    let p = estimate.covariance.matrix();
    for k in 1..P {
        assert_eq!(
            estimate.mean.parameters[k], 0.0,
            "parameter {k} never moves"
        );
        assert_eq!(p.row(3 + k).amax(), 0.0, "nor is it uncertain");
    }
    (
        *bank.weights(),
        estimate.mean.pose,
        p.fixed_view::<3, 3>(0, 0).into_owned(),
        [estimate.mean.parameters[0], p[(3, 3)]],
    )
}

#[test]
fn a_mismatch_of_sigma_zero_and_a_place_left_over_change_nothing() {
    let alone = with_silent::<1, 4>(&[], &[]);
    assert!(
        alone.3[0].abs() > 1e-3,
        "the one that is declared is learned"
    );
    let silent = [
        ProcessMismatch::OdometryTurnScale,
        ProcessMismatch::OdometryRotationBias { axis: 0 },
    ];
    assert_eq!(with_silent::<6, 9>(&[], &[]), alone, "places left over");
    assert_eq!(with_silent::<3, 6>(&silent, &[]), alone, "sigma zero");
    assert_eq!(with_silent::<6, 9>(&silent, &OUTPUTS), alone, "both");
}

#[test]
fn what_is_declared_becomes_parameters() {
    let scale = Declared::soft(ProcessMismatch::OdometryScale, 0.1);
    let turned = OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    };
    let turned = Declared::soft(turned, 0.02);
    let (unknowns, sigmas) = Unknowns::declared::<3, 6>(&[scale], &[turned]).expect("four of six");
    assert_eq!(sigmas, Tangent::from([0.1, 0.02, 0.02, 0.02, 0.0, 0.0]));
    let burst = Tangent::from([0.3, 0.1, 0.1, 0.1, 0.0, 0.0]);
    let expected = Expected::of(&unknowns, &sigmas, &burst);
    assert!(expected[0].of_motion && !expected[1].of_motion && !expected[5].of_motion);
    assert_eq!((expected[3].sigma, expected[3].burst_sigma), (0.02, 0.1));
    assert!(
        Unknowns::declared::<3, 3>(&[scale], &[turned]).is_none(),
        "four, not three"
    );
    let unknown = Declared::hard(ProcessMismatch::OdometryTurnScale);
    assert!(
        Unknowns::declared::<3, 6>(&[unknown], &[]).is_none(),
        "no state without a sigma"
    );
}
