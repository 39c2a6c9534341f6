//! Errors against closed forms.

use std::f64::consts::{FRAC_PI_2, PI};

use inekf_client::dataset::{Truth, Truth2dRow, TruthRow};
use inekf_client::evaluate::{
    DEFAULT_MAX_GAP_NS, Pose, Trajectory, deviations, errors, nees, summarise, wrap_angle,
};
use inekf_client::table::{EstimateRow, EstimateState};
use nalgebra::{UnitQuaternion, Vector3};

const SECOND: u64 = 1_000_000_000;

fn pose(stamp_ns: u64, p: [f64; 3], v: [f64; 3], rotation: [f64; 3]) -> Pose {
    Pose {
        stamp_ns,
        q_wb: UnitQuaternion::from_scaled_axis(Vector3::from(rotation)),
        v_w_mps: Some(v.into()),
        p_w_m: p.into(),
    }
}

/// Constant velocity and a constant turn rate: interpolation is exact.
#[test]
fn interpolation_is_exact_for_constant_rates() {
    let axis = Vector3::new(0.36, 0.48, 0.8);
    let at = |t: f64| Pose {
        stamp_ns: (t * 1e9) as u64,
        q_wb: UnitQuaternion::from_scaled_axis(Vector3::x() * 0.3)
            * UnitQuaternion::from_scaled_axis(axis * (2.5 * t)),
        v_w_mps: Some(Vector3::new(3.0 * t, -t, 0.5)),
        p_w_m: Vector3::new(1.0 + 2.0 * t, -4.0 * t, 7.0),
    };
    let trajectory = Trajectory::new((0..5).map(|i| at(f64::from(i) * 0.5)).collect());
    for step in 0..=200 {
        let expected = at(f64::from(step) * 0.01);
        let found = trajectory.at(expected.stamp_ns, SECOND).unwrap();
        assert!((found.p_w_m - expected.p_w_m).norm() < 1e-12);
        assert!((found.v_w_mps.unwrap() - expected.v_w_mps.unwrap()).norm() < 1e-12);
        assert!(found.q_wb.angle_to(&expected.q_wb) < 1e-7);
        assert!(
            (found.q_wb.coords - expected.q_wb.coords)
                .norm()
                .min((found.q_wb.coords + expected.q_wb.coords).norm())
                < 1e-14
        );
    }
}

#[test]
fn nothing_is_extrapolated_or_bridged_over_long_gaps() {
    let still = |stamp_ns| pose(stamp_ns, [0.0; 3], [0.0; 3], [0.0; 3]);
    let trajectory = Trajectory::new([10, 20, 1000].map(still).to_vec());
    assert!(trajectory.at(9, 100).is_none());
    assert!(trajectory.at(1001, 100).is_none());
    assert!(trajectory.at(500, 100).is_none());
    assert!(trajectory.at(500, 980).is_some());
    assert!(
        [10, 15, 20, 1000]
            .iter()
            .all(|stamp| trajectory.at(*stamp, 100).is_some())
    );
    assert!(Trajectory::default().at(5, 100).is_none());
}

#[test]
fn angles_wrap_into_the_half_open_turn() {
    for (angle, expected) in [
        (0.0, 0.0),
        (PI, PI),
        (-PI, PI),
        (3.5 * PI, -0.5 * PI),
        (-7.0, -7.0 + 2.0 * PI),
    ] {
        assert!((wrap_angle(angle) - expected).abs() < 1e-14, "{angle}");
    }
    assert!(wrap_angle(-1e-20).abs() < 1e-15);
}

#[test]
fn errors_and_figures_of_a_known_run() {
    // The truth drives east at 2 m/s with heading pi - 0.05; the estimate is off by (3, 4, 12) at
    // even seconds and by nothing at odd ones, and its heading is 0.1 further, across the seam.
    let truth: Vec<Pose> = (0..=10_u32)
        .map(|i| {
            let east = 2.0 * f64::from(i);
            pose(
                u64::from(i) * SECOND,
                [east, 0.0, 0.0],
                [2.0, 0.0, 0.0],
                [0.0, 0.0, PI - 0.05],
            )
        })
        .collect();
    let estimate: Vec<Pose> = truth
        .iter()
        .enumerate()
        .map(|(i, pose)| {
            let off = if i % 2 == 0 {
                Vector3::new(3.0, 4.0, 12.0)
            } else {
                Vector3::zeros()
            };
            Pose {
                p_w_m: pose.p_w_m + off,
                v_w_mps: pose.v_w_mps.map(|v| v + Vector3::new(0.0, -0.2, 0.0)),
                q_wb: UnitQuaternion::from_scaled_axis(Vector3::z() * 0.1) * pose.q_wb,
                ..*pose
            }
        })
        .collect();
    let errors = errors(
        &Trajectory::new(estimate),
        &Trajectory::new(truth),
        DEFAULT_MAX_GAP_NS,
    );
    assert_eq!(errors.len(), 11);
    // From second 1 on: 10 errors, 5 of them off.
    let summary = summarise(&errors, SECOND).unwrap();
    assert_eq!(summary.count, 10);
    let half = 0.5_f64.sqrt();
    assert!((summary.position_rmse_m - Vector3::new(3.0, 4.0, 12.0) * half).norm() < 1e-12);
    assert!((summary.horizontal_rmse_m - 5.0 * half).abs() < 1e-12);
    assert!((summary.distance_rmse_m - 13.0 * half).abs() < 1e-12);
    assert!((summary.distance_max_m - 13.0).abs() < 1e-12);
    let velocity = summary.velocity_rmse_mps.unwrap();
    assert!((velocity - Vector3::new(0.0, 0.2, 0.0)).norm() < 1e-12);
    for angle in [
        summary.heading_rmse_rad,
        summary.heading_max_rad,
        summary.attitude_rmse_rad,
        summary.attitude_max_rad,
    ] {
        assert!((angle - 0.1).abs() < 1e-12, "{angle}");
    }
    assert!(errors.iter().all(|error| error.heading_rad > 0.0));
    assert!(summarise(&errors, 11 * SECOND).is_none());
}

#[test]
fn estimate_in_the_plane_is_judged_in_the_plane() {
    // The truth is 40 m up and pitched by 0.3, with the nose towards heading 1.
    let heading = UnitQuaternion::from_scaled_axis(Vector3::z());
    let q = heading * UnitQuaternion::from_scaled_axis(Vector3::y() * 0.3);
    let truth = Truth::Spatial(vec![TruthRow {
        stamp_ns: 5,
        q_wb: q.coords.into(),
        v_w_mps: [1.0, 0.0, 3.0],
        p_w_m: [7.0, 8.0, 40.0],
        bias: None,
    }]);
    let state = EstimateState::Plane {
        theta_rad: 1.25,
        p_w_m: [7.5, 8.0],
    };
    let rows = [EstimateRow {
        stamp_ns: 5,
        state,
        covariance: Vec::new(),
    }];
    let estimate = Trajectory::from_estimates(&rows);
    let found = errors(&estimate, &Trajectory::from_truth(&truth), SECOND);
    assert_eq!(found.len(), 1);
    assert!((found[0].position_m - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-12);
    assert!((found[0].heading_rad - 0.25).abs() < 1e-12);
    assert!((found[0].attitude_rad - 0.25).abs() < 1e-7);
    assert_eq!(found[0].velocity_mps, None);

    let planar = Truth::Planar(vec![Truth2dRow {
        stamp_ns: 5,
        theta_rad: -5.0,
        p_w_m: [7.5, 8.0],
    }]);
    let found = errors(&estimate, &Trajectory::from_truth(&planar), SECOND);
    assert!((found[0].heading_rad - (6.25 - 2.0 * PI)).abs() < 1e-12);
}

#[test]
fn nees_is_the_quadratic_form() {
    // P = [4 2; 2 3], P^-1 = [3 -2; -2 4] / 8, xi = (1, -2): (3 + 8 + 16) / 8.
    let value = nees(&[1.0, -2.0], &[4.0, 2.0, 3.0]).unwrap();
    assert!((value - 27.0 / 8.0).abs() < 1e-14);
    assert_eq!(nees(&[1.0, -2.0], &[1.0, 2.0, 3.0]), None, "indefinite");
    assert_eq!(nees(&[1.0], &[1.0, 2.0, 3.0]), None, "wrong size");
}

#[test]
fn deviations_are_turned_into_the_world() {
    // Heading north: body x is world north, body y world west.
    let q = UnitQuaternion::from_scaled_axis(Vector3::z() * FRAC_PI_2);
    let diagonal: Vec<f64> = (1..=15).map(|i| f64::from(i * i)).collect();
    for dimension in [9, 15] {
        let mut covariance = Vec::new();
        for (i, variance) in diagonal.iter().take(dimension).enumerate() {
            covariance.push(*variance);
            covariance.extend(vec![0.0; dimension - 1 - i]);
        }
        let state = EstimateState::Navigation {
            q_wb: q.coords.into(),
            v_w_mps: [0.0; 3],
            p_w_m: [0.0; 3],
            gyro_bias_rps: [0.0; 3],
            accel_bias_mps2: [0.0; 3],
        };
        let found = deviations(&EstimateRow {
            stamp_ns: 0,
            state,
            covariance,
        })
        .unwrap();
        assert!((found.position_m - Vector3::new(8.0, 7.0, 9.0)).norm() < 1e-12);
        assert!((found.heading_rad - 3.0).abs() < 1e-12);
    }
    // In the plane, with a correlation: rotating by 45 degrees P = [2 1; 1 2] gives diag(1, 3).
    let state = EstimateState::Plane {
        theta_rad: PI / 4.0,
        p_w_m: [0.0; 2],
    };
    let covariance = vec![0.25, 0.0, 0.0, 2.0, 1.0, 2.0];
    let found = deviations(&EstimateRow {
        stamp_ns: 0,
        state,
        covariance,
    })
    .unwrap();
    let expected = Vector3::new(1.0, 3.0_f64.sqrt(), 0.0);
    assert!((found.position_m - expected).norm() < 1e-12, "{found:?}");
    assert!((found.heading_rad - 0.5).abs() < 1e-15);
    let none = EstimateRow {
        stamp_ns: 0,
        state,
        covariance: Vec::new(),
    };
    assert_eq!(deviations(&none), None);
}
