//! Smoothing: the most likely trajectory given all measurements, \[IS\] (12).
//!
//! [`chain`] says what is known: a prior, motions, observations. [`batch`] finds the trajectory by Gauss-Newton, with
//! any parametrisation of [`filter::side`](crate::filter::side), and [`cost`] says what it costs; [`mod@linearise`] makes each of its steps a linear
//! problem, [`solver`] solves that in linear time, exactly where noise vanishes and where the prior is singular.
//! [`mod@deviation`] measures residuals under such covariances. [`window`] smooths the newest states only, for use beside
//! a running filter; [`mod@preintegration`] makes one motion of many IMU samples.
//!
//! ```
//! use inekf::filter::{Belief, Covariance, Left};
//! use inekf::lie::{LieGroup, SE2};
//! use inekf::model::{OdometryStep, PlanarFix, PointFix};
//! use inekf::smoother::{Batch, BatchOptions, Chain};
//! use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
//!
//! // The heading at the start is known to half a radian. Ten metres on, the place tells what it was.
//! let p = Covariance::from_variances(&Vector3::new(0.25, 1e-4, 1e-4));
//! let mut chain = Chain::with_capacity(Belief::<SE2, Left, 3>::new(SE2::identity(), p), 2, 1);
//! chain.advance(OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0), Matrix3::identity() * 1e-4);
//! let truth = SE2::exp(&Vector3::new(0.4, 0.0, 0.0)) * SE2::exp(&Vector3::new(0.0, 10.0, 0.0));
//! chain.observe(PlanarFix::new([PointFix {
//!     position_w: truth.position,
//!     covariance_w: Matrix2::identity() * 1e-4,
//!     lever_arm_b: Vector2::zeros(),
//!     scale_error: 0.0,
//! }]));
//! let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
//! batch.dead_reckon(&chain);
//! batch.smooth(&chain, &BatchOptions::default())?;
//! assert!((batch.states()[0].rotation.angle_rad() - 0.4).abs() < 1e-3);
//! # Ok::<(), inekf::smoother::SmootherError>(())
//! ```

pub mod batch;
pub mod chain;
pub mod cost;
pub mod deviation;
pub mod linearise;
pub mod preintegration;
pub mod solver;
pub mod window;

pub use batch::{Batch, BatchOptions, Smoothed, Step};
pub use chain::{Chain, Link, Motion, Sighting};
pub use cost::Cost;
pub use deviation::{Deviation, deviation};
pub use linearise::Jacobians;
pub use preintegration::Preintegration;
pub use solver::{Gaussian, LinearMeasurement, LinearMotion, SmootherError, Solver};
pub use window::{Fix, PriorForm, Window, WindowCorrection, WindowError, WindowOptions};
