//! Beliefs on Lie groups, and what happens to them.
//!
//! [`Belief`] is a concentrated Gaussian in the left- or right-invariant error ([`side`]), in the
//! additive one of the EKF ([`additive`]), or in those of the usual smoothers ([`componentwise`]);
//! [`mod@propagate`] moves it with the IMU or with odometry, [`mod@update`] corrects it with an observation: one
//! core for every sensor, group, side and filter. What tells the filters apart is the side and the rule of the
//! gain ([`gain`]): Kalman's, the linearly constrained one ([`constrained`], on the algebra of [`constraint`]),
//! H-infinity ([`hinf`]), Schmidt's.
//! [`late`] gives today's belief a correction of the past without going back.
//! [`adaptive`] runs several filters at once where the behaviour of a mismatch is itself unknown,
//! [`gate`] judges innovations, [`alignment`] makes the first belief.
//!
//! | filter | state | side | rule |
//! |---|---|---|---|
//! | InEKF | G | [`Left`], [`Right`] | [`Kalman`] |
//! | EKF | G | [`Additive`] | [`Kalman`] |
//! | LC-InEKF, LC-EKF | G | [`Left`], [`Right`]; [`Additive`] | [`Constrained`], [`hard`](crate::model::Declared::hard) |
//! | soft constraints | G | any | [`Constrained`], [`soft`](crate::model::Declared::soft) |
//! | invariant extended H-infinity | G | [`Left`] | [`HInfinity`] |
//! | considered mismatches (Schmidt) | [`Augmented`](crate::model::Augmented) | any | [`Consider`] |
//! | learned mismatches | [`Augmented`](crate::model::Augmented) | any | [`Kalman`] |
//! | mismatches of unknown behaviour | [`Augmented`](crate::model::Augmented), several | [`Left`] | [`Adaptive`] over [`Kalman`] |
//!
//! What a constraint protects from is declared: wrong odometry
//! ([`ProcessMismatch`](crate::model::ProcessMismatch)), a wrong IMU
//! ([`InertialMismatch`](crate::model::InertialMismatch)) or a wrong source
//! ([`OutputMismatch`](crate::model::OutputMismatch)).
//! Iterated and with transport, or plain, is a matter of [`UpdateOptions`] for all of them.
//!
//! A filter in a few lines: level at rest, half a second of an IMU, a fix.
//!
//! ```
//! use inekf::filter::{
//!     Alignment, Belief, BiasPrior, Gate, Left, Levelled, UpdateOptions, Verdict, propagate, update,
//! };
//! use inekf::model::{Discretisation, ImuInput, ImuNoise, NavState, PositionObservation};
//! use nalgebra::{Matrix3, Vector3};
//!
//! let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
//! let level = Levelled::from_force(&at_rest.force_b, 0.0).expect("there is weight");
//! let start = Alignment {
//!     r_wb: level.r_wb,
//!     tilt_sigma: 0.02,
//!     heading_sigma: 0.1,
//!     velocity_w: Vector3::zeros(),
//!     velocity_sigma: 0.1,
//!     position_w: Vector3::zeros(),
//!     position_covariance_w: Matrix3::identity(),
//!     lever_arm_b: Vector3::zeros(),
//!     biases: BiasPrior {
//!         gyro_bias: Vector3::zeros(),
//!         gyro_sigma: 1e-3,
//!         accel_bias: Vector3::zeros(),
//!         accel_sigma: 1e-2,
//!     },
//! };
//! let mut belief: Belief<NavState, Left, 15> = start.belief();
//!
//! let noise = ImuNoise { gyro_psd: 1e-7, accel_psd: 4e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
//! let g_w = Vector3::new(0.0, 0.0, -9.80665);
//! for _ in 0..100 {
//!     let zoh = Discretisation::ZeroOrderHold;
//!     belief = propagate(&belief, &at_rest, &g_w, 0.005, zoh, &noise);
//! }
//! let fix = PositionObservation {
//!     position_w: Vector3::new(0.5, 0.0, 0.0),
//!     covariance_w: Matrix3::identity() * 0.01,
//!     lever_arm_b: Vector3::zeros(),
//! };
//! let options = UpdateOptions { gate: Gate::of_probability(0.999), ..UpdateOptions::ITERATED };
//! let correction = update(&mut belief, &fix, &options)?;
//! assert_eq!(correction.verdict, Verdict::Accepted);
//! // The fix is ten times as good as what was known.
//! assert!((belief.mean.pose.position.x - 0.5).abs() < 0.01);
//! assert!(belief.is_plausible());
//! # Ok::<(), inekf::filter::UpdateError>(())
//! ```

pub mod adaptive;
pub mod additive;
pub mod alignment;
pub mod belief;
pub mod componentwise;
pub mod constrained;
pub mod constraint;
pub mod covariance;
pub mod definite;
pub mod factor;
pub mod gain;
pub mod gate;
pub mod hinf;
pub mod late;
pub mod linearised;
pub mod propagate;
mod seen;
pub mod side;
pub mod update;

pub use adaptive::{Adaptive, Expected, Mode, STANDARD_MODES, Switching, Weighed, standard_modes};
pub use additive::Additive;
pub use alignment::{Alignment, BiasPrior, Levelled};
pub use belief::Belief;
pub use componentwise::{Forster, Gtsam};
pub use constrained::Constrained;
pub use constraint::Constraints;
pub use covariance::Covariance;
pub use factor::Factor;
pub use gain::{Consider, GainRule, Judgement, Kalman};
pub use gate::Gate;
pub use hinf::{HInfinity, HInfinityGain};
pub use late::{LEAST_SHARE, LateCorrection, LateSide};
pub use linearised::Linearised;
pub(crate) use linearised::is_mild;
pub use propagate::{
    propagate, propagate_augmented, propagate_dense, propagate_in_place, propagate_odometry,
};
pub(crate) use seen::Seen;
pub use side::{InertialSide, Left, Right, Side};
pub use update::{Correction, Transport, UpdateError, UpdateOptions, Verdict, update, update_with};
