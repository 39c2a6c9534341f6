//! The simulated motion: consistent with itself, and with what an integrator makes of the IMU.

use inekf_client::dataset::{Dataset, ImuRow, Truth, TruthRow};
use inekf_client::simulate::{
    Kinematics, PositionOptions, Scenario, SimulationOptions, VelocityOptions, simulate,
};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

fn truth(dataset: &Dataset) -> &[TruthRow] {
    match &dataset.truth {
        Truth::Spatial(rows) => rows,
        other => panic!("truth in space, not {other:?}"),
    }
}

fn quaternion(row: &TruthRow) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::from(row.q_wb))
}

/// Fourth-order central difference of a vector function.
fn derivative(t: f64, f: impl Fn(f64) -> Vector3<f64>) -> Vector3<f64> {
    let h = 1e-3;
    let near = (f(t + h) - f(t - h)) / (2.0 * h);
    let far = (f(t + 2.0 * h) - f(t - 2.0 * h)) / (4.0 * h);
    (near * 4.0 - far) / 3.0
}

#[test]
fn velocity_acceleration_and_body_rate_are_the_derivatives() {
    for scenario in Scenario::ALL {
        for step in 0..400 {
            let t = f64::from(step) * 0.21 - 1.0;
            let at = scenario.at(t);
            let velocity = derivative(t, |t| scenario.at(t).p_w_m);
            assert!((velocity - at.v_w_mps).norm() < 1e-8, "{scenario} {t}");
            let acceleration = derivative(t, |t| scenario.at(t).v_w_mps);
            assert!((acceleration - at.a_w_mps2).norm() < 1e-7, "{scenario} {t}");
            let back = at.q_wb.inverse();
            let turn = derivative(t, |t| (back * scenario.at(t).q_wb).scaled_axis());
            assert!((turn - at.omega_b_rps).norm() < 1e-8, "{scenario} {t}");
        }
    }
}

#[test]
fn car_points_along_the_road_and_hardly_leans() {
    let mut bends = (false, false);
    for step in 0..1500 {
        let at = Scenario::RoadCircuit.at(f64::from(step) * 0.1);
        let velocity_b = at.q_wb.inverse_transform_vector(&at.v_w_mps);
        assert!(velocity_b.x > 4.0 && velocity_b.x < 16.0, "{velocity_b}");
        assert!(velocity_b.yz().norm() < 1e-12 * velocity_b.x);
        let up_w = at.q_wb * Vector3::z();
        assert!(up_w.z > 0.99);
        assert!(at.a_w_mps2.norm() < 5.0);
        bends.0 |= at.omega_b_rps.z > 0.1;
        bends.1 |= at.omega_b_rps.z < -0.1;
    }
    assert_eq!(bends, (true, true), "bends to the left and to the right");
}

#[test]
fn drone_is_carried_by_its_thrust_and_banks_steeply() {
    let gravity = Vector3::new(0.0, 0.0, -9.80665);
    let mut steepest: f64 = 0.0;
    for step in 0..1000 {
        let at = Scenario::DroneLoops.at(f64::from(step) * 0.03);
        let force_b = at.q_wb.inverse_transform_vector(&(at.a_w_mps2 - gravity));
        assert!(force_b.z > 5.0 && force_b.xy().norm() < 1e-12, "{force_b}");
        steepest = steepest.max((at.q_wb * Vector3::z()).z.acos().to_degrees());
    }
    assert!(steepest > 45.0 && steepest < 50.0, "{steepest}");
}

#[test]
fn standing_car_stands_for_15_seconds_and_reads_gravity() {
    let options = SimulationOptions {
        duration_s: 30.0,
        ..SimulationOptions::default()
    };
    let dataset = simulate(Scenario::StandThenDrive, &options.noise_free()).unwrap();
    let (rows, start) = (truth(&dataset), truth(&dataset)[0]);
    let up_b = quaternion(&start).inverse_transform_vector(&Vector3::z());
    for (row, sample) in rows.iter().zip(&dataset.imu) {
        if row.stamp_ns > 15_000_000_000 {
            break;
        }
        assert_eq!(
            (row.p_w_m, row.v_w_mps, row.q_wb),
            (start.p_w_m, [0.0; 3], start.q_wb)
        );
        assert_eq!(sample.gyro_rps, [0.0; 3]);
        let force = Vector3::from(sample.accel_mps2);
        assert!((force - up_b * 9.80665).norm() < 1e-12, "{force}");
        assert!(force.z > 9.79, "the car stands nearly level");
    }
    assert!(
        Vector3::from(rows.last().unwrap().v_w_mps).norm() > 4.0,
        "it drives off"
    );
}

/// Integrates samples held constant over their intervals with many small steps of the defining
/// equations `R' = R [w]x`, `v' = R a + g`, `p' = v` (classical Runge-Kutta on the matrix).
fn integrate(start: &TruthRow, samples: &[ImuRow]) -> (Matrix3<f64>, Vector3<f64>, Vector3<f64>) {
    let gravity = Vector3::new(0.0, 0.0, -9.80665);
    let mut r = quaternion(start).to_rotation_matrix().into_inner();
    let (mut v, mut p) = (Vector3::from(start.v_w_mps), Vector3::from(start.p_w_m));
    let mut last_ns = start.stamp_ns;
    let steps = 4;
    for sample in samples {
        let h = (sample.stamp_ns - last_ns) as f64 * 1e-9 / f64::from(steps);
        last_ns = sample.stamp_ns;
        let spin = Vector3::from(sample.gyro_rps).cross_matrix();
        let force = Vector3::from(sample.accel_mps2);
        for _ in 0..steps {
            let rate = |r: &Matrix3<f64>, v: &Vector3<f64>| (r * spin, r * force + gravity, *v);
            let (r1, v1, p1) = rate(&r, &v);
            let (r2, v2, p2) = rate(&(r + r1 * (h / 2.0)), &(v + v1 * (h / 2.0)));
            let (r3, v3, p3) = rate(&(r + r2 * (h / 2.0)), &(v + v2 * (h / 2.0)));
            let (r4, v4, p4) = rate(&(r + r3 * h), &(v + v3 * h));
            r += (r1 + r2 * 2.0 + r3 * 2.0 + r4) * (h / 6.0);
            v += (v1 + v2 * 2.0 + v3 * 2.0 + v4) * (h / 6.0);
            p += (p1 + p2 * 2.0 + p3 * 2.0 + p4) * (h / 6.0);
        }
    }
    (r, v, p)
}

#[test]
fn noise_free_imu_integrates_to_the_truth() {
    for scenario in Scenario::ALL {
        let options = SimulationOptions {
            duration_s: 60.0,
            ..SimulationOptions::default()
        };
        let dataset = simulate(scenario, &options.noise_free()).unwrap();
        assert_eq!(dataset.imu.len(), 12_001);
        let (start, end) = (truth(&dataset)[0], *truth(&dataset).last().unwrap());
        let (r, v, p) = integrate(&start, &dataset.imu[1..]);
        let attitude = (quaternion(&end).to_rotation_matrix().into_inner() - r).norm();
        let velocity = (Vector3::from(end.v_w_mps) - v).norm();
        let position = (Vector3::from(end.p_w_m) - p).norm();
        // Attitude and velocity are exact; position is off by the trapezium rule's dt^2/12 times
        // the change of acceleration, 2e-5 m here.
        assert!(attitude < 1e-9, "{scenario}: {attitude:e}");
        assert!(velocity < 1e-8, "{scenario}: {velocity:e} m/s");
        assert!(position < 5e-5, "{scenario}: {position:e} m");
    }
}

#[test]
fn stamps_are_regular_and_fixes_lie_between_samples() {
    let options = SimulationOptions {
        imu_rate_hz: 30.0,
        duration_s: 10.0,
        position: Some(PositionOptions {
            rate_hz: 3.0,
            offset_s: 0.01,
            ..PositionOptions::default()
        }),
        truth_every: 7,
        ..SimulationOptions::default()
    };
    let dataset = simulate(Scenario::DroneLoops, &options).unwrap();
    assert_eq!(dataset.imu.len(), 301);
    assert_eq!(dataset.imu[1].stamp_ns, 33_333_333);
    assert_eq!(dataset.imu[300].stamp_ns, 10_000_000_000);
    assert_eq!(dataset.position[0].stamp_ns, 10_000_000);
    assert_eq!(dataset.position[1].stamp_ns, 343_333_333);
    assert_eq!(truth(&dataset).len(), 43);
    assert_eq!(truth(&dataset)[2].stamp_ns, dataset.imu[14].stamp_ns);
}

#[test]
fn noise_free_fixes_are_of_the_antenna_and_the_motion() {
    let options = SimulationOptions {
        velocity: Some(VelocityOptions::default()),
        heading: Some(Default::default()),
        duration_s: 20.0,
        ..SimulationOptions::default()
    };
    let dataset = simulate(Scenario::DroneLoops, &options.noise_free()).unwrap();
    let at = |stamp_ns: u64| -> Kinematics { Scenario::DroneLoops.at(stamp_ns as f64 * 1e-9) };
    assert_eq!(
        (
            dataset.position.len(),
            dataset.velocity.len(),
            dataset.heading.len()
        ),
        (100, 100, 20)
    );
    for fix in &dataset.position {
        let motion = at(fix.stamp_ns);
        let arm_b = motion
            .q_wb
            .inverse_transform_vector(&(Vector3::from(fix.position_w_m) - motion.p_w_m));
        assert!((arm_b - Vector3::new(-0.3, 0.0, 0.5)).norm() < 1e-12);
    }
    for fix in &dataset.velocity {
        assert!((Vector3::from(fix.velocity_w_mps) - at(fix.stamp_ns).v_w_mps).norm() < 1e-12);
    }
    for fix in &dataset.heading {
        let (_, _, yaw) = at(fix.stamp_ns).q_wb.euler_angles();
        assert!((fix.heading_rad - yaw).abs() < 1e-9);
    }
}

#[test]
fn scenarios_are_found_by_name() {
    for scenario in Scenario::ALL {
        assert_eq!(scenario.name().parse(), Ok(scenario));
        assert!(!scenario.description().is_empty());
    }
    let error = "road".parse::<Scenario>().unwrap_err().to_string();
    for scenario in Scenario::ALL {
        assert!(error.contains(scenario.name()), "{error}");
    }
}

#[test]
fn impossible_options_are_refused_by_name() {
    let base = SimulationOptions::default;
    for (options, name) in [
        (
            SimulationOptions {
                imu_rate_hz: 0.0,
                ..base()
            },
            "imu_rate_hz",
        ),
        (
            SimulationOptions {
                imu_rate_hz: f64::NAN,
                ..base()
            },
            "imu_rate_hz",
        ),
        (
            SimulationOptions {
                duration_s: -1.0,
                ..base()
            },
            "duration_s",
        ),
        (
            SimulationOptions {
                duration_s: f64::INFINITY,
                ..base()
            },
            "duration_s",
        ),
        (
            SimulationOptions {
                imu_rate_hz: 1e5,
                duration_s: 1e5,
                ..base()
            },
            "duration_s",
        ),
        (
            SimulationOptions {
                truth_every: 0,
                ..base()
            },
            "truth_every",
        ),
        (
            SimulationOptions {
                gyro_density: -1e-3,
                ..base()
            },
            "gyro_density",
        ),
    ] {
        let error = simulate(Scenario::RoadCircuit, &options)
            .unwrap_err()
            .to_string();
        assert!(error.contains(name), "{error}");
    }
}
