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
