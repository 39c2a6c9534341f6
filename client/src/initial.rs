//! The set-state request that a dataset's initial state makes, by model.
//!
//! The stamp is the file's. A daemon takes the stamp 0, before its first sample, as "from the start of the data": the
//! first IMU sample, or the beginning of the first odometry row's interval.

use inekf_shared::message::{StateVector, Zero, triangle_index};

use crate::dataset::{Initial, Meta};
use crate::model::Model;

/// An initial state that is not one of the daemon's model. `Display` is one line.
///
/// ```
/// use inekf_client::dataset::{Initial, Meta};
/// use inekf_client::initial::{InitialError, state_vector};
/// use inekf_client::model::Model;
///
/// let initial = Initial::Planar { stamp_ns: 0, theta_rad: 0.0, p_w_m: [0.0; 2] };
/// let meta = Meta { initial: Some(initial), p0_diag: Some(vec![1.0; 6]), ..Meta::default() };
/// // A pose in the plane has three variances, and does not start a flight.
/// assert!(matches!(
///     state_vector(&meta, Model::Odometry2d),
///     Err(InitialError::Dimension { found: 6, .. })
/// ));
/// assert!(matches!(state_vector(&meta, Model::Imu), Err(InitialError::Kind { .. })));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InitialError {
    /// It is of the plane and the model of space, or the other way round.
    #[error(
        "meta.json: initial is {found}, but the daemon's model {model} starts from {wanted}: \
         use a configuration of another model, or take initial out"
    )]
    Kind {
        /// The daemon's model.
        model: Model,
        /// What the file has.
        found: &'static str,
        /// What the model needs.
        wanted: &'static str,
    },
    /// The variances are not as many as the model has.
    #[error(
        "meta.json: P0_diag has {found} entries, but the daemon's model {model} takes {wanted}; \
         without P0_diag the configured covariance is used"
    )]
    Dimension {
        /// The daemon's model.
        model: Model,
        /// How many there are.
        found: usize,
        /// How many there may be, in words.
        wanted: &'static str,
    },
}

/// The set-state request for the initial state of a dataset; `None` if it names none. Without `P0_diag` its dimension
/// is 0, and the daemon takes the covariance of its configuration.
///
/// ```
/// use inekf_client::dataset::Meta;
/// use inekf_client::initial::state_vector;
/// use inekf_client::model::Model;
///
/// // Without an initial state in meta.json the daemon starts as its configuration says.
/// assert!(state_vector(&Meta::default(), Model::Imu)?.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`InitialError`] if state or variances are not those of `model`.
pub fn state_vector(meta: &Meta, model: Model) -> Result<Option<StateVector>, InitialError> {
    let Some(initial) = &meta.initial else {
        return Ok(None);
    };
    let mut state = mean(initial, model)?;
    let variances = meta.p0_diag.as_deref().unwrap_or_default();
    let (sizes, wanted): (&[usize], _) = match model {
        Model::Imu => (
            &[9, 15],
            "9 (rotation, velocity, position) or 15 (and biases)",
        ),
        Model::Odometry3d => (&[6], "6 (rotation, position)"),
        Model::Odometry2d => (&[3], "3 (theta, x, y)"),
    };
    let dimension = variances.len();
    let wrong = InitialError::Dimension {
        model,
        found: dimension,
        wanted,
    };
    if dimension > 0 && !sizes.contains(&dimension) {
        return Err(wrong);
    }
    state.dimension = u32::try_from(dimension).unwrap_or(u32::MAX);
    for (i, variance) in variances.iter().enumerate() {
        let slot = triangle_index(i, i, dimension)
            .and_then(|index| state.covariance.get_mut(index))
            .ok_or_else(|| wrong.clone())?;
        *slot = *variance;
    }
    Ok(Some(state))
}

/// The mean alone.
fn mean(initial: &Initial, model: Model) -> Result<StateVector, InitialError> {
    let zero = StateVector {
        model: model.code(),
        ..StateVector::ZERO
    };
    match (initial, model) {
        (
            Initial::Planar {
                stamp_ns,
                theta_rad,
                p_w_m: [x, y],
            },
            Model::Odometry2d,
        ) => {
            let (sin, cos) = (0.5 * theta_rad).sin_cos();
            Ok(StateVector {
                stamp_ns: *stamp_ns,
                q_wb: [0.0, 0.0, sin, cos],
                p_w_m: [*x, *y, 0.0],
                ..zero
            })
        }
        (
            Initial::Spatial {
                stamp_ns,
                q_wb,
                v_w_mps,
                p_w_m,
                gyro_bias_rps,
                accel_bias_mps2,
            },
            Model::Imu,
        ) => Ok(StateVector {
            stamp_ns: *stamp_ns,
            q_wb: *q_wb,
            v_w_mps: *v_w_mps,
            p_w_m: *p_w_m,
            gyro_bias_rps: *gyro_bias_rps,
            accel_bias_mps2: *accel_bias_mps2,
            ..zero
        }),
        // A pose has neither velocity nor biases.
        (
            Initial::Spatial {
                stamp_ns,
                q_wb,
                p_w_m,
                ..
            },
            Model::Odometry3d,
        ) => Ok(StateVector {
            stamp_ns: *stamp_ns,
            q_wb: *q_wb,
            p_w_m: *p_w_m,
            ..zero
        }),
        (Initial::Planar { .. }, Model::Imu | Model::Odometry3d) => Err(InitialError::Kind {
            model,
            found: "planar (theta, x, y)",
            wanted: "a spatial state (qw, qx, qy, qz, x, y, z)",
        }),
        (Initial::Spatial { .. }, Model::Odometry2d) => Err(InitialError::Kind {
            model,
            found: "spatial (qw, qx, qy, qz, x, y, z)",
            wanted: "a planar state (theta, x, y)",
        }),
    }
}
