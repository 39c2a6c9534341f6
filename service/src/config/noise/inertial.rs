//! The IMU's white noise and the random walk of its biases.
//!
//! White noise is given either as a continuous density `n` (a sample that stands for `dt` seconds then has the
//! standard deviation `n / sqrt(dt)`) or as the standard deviation of each sample, whatever its interval.

use super::super::interval::Interval;
use super::super::section::Section;
use super::{Form, Relevance, form_of};

/// Process noise of inertial navigation, equal on all three axes of a sensor.
///
/// ```
#[doc = include_str!("../example.txt")]
/// let noise = inertial(format!("{IMU}gyro_bias_walk = 1e-5\n"))?.noise;
/// assert_eq!((noise.gyro_bias_walk, noise.accel_bias_walk), (1e-5, 0.0));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct InertialNoise {
    /// White noise of gyroscope and accelerometer.
    pub white: WhiteNoise,
    /// Random walk of the gyroscope's bias, rad/s^2/sqrt(Hz).
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer's bias, m/s^3/sqrt(Hz).
    pub accel_bias_walk: f64,
}

/// White noise of gyroscope and accelerometer, both in the same form.
///
/// ```
#[doc = include_str!("../example.txt")]
/// let densities = WhiteNoise::Density { gyro: 3e-4, accel: 2e-2 };
/// assert_eq!(inertial(IMU.to_owned())?.noise.white, densities);
/// let text = "model = 'imu'\n[noise]\ngyro_sigma_per_sample = 0.01\naccel_sigma_per_sample = 0.5\n";
/// let sigmas = WhiteNoise::PerSample { gyro: 0.01, accel: 0.5 };
/// assert_eq!(inertial(text.to_owned())?.noise.white, sigmas);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WhiteNoise {
    /// Continuous densities.
    Density {
        /// Gyroscope, rad/s/sqrt(Hz).
        gyro: f64,
        /// Accelerometer, m/s^2/sqrt(Hz).
        accel: f64,
    },
    /// Standard deviations of one sample.
    PerSample {
        /// Gyroscope, rad/s.
        gyro: f64,
        /// Accelerometer, m/s^2.
        accel: f64,
    },
}

/// What each number of the gyroscope may be, in its own unit.
pub(super) const GYRO_RANGE: Interval = Interval::closed(0.0, 10.0);
/// What each number of the accelerometer may be, in its own unit.
pub(super) const ACCEL_RANGE: Interval = Interval::closed(0.0, 100.0);

const DENSITY: [&str; 2] = ["gyro_density", "accel_density"];
const PER_SAMPLE: [&str; 2] = ["gyro_sigma_per_sample", "accel_sigma_per_sample"];

/// Every key of inertial navigation in the table.
pub(super) const KEYS: [&str; 6] = [
    DENSITY[0],
    DENSITY[1],
    PER_SAMPLE[0],
    PER_SAMPLE[1],
    "gyro_bias_walk",
    "accel_bias_walk",
];

impl InertialNoise {
    pub(super) fn read(noise: &mut Section<'_, '_>, relevance: Relevance) -> Self {
        Self {
            white: WhiteNoise::read(noise, relevance),
            gyro_bias_walk: noise.float("gyro_bias_walk", "rad/s^2/sqrt(Hz)", GYRO_RANGE, 0.0),
            accel_bias_walk: noise.float("accel_bias_walk", "m/s^3/sqrt(Hz)", ACCEL_RANGE, 0.0),
        }
    }
}

impl WhiteNoise {
    /// Exactly one of the two pairs must be given, and whole.
    fn read(noise: &mut Section<'_, '_>, relevance: Relevance) -> Self {
        let densities = [
            noise.optional_float(DENSITY[0], Some("rad/s/sqrt(Hz)"), GYRO_RANGE),
            noise.optional_float(DENSITY[1], Some("m/s^2/sqrt(Hz)"), ACCEL_RANGE),
        ];
        let sigmas = [
            noise.optional_float(PER_SAMPLE[0], Some("rad/s"), GYRO_RANGE),
            noise.optional_float(PER_SAMPLE[1], Some("m/s^2"), ACCEL_RANGE),
        ];
        // Zeros stand where a fault has been noted: nobody gets to see them.
        let or_zero = |values: [Option<f64>; 2]| values.map(Option::unwrap_or_default);
        match form_of(noise, DENSITY, PER_SAMPLE, "sample", relevance) {
            Form::Each => {
                let [gyro, accel] = or_zero(sigmas);
                Self::PerSample { gyro, accel }
            }
            Form::Density => {
                let [gyro, accel] = or_zero(densities);
                Self::Density { gyro, accel }
            }
        }
    }
}
