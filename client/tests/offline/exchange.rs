//! Exports and imports, against numbers by hand and numerical derivatives.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use inekf_client::consistency::{band_95, invariant_error, nees_series};
use inekf_client::dataset::{Dataset, Truth, save_truth};
use inekf_client::evaluate::{Pose, Trajectory};
use inekf_client::exchange::ros::{Odometry, UNKNOWN};
use inekf_client::exchange::{ExportError, flat, mcap, tum};
use inekf_client::import::{euroc, tum as from_tum};
use inekf_client::table::{EstimateRow, EstimateState, EstimateTable, Layout};
use nalgebra::{DMatrix, Matrix6, UnitQuaternion, Vector3};
use tempfile::TempDir;

const TURN: [f64; 3] = [0.4, -0.7, 1.1];
const VELOCITY: [f64; 3] = [3.0, -2.0, 0.5];
const POSITION: [f64; 3] = [10.0, -20.0, 5.0];

/// A symmetric positive definite matrix: `A A^T + I`, A of small whole numbers.
fn covariance(dimension: usize) -> DMatrix<f64> {
    let a = DMatrix::from_fn(dimension, dimension, |i, j| {
        ((i * 7 + j * 3) % 5) as f64 - 2.0
    });
    &a * a.transpose() + DMatrix::identity(dimension, dimension)
}

fn triangle(matrix: &DMatrix<f64>) -> Vec<f64> {
    let n = matrix.nrows();
    (0..n)
        .flat_map(|i| (i..n).map(move |j| (i, j)))
        .map(|at| matrix[at])
        .collect()
}

fn row(stamp_ns: u64, dimension: usize) -> EstimateRow {
    let q = UnitQuaternion::from_scaled_axis(Vector3::from(TURN));
    EstimateRow {
        stamp_ns,
        state: EstimateState::Navigation {
            q_wb: q.coords.into(),
            v_w_mps: VELOCITY,
            p_w_m: POSITION,
            gyro_bias_rps: [0.0; 3],
            accel_bias_mps2: [0.0; 3],
        },
        covariance: triangle(&covariance(dimension)),
    }
}

/// `chi_hat exp(xi)` to first order in a tiny `xi`, and what ROS would measure of it: position and the turn about the
/// world's axes against the estimate, velocity in the disturbed body's own axes against the estimate's.
fn seen_by_ros(xi: &[f64]) -> [f64; 9] {
    let q = UnitQuaternion::from_scaled_axis(Vector3::from(TURN));
    let part = |at: usize| Vector3::new(xi[at], xi[at + 1], xi[at + 2]);
    let true_q = q * UnitQuaternion::from_scaled_axis(part(0));
    let true_v = Vector3::from(VELOCITY) + q * part(3);
    let true_p = Vector3::from(POSITION) + q * part(6);
    let position = true_p - Vector3::from(POSITION);
    let turn = (true_q * q.inverse()).scaled_axis();
    let velocity = true_q.inverse() * true_v - q.inverse() * Vector3::from(VELOCITY);
    let parts = [position, turn, velocity];
    std::array::from_fn(|i| parts[i / 3][i % 3])
}

#[test]
fn the_covariance_for_ros_is_that_of_numerical_derivatives() {
    for dimension in [9, 15] {
        let step = 1e-6;
        let mut jacobian = DMatrix::zeros(9, dimension);
        for column in 0..9 {
            let at = |side: f64| {
                let mut xi = vec![0.0; dimension];
                xi[column] = side * step;
                seen_by_ros(&xi)
            };
            let (plus, minus) = (at(1.0), at(-1.0));
            for i in 0..9 {
                jacobian[(i, column)] = (plus[i] - minus[i]) / (2.0 * step);
            }
        }
        let expected = &jacobian * covariance(dimension) * jacobian.transpose();
        let odometry = Odometry::from_row(&row(1, dimension));
        let pose: Matrix6<f64> = expected.fixed_view::<6, 6>(0, 0).into_owned();
        let apart = (odometry.pose_covariance - pose).abs().max();
        assert!(apart < 1e-6 * pose.abs().max(), "{apart}");
        let velocity = expected.fixed_view::<3, 3>(6, 6).into_owned();
        let found = odometry
            .twist_covariance
            .fixed_view::<3, 3>(0, 0)
            .into_owned();
        assert!((found - velocity).abs().max() < 1e-6 * velocity.abs().max());
        assert_eq!(odometry.twist_covariance[(4, 4)], UNKNOWN);
    }
}

#[test]
fn the_plane_for_ros_turns_about_z_alone() {
    let state = EstimateState::Plane {
        theta_rad: std::f64::consts::FRAC_PI_2,
        p_w_m: [3.0, 4.0],
    };
    // theta, forwards, sideways: sigma 0.1 rad, 1 m, 2 m; heading north, forwards is y.
    let covariance = vec![0.01, 0.0, 0.0, 1.0, 0.0, 4.0];
    let odometry = Odometry::from_row(&EstimateRow {
        stamp_ns: 1,
        state,
        covariance,
    });
    let mut expected = Matrix6::zeros();
    expected[(0, 0)] = 4.0;
    expected[(1, 1)] = 1.0;
    expected[(5, 5)] = 0.01;
    assert!((odometry.pose_covariance - expected).abs().max() < 1e-12);
    assert_eq!(odometry.pose.p_w_m, Vector3::new(3.0, 4.0, 0.0));
}

#[test]
fn nothing_unsorted_or_empty_is_exported() {
    let sorted = [row(5, 9), row(9, 9)];
    let mut text = Vec::new();
    tum::write(&sorted, &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert!(text.starts_with("0.000000005 10.0 -20.0 5.0 "), "{text}");
    let table = |rows: &[EstimateRow]| EstimateTable {
        layout: Layout::Navigation,
        covariance_dimension: Some(9),
        rows: rows.to_vec(),
    };
    for unsorted in [[row(9, 9), row(5, 9)], [row(5, 9), row(5, 9)]] {
        let mut out = Vec::new();
        let refused = [
            tum::write(&unsorted, &mut out),
            flat::write(&table(&unsorted), &mut out),
            mcap::write(&unsorted, Cursor::new(&mut out)),
        ];
        for result in refused {
            assert!(matches!(result, Err(ExportError::Unsorted { .. })));
        }
        assert!(out.is_empty());
    }
    assert!(matches!(
        tum::write(&[], &mut Vec::new()),
        Err(ExportError::Empty)
    ));
    // The year 2038: ROS counts seconds in 32 bits with sign.
    let late = [row(2_147_483_648_000_000_000, 9)];
    let result = mcap::write(&late, Cursor::new(Vec::new()));
    assert!(matches!(result, Err(ExportError::TooLate { .. })));
}

#[test]
fn the_table_for_people_has_degrees_and_deviations_in_the_world() {
    let rows = vec![EstimateRow {
        stamp_ns: 1_500_000_000,
        state: EstimateState::Plane {
            theta_rad: std::f64::consts::FRAC_PI_2,
            p_w_m: [3.0, 4.0],
        },
        covariance: vec![0.01, 0.0, 0.0, 1.0, 0.0, 4.0],
    }];
    let mut out = Vec::new();
    let table = EstimateTable {
        layout: Layout::Plane,
        covariance_dimension: Some(3),
        rows,
    };
    flat::write(&table, &mut out).unwrap();
    let expected = "t_s,x,y,z,roll_deg,pitch_deg,yaw_deg,sx,sy,sz,syaw_deg\n\
        1.500000000,3.000000,4.000000,0.000000,0.000000,0.000000,90.000000,2.000000,1.000000,0.000000,5.729578\n";
    assert_eq!(
        String::from_utf8(out)
            .unwrap()
            .replace("-0.000000", "0.000000"),
        expected
    );
}

/// The error of a truth that was made as `chi_hat exp(xi)` is `xi`, by a long product of tiny steps.
#[test]
fn the_invariant_error_undoes_the_exponential() {
    let xi = [0.3, -0.2, 0.5, 1.0, 2.0, -1.0, 4.0, -3.0, 2.0];
    let steps = 200_000;
    let part = |at: usize| Vector3::new(xi[at], xi[at + 1], xi[at + 2]) / f64::from(steps);
    let (turn, dv, dp) = (UnitQuaternion::from_scaled_axis(part(0)), part(3), part(6));
    let mut q = UnitQuaternion::from_scaled_axis(Vector3::from(TURN));
    let (mut v, mut p) = (Vector3::from(VELOCITY), Vector3::from(POSITION));
    for _ in 0..steps {
        // The middle of each step: second order, so that the product is exact to 1e-9.
        let half = q * UnitQuaternion::from_scaled_axis(0.5 * part(0));
        v += half * dv;
        p += half * dp;
        q *= turn;
    }
    let truth = Pose {
        stamp_ns: 7,
        q_wb: q,
        v_w_mps: Some(v),
        p_w_m: p,
    };
    let row = row(7, 9);
    let error = invariant_error(&row, &truth);
    for (found, expected) in error.iter().zip(xi) {
        assert!((found - expected).abs() < 1e-8, "{error:?}");
    }
    let series = nees_series(&[row], &Trajectory::new(vec![truth]), 1);
    let solved = covariance(9)
        .lu()
        .solve(&DMatrix::from_column_slice(9, 1, &xi))
        .unwrap();
    let expected = (DMatrix::from_row_slice(1, 9, &xi) * solved)[(0, 0)];
    assert!((series[0].nees / expected - 1.0).abs() < 1e-6);
}

#[test]
fn the_bands_are_those_of_the_tables() {
    // 2.5 % and 97.5 % points of chi-square.
    for (degrees, low, high) in [
        (1, 0.000_98, 5.024),
        (2, 0.0506, 7.378),
        (3, 0.2158, 9.348),
        (6, 1.2373, 14.449),
        (9, 2.7004, 19.023),
        (15, 6.2621, 27.488),
        (100, 74.222, 129.561),
    ] {
        let band = band_95(degrees);
        assert!((band.0 - low).abs() < 6e-4, "{band:?}");
        assert!((band.1 - high).abs() < 6e-4, "{band:?}");
    }
}

fn write(dir: &Path, name: &str, text: &str) {
    let path = dir.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

/// The first row of MH_01_easy as it is published, its noise and its lever arm, and an attitude that has the IMU's x
/// axis up and its z axis north.
#[test]
fn a_euroc_folder_becomes_a_dataset_with_the_body_forward_left_up() {
    let folder = TempDir::new().unwrap();
    write(
        folder.path(),
        "mav0/imu0/data.csv",
        "#timestamp [ns],w_RS_S_x [rad s^-1],...\n\
         1403636579758555392,-0.0991347,0.1473058,0.02722714,8.147692,-0.3759216,-2.402629\n\
         1403636579763555584,-0.0991347,0.1403245,0.02932153,8.033281,-0.4086104,-2.402629\n",
    );
    write(
        folder.path(),
        "mav0/imu0/sensor.yaml",
        "gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]\n\
         gyroscope_random_walk: 1.9393e-05\naccelerometer_noise_density: 2.0e-3\n\
         accelerometer_random_walk: 3.0e-3\n",
    );
    write(
        folder.path(),
        "mav0/leica0/data.csv",
        "#timestamp [ns],p_RS_R_x [m],...\n1403636579759555392,4.75,-1.79,0.80\n",
    );
    write(
        folder.path(),
        "mav0/leica0/sensor.yaml",
        "T_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 7.48903e-02,\n         0.0, 1.0, 0.0, -1.84772e-02,\n\
         \x20        0.0, 0.0, 1.0, -1.20209e-01,\n         0.0, 0.0, 0.0, 1.0]\n",
    );
    // x_S to up, y_S to east, z_S to north: the even permutation (x y z) to (z x y), a turn by -120 degrees about (1 1 1).
    write(
        folder.path(),
        "mav0/state_groundtruth_estimate0/data.csv",
        "#timestamp, ...\n1403636579759555392,4.6,-1.7,0.8,0.5,-0.5,-0.5,-0.5,1,2,3,0.01,0.02,0.03,0.1,0.2,0.3\n",
    );
    let dataset = euroc::read(folder.path(), 0.01).unwrap();
    assert_eq!(dataset.imu.len(), 2);
    assert_eq!(dataset.imu[0].stamp_ns, 1_403_636_579_758_555_392);
    // As the recording in forward-left-up has it.
    assert_eq!(
        dataset.imu[0].gyro_rps,
        [0.02722714, -0.1473058, -0.0991347]
    );
    assert_eq!(dataset.imu[0].accel_mps2, [-2.402629, 0.3759216, 8.147692]);
    assert_eq!(dataset.position[0].position_w_m, [4.75, -1.79, 0.80]);
    assert_eq!(
        dataset.meta.lever_arms_m,
        [[-0.120209, 0.0184772, 0.0748903]]
    );
    let noise = dataset.meta.imu_noise.unwrap();
    assert_eq!(
        (noise.gyro_density, noise.accel_bias_walk),
        (1.6968e-4, 3e-3)
    );
    let Truth::Spatial(truth) = &dataset.truth else {
        panic!("a truth in space");
    };
    let [x, y, z, w] = truth[0].q_wb;
    let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    // Forwards is z_S: north. Left is -y_S: west. Up is up.
    assert!((q * Vector3::x() - Vector3::y()).norm() < 1e-12, "{q}");
    assert!((q * Vector3::y() + Vector3::x()).norm() < 1e-12, "{q}");
    assert!((q * Vector3::z() - Vector3::z()).norm() < 1e-12, "{q}");
    assert_eq!(truth[0].v_w_mps, [1.0, 2.0, 3.0]);
    assert_eq!(truth[0].bias.unwrap().gyro_rps, [0.03, -0.02, 0.01]);

    let out = folder.path().join("dataset");
    dataset.save(&out).unwrap();
    let mut read = Dataset::load(&out).unwrap();
    read.meta.other = dataset.meta.other.clone();
    assert_eq!(read, dataset);
}

#[test]
fn a_tum_trajectory_becomes_a_truth_with_velocities() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("truth.txt");
    fs::write(
        &file,
        "# seconds x y z qx qy qz qw\n100.000000001 0 0 0 0 0 0 1\n100.500000001 1 2 3 0 0 0.6 0.8\n\
         101.000000001 3 2 1 0 0 0 2\n",
    )
    .unwrap();
    let error = from_tum::read(&folder.path().join("absent.txt")).unwrap_err();
    assert!(error.to_string().contains("absent.txt"), "{error}");
    let truth = from_tum::read(&file).unwrap();
    let Truth::Spatial(rows) = &truth else {
        panic!("a truth in space");
    };
    assert_eq!(rows[1].stamp_ns, 100_500_000_001);
    // From the first to the third row in one second; at the ends one-sided.
    assert_eq!(rows[1].v_w_mps, [3.0, 2.0, 1.0]);
    assert_eq!(rows[0].v_w_mps, [2.0, 4.0, 6.0]);
    assert_eq!(rows[2].q_wb, [0.0, 0.0, 0.0, 1.0]);
    // Into a folder whose other files stay.
    write(
        folder.path(),
        "data/imu.csv",
        "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,0,9.8\n",
    );
    save_truth(folder.path().join("data"), &truth).unwrap();
    let dataset = Dataset::load(folder.path().join("data")).unwrap();
    assert_eq!((&dataset.truth, dataset.imu.len()), (&truth, 1));

    for (text, complaint) in [
        (
            "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n",
            "line 2: the stamp 1000000000 ns does not come after",
        ),
        (
            "1 0 0 0 0 0 0\n",
            "line 1: 6 numbers after the stamp, not 7",
        ),
        ("1 0 x 0 0 0 0 1\n", "line 1: \"x\" is no finite number"),
        (
            "1 0 0 0 0 0 0 0\n",
            "line 1: the quaternion is not of length one",
        ),
        ("# nothing\n", "holds no rows"),
    ] {
        fs::write(&file, text).unwrap();
        let error = from_tum::read(&file).unwrap_err().to_string();
        assert!(error.contains(complaint), "{error}");
    }
}
