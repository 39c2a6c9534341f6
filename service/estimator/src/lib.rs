//! Invariant Kalman filtering for navigation, as a plain library.
//!
//! No inter-process communication, no clock, no files, and every function is deterministic. Nothing
//! allocates, states and covariances live on the stack; but a smoother owns the buffers of its trajectory.
//!
//! - [`lie`]: the matrix Lie groups, one file each, behind one interface;
//! - [`model`]: group-affine dynamics driven by an IMU or by odometry, what the sensors observe, and how both
//!   may be wrong;
//! - [`filter`]: beliefs on groups, propagation, the one update core of every filter, gating, initialisation;
//! - [`smoother`]: whole trajectories by Gauss-Newton, exact where noise vanishes.
//!
//! # In short
//!
//! ```
//! use inekf::filter::{Belief, Covariance, Left, UpdateOptions, propagate, update};
//! use inekf::lie::{LieGroup, SE23};
//! use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
//! use nalgebra::{Matrix3, SVector, Vector3};
//!
//! let p = Covariance::from_variances(&SVector::repeat(0.1));
//! let mut belief = Belief::<SE23, Left, 9>::new(SE23::identity(), p);
//! // A sample of the IMU: at rest it feels what holds it up.
//! let sample = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
//! let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
//! let g_w = Vector3::new(0.0, 0.0, -9.80665);
//! belief = propagate(&belief, &sample, &g_w, 0.005, Discretisation::ZeroOrderHold, &noise);
//! // A fix of the antenna, 1.5 m above it.
//! let fix = PositionObservation {
//!     position_w: Vector3::new(0.2, 0.0, 1.5),
//!     covariance_w: Matrix3::identity() * 0.01,
//!     lever_arm_b: Vector3::new(0.0, 0.0, 1.5),
//! };
//! let before = belief.covariance.matrix()[(6, 6)];
//! update(&mut belief, &fix, &UpdateOptions::ITERATED)?;
//! assert!(belief.mean.position.x > 0.0 && belief.covariance.matrix()[(6, 6)] < before);
//! # Ok::<(), inekf::filter::UpdateError>(())
//! ```
//!
//! # Conventions
//!
//! | what | convention |
//! |---|---|
//! | frames | world `w`: ENU, z up; body `b`: forward, left, up |
//! | attitude | `r_wb` takes body vectors to the world; quaternions are Hamilton, `x, y, z, w` |
//! | error | left-invariant, `chi = chi_hat * exp(xi)`, unless a type says [`filter::Right`] |
//! | order | rotation, velocity, position, gyro bias, accelerometer bias |
//! | units | SI, radians |
//!
//! # Sources
//!
//! Equations are cited as \[LC\] (Chauchat, Vilà-Valls, Chaumette, *Robust linearly constrained
//! invariant filtering*), \[IS\] (Chauchat, Bonnabel, Barrau, *Invariant smoothing with low process
//! noise*) and \[PAR\] (Chauchat, *Effet de la paramétrisation sur le filtrage de Kalman et le
//! lissage*).
#![forbid(unsafe_code)]

mod columns;
pub mod filter;
mod lanes;
pub mod lie;
pub mod model;
pub mod smoother;
