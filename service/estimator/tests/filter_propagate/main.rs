//! The propagation by blocks against the one by general matrix products, which
//! `filter_side.rs` holds to numerical derivatives: every side, 9 and 15 states, both schemes, and the corners
//! of the input. [`late`] holds corrections of the past, carried to now, to a replay.

#[path = "../common/mod.rs"]
mod common;

mod late;

use common::{
    GRAVITY_W, NOISE, any_belief, any_input, any_state, assert_same_covariance, assert_same_pose,
    normal, seeded,
};
use inekf::filter::{
    Additive, Belief, Covariance, InertialSide, Left, Right, propagate, propagate_dense,
};
use inekf::lie::SE23;
use inekf::model::{Discretisation, ImuInput, ImuNoise, InertialState, NavState};
use nalgebra::{SVector, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

const SCHEMES: [Discretisation; 2] = [Discretisation::ZeroOrderHold, Discretisation::Euler];

fn assert_one_step<G: InertialState<D>, S: InertialSide, const D: usize>(
    belief: &Belief<G, S, D>,
    measured: &ImuInput,
    dt_s: f64,
    noise: &ImuNoise,
    what: &str,
) {
    for scheme in SCHEMES {
        let by_blocks = propagate(belief, measured, &GRAVITY_W, dt_s, scheme, noise);
        let dense = propagate_dense(belief, measured, &GRAVITY_W, dt_s, scheme, noise);
        let what = format!("{what}, {D} states, {scheme:?}");
        assert_same_pose(&what, by_blocks.mean.pose(), dense.mean.pose(), 1e-15);
        assert_eq!(by_blocks.mean.gyro_bias(), dense.mean.gyro_bias());
        assert_eq!(by_blocks.mean.accel_bias(), dense.mean.accel_bias());
        let p = by_blocks.covariance.matrix();
        assert_same_covariance(&what, p, dense.covariance.matrix(), 1e-12);
        assert_eq!(p, &p.transpose(), "{what}");
    }
}

fn assert_steps<G: InertialState<D>, S: InertialSide, const D: usize>(
    side: &str,
    state: impl Fn(&mut ChaCha8Rng) -> G,
    seed: u64,
) {
    let mut rng = seeded(seed);
    for _ in 0..100 {
        let mean = state(&mut rng);
        let belief: Belief<G, S, D> = any_belief(mean, 0.3, &mut rng);
        let measured = any_input(&mut rng);
        // From a fast IMU to a gap in which the body turns by a radian.
        let dt_s = 10f64.powf(rng.random_range(-4.0..0.0));
        assert_one_step(&belief, &measured, dt_s, &NOISE, side);
    }
}

#[test]
fn the_left_error_moves_as_the_dense_products_say() {
    assert_steps::<SE23, Left, 9>("left", |rng| any_state(rng).pose, 401);
    assert_steps::<NavState, Left, 15>("left", any_state, 402);
}

#[test]
fn the_right_error_moves_as_the_dense_products_say() {
    assert_steps::<SE23, Right, 9>("right", |rng| any_state(rng).pose, 403);
    assert_steps::<NavState, Right, 15>("right", any_state, 404);
}

#[test]
fn the_additive_error_moves_as_the_dense_products_say() {
    assert_steps::<SE23, Additive, 9>("additive", |rng| any_state(rng).pose, 405);
    assert_steps::<NavState, Additive, 15>("additive", any_state, 406);
}

/// No rotation, no force, no time, no noise, nothing known: each leaves zeros where blocks are combined.
#[test]
fn the_corners_are_no_different() {
    let mut rng = seeded(407);
    let still = ImuInput {
        omega_b: Vector3::zeros(),
        force_b: Vector3::zeros(),
    };
    let silent = ImuNoise {
        gyro_psd: 0.0,
        accel_psd: 0.0,
        gyro_bias_psd: 0.0,
        accel_bias_psd: 0.0,
    };
    let state = any_state(&mut rng);
    let unbiased = NavState::from_parts(state.pose, Vector3::zeros(), Vector3::zeros());
    let belief: Belief<NavState, Left, 15> = any_belief(unbiased, 0.3, &mut rng);
    let measured = any_input(&mut rng);
    assert_one_step(&belief, &still, 0.01, &NOISE, "at rest");
    assert_one_step(&belief, &measured, 0.01, &silent, "no noise");
    assert_one_step(&belief, &measured, 0.0, &NOISE, "no time");

    let certain = Belief::<_, Left, 15>::new(
        state,
        Covariance::from_variances(&SVector::<f64, 15>::zeros()),
    );
    let after = propagate(&certain, &still, &GRAVITY_W, 0.01, SCHEMES[0], &silent);
    assert_eq!(after.covariance, certain.covariance);
}

/// A chain of a thousand steps keeps the rotation on the group and both ways together.
#[test]
fn a_long_chain_stays_together() {
    let mut rng = seeded(408);
    let mut by_blocks: Belief<NavState, Left, 15> = any_belief(any_state(&mut rng), 0.3, &mut rng);
    let mut dense = by_blocks;
    for _ in 0..1000 {
        let measured = ImuInput {
            omega_b: 0.3 * normal::<3, 1>(&mut rng),
            force_b: normal::<3, 1>(&mut rng),
        };
        let scheme = SCHEMES[0];
        by_blocks = propagate(&by_blocks, &measured, &GRAVITY_W, 0.01, scheme, &NOISE);
        dense = propagate_dense(&dense, &measured, &GRAVITY_W, 0.01, scheme, &NOISE);
    }
    let [x, y, z, w] = by_blocks.mean.pose.rotation.quaternion_xyzw();
    assert!((x * x + y * y + z * z + w * w - 1.0).abs() < 4.0 * f64::EPSILON);
    assert_same_covariance(
        "after 1000 steps",
        by_blocks.covariance.matrix(),
        dense.covariance.matrix(),
        1e-10,
    );
}
