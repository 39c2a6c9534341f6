//! The simulated noise: as large as stated, white, reproducible, and separate per sensor.

use inekf_client::dataset::{Dataset, Initial, Truth, TruthRow};
use inekf_client::simulate::{
    HeadingOptions, InitialOptions, Scenario, SimulationOptions, VelocityOptions, simulate,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

fn truth(dataset: &Dataset) -> &[TruthRow] {
    match &dataset.truth {
        Truth::Spatial(rows) => rows,
        other => panic!("truth in space, not {other:?}"),
    }
}

fn noisy() -> SimulationOptions {
    SimulationOptions {
        gyro_bias_walk: 3e-4,
        accel_bias_walk: 2e-3,
        velocity: Some(VelocityOptions {
            rate_hz: 100.0,
            ..VelocityOptions::default()
        }),
        heading: Some(HeadingOptions {
            rate_hz: 100.0,
            ..HeadingOptions::default()
        }),
        seed: 77,
        ..SimulationOptions::default()
    }
}

/// Holds numbers that should be standard normal and independent to it, each statistic to five of
/// its own standard deviations: mean 1/sqrt(n), mean square sqrt(2/n), correlation of neighbours
/// 1/sqrt(n), fourth moment sqrt(96/n).
fn assert_standard_normal(what: &str, values: &[f64]) {
    let n = values.len() as f64;
    assert!(n > 200.0, "{what}: too few values");
    let mean = |f: &dyn Fn(f64) -> f64| values.iter().map(|value| f(*value)).sum::<f64>() / n;
    let neighbours = values.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / n;
    for (name, found, expected, deviation) in [
        ("mean", mean(&|x| x), 0.0, 1.0_f64),
        ("variance", mean(&|x| x * x), 1.0, 2.0_f64.sqrt()),
        ("fourth moment", mean(&|x| x.powi(4)), 3.0, 96.0_f64.sqrt()),
        ("correlation", neighbours, 0.0, 1.0),
    ] {
        let bound = 5.0 * deviation / n.sqrt();
        assert!(
            (found - expected).abs() < bound,
            "{what} {name}: {found} +- {bound}"
        );
    }
}

#[test]
fn imu_noise_and_bias_walk_have_their_densities() {
    let options = noisy();
    let dataset = simulate(Scenario::RoadCircuit, &options).unwrap();
    let ideal = simulate(Scenario::RoadCircuit, &options.clone().noise_free()).unwrap();
    let dt: f64 = 1.0 / options.imu_rate_hz;
    let biases: Vec<_> = truth(&dataset)
        .iter()
        .map(|row| row.bias.unwrap())
        .collect();
    let (mut gyro, mut accel) = (Vec::new(), Vec::new());
    let (mut gyro_walk, mut accel_walk) = (Vec::new(), Vec::new());
    for k in 1..dataset.imu.len() {
        for axis in 0..3 {
            // The sample of the interval from k-1 to k carries the bias at k-1.
            let (noisy, ideal) = (&dataset.imu[k], &ideal.imu[k]);
            let bias = biases[k - 1];
            let white = noisy.gyro_rps[axis] - ideal.gyro_rps[axis] - bias.gyro_rps[axis];
            gyro.push(white * dt.sqrt() / options.gyro_density);
            let white = noisy.accel_mps2[axis] - ideal.accel_mps2[axis] - bias.accel_mps2[axis];
            accel.push(white * dt.sqrt() / options.accel_density);
            let step = biases[k].gyro_rps[axis] - bias.gyro_rps[axis];
            gyro_walk.push(step / (options.gyro_bias_walk * dt.sqrt()));
            let step = biases[k].accel_mps2[axis] - bias.accel_mps2[axis];
            accel_walk.push(step / (options.accel_bias_walk * dt.sqrt()));
        }
    }
    assert_standard_normal("gyro", &gyro);
    assert_standard_normal("accelerometer", &accel);
    assert_standard_normal("gyro bias", &gyro_walk);
    assert_standard_normal("accelerometer bias", &accel_walk);
}

#[test]
fn fixes_have_their_deviations() {
    let options = noisy();
    let dataset = simulate(Scenario::DroneLoops, &options).unwrap();
    let ideal = simulate(Scenario::DroneLoops, &options.clone().noise_free()).unwrap();
    let scaled = |noisy: [f64; 3], ideal: [f64; 3], sigma: [f64; 3]| {
        [0, 1, 2].map(|axis| (noisy[axis] - ideal[axis]) / sigma[axis])
    };
    let position: Vec<f64> = dataset
        .position
        .iter()
        .zip(&ideal.position)
        .flat_map(|(noisy, ideal)| scaled(noisy.position_w_m, ideal.position_w_m, noisy.sigma_m))
        .collect();
    let velocity: Vec<f64> = dataset
        .velocity
        .iter()
        .zip(&ideal.velocity)
        .flat_map(|(a, b)| scaled(a.velocity_w_mps, b.velocity_w_mps, a.sigma_mps))
        .collect();
    let heading: Vec<f64> = dataset
        .heading
        .iter()
        .zip(&ideal.heading)
        .map(|(noisy, ideal)| (noisy.heading_rad - ideal.heading_rad) / noisy.sigma_rad)
        .collect();
    assert_standard_normal("position", &position);
    assert_standard_normal("velocity", &velocity);
    assert_standard_normal("heading", &heading);
}

/// The initial error `xi` of `chi = chi_hat exp(xi)`, taken apart again, and the biases at the start
/// have the variances that `P0_diag` states.
#[test]
fn initial_states_scatter_as_their_covariance_says() {
    let mut whitened = Vec::new();
    for seed in 0..400 {
        let options = SimulationOptions {
            seed,
            duration_s: 0.004,
            position: None,
            initial: Some(InitialOptions {
                rotation_sigma_rad: [0.1, 0.2, 0.6],
                velocity_sigma_mps: [0.01, 3.0, 0.3],
                position_sigma_m: [9.0, 0.1, 1.0],
            }),
            ..SimulationOptions::default()
        };
        let dataset = simulate(Scenario::DroneLoops, &options).unwrap();
        let start = truth(&dataset)[0];
        let Some(Initial::Spatial {
            q_wb,
            v_w_mps,
            p_w_m,
            gyro_bias_rps,
            accel_bias_mps2,
            ..
        }) = dataset.meta.initial
        else {
            panic!("a state in space");
        };
        let believed = UnitQuaternion::new_normalize(Quaternion::from(q_wb));
        let actual = UnitQuaternion::new_normalize(Quaternion::from(start.q_wb));
        let rotation = (believed.inverse() * actual).scaled_axis();
        // The mean of Exp(s rotation) over s by the midpoint rule: independent of the simulator's
        // closed form.
        let mean = mean_rotation(&rotation).try_inverse().unwrap();
        let body = |actual: [f64; 3], believed_: [f64; 3]| {
            let difference = Vector3::from(actual) - Vector3::from(believed_);
            mean * believed.inverse_transform_vector(&difference)
        };
        let bias = start.bias.unwrap();
        let xi = [
            rotation,
            body(start.v_w_mps, v_w_mps),
            body(start.p_w_m, p_w_m),
            Vector3::from(bias.gyro_rps) - Vector3::from(gyro_bias_rps),
            Vector3::from(bias.accel_mps2) - Vector3::from(accel_bias_mps2),
        ];
        let variances = dataset.meta.p0_diag.unwrap();
        assert_eq!(variances.len(), 15);
        let entries = xi.iter().flat_map(|part| part.iter().copied());
        whitened.extend(
            entries
                .zip(variances)
                .map(|(entry, variance)| entry / variance.sqrt()),
        );
    }
    assert_standard_normal("initial error", &whitened);
    // Each kind by itself, too: a wrong scale of one is lost among fifteen.
    for kind in 0..5 {
        let values: Vec<f64> = whitened
            .chunks_exact(15)
            .flat_map(|xi| xi[3 * kind..3 * kind + 3].to_vec())
            .collect();
        assert_standard_normal(&format!("initial error {kind}"), &values);
    }
}

fn mean_rotation(rotation: &Vector3<f64>) -> nalgebra::Matrix3<f64> {
    let steps = 400;
    let mut mean = nalgebra::Matrix3::zeros();
    for step in 0..steps {
        let share = (f64::from(step) + 0.5) / f64::from(steps);
        let part = UnitQuaternion::from_scaled_axis(rotation * share);
        mean += part.to_rotation_matrix().into_inner() / f64::from(steps);
    }
    mean
}

#[test]
fn one_seed_gives_one_dataset_and_another_seed_another() {
    let options = noisy();
    let first = simulate(Scenario::RoadCircuit, &options).unwrap();
    assert_eq!(first, simulate(Scenario::RoadCircuit, &options).unwrap());
    let other = SimulationOptions {
        seed: 78,
        ..options
    };
    let second = simulate(Scenario::RoadCircuit, &other).unwrap();
    assert_ne!(first.imu, second.imu);
    assert_ne!(first.position, second.position);
}

#[test]
fn the_same_seed_writes_the_same_bytes() {
    let options = SimulationOptions {
        duration_s: 3.0,
        ..noisy()
    };
    let write = || {
        let dir = tempfile::TempDir::new().unwrap();
        simulate(Scenario::StandThenDrive, &options)
            .unwrap()
            .save(dir.path())
            .unwrap();
        [
            "meta.json",
            "imu.csv",
            "position.csv",
            "velocity.csv",
            "heading.csv",
            "truth.csv",
        ]
        .map(|name| std::fs::read(dir.path().join(name)).unwrap())
    };
    assert_eq!(write(), write());
}

#[test]
fn sensors_have_random_streams_of_their_own() {
    let all = simulate(Scenario::RoadCircuit, &noisy()).unwrap();
    let few = SimulationOptions {
        position: None,
        velocity: None,
        ..noisy()
    };
    let few = simulate(Scenario::RoadCircuit, &few).unwrap();
    assert_eq!((&all.imu, &all.heading), (&few.imu, &few.heading));
    assert!(few.position.is_empty() && few.velocity.is_empty());
}

/// If two streams were one, the first draws of two sensors would agree.
#[test]
fn no_two_sensors_share_their_noise() {
    let options = noisy();
    let noisy = simulate(Scenario::RoadCircuit, &options).unwrap();
    let ideal = simulate(Scenario::RoadCircuit, &options.clone().noise_free()).unwrap();
    let bias = truth(&noisy)[0].bias.unwrap().gyro_rps[0];
    let white = noisy.imu[0].gyro_rps[0] - ideal.imu[0].gyro_rps[0] - bias;
    let (position, velocity) = (&noisy.position[0], &noisy.velocity[0]);
    let heading = &noisy.heading[0];
    let draws = [
        bias / options.gyro_bias_sigma_rps,
        white / (options.gyro_density * options.imu_rate_hz.sqrt()),
        (position.position_w_m[0] - ideal.position[0].position_w_m[0]) / position.sigma_m[0],
        (velocity.velocity_w_mps[0] - ideal.velocity[0].velocity_w_mps[0]) / velocity.sigma_mps[0],
        (heading.heading_rad - ideal.heading[0].heading_rad) / heading.sigma_rad,
    ];
    for (index, draw) in draws.iter().enumerate() {
        for other in &draws[..index] {
            assert!((draw - other).abs() > 1e-6, "{draws:?}");
        }
    }
}

/// Without white noise the sample of the interval from k-1 to k shows the bias of k-1.
#[test]
fn a_sample_carries_the_bias_from_the_start_of_its_interval() {
    let options = SimulationOptions {
        gyro_density: 0.0,
        accel_density: 0.0,
        ..noisy()
    };
    let noisy = simulate(Scenario::DroneLoops, &options).unwrap();
    let ideal = simulate(Scenario::DroneLoops, &options.clone().noise_free()).unwrap();
    for k in 1..noisy.imu.len() {
        let before = truth(&noisy)[k - 1].bias.unwrap();
        for axis in 0..3 {
            let gyro = noisy.imu[k].gyro_rps[axis] - ideal.imu[k].gyro_rps[axis];
            assert!((gyro - before.gyro_rps[axis]).abs() < 1e-14);
            let accel = noisy.imu[k].accel_mps2[axis] - ideal.imu[k].accel_mps2[axis];
            assert!((accel - before.accel_mps2[axis]).abs() < 1e-13);
        }
    }
}
