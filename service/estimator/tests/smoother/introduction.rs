//! The introductory example of [IS] section II: a straight drive with a heading wrong by 135 degrees, a known start
//! and odometry that is trusted. Every iteration of invariant and of conventional smoothing, and the length of the
//! road in each.

use inekf::filter::{Additive, Belief, Covariance, Left, Side};
use inekf::lie::{LieGroup, SE2, SO2};
use inekf::model::OdometryStep;
use inekf::smoother::{Batch, BatchOptions, Chain};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

use crate::common::golden::{matrix, numbers};
use crate::drive::{Drive, fix, length_m};

const TOLERANCE_M: f64 = 1e-9;

/// One Gauss-Newton step as it comes.
const PLAIN: BatchOptions = BatchOptions {
    iterations: 1,
    tolerance: 0.0,
    jacobians: inekf::smoother::Jacobians::Exact,
    step_control: false,
};

fn golden() -> Value {
    serde_json::from_str(include_str!("../data/se2_intro.json")).expect("valid JSON")
}

fn pose(values: &[f64]) -> SE2 {
    SE2 {
        rotation: SO2::from_angle(values[0]),
        position: Vector2::new(values[1], values[2]),
    }
}

fn chain(case: &Value) -> Drive<SE2, OdometryStep<SE2>, 3, 2> {
    let prior = Belief::new(
        pose(&numbers(&case["prior"])),
        Covariance::from_upper(matrix(&case["P0"])),
    );
    let u: Vector2<f64> = matrix(&case["u"]);
    let step = OdometryStep::new(
        &Vector3::new(0.0, u.x, u.y),
        case["dt"].as_f64().expect("a duration"),
    );
    let steps = case["n_steps"].as_u64().expect("a count") as usize;
    let sigma_m = case["sigma_gps"].as_f64().expect("a standard deviation");
    let seen: Vec<usize> = numbers(&case["gps_index"])
        .iter()
        .map(|i| *i as usize)
        .collect();
    let mut chain = Chain::with_capacity(prior, steps + 1, seen.len());
    for k in 1..=steps {
        chain.advance(step, matrix(&case["Q"]));
        if let Some(index) = seen.iter().position(|state| *state == k) {
            chain.observe(fix(matrix(&case["gps"][index]), sigma_m));
        }
    }
    chain
}

/// The trajectories of every iteration, the first one by dead reckoning.
fn iterations<S: Side>(case: &Value, count: usize) -> Vec<Vec<SE2>> {
    let chain = chain(case);
    let mut batch = Batch::<SE2, S, 3, 2>::with_capacity(chain.states(), 10);
    batch.dead_reckon(&chain);
    let mut trajectories = vec![batch.states().to_vec()];
    for _ in 1..count {
        batch.iterate(&chain, &PLAIN).expect("a solvable problem");
        trajectories.push(batch.states().to_vec());
    }
    trajectories
}

fn assert_golden<S: Side>(case: &Value, name: &str) {
    let expected = case[name]["trajectory"].as_array().expect("iterations");
    let actual = iterations::<S>(case, expected.len());
    for (iteration, (actual, expected)) in actual.iter().zip(expected).enumerate() {
        for (i, (chi, golden)) in actual
            .iter()
            .zip(expected.as_array().expect("states"))
            .enumerate()
        {
            let golden = pose(&numbers(golden));
            let off_m = (chi.position - golden.position).amax();
            let off_rad = (golden.rotation.inverse() * chi.rotation).angle_rad().abs();
            assert!(
                off_m <= TOLERANCE_M && off_rad <= TOLERANCE_M,
                "{name}, iteration {iteration}, state {i}: off by {off_m:e} m and {off_rad:e} rad"
            );
        }
        assert_eq!(actual.len(), expected.as_array().expect("states").len());
    }
}

#[test]
fn every_iteration_of_both_smoothers_is_that_of_50_digits() {
    let golden = golden();
    for name in ["noisy_gps", "noisefree_gps", "noisy_gps_Q1e-4"] {
        assert_golden::<Left>(&golden[name], "IS");
        assert_golden::<Additive>(&golden[name], "conv");
    }
}

#[test]
fn invariant_smoothing_keeps_the_length_of_the_road_and_the_conventional_smoother_does_not() {
    let golden = golden();
    for name in ["noisy_gps", "noisefree_gps"] {
        for states in iterations::<Left>(&golden[name], 9) {
            assert!((length_m(&states) - 70.0).abs() < 1e-10);
        }
        let conventional = iterations::<Additive>(&golden[name], 9);
        for pair in conventional.windows(2) {
            // A step along the tangent of the circle: 70 sqrt(1 + dtheta^2).
            let turned = (pair[0][0].rotation.inverse() * pair[1][0].rotation).angle_rad();
            let expected = 70.0 * (1.0 + turned * turned).sqrt();
            assert!((length_m(&pair[1]) - expected).abs() < 1e-9);
        }
        assert!(length_m(&conventional[1]) > 85.0);
    }
}
