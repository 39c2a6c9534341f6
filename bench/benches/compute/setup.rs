//! The vehicle that is timed: a belief with no zero in it, a lively IMU sample, a fix a metre off.

use inekf::filter::{Belief, Covariance, Side};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{ImuInput, ImuNoise, NavState, PositionObservation};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// World frame ENU, m/s^2.
pub const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);

/// 200 samples a second.
pub const DT_S: f64 = 0.005;

/// Densities of a MEMS IMU.
pub const NOISE: ImuNoise = ImuNoise {
    gyro_psd: 4e-6,
    accel_psd: 1e-4,
    gyro_bias_psd: 1e-10,
    accel_bias_psd: 1e-8,
};

/// A car that turns and brakes: rad/s and m/s^2, body frame.
pub fn sample() -> ImuInput {
    ImuInput {
        omega_b: Vector3::new(0.03, -0.02, 0.4),
        force_b: Vector3::new(-1.2, 2.1, 9.7),
    }
}

/// A vehicle with some attitude, speed and place, and the biases of its IMU.
pub fn state() -> NavState {
    NavState {
        pose: SE23 {
            rotation: SO3::from_roll_pitch_heading(0.04, -0.03, 1.1),
            velocity: Vector3::new(9.0, 4.0, 0.2),
            position: Vector3::new(120.0, -45.0, 3.0),
        },
        gyro_bias: Vector3::new(0.002, -0.001, 0.003),
        accel_bias: Vector3::new(0.05, 0.02, -0.04),
    }
}

/// A fix a metre off, 0.5 m sure of itself, from an antenna at `lever_arm_b`.
pub fn fix(lever_arm_b: Vector3<f64>) -> PositionObservation {
    PositionObservation {
        position_w: Vector3::new(120.8, -45.5, 3.3),
        covariance_w: Matrix3::new(0.25, 0.02, 0.0, 0.02, 0.25, 0.01, 0.0, 0.01, 0.6),
        lever_arm_b,
    }
}

/// A belief around `mean` whose covariance has no zero entry.
pub fn belief<G: LieGroup<D>, S: Side, const D: usize>(mean: G) -> Belief<G, S, D> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mixing = SMatrix::<f64, D, D>::from_fn(|_, _| rng.sample(StandardNormal));
    let sigmas = SVector::<f64, D>::from_fn(|i, _| [0.1, 0.5, 2.0, 0.003, 0.05][(i / 3) % 5]);
    let root = SMatrix::from_diagonal(&sigmas) * (SMatrix::identity() + 0.1 * mixing);
    Belief::from_left_covariance(mean, Covariance::from_upper(root * root.transpose()))
}

/// Fails unless each entry of two covariances agrees to `1e-9` of its standard deviations.
pub fn assert_same<const D: usize>(actual: &SMatrix<f64, D, D>, expected: &SMatrix<f64, D, D>) {
    for column in 0..D {
        for row in 0..D {
            let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let off = (actual[(row, column)] - expected[(row, column)]).abs();
            assert!(
                off <= 1e-9 * scale,
                "the dense baseline differs at ({row}, {column})"
            );
        }
    }
}
