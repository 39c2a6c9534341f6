//! The alignment of [IS] section V: a vehicle at rest for 15 s, then driving off; a precise IMU at 200 Hz, fixes of
//! 3 m at 1 Hz, and a first heading that is 80 deg wrong.

use inekf::filter::{Belief, Covariance, Left};
use inekf::lie::{SE23, SO3};
use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
use inekf::smoother::Preintegration;
use nalgebra::{Matrix3, SVector, Vector3};
use std::path::Path;

pub const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
pub const DT_S: f64 = 1.0 / 200.0;
const SAMPLES_PER_FIX: usize = 200;
const SIGMA_FIX_M: f64 = 3.0;

/// The numbers of a file of the golden set, row by row.
pub fn rows(name: &str) -> Vec<Vec<f64>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/align_straight");
    let text = std::fs::read_to_string(folder.join(name)).expect("a file of the set");
    let number = |cell: &str| cell.parse().expect("a number");
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(number).collect())
        .collect()
}

pub fn vector(row: &[f64]) -> Vector3<f64> {
    Vector3::from_row_slice(&row[..3])
}

/// Discrete standard deviations for each sample, as densities.
pub fn noise() -> ImuNoise {
    ImuNoise {
        gyro_psd: 2.7e-4_f64.to_radians().powi(2) * DT_S,
        accel_psd: 1.5e-3_f64.powi(2) * DT_S,
        gyro_bias_psd: 0.0,
        accel_bias_psd: 0.0,
    }
}

pub fn samples() -> Vec<ImuInput> {
    let input = |row: &Vec<f64>| ImuInput {
        omega_b: vector(row),
        force_b: vector(&row[3..]),
    };
    rows("imu.csv").iter().map(input).collect()
}

/// The motions between the fixes.
pub fn motions(discretisation: Discretisation) -> Vec<Preintegration<SE23, 9>> {
    let start = first().mean;
    let preintegrated = |samples: &[ImuInput]| {
        let mut motion = Preintegration::new(&start);
        for sample in samples {
            motion.push(sample, &GRAVITY_W, DT_S, discretisation, &noise());
        }
        motion
    };
    samples()
        .chunks(SAMPLES_PER_FIX)
        .map(preintegrated)
        .collect()
}

pub fn fixes() -> Vec<PositionObservation> {
    let fix = |row: &Vec<f64>| PositionObservation {
        position_w: vector(row),
        covariance_w: Matrix3::identity() * (SIGMA_FIX_M * SIGMA_FIX_M),
        lever_arm_b: Vector3::zeros(),
    };
    rows("gps.csv").iter().map(fix).collect()
}

/// Level and position known, the heading 80 deg wrong.
pub fn first() -> Belief<SE23, Left, 9> {
    let heading = 0.523_598_775_598_298_8 + 80_f64.to_radians();
    let sigmas = SVector::<f64, 9>::from_fn(|i, _| match i / 3 {
        0 => 100_f64.to_radians(),
        1 => 10.0,
        _ => 0.0,
    });
    Belief::new(
        SE23 {
            rotation: SO3::from_roll_pitch_heading(0.0, 0.0, heading),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
        },
        Covariance::from_variances(&sigmas.component_mul(&sigmas)),
    )
}
