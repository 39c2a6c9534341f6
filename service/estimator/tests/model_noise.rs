//! The noise of the IMU: the covariance that `advance` accumulates against sampled noise, against the
//! textbook integrals of white noise, and per-sample deviations against densities.

mod common;

use common::{GRAVITY_W, any_input, any_state, assert_close, normal, seeded};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{Discretisation, ImuInput, ImuNoise, ImuStep, InertialState, NavState};
use nalgebra::{SMatrix, SVector, Vector3};

const DT_S: f64 = 0.02;

/// Sampled noise, constant over each interval, through the exact motion: 25 intervals of a lively
/// trajectory, 50,000 times. Every entry of the 15-state covariance must be within 4.8 standard deviations
/// of its sample estimate; one of the 120 is beyond by chance with a probability of 2e-4.
#[test]
fn the_accumulated_covariance_is_that_of_sampled_noise() {
    const STEPS: usize = 25;
    const SAMPLES: usize = 50_000;
    let mut rng = seeded(31);
    let start = any_state(&mut rng);
    let measured: Vec<ImuInput> = (0..STEPS).map(|_| any_input(&mut rng)).collect();
    // Small enough that the error stays linear, of the same order of effect in every component.
    let (gyro, accel, gyro_walk, accel_walk) = (2e-3, 2e-2, 2e-4, 4e-3);
    let noise = ImuNoise {
        gyro_psd: gyro * gyro * DT_S,
        accel_psd: accel * accel * DT_S,
        gyro_bias_psd: gyro_walk * gyro_walk / DT_S,
        accel_bias_psd: accel_walk * accel_walk / DT_S,
    };
    for discretisation in [Discretisation::ZeroOrderHold, Discretisation::Euler] {
        let mut nominal = start;
        let mut predicted = SMatrix::<f64, 15, 15>::zeros();
        for sample in &measured {
            let step = nominal.imu_step(sample, &GRAVITY_W, DT_S, discretisation);
            let (next, f, q) = nominal.advance(&step, &noise);
            nominal = next;
            predicted = f * predicted * f.transpose() + q;
        }

        let mut sampled = SMatrix::<f64, 15, 15>::zeros();
        for _ in 0..SAMPLES {
            let mut truth = start;
            for sample in &measured {
                let input = ImuInput {
                    omega_b: sample.omega_b - truth.gyro_bias - gyro * normal::<3, 1>(&mut rng),
                    force_b: sample.force_b - truth.accel_bias - accel * normal::<3, 1>(&mut rng),
                };
                let step = ImuStep::new(&input, &GRAVITY_W, DT_S, discretisation).step;
                truth.pose = step.apply(&truth.pose);
                truth.gyro_bias += gyro_walk * normal::<3, 1>(&mut rng);
                truth.accel_bias += accel_walk * normal::<3, 1>(&mut rng);
            }
            let xi = nominal.inverse().compose(&truth).log();
            sampled += xi * xi.transpose() / SAMPLES as f64;
        }

        for i in 0..15 {
            for j in i..15 {
                let (p, p_ii, p_jj) = (predicted[(i, j)], predicted[(i, i)], predicted[(j, j)]);
                let deviation = ((p_ii * p_jj + p * p) / SAMPLES as f64).sqrt();
                let score = (sampled[(i, j)] - p) / deviation;
                assert!(
                    score.abs() < 4.8,
                    "{discretisation:?}, entry ({i}, {j}): {} sampled, {p} predicted, {score} deviations",
                    sampled[(i, j)]
                );
            }
        }
    }
}

/// A deviation `sigma` per sample of length dt is the density `sigma^2 dt`: the input covariance of one step
/// is then `diag(sigma^2)`, whatever the rate.
#[test]
fn a_deviation_per_sample_is_a_density_times_the_rate() {
    let mut rng = seeded(32);
    for dt_s in [0.001, 0.01, 0.1] {
        let (gyro, accel) = (0.03, 0.4);
        let noise = ImuNoise {
            gyro_psd: gyro * gyro * dt_s,
            accel_psd: accel * accel * dt_s,
            gyro_bias_psd: 0.0,
            accel_bias_psd: 0.0,
        };
        let step = ImuStep::new(
            &any_input(&mut rng),
            &GRAVITY_W,
            dt_s,
            Discretisation::ZeroOrderHold,
        );
        let input = SMatrix::<f64, 6, 6>::from_diagonal(&SVector::from([
            gyro * gyro,
            gyro * gyro,
            gyro * gyro,
            accel * accel,
            accel * accel,
            accel * accel,
        ]));
        let expected = step.input_jacobian * input * step.input_jacobian.transpose();
        let scale = expected.amax();
        assert_close(
            "Q",
            &(step.noise_covariance(&noise) / scale),
            &(expected / scale),
            1e-14,
        );
    }
}

/// Covariance after `steps` intervals of a body that neither turns nor feels a force.
fn after_free_fall(duration_s: f64, steps: usize, noise: &ImuNoise) -> SMatrix<f64, 15, 15> {
    let still = ImuInput {
        omega_b: Vector3::zeros(),
        force_b: Vector3::zeros(),
    };
    let mut state = NavState::identity();
    let mut p = SMatrix::<f64, 15, 15>::zeros();
    for _ in 0..steps {
        let dt_s = duration_s / steps as f64;
        let step = state.imu_step(&still, &GRAVITY_W, dt_s, Discretisation::ZeroOrderHold);
        let (next, f, q) = state.advance(&step, noise);
        state = next;
        p = f * p * f.transpose() + q;
    }
    p
}

/// Integrated once, twice and three times, white noise of density s has the variances s T, s T^3 / 3 and
/// s T^5 / 20, and the covariances between them s T^2 / 2, s T^3 / 6 and s T^4 / 8.
#[test]
fn densities_integrate_to_their_textbook_variances() {
    let noise = ImuNoise {
        gyro_psd: 2.0,
        accel_psd: 3.0,
        gyro_bias_psd: 0.0,
        accel_bias_psd: 0.0,
    };
    let walks = ImuNoise {
        gyro_psd: 0.0,
        accel_psd: 0.0,
        gyro_bias_psd: 5.0,
        accel_bias_psd: 7.0,
    };
    let (t, steps) = (1.5_f64, 2000);
    let white = after_free_fall(t, steps, &noise);
    let walked = after_free_fall(t, steps, &walks);
    // Held noise differs from white noise by this share of an interval.
    let tolerance = 3.0 / steps as f64;
    let check = |what: &str, actual: f64, expected: f64| {
        assert!(
            (actual - expected).abs() <= tolerance * expected.abs(),
            "{what}: {actual}, expected {expected}"
        );
    };
    for axis in 0..3 {
        let at = |p: &SMatrix<f64, 15, 15>, i: usize, j: usize| p[(3 * i + axis, 3 * j + axis)];
        check("attitude", at(&white, 0, 0), 2.0 * t);
        check("velocity", at(&white, 1, 1), 3.0 * t);
        check(
            "velocity, position",
            at(&white, 1, 2),
            3.0 * t.powi(2) / 2.0,
        );
        check("position", at(&white, 2, 2), 3.0 * t.powi(3) / 3.0);
        check("gyro bias", at(&walked, 3, 3), 5.0 * t);
        check(
            "attitude, gyro bias",
            at(&walked, 0, 3),
            -5.0 * t.powi(2) / 2.0,
        );
        check("attitude by bias", at(&walked, 0, 0), 5.0 * t.powi(3) / 3.0);
        check("accelerometer bias", at(&walked, 4, 4), 7.0 * t);
        check("velocity by bias", at(&walked, 1, 1), 7.0 * t.powi(3) / 3.0);
        check("position, bias", at(&walked, 2, 4), -7.0 * t.powi(3) / 6.0);
        check(
            "velocity, position by bias",
            at(&walked, 1, 2),
            7.0 * t.powi(4) / 8.0,
        );
        check(
            "position by bias",
            at(&walked, 2, 2),
            7.0 * t.powi(5) / 20.0,
        );
    }
}

/// The same densities at 100 Hz and at 1 kHz give the same uncertainty.
#[test]
fn densities_do_not_know_the_rate() {
    let slow = after_free_fall(1.0, 100, &common::NOISE);
    let fast = after_free_fall(1.0, 1000, &common::NOISE);
    for i in 0..15 {
        let ratio = slow[(i, i)] / fast[(i, i)];
        assert!((ratio - 1.0).abs() < 0.02, "variance {i}: ratio {ratio}");
    }
}

#[test]
fn the_state_without_biases_has_the_same_noise() {
    let mut rng = seeded(33);
    let (state, input) = (any_state(&mut rng), any_input(&mut rng));
    let step = state.imu_step(&input, &GRAVITY_W, DT_S, Discretisation::ZeroOrderHold);
    let (_, f, q) = <SE23 as InertialState<9>>::advance(&state.pose, &step, &common::NOISE);
    let (_, f_biased, q_biased) = state.advance(&step, &common::NOISE);
    assert_eq!(f, f_biased.fixed_view::<9, 9>(0, 0).into_owned());
    assert_eq!(q, q_biased.fixed_view::<9, 9>(0, 0).into_owned());
}
