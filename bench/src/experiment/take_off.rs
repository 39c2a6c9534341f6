//! The simulation of \[IS\] section V: a vehicle that stands for 15 s and then drives off, straight on, for 25 s at
//! 1 m/s^2; a precise IMU at 200 Hz, position fixes of 3 m at 1 Hz, and a first heading that is 80 deg wrong.
//!
//! World frame ENU, body frame FLU; an IMU sample speaks for the 5 ms that begin with it; tangent order rotation,
//! velocity, position; left-invariant. Level and position are known at the start, heading and velocity are not:
//! `P0 = diag((100 deg)^2, (10 m/s)^2, 0)` on each axis. The true heading is 30 deg, and the first estimate stands.

use std::f64::consts::FRAC_PI_6;

use inekf::filter::{Belief, Covariance, Left};
use inekf::lie::{SE23, SO3};
use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
use inekf::smoother::Preintegration;
use nalgebra::{Matrix3, SVector, Vector3};

use super::section7::{normal, stream};

/// Fixes, and seconds, of a run.
pub const FIXES: usize = 40;
/// The true heading, counter-clockwise from east, rad.
pub const HEADING_RAD: f64 = FRAC_PI_6;
/// By how much the first estimate's heading is wrong, rad.
const WRONG_BY_RAD: f64 = 80.0 * std::f64::consts::PI / 180.0;
const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const DT_S: f64 = 1.0 / 200.0;
const SAMPLES_PER_FIX: usize = 200;
/// The vehicle drives off, s.
const DEPARTURE_S: usize = 15;
const ACCELERATION_M_S2: f64 = 1.0;
/// Standard deviations of a sample, rad/s and m/s^2, and of a fix on each axis, m: \[IS\] (25).
const SIGMA_GYRO: f64 = 2.7e-4 * std::f64::consts::PI / 180.0;
const SIGMA_ACCEL: f64 = 1.5e-3;
const SIGMA_FIX_M: f64 = 3.0;

/// One simulated run.
pub struct TakeOff {
    /// The IMU from one fix to the next, as one motion.
    pub motions: Vec<Preintegration<SE23, 9>>,
    /// What is seen at the end of each motion.
    pub fixes: Vec<PositionObservation>,
}

impl TakeOff {
    /// Run number `index` of `seed`.
    pub fn draw(seed: u64, index: u64) -> Self {
        let mut rng = stream(seed, index);
        let noise = ImuNoise {
            gyro_psd: SIGMA_GYRO * SIGMA_GYRO * DT_S,
            accel_psd: SIGMA_ACCEL * SIGMA_ACCEL * DT_S,
            gyro_bias_psd: 0.0,
            accel_bias_psd: 0.0,
        };
        let reference = first().mean;
        let (mut motions, mut fixes) = (Vec::new(), Vec::new());
        for second in 0..FIXES {
            let ahead = if second < DEPARTURE_S {
                0.0
            } else {
                ACCELERATION_M_S2
            };
            let mut motion = Preintegration::new(&reference);
            for _ in 0..SAMPLES_PER_FIX {
                let measured = ImuInput {
                    omega_b: SIGMA_GYRO * normal::<3, 1>(&mut rng),
                    force_b: Vector3::new(ahead, 0.0, 0.0) - GRAVITY_W
                        + SIGMA_ACCEL * normal::<3, 1>(&mut rng),
                };
                let zoh = Discretisation::ZeroOrderHold;
                motion.push(&measured, &GRAVITY_W, DT_S, zoh, &noise);
            }
            motions.push(motion);
            let driven_s = (second + 1).saturating_sub(DEPARTURE_S) as f64;
            let way_m = 0.5 * ACCELERATION_M_S2 * driven_s * driven_s;
            let (sin, cos) = HEADING_RAD.sin_cos();
            fixes.push(PositionObservation {
                position_w: Vector3::new(way_m * cos, way_m * sin, 0.0)
                    + SIGMA_FIX_M * normal::<3, 1>(&mut rng),
                covariance_w: Matrix3::identity() * (SIGMA_FIX_M * SIGMA_FIX_M),
                lever_arm_b: Vector3::zeros(),
            });
        }
        Self { motions, fixes }
    }
}

/// What every estimator begins with.
pub fn first() -> Belief<SE23, Left, 9> {
    let sigmas = SVector::<f64, 9>::from_fn(|i, _| match i / 3 {
        0 => 100_f64.to_radians(),
        1 => 10.0,
        _ => 0.0,
    });
    Belief::new(
        SE23 {
            rotation: SO3::from_roll_pitch_heading(0.0, 0.0, HEADING_RAD + WRONG_BY_RAD),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
        },
        Covariance::from_variances(&sigmas.component_mul(&sigmas)),
    )
}
