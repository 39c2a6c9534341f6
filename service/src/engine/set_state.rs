//! A state handed in by request, checked as if by a stranger.

use inekf::filter::Covariance;
use inekf::lie::SO3;
use inekf_shared::message::StateVector;
use nalgebra::SMatrix;

/// Largest believable entry of the mean, in its own unit.
const MAX_MEAN: f64 = 1e9;
/// Largest believable entry of the covariance, in its own unit.
const MAX_COVARIANCE: f64 = 1e18;
/// How far the quaternion's norm may be from 1: two decimals are enough to write it down.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// The attitude of `state`, once every number of it has been looked at.
///
/// # Errors
/// A sentence that names the fault and the remedy.
pub fn checked_attitude(state: &StateVector) -> Result<SO3, &'static str> {
    let means = [
        &state.q_wb[..],
        &state.v_w_mps,
        &state.p_w_m,
        &state.gyro_bias_rps,
        &state.accel_bias_mps2,
    ];
    let all = |test: &dyn Fn(f64) -> bool, parts: &[&[f64]]| {
        parts.iter().all(|part| part.iter().all(|&x| test(x)))
    };
    if !all(&f64::is_finite, &means) || !all(&f64::is_finite, &[&state.covariance]) {
        return Err("the state has a number that is not finite");
    }
    if !all(&|x| x.abs() <= MAX_MEAN, &means)
        || !all(&|x| x.abs() <= MAX_COVARIANCE, &[&state.covariance])
    {
        return Err(
            "the state has a number beyond belief (1e9, or 1e18 in the covariance): check its units",
        );
    }
    let norm = state.q_wb.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
        return Err("the attitude is not a unit quaternion: give x, y, z, w of norm 1");
    }
    SO3::from_quaternion_xyzw(state.q_wb)
        .map_err(|_| "the attitude is not a unit quaternion: give x, y, z, w of norm 1")
}

/// The covariance of `state`, positive semidefinite to rounding.
///
/// # Errors
/// A sentence that names the fault.
pub fn covariance<const N: usize>(state: &StateVector) -> Result<Covariance<N>, &'static str> {
    let entries = N * (N + 1) / 2;
    let covariance = Covariance::<N>::from_upper_triangle(&state.covariance[..entries])
        .ok_or("the covariance has the wrong number of entries")?;
    let p = covariance.matrix();
    if !is_positive_semidefinite(p) {
        return Err("the covariance is not positive semidefinite: check its order and signs");
    }
    Ok(covariance)
}

/// Whether `p` plus a rounding error on its diagonal has a Cholesky factor, after scaling to unit
/// variances (the units differ by many orders of magnitude).
pub fn is_positive_semidefinite<const N: usize>(p: &SMatrix<f64, N, N>) -> bool {
    let mut scaled = *p;
    for row in 0..N {
        for column in 0..N {
            let variances = (p[(row, row)], p[(column, column)]);
            if variances.0 < 0.0 {
                return false;
            }
            let scale = (variances.0 * variances.1).sqrt();
            scaled[(row, column)] = if row == column {
                1.0 + 1e-9
            } else if scale > 0.0 {
                p[(row, column)] / scale
            } else if p[(row, column)] == 0.0 {
                0.0
            } else {
                return false;
            };
        }
    }
    // A hand-written factorisation: the size is generic, and failure is an answer.
    for column in 0..N {
        for k in 0..column {
            let factor = scaled[(column, k)];
            for row in column..N {
                scaled[(row, column)] -= scaled[(row, k)] * factor;
            }
        }
        let pivot = scaled[(column, column)];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let root = pivot.sqrt();
        for row in column..N {
            scaled[(row, column)] /= root;
        }
    }
    true
}
