//! A state handed in by request for the model `imu`.

use inekf::filter::{Belief, Covariance, Left, Side};
use inekf::lie::SE23;
use inekf::model::{InertialState, NavState};
use inekf_shared::message::{MODEL_IMU, StateVector, model_name};
use nalgebra::{SMatrix, Vector3};

use super::super::set_state::{checked_attitude, covariance};
use super::super::settings::InitialSettings;

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
    if state.parameter_count != 0 {
        return Err("the state has parameters of mismatches, and the model imu has none");
    }
    let rotation = checked_attitude(state)?;
    let pose = SE23 {
        rotation,
        velocity: state.v_w_mps.into(),
        position: state.p_w_m.into(),
    };
    let full = match state.dimension {
        0 => {
            let alignment = initial.alignment_at(pose.rotation, pose.position);
            *alignment.belief::<NavState, Left, 15>().covariance.matrix()
        }
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
