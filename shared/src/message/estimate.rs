//! Estimates, one payload per model, and what they have in common.
//!
//! The covariance is always that of the left-invariant error, `chi = chi_hat * exp(xi)` with `xi` in body
//! coordinates, as upper triangle row by row ([`super::triangle_index`]). Order of `xi`: rotation, velocity,
//! position, gyro bias, accelerometer bias (SE_2(3)); rotation, position (SE(3)); theta, x, y (SE(2)). Units are
//! products of rad, m/s, m, rad/s and m/s^2.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;
use super::{MAX_MISMATCHES, MAX_SOURCES, Message, NAV_TRI, SE2_TRI, SE3_TRI, Zero, serde_array};

/// Flag: a sample was propagated.
pub const ESTIMATE_PROPAGATED: u32 = 1;
/// Flag: a fix was fused; the estimate before it has the same stamp.
pub const ESTIMATE_UPDATED: u32 = 2;
/// Flag: the state was set anew and does not continue the one before.
pub const ESTIMATE_RESET: u32 = 4;
/// Flag: there has been no aiding for long, the error grows.
pub const ESTIMATE_DEGRADED: u32 = 8;
/// Flag: a late fix was fused by replaying the samples since.
pub const ESTIMATE_REPLAYED: u32 = 16;
/// Flag: the first estimate after a start from a checkpoint.
pub const ESTIMATE_RESUMED: u32 = 32;
/// Flag: the window of a smoother has seen all fixes so far, and this estimate comes from it; the estimate before it has
/// the same stamp.
pub const ESTIMATE_SMOOTHED: u32 = 64;
/// Every flag that is defined.
pub const ESTIMATE_FLAGS: u32 = ESTIMATE_PROPAGATED
    | ESTIMATE_UPDATED
    | ESTIMATE_RESET
    | ESTIMATE_DEGRADED
    | ESTIMATE_REPLAYED
    | ESTIMATE_RESUMED
    | ESTIMATE_SMOOTHED;

/// Model: an IMU drives SE_2(3) with biases ([`EstimateSe23`]).
pub const MODEL_IMU: u32 = 1;
/// Model: spatial odometry drives SE(3) ([`EstimateSe3`]).
pub const MODEL_ODOMETRY_3D: u32 = 2;
/// Model: planar odometry drives SE(2) ([`EstimateSe2`]).
pub const MODEL_ODOMETRY_2D: u32 = 3;

/// The `source` of an estimate that no fix was fused into.
pub const NO_SOURCE: u32 = u32::MAX;
/// The source of a fix that the daemon has made itself: it found that the vehicle stands (`[zero_velocity]`).
pub const ZERO_VELOCITY_SOURCE: u32 = u32::MAX - 1;

/// The `mode` of an estimate that has none.
pub const NO_MODE: u32 = u32::MAX;

/// Name of one estimate flag; `"unknown"` for anything else, a combination of flags included.
///
/// ```
/// use inekf_shared::message::{ESTIMATE_FLAGS, ESTIMATE_UPDATED, estimate_flag_name};
///
/// assert_eq!(estimate_flag_name(ESTIMATE_UPDATED), "updated");
/// // All that are set in some flags, one by one.
/// let names = (0..32).map(|bit| 1 << bit).filter(|flag| ESTIMATE_FLAGS & flag != 0).map(estimate_flag_name);
/// assert!(names.into_iter().all(|name| name != "unknown"));
/// ```
#[must_use]
pub const fn estimate_flag_name(flag: u32) -> &'static str {
    match flag {
        ESTIMATE_PROPAGATED => "propagated",
        ESTIMATE_UPDATED => "updated",
        ESTIMATE_RESET => "reset",
        ESTIMATE_DEGRADED => "degraded",
        ESTIMATE_REPLAYED => "replayed",
        ESTIMATE_RESUMED => "resumed",
        ESTIMATE_SMOOTHED => "smoothed",
        _ => "unknown",
    }
}

/// Name of a model as a configuration file spells it; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{MODEL_ODOMETRY_2D, model_name};
///
/// assert_eq!(model_name(MODEL_ODOMETRY_2D), "odometry2d");
/// ```
#[must_use]
pub const fn model_name(code: u32) -> &'static str {
    match code {
        MODEL_IMU => "imu",
        MODEL_ODOMETRY_3D => "odometry3d",
        MODEL_ODOMETRY_2D => "odometry2d",
        _ => "unknown",
    }
}

/// What became of the inputs since the daemon's start.
///
/// ```
/// use inekf_shared::message::{Counters, Zero};
///
/// // Every fix that came is counted once, as one of these; what never came is `lost`.
/// let counters = Counters { accepted: 95, gated: 3, late: 2, ..Counters::ZERO };
/// assert_eq!(counters.accepted + counters.gated + counters.late + counters.rejected, 100);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.Counters.v2")]
pub struct Counters {
    /// Fixes that were fused.
    pub accepted: u64,
    /// Fixes that the chi-square gate refused.
    pub gated: u64,
    /// Fixes that came too late to be fused.
    pub late: u64,
    /// Inputs that never arrived, counted from gaps in `seq`.
    pub lost: u64,
    /// Inputs that were refused by a check; by reason in [`super::Health`].
    pub rejected: u64,
    /// Position fixes of a stack whose partner did not come in time.
    pub unpaired: u64,
}

layout! {
    Counters as "inekf.Counters.v2", size 48, align 8 {
        accepted: 0, gated: 8, late: 16, lost: 24, rejected: 32, unpaired: 40,
    }
}

/// What every estimate starts with.
///
/// ```
/// use inekf_shared::message::{ESTIMATE_PROPAGATED, ESTIMATE_RESET, EstimateHead, NO_SOURCE};
///
/// let head = EstimateHead {
///     sent_ns: 1_000,
///     received_ns: 1_400,
///     published_ns: 2_100,
///     flags: ESTIMATE_PROPAGATED,
///     ..EstimateHead::UNSTARTED
/// };
/// // From the sensor's send to the estimate's publication, one clock for all processes of a host.
/// assert_eq!(head.published_ns - head.sent_ns, 1_100);
/// assert!(head.flags & ESTIMATE_RESET == 0 && head.source == NO_SOURCE && head.nis[0].is_nan());
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.EstimateHead.v2")]
pub struct EstimateHead {
    /// Time the state holds at, nanoseconds of the sensor clock.
    pub stamp_ns: u64,
    /// `seq` of the IMU or odometry sample that the estimate answers.
    pub seq: u64,
    /// `sent_ns` of that sample, CLOCK_MONOTONIC.
    pub sent_ns: u64,
    /// When the daemon took that sample, CLOCK_MONOTONIC, nanoseconds.
    pub received_ns: u64,
    /// When the daemon published the estimate, CLOCK_MONOTONIC, nanoseconds.
    pub published_ns: u64,
    /// Counts the published estimates, by one.
    pub estimate_seq: u64,
    /// How often the state was set anew since the daemon's start.
    pub reset_count: u64,
    /// How far the position jumped at the last reset, m.
    pub reset_jump_m: f64,
    /// `ESTIMATE_*` flags.
    pub flags: u32,
    /// `STATE_*` code of the daemon.
    pub state: u32,
    /// Source of the fix that was fused, [`NO_SOURCE`] if none was, [`ZERO_VELOCITY_SOURCE`] if it is the daemon's own.
    pub source: u32,
    /// Dimension of the covariance: 15 or 9 (SE_2(3)), 6 (SE(3)), 3 (SE(2)).
    pub dimension: u32,
    /// Bit i: the last update of this estimate allowed for mismatch i (a constraint of the gain, or parameters beside
    /// the pose): those of the odometry first, then those of the sources, each in the order of the configuration.
    /// Zero where none is declared.
    pub active_mismatches: u32,
    /// With adaptive mismatches, the likeliest mode (`inekf::filter::standard_modes`); else [`NO_MODE`].
    pub mode: u32,
    /// What became of the inputs.
    pub counters: Counters,
    /// Last normalised innovation squared of each position source; NaN before its first fix.
    pub nis: [f64; MAX_SOURCES],
}

layout! {
    EstimateHead as "inekf.EstimateHead.v2", size 200, align 8 {
        stamp_ns: 0, seq: 8, sent_ns: 16, received_ns: 24, published_ns: 32, estimate_seq: 40,
        reset_count: 48, reset_jump_m: 56, flags: 64, state: 68, source: 72, dimension: 76,
        active_mismatches: 80, mode: 84, counters: 88, nis: 136,
    }
}

impl EstimateHead {
    /// The head before anything has happened: zero, but no source, no mode and every NIS NaN.
    pub const UNSTARTED: Self = Self {
        source: NO_SOURCE,
        mode: NO_MODE,
        nis: [f64::NAN; MAX_SOURCES],
        ..Self::ZERO
    };
}

/// Estimate of the IMU model: pose and velocity on SE_2(3), biases beside it.
///
/// ```
/// use inekf_shared::message::{EstimateSe23, NAV_DIM, Zero, triangle_index};
///
/// let mut estimate = EstimateSe23::ZERO;
/// // Rotation, velocity, position, gyro bias, accelerometer bias: the position begins at 6.
/// let along = triangle_index(6, 6, NAV_DIM).expect("in the triangle");
/// estimate.covariance[along] = 0.25;
/// // Half a metre along the body's x axis: the error is in body coordinates.
/// assert_eq!(estimate.covariance[along].sqrt(), 0.5);
/// assert_eq!(size_of::<EstimateSe23>(), 1288);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.EstimateSe23.v2")]
pub struct EstimateSe23 {
    /// Stamps, flags and counters.
    pub head: EstimateHead,
    /// Attitude, body to world, unit quaternion x, y, z, w.
    pub q_wb: [f64; 4],
    /// Velocity, world frame, m/s.
    pub v_w_mps: [f64; 3],
    /// Position of the IMU, world frame, m.
    pub p_w_m: [f64; 3],
    /// Gyroscope bias, body frame, rad/s.
    pub gyro_bias_rps: [f64; 3],
    /// Accelerometer bias, body frame, m/s^2.
    pub accel_bias_mps2: [f64; 3],
    /// Upper triangle of the covariance. With 9 states the triangle of the 9 x 9 fills the first 45 entries and the
    /// rest is zero.
    #[serde(with = "serde_array")]
    pub covariance: [f64; NAV_TRI],
}

layout! {
    EstimateSe23 as "inekf.EstimateSe23.v2", size 1288, align 8 {
        head: 0, q_wb: 200, v_w_mps: 232, p_w_m: 256, gyro_bias_rps: 280, accel_bias_mps2: 304,
        covariance: 328,
    }
}

/// Estimate of the spatial odometry model: a pose on SE(3).
///
/// ```
/// use inekf_shared::message::{EstimateSe3, SE3_TRI, Zero, triangle_index};
///
/// // Rotation, then position: the last entry is the variance along the body's z axis.
/// assert_eq!(triangle_index(5, 5, 6), Some(SE3_TRI - 1));
/// assert_eq!(EstimateSe3::ZERO.covariance.len(), SE3_TRI);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.EstimateSe3.v2")]
pub struct EstimateSe3 {
    /// Stamps, flags and counters.
    pub head: EstimateHead,
    /// Attitude, body to world, unit quaternion x, y, z, w.
    pub q_wb: [f64; 4],
    /// Position, world frame, m.
    pub p_w_m: [f64; 3],
    /// Upper triangle of the covariance: rotation, position.
    pub covariance: [f64; SE3_TRI],
    /// Estimated parameters of the declared mismatches, those of the odometry first, then those of the sources, each
    /// in its own unit; NaN where none is estimated.
    pub mismatch: [f64; MAX_MISMATCHES],
    /// Their standard deviations.
    pub mismatch_sigma: [f64; MAX_MISMATCHES],
}

layout! {
    EstimateSe3 as "inekf.EstimateSe3.v2", size 520, align 8 {
        head: 0, q_wb: 200, p_w_m: 232, covariance: 256, mismatch: 424, mismatch_sigma: 472,
    }
}

/// Estimate of the planar odometry model: a pose on SE(2).
///
/// ```
/// use inekf_shared::message::{EstimateSe2, Zero, triangle_index};
///
/// let mut estimate = EstimateSe2::ZERO;
/// // theta, x, y.
/// let heading = triangle_index(0, 0, 3).expect("in the triangle");
/// estimate.covariance[heading] = 0.04;
/// assert_eq!(estimate.covariance[0].sqrt(), 0.2);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.EstimateSe2.v2")]
pub struct EstimateSe2 {
    /// Stamps, flags and counters.
    pub head: EstimateHead,
    /// Heading, rad, counter-clockwise from east.
    pub theta_rad: f64,
    /// Position, world frame, m.
    pub p_w_m: [f64; 2],
    /// Upper triangle of the covariance: theta, x, y.
    pub covariance: [f64; SE2_TRI],
    /// Estimated parameters of the declared mismatches, those of the odometry first, then those of the sources, each
    /// in its own unit; NaN where none is estimated.
    pub mismatch: [f64; MAX_MISMATCHES],
    /// Their standard deviations.
    pub mismatch_sigma: [f64; MAX_MISMATCHES],
}

layout! {
    EstimateSe2 as "inekf.EstimateSe2.v2", size 368, align 8 {
        head: 0, theta_rad: 200, p_w_m: 208, covariance: 224, mismatch: 272, mismatch_sigma: 320,
    }
}

/// The payload of the `estimate` topic under one model.
///
/// ```
/// use inekf_shared::message::{EstimateMessage, EstimateSe2, EstimateSe23, MODEL_IMU, Zero};
///
/// /// Whatever the model.
/// fn is_new<E: EstimateMessage>(estimate: &E, last_seq: u64) -> bool {
///     estimate.head().estimate_seq > last_seq
/// }
///
/// let mut estimate = EstimateSe2::ZERO;
/// estimate.head_mut().estimate_seq = 5;
/// assert!(is_new(&estimate, 4) && !is_new(&estimate, 5));
/// assert_eq!(EstimateSe23::MODEL, MODEL_IMU);
/// ```
pub trait EstimateMessage: Message {
    /// The `MODEL_*` code whose estimate this is.
    const MODEL: u32;

    /// Stamps, flags and counters.
    ///
    /// ```
    /// use inekf_shared::message::{EstimateMessage, EstimateSe3, Zero};
    ///
    /// let estimate = EstimateSe3::ZERO;
    /// assert_eq!(estimate.head(), &estimate.head);
    /// ```
    fn head(&self) -> &EstimateHead;

    /// Stamps, flags and counters, to be written.
    ///
    /// ```
    /// use inekf_shared::message::{EstimateMessage, EstimateSe3, Zero};
    ///
    /// let mut estimate = EstimateSe3::ZERO;
    /// estimate.head_mut().stamp_ns = 7;
    /// assert_eq!(estimate.head.stamp_ns, 7);
    /// ```
    fn head_mut(&mut self) -> &mut EstimateHead;
}

macro_rules! estimate_of {
    ($name:ident, $model:expr) => {
        impl EstimateMessage for $name {
            const MODEL: u32 = $model;

            fn head(&self) -> &EstimateHead {
                &self.head
            }

            fn head_mut(&mut self) -> &mut EstimateHead {
                &mut self.head
            }
        }
    };
}

estimate_of!(EstimateSe23, MODEL_IMU);
estimate_of!(EstimateSe3, MODEL_ODOMETRY_3D);
estimate_of!(EstimateSe2, MODEL_ODOMETRY_2D);
