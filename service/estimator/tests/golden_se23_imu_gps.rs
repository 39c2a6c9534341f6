//! The left InEKF on SE_2(3) against an independent implementation: 200 Hz IMU for 40 s, fixes at
//! 1 Hz, the paper's Euler discretisation, one pass without transport, three priors.
//!
//! The priors are those of [IS] section V: isotropic, level known, and known but for the heading
//! (a covariance of rank 4). The vectors are `golden_se23_imu_gps.json`.

use inekf::filter::{Belief, Covariance, Left, UpdateOptions, propagate, update};
use inekf::lie::{SE23, SO3};
use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
use nalgebra::{Matrix3, SMatrix, Vector3};
use serde_json::Value;

const STATE_TOLERANCE: f64 = 1e-9;
const COVARIANCE_TOLERANCE: f64 = 1e-8;
const SAMPLES_PER_FIX: usize = 200;

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().expect("a number")],
    }
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_row_slice(&numbers(value))
}

fn matrix<const R: usize, const C: usize>(value: &Value) -> SMatrix<f64, R, C> {
    SMatrix::from_row_slice(&numbers(value))
}

type Filter = Belief<SE23, Left, 9>;

/// Largest absolute difference of the state; the golden matrix has the columns R | v | x.
fn state_error(chi: &SE23, golden: &Value) -> f64 {
    let golden = matrix::<5, 5>(golden);
    let rotation = golden.fixed_view::<3, 3>(0, 0) - chi.rotation.matrix();
    let velocity = golden.fixed_view::<3, 1>(0, 3) - chi.velocity;
    let position = golden.fixed_view::<3, 1>(0, 4) - chi.position;
    rotation.amax().max(velocity.amax()).max(position.amax())
}

/// Largest difference of the covariance relative to its largest entry.
fn covariance_error(belief: &Filter, golden: &Value) -> f64 {
    let golden = matrix::<9, 9>(golden);
    (belief.covariance.matrix() - golden).amax() / golden.amax()
}

fn assert_agrees(belief: &Filter, state: &Value, covariance: &Value, when: &str) {
    let error = state_error(&belief.mean, state);
    assert!(error < STATE_TOLERANCE, "{when}: state off by {error:e}");
    let error = covariance_error(belief, covariance);
    assert!(error < COVARIANCE_TOLERANCE, "{when}: P off by {error:e}");
}

fn run(prior: &str) {
    let golden: Value =
        serde_json::from_str(include_str!("data/golden_se23_imu_gps.json")).expect("valid JSON");
    let inputs = &golden["inputs"];
    let expected = &golden["filters"][prior];
    let dt_s = inputs["dt"].as_f64().expect("dt");
    let g_w = vector(&inputs["g"]);
    let psd = |name: &str| inputs[name].as_f64().expect("sigma").powi(2) * dt_s;
    let noise = ImuNoise {
        gyro_psd: psd("sigma_g"),
        accel_psd: psd("sigma_a"),
        gyro_bias_psd: 0.0,
        accel_bias_psd: 0.0,
    };
    let mut belief = Filter::new(
        SE23 {
            rotation: SO3::from_matrix(&matrix::<3, 3>(&inputs["R0"])).expect("a rotation"),
            velocity: vector(&inputs["v0"]),
            position: vector(&inputs["x0"]),
        },
        Covariance::from_upper(matrix::<9, 9>(&inputs["P0"][prior])),
    );
    let gyro = inputs["gyro"].as_array().expect("rows");
    let accel = inputs["acc"].as_array().expect("rows");
    let fixes = inputs["gps"].as_array().expect("rows");
    assert_eq!((gyro.len(), fixes.len()), (8000, 40));

    for (k, (omega_b, force_b)) in gyro.iter().zip(accel).enumerate() {
        let input = ImuInput {
            omega_b: vector(omega_b),
            force_b: vector(force_b),
        };
        belief = propagate(&belief, &input, &g_w, dt_s, Discretisation::Euler, &noise);
        if k < 5 {
            assert_agrees(
                &belief,
                &expected["first5_imu_X"][k],
                &expected["first5_imu_P"][k],
                &format!("{prior}, IMU step {}", k + 1),
            );
        }
        if (k + 1) % SAMPLES_PER_FIX == 0 {
            let fix = k / SAMPLES_PER_FIX;
            let when = format!("{prior}, fix {}", fix + 1);
            assert_agrees(
                &belief,
                &expected["X_pred"][fix],
                &expected["P_pred"][fix],
                &format!("{when}, predicted"),
            );
            let observation = PositionObservation {
                position_w: vector(&fixes[fix]),
                covariance_w: matrix::<3, 3>(&inputs["N"]),
                lever_arm_b: Vector3::zeros(),
            };
            update(&mut belief, &observation, &UpdateOptions::PLAIN).expect("an update");
            assert_agrees(
                &belief,
                &expected["X"][fix],
                &expected["P"][fix],
                &format!("{when}, updated"),
            );
        }
    }
    assert_ne!(
        belief.covariance.matrix().fixed_view::<3, 3>(6, 6),
        Matrix3::zeros()
    );
}

#[test]
fn isotropic_prior() {
    run("P0_iso");
}

#[test]
fn level_known() {
    run("P0_yaw");
}

#[test]
fn only_the_heading_unknown() {
    run("P0_yaw_only");
}
