//! The table `[noise]` of a configuration as numbers, to be handed to a running daemon.
//!
//! Only names and kinds are looked at here; what each number may be, the daemon says.

use std::fs;
use std::path::Path;

use anyhow::{Context, bail};
use inekf_shared::message::{NOISE_DENSITY, NOISE_PER_SAMPLE, ProcessNoise};
use toml::{Table, Value};

/// The process noise in the configuration file at `path`.
///
/// # Errors
/// The file cannot be read, or its table `[noise]` is not one of a configuration; the error names the key.
///
/// ```
/// use inekf_shared::message::NOISE_DENSITY;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("car.toml");
/// std::fs::write(&path, "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n")?;
/// let noise = inekf_client::noise::load(&path)?;
/// assert_eq!((noise.form, noise.rotation, noise.translation), (NOISE_DENSITY, 3e-4, 2e-2));
/// // What is not given is NaN: the daemon takes its default.
/// assert!(noise.gyro_bias_walk.is_nan());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(path: &Path) -> anyhow::Result<ProcessNoise> {
    let read = fs::read_to_string(path).map_err(anyhow::Error::from);
    read.and_then(|text| parse(&text))
        .with_context(|| path.display().to_string())
}

/// The same from the text of a configuration.
///
/// ```
/// let noise = "[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// assert!(inekf_client::noise::parse(noise).is_ok());
/// assert!(inekf_client::noise::parse("model = 'imu'").is_err());
/// ```
///
/// # Errors
/// As [`load`].
pub fn parse(text: &str) -> anyhow::Result<ProcessNoise> {
    let document: Table = text.parse()?;
    let Some(Value::Table(noise)) = document.get("noise") else {
        bail!("there is no table [noise]");
    };
    let mut numbers = ProcessNoise::UNGIVEN;
    for (key, value) in noise {
        let number = match value {
            Value::Float(number) => *number,
            // Whatever a whole number loses here is far out of every range.
            Value::Integer(number) => *number as f64,
            _ => bail!("noise.{key} must be a number"),
        };
        if !number.is_finite() {
            bail!("noise.{key} is not a finite number");
        }
        let (form, slot) =
            slot(&mut numbers, key).with_context(|| format!("noise.{key}: unknown key"))?;
        *slot = number;
        if let Some(form) = form {
            if numbers.form != 0 && numbers.form != form {
                bail!("noise.{key} contradicts another key: give densities or sigmas, not both");
            }
            numbers.form = form;
        }
    }
    if numbers.rotation.is_nan() || numbers.translation.is_nan() {
        bail!("the table [noise] must give both densities, or both sigmas per sample or row");
    }
    Ok(numbers)
}

/// Where the number of a key goes, and the form that it stands for.
fn slot<'a>(numbers: &'a mut ProcessNoise, key: &str) -> Option<(Option<u32>, &'a mut f64)> {
    const DENSITY: Option<u32> = Some(NOISE_DENSITY);
    const EACH: Option<u32> = Some(NOISE_PER_SAMPLE);
    Some(match key {
        "gyro_density" | "rotation_density" => (DENSITY, &mut numbers.rotation),
        "accel_density" | "translation_density" => (DENSITY, &mut numbers.translation),
        "lateral_density" => (DENSITY, &mut numbers.lateral),
        "gyro_sigma_per_sample" | "rotation_sigma_per_row" => (EACH, &mut numbers.rotation),
        "accel_sigma_per_sample" | "translation_sigma_per_row" => (EACH, &mut numbers.translation),
        "lateral_sigma_per_row" => (EACH, &mut numbers.lateral),
        "gyro_bias_walk" => (None, &mut numbers.gyro_bias_walk),
        "accel_bias_walk" => (None, &mut numbers.accel_bias_walk),
        "rotation_per_sqrt_m" => (None, &mut numbers.rotation_per_sqrt_m),
        "rotation_per_sqrt_rad" => (None, &mut numbers.rotation_per_sqrt_rad),
        "translation_per_sqrt_m" => (None, &mut numbers.translation_per_sqrt_m),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_finds_its_number() {
        let imu = parse(
            "model = 'imu'\n[noise]\ngyro_sigma_per_sample = 1e-3\naccel_sigma_per_sample = 2\n\
             gyro_bias_walk = 3e-5\naccel_bias_walk = 4e-4\n[late]\nwindow_s = 1.0\n",
        )
        .unwrap();
        assert_eq!(
            (imu.form, imu.rotation, imu.translation),
            (NOISE_PER_SAMPLE, 1e-3, 2.0)
        );
        assert_eq!((imu.gyro_bias_walk, imu.accel_bias_walk), (3e-5, 4e-4));
        assert!(imu.lateral.is_nan() && imu.rotation_per_sqrt_m.is_nan());

        let odometry = parse(
            "[noise]\nrotation_density = 1.0\ntranslation_density = 2.0\nlateral_density = 3.0\n\
             rotation_per_sqrt_m = 4.0\nrotation_per_sqrt_rad = 5.0\ntranslation_per_sqrt_m = 6.0\n",
        )
        .unwrap();
        assert_eq!(odometry.form, NOISE_DENSITY);
        assert_eq!(
            [odometry.rotation, odometry.translation, odometry.lateral],
            [1.0, 2.0, 3.0]
        );
        assert_eq!(
            [
                odometry.rotation_per_sqrt_m,
                odometry.rotation_per_sqrt_rad,
                odometry.translation_per_sqrt_m
            ],
            [4.0, 5.0, 6.0]
        );
    }

    #[test]
    fn what_is_no_such_table_is_refused_by_key() {
        for (text, word) in [
            ("model = 'imu'", "no table [noise]"),
            ("noise = 3", "no table [noise]"),
            ("[noise]\ngyro_density = 1e-3", "both densities"),
            (
                "[noise]\ngyro_density = 1e-3\naccel_sigma_per_sample = 1.0",
                "contradicts",
            ),
            (
                "[noise]\ngyro_density = 'much'",
                "gyro_density must be a number",
            ),
            (
                "[noise]\ngyro_density = nan",
                "gyro_density is not a finite",
            ),
            ("[noise]\ngyro = 1.0", "noise.gyro: unknown"),
            ("[noise\n", "noise"),
        ] {
            let error = format!("{:#}", parse(text).unwrap_err());
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
