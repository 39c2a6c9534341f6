//! What moves the state and what observes it.
//!
//! [`group_affine`] is the abstract step of \[IS\] (6), [`drift`] its world's share over any time; [`imu`] makes one from an IMU sample, [`odometry`] one from
//! an increment; [`inertial`] is the interface of states that an IMU drives, with [`nav_state`] the one that
//! carries biases, and [`pose`] that of all states that have a place in the plane or in space; [`observation`]
//! holds the sensors. [`mismatch`] and [`inertial_mismatch`] say how the models may be wrong, as the columns of
//! \[LC\], [`process`] sums those of the motion; [`augmented`] and [`unknowns`] carry the same mismatches of
//! odometry as states.
//!
//! ```
//! use inekf::lie::{LieGroup, SE23};
//! use inekf::model::{Discretisation, ImuInput, ImuStep, Observation, PositionObservation};
//! use nalgebra::{Matrix3, Vector3};
//!
//! // What moves the state: two seconds of 1 m/s^2 ahead, from rest.
//! let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(1.0, 0.0, 9.80665) };
//! let g_w = Vector3::new(0.0, 0.0, -9.80665);
//! let chi = ImuStep::new(&push, &g_w, 2.0, Discretisation::ZeroOrderHold).apply(&SE23::identity());
//! // And what observes it, half a metre farther than that.
//! let fix = PositionObservation {
//!     position_w: Vector3::new(2.5, 0.0, 0.0),
//!     covariance_w: Matrix3::identity(),
//!     lever_arm_b: Vector3::zeros(),
//! };
//! assert!((fix.residual(&chi) - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-12);
//! ```

pub mod augmented;
pub mod drift;
pub mod group_affine;
pub mod imu;
pub mod increment;
pub mod inertial;
pub mod inertial_mismatch;
mod lines;
pub mod mismatch;
pub mod nav_state;
pub mod observation;
pub mod odometry;
pub mod pose;
pub mod process;
pub mod transition;
pub mod unknowns;

pub use augmented::Augmented;
pub use drift::{Drift, Unmoved};
pub use group_affine::{Automorphism, FreeMotion, GroupAffineStep};
pub use imu::{Discretisation, ImuInput, ImuNoise, ImuStep};
pub use increment::ImuIncrement;
pub use inertial::InertialState;
pub use inertial_mismatch::{InertialMismatch, InertialScale};
pub(crate) use lines::Lines;
pub use mismatch::{Columns, Declared, OutputMismatch, ProcessMismatch};
pub use nav_state::NavState;
pub use observation::points::{PlanarFix, PlanarPair, PointFix, Points, SpatialFix, SpatialPair};
pub use observation::{HeadingObservation, Observation, PositionObservation, VelocityObservation};
pub use odometry::OdometryStep;
pub use pose::{Pose, RigidPose};
pub use process::{MeanMismatch, Motion, Part, PathNoise, ProcessColumns};
pub use transition::Transition;
pub use unknowns::{AugmentedPoints, AugmentedStep, Unknowns};
