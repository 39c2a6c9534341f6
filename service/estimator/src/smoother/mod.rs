//! Smoothing: the most likely trajectory given all measurements, \[IS\] (12).
//!
//! [`chain`] says what is known: a prior, motions, observations. [`batch`] finds the trajectory by Gauss-Newton, with
//! any parametrisation of [`filter::side`](crate::filter::side); [`mod@linearise`] makes each of its steps a linear
//! problem, [`solver`] solves that in linear time, exactly where noise vanishes and where the prior is singular.
//! [`mod@deviation`] measures residuals under such covariances. [`window`] smooths the newest states only, for use beside
//! a running filter; [`mod@preintegration`] makes one motion of many IMU samples.

pub mod batch;
pub mod chain;
pub mod deviation;
pub mod linearise;
pub mod preintegration;
pub mod solver;
pub mod window;

pub use batch::{Batch, BatchOptions, Cost, Smoothed, Step};
pub use chain::{Chain, Link, Motion, Sighting};
pub use deviation::{Deviation, deviation};
pub use linearise::Jacobians;
pub use preintegration::Preintegration;
pub use solver::{Gaussian, LinearMeasurement, LinearMotion, SmootherError, Solver};
pub use window::{Fix, PriorForm, Window, WindowCorrection, WindowError, WindowOptions};
