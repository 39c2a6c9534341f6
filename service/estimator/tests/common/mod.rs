//! What the tests of the model and the filter share: seeded draws, and oracles that are slower and plainer
//! than the code under test.

// Every test file is a crate of its own and uses a part of this.
#![allow(dead_code)]

pub mod dataset;
pub mod drive;
pub mod golden;
pub mod section7;

use inekf::filter::{Belief, Covariance, Side};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{ImuInput, ImuNoise, NavState};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// World frame ENU, m/s^2.
pub const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);

/// A generator whose draws depend on `seed` alone.
pub fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Independent standard normal entries.
pub fn normal<const R: usize, const C: usize>(rng: &mut ChaCha8Rng) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| rng.sample(StandardNormal))
}

/// A rotation by up to pi about any axis.
pub fn any_rotation(rng: &mut ChaCha8Rng) -> SO3 {
    let axis: Vector3<f64> = normal(rng);
    SO3::exp(&(axis.normalize() * rng.random_range(0.0..PI)))
}

/// A vehicle anywhere within some 50 m, at some 10 m/s, in any attitude.
pub fn any_pose(rng: &mut ChaCha8Rng) -> SE23 {
    SE23 {
        rotation: any_rotation(rng),
        velocity: 10.0 * normal::<3, 1>(rng),
        position: 50.0 * normal::<3, 1>(rng),
    }
}

/// Any pose, with the biases of a poor IMU.
pub fn any_state(rng: &mut ChaCha8Rng) -> NavState {
    NavState {
        pose: any_pose(rng),
        gyro_bias: 0.05 * normal::<3, 1>(rng),
        accel_bias: 0.3 * normal::<3, 1>(rng),
    }
}

/// A lively input: about 1 rad/s and 10 m/s^2.
pub fn any_input(rng: &mut ChaCha8Rng) -> ImuInput {
    ImuInput {
        omega_b: normal(rng),
        force_b: 10.0 * normal::<3, 1>(rng),
    }
}

/// Densities of a poor IMU.
pub const NOISE: ImuNoise = ImuNoise {
    gyro_psd: 4e-6,
    accel_psd: 1e-4,
    gyro_bias_psd: 1e-10,
    accel_bias_psd: 1e-8,
};

/// A full, well conditioned covariance with these standard deviations as its scale: no entry is zero.
pub fn covariance_of_scale<const D: usize>(
    sigmas: &SVector<f64, D>,
    rng: &mut ChaCha8Rng,
) -> Covariance<D> {
    let mixing: SMatrix<f64, D, D> = normal(rng);
    let root = SMatrix::from_diagonal(sigmas)
        * (SMatrix::<f64, D, D>::identity() + 0.4 / (D as f64).sqrt() * mixing);
    Covariance::from_upper(root * root.transpose())
}

/// A full positive definite matrix with these standard deviations as its scale.
pub fn noise_of_scale<const M: usize>(
    sigmas: &SVector<f64, M>,
    rng: &mut ChaCha8Rng,
) -> SMatrix<f64, M, M> {
    *covariance_of_scale(sigmas, rng).matrix()
}

/// Standard deviations of a 9- or 15-state belief: `attitude` rad, 1 m/s, 5 m, and small biases.
pub fn sigmas<const D: usize>(attitude: f64) -> SVector<f64, D> {
    SVector::from_fn(|i, _| match i / 3 {
        0 => attitude,
        1 => 1.0,
        2 => 5.0,
        3 => 0.01,
        _ => 0.1,
    })
}

/// Any belief around `mean`, in the error of side S.
pub fn any_belief<G: LieGroup<D>, S: Side, const D: usize>(
    mean: G,
    attitude: f64,
    rng: &mut ChaCha8Rng,
) -> Belief<G, S, D> {
    Belief::from_left_covariance(mean, covariance_of_scale(&sigmas(attitude), rng))
}

/// The derivative of `f` at zero, by central differences of fourth order.
pub fn derivative_at_zero<const N: usize, const M: usize>(
    f: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
) -> SMatrix<f64, M, N> {
    const STEP: f64 = 3e-4;
    let mut jacobian = SMatrix::<f64, M, N>::zeros();
    for j in 0..N {
        let along = |steps: f64| {
            let mut x = SVector::<f64, N>::zeros();
            x[j] = steps * STEP;
            f(&x)
        };
        let slope = ((along(1.0) - along(-1.0)) * 8.0 - (along(2.0) - along(-2.0))) / (12.0 * STEP);
        jacobian.set_column(j, &slope);
    }
    jacobian
}

/// Fails unless the difference is at most `tolerance` times the largest entry of `expected` (at least 1).
pub fn assert_close<const R: usize, const C: usize>(
    what: &str,
    actual: &SMatrix<f64, R, C>,
    expected: &SMatrix<f64, R, C>,
    tolerance: f64,
) {
    assert_within(what, actual, expected, tolerance * expected.amax().max(1.0));
}

/// Fails unless every entry differs by at most `bound`.
pub fn assert_within<const R: usize, const C: usize>(
    what: &str,
    actual: &SMatrix<f64, R, C>,
    expected: &SMatrix<f64, R, C>,
    bound: f64,
) {
    // `amax` passes over NaN, a comparison does not.
    let largest =
        (actual - expected).iter().fold(
            0.0,
            |largest: f64, x| if x.abs() <= largest { largest } else { x.abs() },
        );
    assert!(
        largest <= bound,
        "{what}: off by {largest:e}, allowed {bound:e}\nactual {actual}expected {expected}"
    );
}

/// Fails unless every entry differs by at most `tolerance` of the standard deviations of its row and column.
pub fn assert_same_covariance<const D: usize>(
    what: &str,
    actual: &SMatrix<f64, D, D>,
    expected: &SMatrix<f64, D, D>,
    tolerance: f64,
) {
    let scale = expected.diagonal().map(|variance| 1.0 / variance.sqrt());
    let normal = |p: &SMatrix<f64, D, D>| {
        SMatrix::from_diagonal(&scale) * p * SMatrix::from_diagonal(&scale)
    };
    assert_within(what, &normal(actual), &normal(expected), tolerance);
}

/// The pose as the plain triple that the textbooks integrate.
pub fn parts(chi: &SE23) -> (Matrix3<f64>, Vector3<f64>, Vector3<f64>) {
    (chi.rotation.matrix(), chi.velocity, chi.position)
}

/// Fails unless attitude, velocity and position agree to `tolerance` relative to their largest entries.
pub fn assert_same_pose(what: &str, actual: &SE23, expected: &SE23, tolerance: f64) {
    let ((ra, va, pa), (re, ve, pe)) = (parts(actual), parts(expected));
    assert_close(&format!("{what}, attitude"), &ra, &re, tolerance);
    assert_close(&format!("{what}, velocity"), &va, &ve, tolerance);
    assert_close(&format!("{what}, position"), &pa, &pe, tolerance);
}
