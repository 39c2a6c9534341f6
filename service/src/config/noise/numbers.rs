//! Process noise that comes as numbers, in a request, instead of in the file: held to the file's own ranges.

use inekf_shared::message::{NOISE_DENSITY, NOISE_PER_SAMPLE, ProcessNoise};

use super::super::interval::Interval;
use super::inertial::{ACCEL_RANGE, GYRO_RANGE};
use super::odometry::{ROTATION_RANGE, TRANSLATION_RANGE};
use super::{IncrementNoise, InertialNoise, OdometryNoise, WhiteNoise};

/// The numbers are of the other kind of motion.
const FOREIGN: &str =
    "the noise has a number of the other kind of motion: this daemon has another model";

/// A number within its range.
fn required(value: f64, range: Interval, refusal: &'static str) -> Result<f64, &'static str> {
    if range.contains(value) {
        Ok(value)
    } else {
        Err(refusal)
    }
}

/// The same, or zero where none is given.
fn or_zero(value: f64, range: Interval, refusal: &'static str) -> Result<f64, &'static str> {
    if value.is_nan() {
        Ok(0.0)
    } else {
        required(value, range, refusal)
    }
}

/// Whether the white noise is of each sample or row, rather than a density.
fn is_per_sample(noise: &ProcessNoise) -> Result<bool, &'static str> {
    match noise.form {
        NOISE_DENSITY => Ok(false),
        NOISE_PER_SAMPLE => Ok(true),
        _ => Err("the form of the noise must be 1 (densities) or 2 (per sample or row)"),
    }
}

impl InertialNoise {
    /// The noise of an IMU that `numbers` say.
    ///
    /// # Errors
    /// A sentence that names the number at fault and its range.
    pub(crate) fn from_numbers(numbers: &ProcessNoise) -> Result<Self, &'static str> {
        let foreign = [
            numbers.lateral,
            numbers.rotation_per_sqrt_m,
            numbers.rotation_per_sqrt_rad,
            numbers.translation_per_sqrt_m,
        ];
        if !foreign.iter().all(|number| number.is_nan()) {
            return Err(FOREIGN);
        }
        let gyro = required(
            numbers.rotation,
            GYRO_RANGE,
            "the gyroscope's noise must be 0 to 10 rad/s/sqrt(Hz) or rad/s",
        )?;
        let accel = required(
            numbers.translation,
            ACCEL_RANGE,
            "the accelerometer's noise must be 0 to 100 m/s^2/sqrt(Hz) or m/s^2",
        )?;
        Ok(Self {
            white: match is_per_sample(numbers)? {
                true => WhiteNoise::PerSample { gyro, accel },
                false => WhiteNoise::Density { gyro, accel },
            },
            gyro_bias_walk: or_zero(
                numbers.gyro_bias_walk,
                GYRO_RANGE,
                "gyro_bias_walk must be 0 to 10 rad/s^2/sqrt(Hz)",
            )?,
            accel_bias_walk: or_zero(
                numbers.accel_bias_walk,
                ACCEL_RANGE,
                "accel_bias_walk must be 0 to 100 m/s^3/sqrt(Hz)",
            )?,
        })
    }
}

impl OdometryNoise {
    /// The noise of odometry that `numbers` say.
    ///
    /// # Errors
    /// A sentence that names the number at fault and its range.
    pub(crate) fn from_numbers(numbers: &ProcessNoise) -> Result<Self, &'static str> {
        let foreign = [numbers.gyro_bias_walk, numbers.accel_bias_walk];
        if !foreign.iter().all(|number| number.is_nan()) {
            return Err(FOREIGN);
        }
        let rotation = required(
            numbers.rotation,
            ROTATION_RANGE,
            "the rotation's noise must be 0 to 10 rad/sqrt(s) or rad",
        )?;
        let translation = required(
            numbers.translation,
            TRANSLATION_RANGE,
            "the translation's noise must be 0 to 100 m/sqrt(s) or m",
        )?;
        let lateral = if numbers.lateral.is_nan() {
            translation
        } else {
            required(
                numbers.lateral,
                TRANSLATION_RANGE,
                "the lateral noise must be 0 to 100 m/sqrt(s) or m",
            )?
        };
        Ok(Self {
            white: match is_per_sample(numbers)? {
                true => IncrementNoise::PerRow {
                    rotation,
                    translation,
                    lateral,
                },
                false => IncrementNoise::Density {
                    rotation,
                    translation,
                    lateral,
                },
            },
            rotation_per_sqrt_m: or_zero(
                numbers.rotation_per_sqrt_m,
                ROTATION_RANGE,
                "rotation_per_sqrt_m must be 0 to 10 rad/sqrt(m)",
            )?,
            rotation_per_sqrt_rad: or_zero(
                numbers.rotation_per_sqrt_rad,
                ROTATION_RANGE,
                "rotation_per_sqrt_rad must be 0 to 10 rad/sqrt(rad)",
            )?,
            translation_per_sqrt_m: or_zero(
                numbers.translation_per_sqrt_m,
                TRANSLATION_RANGE,
                "translation_per_sqrt_m must be 0 to 100 m/sqrt(m)",
            )?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMU: ProcessNoise = ProcessNoise {
        form: NOISE_DENSITY,
        rotation: 1e-3,
        translation: 2e-2,
        ..ProcessNoise::UNGIVEN
    };

    #[test]
    fn numbers_are_what_a_file_with_them_says() {
        let numbers = ProcessNoise {
            gyro_bias_walk: 1e-5,
            ..IMU
        };
        let file = "model = 'imu'\n[noise]\ngyro_density = 1e-3\naccel_density = 2e-2\ngyro_bias_walk = 1e-5\n";
        let config = crate::config::Config::from_toml_str(file, "a file").unwrap();
        let crate::config::Motion::Inertial(inertial) = config.motion else {
            panic!("an IMU");
        };
        assert_eq!(InertialNoise::from_numbers(&numbers), Ok(inertial.noise));

        let numbers = ProcessNoise {
            form: NOISE_PER_SAMPLE,
            rotation_per_sqrt_m: 0.5,
            ..IMU
        };
        let file = "model = 'odometry2d'\n[noise]\nrotation_sigma_per_row = 1e-3\n\
                    translation_sigma_per_row = 2e-2\nrotation_per_sqrt_m = 0.5\n";
        let config = crate::config::Config::from_toml_str(file, "a file").unwrap();
        let crate::config::Motion::Odometry(odometry) = config.motion else {
            panic!("odometry");
        };
        assert_eq!(OdometryNoise::from_numbers(&numbers), Ok(odometry.noise));
    }

    #[test]
    fn a_number_out_of_its_range_or_of_another_motion_is_refused_by_name() {
        for (bad, word) in [
            (ProcessNoise { form: 0, ..IMU }, "form"),
            (
                ProcessNoise {
                    rotation: f64::NAN,
                    ..IMU
                },
                "gyroscope",
            ),
            (
                ProcessNoise {
                    rotation: -1.0,
                    ..IMU
                },
                "gyroscope",
            ),
            (
                ProcessNoise {
                    translation: f64::INFINITY,
                    ..IMU
                },
                "accelerometer",
            ),
            (
                ProcessNoise {
                    gyro_bias_walk: 10.1,
                    ..IMU
                },
                "gyro_bias_walk",
            ),
            (
                ProcessNoise {
                    accel_bias_walk: -0.1,
                    ..IMU
                },
                "accel_bias_walk",
            ),
            (
                ProcessNoise {
                    lateral: 0.0,
                    ..IMU
                },
                "other kind",
            ),
        ] {
            let text = InertialNoise::from_numbers(&bad).unwrap_err();
            assert!(text.contains(word), "{text}");
        }
        for (bad, word) in [
            (
                ProcessNoise {
                    rotation: 11.0,
                    ..IMU
                },
                "rotation",
            ),
            (
                ProcessNoise {
                    lateral: -1.0,
                    ..IMU
                },
                "lateral",
            ),
            (
                ProcessNoise {
                    translation: f64::NAN,
                    ..IMU
                },
                "translation",
            ),
            (
                ProcessNoise {
                    translation_per_sqrt_m: 101.0,
                    ..IMU
                },
                "translation_per_sqrt_m",
            ),
            (
                ProcessNoise {
                    accel_bias_walk: 0.0,
                    ..IMU
                },
                "other kind",
            ),
        ] {
            let text = OdometryNoise::from_numbers(&bad).unwrap_err();
            assert!(text.contains(word), "{text}");
        }
    }
}
