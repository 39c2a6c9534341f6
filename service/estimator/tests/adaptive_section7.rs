//! One configuration of the adaptive filter for every law of mismatch of [LC] section VII: position RMSE and NEES
//! of the pose over the second half, 200 runs for each law.

mod common;

use common::section7::{DT_S, Law, Run, STEPS, odometry_noise, start_variances};
use inekf::filter::{
    Adaptive, Belief, Covariance, Expected, STANDARD_MODES, UpdateOptions, Verdict, standard_modes,
};
use inekf::lie::{LieGroup, SE2};
use inekf::model::{OutputMismatch, PlanarFix, ProcessMismatch, Unknowns};

/// Odometry scale, measurement scale, rotation: the order of [`Unknowns`].
const PROCESS: [ProcessMismatch; 1] = [ProcessMismatch::OdometryScale];
const OUTPUTS: [OutputMismatch; 2] = [
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    },
];

/// The one configuration.
const EXPECTED: [Expected; 3] = [
    Expected {
        sigma: 0.08,
        burst_sigma: 0.25,
        of_motion: true,
    },
    Expected {
        sigma: 0.06,
        burst_sigma: 0.06,
        of_motion: false,
    },
    Expected {
        sigma: 0.03,
        burst_sigma: 0.03,
        of_motion: false,
    },
];

const RUNS: u64 = 200;

/// The first of the runs; those of other tests of this experiment begin below.
const FIRST_RUN: u64 = 20_000;

/// Mean squared position error, m^2, and mean NEES of the pose for each dimension, over the second half of `run`.
fn second_half(run: &Run) -> [f64; 2] {
    let unknowns = Unknowns::new::<2, 3>(&PROCESS, &OUTPUTS).expect("three parameters");
    let (modes, switching) = standard_modes(&EXPECTED, DT_S);
    let prior = Belief::new(run.start, Covariance::from_variances(&start_variances()));
    let mut bank: Adaptive<SE2, 3, 3, 6, STANDARD_MODES> =
        Adaptive::new(&prior, modes, switching, UpdateOptions::PLAIN);
    let mut sums = [0.0; 2];
    for k in 0..STEPS {
        bank.advance(&unknowns, &run.steps[k], &odometry_noise());
        for (source, fix) in run.pairs[k].fixes.into_iter().enumerate() {
            let seen = unknowns.observe_from(source, PlanarFix::new([fix]));
            assert_eq!(bank.update(&seen), Ok(Verdict::Accepted));
        }
        if k < STEPS / 2 {
            continue;
        }
        let estimate = bank.estimate();
        let pose = estimate.mean.pose;
        let xi = pose.inverse().compose(&run.truth[k]).log();
        let p = estimate.covariance.matrix().fixed_view::<3, 3>(0, 0);
        let information = p.try_inverse().expect("a regular covariance");
        sums[0] += (pose.position - run.truth[k].position).norm_squared();
        sums[1] += xi.dot(&(information * xi)) / 3.0;
    }
    sums.map(|sum| sum / (STEPS - STEPS / 2) as f64)
}

/// Position RMSE at most `bound_m`, and NEES for each dimension between 0.7 and 1.5.
fn assert_row(law: Law, exists: [bool; 3], bound_m: f64) {
    let mut sums = [0.0; 2];
    for seed in FIRST_RUN..FIRST_RUN + RUNS {
        let of_run = second_half(&Run::with_only(seed, law, exists));
        sums = [sums[0] + of_run[0], sums[1] + of_run[1]];
    }
    let [rmse_m, nees] = [(sums[0] / RUNS as f64).sqrt(), sums[1] / RUNS as f64];
    println!("{law:?} {exists:?}: {rmse_m:.3} m (at most {bound_m}), NEES {nees:.2}");
    assert!(rmse_m <= bound_m, "{law:?} {exists:?}: {rmse_m} m");
    assert!((0.7..1.5).contains(&nees), "{law:?} {exists:?}: {nees}");
}

const ALL: [bool; 3] = [true; 3];

/// Each mismatch alone must be no worse than all together may be.
fn assert_alone(law: Law, bound_m: f64) {
    for only in 0..3 {
        assert_row(law, std::array::from_fn(|i| i == only), bound_m);
    }
}

#[test]
fn constant_mismatch() {
    assert_row(Law::Constant, ALL, 0.52);
}

#[test]
fn mismatch_redrawn_for_each_step() {
    assert_row(Law::Redrawn, ALL, 0.72);
}

#[test]
fn mismatch_in_bursts() {
    assert_row(Law::Bursts, ALL, 1.25);
}

#[test]
fn no_mismatch() {
    assert_row(Law::Clean, ALL, 0.42);
}

#[test]
fn one_constant_mismatch() {
    assert_alone(Law::Constant, 0.52);
}

#[test]
fn one_mismatch_redrawn_for_each_step() {
    assert_alone(Law::Redrawn, 0.72);
}

#[test]
fn one_mismatch_in_bursts() {
    assert_alone(Law::Bursts, 1.25);
}
