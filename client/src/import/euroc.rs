//! A folder of the EuRoC MAV benchmark (`mav0/imu0`, `mav0/state_groundtruth_estimate0`, `mav0/leica0` or
//! `mav0/vicon0`) as a dataset.
//!
//! The benchmark's body is the IMU's own frame `S`: x up, y to the right, z forwards. Here the body is
//! forward-left-up, `R_SB = [0 0 1; 0 -1 0; 1 0 0]`: vectors of the IMU and biases are turned by its transpose, attitudes
//! become `q_WS q_SB`. The world is z up and stays. Stamps stay absolute.
//!
//! Noise and the lever arm of the position sensor come from the `sensor.yaml` files, where they are there.

use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::ImportError;
use super::lines::{self, three, unit};
use crate::dataset::{Dataset, ImuBias, ImuNoise, ImuRow, Meta, PositionRow, Truth, TruthRow};

const IMU: &str = "timestamp [ns],w_x,w_y,w_z [rad/s],a_x,a_y,a_z [m/s^2]";
const TRUTH: &str =
    "timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z,b_w_x,b_w_y,b_w_z,b_a_x,b_a_y,b_a_z";
const POSITION: &str = "timestamp [ns],p_x,p_y,p_z [m]";

/// Reads a folder: that of a sequence, which holds `mav0`, or `mav0` itself. `position_sigma_m` is the standard
/// deviation that position fixes get, metres per axis.
///
/// # Errors
/// [`ImportError`] with file and line. The IMU has to be there, truth and positions need not.
///
/// ```
/// use std::fs;
///
/// use inekf_client::import::euroc;
///
/// let folder = tempfile::tempdir()?;
/// let imu = folder.path().join("mav0/imu0");
/// fs::create_dir_all(&imu)?;
/// // The sensor's x axis is up: at rest it feels 9.81 there.
/// fs::write(imu.join("data.csv"), "#timestamp,w_x,w_y,w_z,a_x,a_y,a_z\n5,0.1,0,0,9.81,0,0\n")?;
/// let drive = euroc::read(folder.path(), 0.01)?;
/// // Here up is z.
/// assert_eq!(drive.imu[0].accel_mps2, [0.0, 0.0, 9.81]);
/// assert_eq!(drive.imu[0].gyro_rps, [0.0, 0.0, 0.1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(dir: &Path, position_sigma_m: f64) -> Result<Dataset, ImportError> {
    let inside = dir.join("mav0");
    let mav = if inside.is_dir() { &inside } else { dir };
    let imu = read_imu(&mav.join("imu0/data.csv"))?;
    let truth_file = mav.join("state_groundtruth_estimate0/data.csv");
    let truth = if truth_file.is_file() {
        read_truth(&truth_file)?
    } else {
        Truth::None
    };
    let sensor = ["leica0", "vicon0"]
        .map(|name| mav.join(name))
        .into_iter()
        .find(|sensor| sensor.join("data.csv").is_file());
    let position = match &sensor {
        Some(sensor) => read_position(&sensor.join("data.csv"), position_sigma_m)?,
        None => Vec::new(),
    };
    let lever_arm = sensor.and_then(|sensor| lever_arm_m(&yaml(&sensor)));
    let name = dir
        .file_name()
        .map_or_else(|| "euroc".to_owned(), |name| name.to_string_lossy().into());
    Ok(Dataset {
        meta: Meta {
            name,
            kind: if position.is_empty() {
                "imu".to_owned()
            } else {
                "imu+position".to_owned()
            },
            imu_noise: imu_noise(&yaml(&mav.join("imu0"))),
            lever_arms_m: lever_arm.into_iter().collect(),
            ..Meta::default()
        },
        imu,
        position,
        truth,
        ..Dataset::default()
    })
}

/// From the IMU's axes to forward-left-up, and back.
fn r_sb() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::new(
        0.0, 0.0, 1.0, //
        0.0, -1.0, 0.0, //
        1.0, 0.0, 0.0,
    ))
}

/// A vector of the IMU in forward-left-up axes. The rotation is its own transpose.
fn to_flu(vector_s: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = vector_s;
    [z, -y, x]
}

fn read_imu(path: &Path) -> Result<Vec<ImuRow>, ImportError> {
    let rows = lines::read(path, 6, IMU, |text| text.parse().ok())?;
    Ok(rows
        .iter()
        .map(|row| ImuRow {
            stamp_ns: row.stamp_ns,
            gyro_rps: to_flu(three(&row.values, 0)),
            accel_mps2: to_flu(three(&row.values, 3)),
        })
        .collect())
}

fn read_truth(path: &Path) -> Result<Truth, ImportError> {
    let q_sb = UnitQuaternion::from_rotation_matrix(&r_sb());
    let rows = lines::read(path, 16, TRUTH, |text| text.parse().ok())?;
    let rows = rows
        .iter()
        .map(|row| {
            let [x, y, z] = three(&row.values, 4);
            let q_ws = unit([x, y, z, row.values[3]]).ok_or_else(|| ImportError::Line {
                path: path.to_owned(),
                line: row.number,
                problem: "the quaternion is not of length one".to_owned(),
                remedy: format!("a row is `{TRUTH}`"),
            })?;
            let q_wb = UnitQuaternion::new_normalize(Quaternion::from(q_ws)) * q_sb;
            Ok(TruthRow {
                stamp_ns: row.stamp_ns,
                q_wb: q_wb.coords.into(),
                v_w_mps: three(&row.values, 7),
                p_w_m: three(&row.values, 0),
                bias: Some(ImuBias {
                    gyro_rps: to_flu(three(&row.values, 10)),
                    accel_mps2: to_flu(three(&row.values, 13)),
                }),
            })
        })
        .collect::<Result<Vec<TruthRow>, ImportError>>()?;
    Ok(Truth::Spatial(rows))
}

fn read_position(path: &Path, sigma_m: f64) -> Result<Vec<PositionRow>, ImportError> {
    let rows = lines::read(path, 3, POSITION, |text| text.parse().ok())?;
    Ok(rows
        .iter()
        .map(|row| PositionRow {
            stamp_ns: row.stamp_ns,
            source: 0,
            dimension: 3,
            position_w_m: three(&row.values, 0),
            sigma_m: [sigma_m; 3],
        })
        .collect())
}

/// The text of a sensor's description; empty if there is none.
fn yaml(sensor: &Path) -> String {
    fs::read_to_string(sensor.join("sensor.yaml")).unwrap_or_default()
}

/// Noise, if all four figures are there.
fn imu_noise(yaml: &str) -> Option<ImuNoise> {
    Some(ImuNoise {
        gyro_density: number(yaml, "gyroscope_noise_density")?,
        accel_density: number(yaml, "accelerometer_noise_density")?,
        gyro_bias_walk: number(yaml, "gyroscope_random_walk")?,
        accel_bias_walk: number(yaml, "accelerometer_random_walk")?,
    })
}

/// The number after `key:`.
fn number(yaml: &str, key: &str) -> Option<f64> {
    let line = yaml
        .lines()
        .find_map(|line| line.trim_start().strip_prefix(key)?.strip_prefix(':'))?;
    line.split('#').next()?.trim().parse().ok()
}

/// From the IMU to the sensor, forward-left-up, m: the translation of `T_BS`, twelve or more numbers in brackets.
fn lever_arm_m(yaml: &str) -> Option<[f64; 3]> {
    let (_, after) = yaml.split_once("T_BS")?;
    let (_, data) = after.split_once('[')?;
    let (data, _) = data.split_once(']')?;
    let entries: Vec<f64> = data
        .split(',')
        .map(|entry| entry.trim().parse().ok())
        .collect::<Option<_>>()?;
    let translation = Vector3::new(*entries.get(3)?, *entries.get(7)?, *entries.get(11)?);
    Some(to_flu(translation.into()))
}
