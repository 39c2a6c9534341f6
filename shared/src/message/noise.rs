//! Process noise as numbers: what the table `[noise]` of a configuration says.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;

/// Form of the white noise: continuous densities.
pub const NOISE_DENSITY: u32 = 1;
/// Form of the white noise: the standard deviation of each IMU sample or row of odometry.
pub const NOISE_PER_SAMPLE: u32 = 2;

/// Process noise of either kind of motion. A number that the motion does not have is NaN, and so is one that is not
/// given and has a default.
///
/// ```
/// use inekf_shared::message::{NOISE_DENSITY, ProcessNoise};
///
/// let noise = ProcessNoise {
///     form: NOISE_DENSITY,
///     rotation: 3e-4,    // rad/s/sqrt(Hz)
///     translation: 2e-2, // m/s^2/sqrt(Hz)
///     ..ProcessNoise::UNGIVEN
/// };
/// // At 200 Hz a sample of the gyroscope is good to 0.0042 rad/s.
/// assert!((noise.rotation * 200_f64.sqrt() - 0.00424).abs() < 1e-5);
/// // What is not given is not a number.
/// assert!(noise.gyro_bias_walk.is_nan());
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.ProcessNoise.v1")]
pub struct ProcessNoise {
    /// [`NOISE_DENSITY`] or [`NOISE_PER_SAMPLE`].
    pub form: u32,
    /// Zero.
    pub reserved: u32,
    /// Gyroscope (rad/s/sqrt(Hz), or rad/s), or rotation of odometry (rad/sqrt(s), or rad).
    pub rotation: f64,
    /// Accelerometer (m/s^2/sqrt(Hz), or m/s^2), or translation of odometry (m/sqrt(s), or m).
    pub translation: f64,
    /// Translation of odometry across the direction of travel; NaN: as `translation`.
    pub lateral: f64,
    /// Random walk of the gyroscope's bias, rad/s^2/sqrt(Hz); NaN: 0.
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer's bias, m/s^3/sqrt(Hz); NaN: 0.
    pub accel_bias_walk: f64,
    /// Rotation of odometry by the root of the way, rad/sqrt(m); NaN: 0.
    pub rotation_per_sqrt_m: f64,
    /// Rotation of odometry by the root of the turn, rad/sqrt(rad); NaN: 0.
    pub rotation_per_sqrt_rad: f64,
    /// Translation of odometry by the root of the way, m/sqrt(m); NaN: 0.
    pub translation_per_sqrt_m: f64,
}

layout! {
    ProcessNoise as "inekf.ProcessNoise.v1", size 72, align 8 {
        form: 0, reserved: 4, rotation: 8, translation: 16, lateral: 24, gyro_bias_walk: 32,
        accel_bias_walk: 40, rotation_per_sqrt_m: 48, rotation_per_sqrt_rad: 56,
        translation_per_sqrt_m: 64,
    }
}

impl ProcessNoise {
    /// Nothing given.
    pub const UNGIVEN: Self = Self {
        form: 0,
        reserved: 0,
        rotation: f64::NAN,
        translation: f64::NAN,
        lateral: f64::NAN,
        gyro_bias_walk: f64::NAN,
        accel_bias_walk: f64::NAN,
        rotation_per_sqrt_m: f64::NAN,
        rotation_per_sqrt_rad: f64::NAN,
        translation_per_sqrt_m: f64::NAN,
    };
}
