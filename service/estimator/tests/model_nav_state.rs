//! The state with biases: its transition against a numerical one, the bias columns included, and its noise.
//!
//! The oracle moves a neighbouring state with the same raw sample, so that the bias acts through the sample
//! as it does in the filter; the error is left-invariant in the pose and additive in the biases.

mod common;

use common::{
    GRAVITY_W, NOISE, any_input, any_state, assert_close, assert_same_pose, derivative_at_zero,
    seeded,
};
use inekf::lie::LieGroup;
use inekf::model::{Discretisation, ImuInput, InertialState, NavState};
use nalgebra::{SMatrix, SVector, Vector3};

const BOTH: [Discretisation; 2] = [Discretisation::ZeroOrderHold, Discretisation::Euler];

#[test]
fn the_transition_matches_a_numerical_one() {
    let mut rng = seeded(21);
    for discretisation in BOTH {
        for dt_s in [0.01, 0.5] {
            for _ in 0..10 {
                let (chi, measured) = (any_state(&mut rng), any_input(&mut rng));
                let moved = |chi: &NavState| {
                    let step = chi.imu_step(&measured, &GRAVITY_W, dt_s, discretisation);
                    chi.advance(&step, &NOISE)
                };
                let (after, f, _) = moved(&chi);
                let numerical = derivative_at_zero(|xi: &SVector<f64, 15>| {
                    after
                        .inverse()
                        .compose(&moved(&chi.compose(&NavState::exp(xi))).0)
                        .log()
                });
                assert_close("F", &f, &numerical, 1e-9);
            }
        }
    }
}

/// Without bias error the transition does not know the state ([IS] Proposition 1).
#[test]
fn the_pose_block_does_not_depend_on_the_pose() {
    let mut rng = seeded(22);
    let (one, mut other) = (any_state(&mut rng), any_state(&mut rng));
    (other.gyro_bias, other.accel_bias) = (one.gyro_bias, one.accel_bias);
    let measured = any_input(&mut rng);
    let transition = |chi: &NavState| {
        let step = chi.imu_step(&measured, &GRAVITY_W, 0.1, Discretisation::ZeroOrderHold);
        chi.advance(&step, &NOISE).1
    };
    assert_eq!(transition(&one), transition(&other));
}

#[test]
fn the_pose_moves_as_without_biases_and_the_biases_stay() {
    let mut rng = seeded(23);
    for discretisation in BOTH {
        let (chi, measured) = (any_state(&mut rng), any_input(&mut rng));
        let step = chi.imu_step(&measured, &GRAVITY_W, 0.2, discretisation);
        let (after, _, _) = chi.advance(&step, &NOISE);
        let free = ImuInput {
            omega_b: measured.omega_b - chi.gyro_bias,
            force_b: measured.force_b - chi.accel_bias,
        };
        let pose_step = chi.pose.imu_step(&free, &GRAVITY_W, 0.2, discretisation);
        let (pose, _, _) = chi.pose.advance(&pose_step, &NOISE);
        assert_same_pose("pose", &after.pose, &pose, 1e-15);
        assert_eq!(after.gyro_bias, chi.gyro_bias);
        assert_eq!(after.accel_bias, chi.accel_bias);
    }
}

#[test]
fn the_noise_is_that_of_the_pose_and_a_random_walk_of_the_biases() {
    let mut rng = seeded(24);
    let (chi, measured) = (any_state(&mut rng), any_input(&mut rng));
    let dt_s = 0.2;
    let step = chi.imu_step(&measured, &GRAVITY_W, dt_s, Discretisation::ZeroOrderHold);
    let (_, _, q) = chi.advance(&step, &NOISE);
    let mut expected = SMatrix::<f64, 15, 15>::zeros();
    expected
        .fixed_view_mut::<9, 9>(0, 0)
        .copy_from(&chi.pose.advance(&step, &NOISE).2);
    for axis in 0..3 {
        expected[(9 + axis, 9 + axis)] = NOISE.gyro_bias_psd * dt_s;
        expected[(12 + axis, 12 + axis)] = NOISE.accel_bias_psd * dt_s;
    }
    assert_eq!(q, expected);
}

#[test]
fn the_noise_is_exactly_symmetric() {
    let mut rng = seeded(25);
    for _ in 0..100 {
        let (chi, measured) = (any_state(&mut rng), any_input(&mut rng));
        let step = chi.imu_step(&measured, &GRAVITY_W, 0.01, Discretisation::ZeroOrderHold);
        let (_, _, q) = chi.advance(&step, &NOISE);
        assert_eq!(q, q.transpose());
    }
}

/// Two samples with one stamp must not break the filter.
#[test]
fn an_interval_of_no_length_changes_nothing() {
    let mut rng = seeded(26);
    for discretisation in BOTH {
        let (chi, measured) = (any_state(&mut rng), any_input(&mut rng));
        let step = chi.imu_step(&measured, &GRAVITY_W, 0.0, discretisation);
        let (after, f, q) = chi.advance(&step, &NOISE);
        assert_eq!(after, chi);
        assert_eq!(f, SMatrix::<f64, 15, 15>::identity());
        assert_eq!(q, SMatrix::<f64, 15, 15>::zeros());
    }
}

#[test]
fn parts_come_back_as_they_went_in() {
    let mut rng = seeded(27);
    let chi = any_state(&mut rng);
    let (pose, gyro, accel) = (*chi.pose(), chi.gyro_bias(), chi.accel_bias());
    assert_eq!(NavState::from_parts(pose, gyro, accel), chi);
    let bare: inekf::lie::SE23 = InertialState::from_parts(pose, gyro, accel);
    assert_eq!(
        (*bare.pose(), bare.gyro_bias(), bare.accel_bias()),
        (pose, Vector3::zeros(), Vector3::zeros())
    );
}
