//! A state handed in by request, checked as if by a stranger.

use inekf::filter::{Belief, Covariance, Left, Side};
use inekf::lie::{SE23, SO3};
use inekf::model::{InertialState, NavState};
use inekf_shared::message::{MODEL_IMU, StateVector, model_name};
use nalgebra::{Matrix3, SMatrix, Vector3};

use super::fix::FirstPosition;
use super::settings::{InitialSettings, PositionSource};

/// Standard deviation per axis of a position that comes without one, m: the configuration's default.
const UNSTATED_POSITION_SIGMA: f64 = 10.0;
/// Largest believable entry of the mean, in its own unit.
const MAX_MEAN: f64 = 1e9;
/// Largest believable entry of the covariance, in its own unit.
const MAX_COVARIANCE: f64 = 1e18;
/// How far the quaternion's norm may be from 1: two decimals are enough to write it down.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// The belief that `state` describes.
///
/// A state of 9 dimensions is taken by a filter of 15 with the configured bias prior; a state of
/// 15 is taken by a filter of 9 without its biases. A state of 0 dimensions has no covariance: it is
/// believed as much as the configured start.
///
/// # Errors
/// A sentence that names the fault and the remedy.
pub fn belief_of<G: InertialState<D>, S: Side, const D: usize>(
    state: &StateVector,
    initial: &InitialSettings,
) -> Result<Belief<G, S, D>, &'static str> {
    let biases = &initial.biases;
    if state.model != MODEL_IMU {
        return Err(if model_name(state.model) == "unknown" {
            "the state's model is unknown: this daemon runs the model imu"
        } else {
            "the state is of another model: this daemon runs the model imu"
        });
    }
    let numbers = [
        &state.q_wb[..],
        &state.v_w_mps,
        &state.p_w_m,
        &state.gyro_bias_rps,
        &state.accel_bias_mps2,
        &state.covariance,
    ];
    if !numbers
        .iter()
        .all(|part| part.iter().all(|x| x.is_finite()))
    {
        return Err("the state has a number that is not finite");
    }
    let (covariances, means) = (&numbers[5..], &numbers[..5]);
    let within = |parts: &[&[f64]], limit: f64| {
        parts
            .iter()
            .all(|part| part.iter().all(|x| x.abs() <= limit))
    };
    if !within(means, MAX_MEAN) || !within(covariances, MAX_COVARIANCE) {
        return Err(
            "the state has a number beyond belief (1e9, or 1e18 in the covariance): check its units",
        );
    }
    let norm = state.q_wb.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
        return Err("the attitude is not a unit quaternion: give x, y, z, w of norm 1");
    }
    let rotation = SO3::from_quaternion_xyzw(state.q_wb)
        .map_err(|_| "the attitude is not a unit quaternion: give x, y, z, w of norm 1")?;
    let pose = SE23 {
        rotation,
        velocity: state.v_w_mps.into(),
        position: state.p_w_m.into(),
    };
    let full = match state.dimension {
        0 => *configured(initial, &pose).matrix(),
        9 => {
            let pose_covariance = covariance::<9>(state)?;
            let mut p = SMatrix::<f64, 15, 15>::zeros();
            p.fixed_view_mut::<9, 9>(0, 0)
                .copy_from(pose_covariance.matrix());
            for axis in 0..3 {
                p[(9 + axis, 9 + axis)] = biases.gyro_sigma * biases.gyro_sigma;
                p[(12 + axis, 12 + axis)] = biases.accel_sigma * biases.accel_sigma;
            }
            p
        }
        15 => *covariance::<15>(state)?.matrix(),
        _ => {
            return Err(
                "the state's dimension must be 9 or 15 for the model imu, or 0 for the configured covariance",
            );
        }
    };
    let (gyro_bias, accel_bias): (Vector3<f64>, Vector3<f64>) = if state.dimension != 15 {
        (biases.gyro_bias, biases.accel_bias)
    } else {
        (state.gyro_bias_rps.into(), state.accel_bias_mps2.into())
    };
    let own = full.fixed_view::<D, D>(0, 0).into_owned();
    Ok(Belief::from_left_covariance(
        G::from_parts(pose, gyro_bias, accel_bias),
        Covariance::from_upper(own),
    ))
}

/// The covariance that the configuration gives a start at `pose`.
fn configured(initial: &InitialSettings, pose: &SE23) -> Covariance<15> {
    let sigma = match initial.position {
        PositionSource::Given { sigma, .. } => sigma,
        PositionSource::FirstFix => UNSTATED_POSITION_SIGMA,
    };
    let here = FirstPosition {
        stamp_ns: 0,
        position_w: pose.position,
        covariance_w: Matrix3::identity() * (sigma * sigma),
        lever_arm_b: Vector3::zeros(),
    };
    let belief: Belief<NavState, Left, 15> = initial.alignment(pose.rotation, &here).belief();
    belief.covariance
}

/// The covariance of `state`, positive semidefinite to rounding.
fn covariance<const N: usize>(state: &StateVector) -> Result<Covariance<N>, &'static str> {
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
fn is_positive_semidefinite<const N: usize>(p: &SMatrix<f64, N, N>) -> bool {
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
