//! Health of the daemon, and the codes it speaks in.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;
use super::{Counters, MAX_SOURCES};

/// State: not initialised; [`Health::waiting_for`] says what is missing.
pub const STATE_WAITING: u32 = 1;
/// State: initialising from the accelerometer.
pub const STATE_ALIGNING: u32 = 2;
/// State: estimating.
pub const STATE_RUNNING: u32 = 3;
/// State: estimating, but no fix was accepted for long.
pub const STATE_DEGRADED: u32 = 4;
/// State: the IMU or odometry has fallen silent.
pub const STATE_STALE: u32 = 5;
/// State: paused on request.
pub const STATE_PAUSED: u32 = 6;

/// Name of a state; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{STATE_DEGRADED, state_name};
///
/// assert_eq!(state_name(STATE_DEGRADED), "degraded");
/// assert_eq!(state_name(0), "unknown");
/// ```
#[must_use]
pub const fn state_name(code: u32) -> &'static str {
    match code {
        STATE_WAITING => "waiting",
        STATE_ALIGNING => "aligning",
        STATE_RUNNING => "running",
        STATE_DEGRADED => "degraded",
        STATE_STALE => "stale",
        STATE_PAUSED => "paused",
        _ => "unknown",
    }
}

/// Waiting for nothing.
pub const WAITING_FOR_NOTHING: u32 = 0;
/// Waiting for the first IMU or odometry sample.
pub const WAITING_FOR_IMU: u32 = 1;
/// Waiting for the first position fix.
pub const WAITING_FOR_POSITION: u32 = 2;
/// Waiting until enough samples have been averaged to find level.
pub const WAITING_FOR_LEVEL: u32 = 3;
/// Waiting for a set-state request.
pub const WAITING_FOR_REQUEST: u32 = 4;

/// Name of what the daemon waits for; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{WAITING_FOR_POSITION, waiting_for_name};
///
/// assert_eq!(waiting_for_name(WAITING_FOR_POSITION), "position");
/// ```
#[must_use]
pub const fn waiting_for_name(code: u32) -> &'static str {
    match code {
        WAITING_FOR_NOTHING => "nothing",
        WAITING_FOR_IMU => "imu",
        WAITING_FOR_POSITION => "position",
        WAITING_FOR_LEVEL => "level",
        WAITING_FOR_REQUEST => "request",
        _ => "unknown",
    }
}

/// Slots for reasons of rejection. Codes are indices into them; the unused ones leave room for reasons to come.
pub const REASONS: usize = 16;

/// Rejected: a number is NaN or infinite.
pub const REASON_NOT_FINITE: u32 = 0;
/// Rejected: a number is outside its allowed range.
pub const REASON_OUT_OF_RANGE: u32 = 1;
/// Rejected: the stamp is not after the last one.
pub const REASON_STAMP_NOT_AFTER: u32 = 2;
/// Rejected: the gap since the last sample is longer than allowed.
pub const REASON_GAP: u32 = 3;
/// Rejected: the source is not configured.
pub const REASON_UNKNOWN_SOURCE: u32 = 4;
/// Rejected: the covariance is not symmetric positive definite.
pub const REASON_BAD_COVARIANCE: u32 = 5;
/// Rejected: a flag is set that is not defined.
pub const REASON_BAD_FLAGS: u32 = 6;
/// Rejected: the configured model does not use this input.
pub const REASON_WRONG_MODEL: u32 = 7;
/// Rejected: a buffer of the daemon was full.
pub const REASON_BUFFER_FULL: u32 = 8;
/// Rejected: the estimator failed on it.
pub const REASON_INTERNAL: u32 = 9;
/// Rejected: the dimension of a fix is none that is defined.
pub const REASON_BAD_DIMENSION: u32 = 10;
/// Rejected: it came before the state was initialised, or while paused.
pub const REASON_NOT_READY: u32 = 11;

/// Name of a reason for rejection; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{REASONS, reason_name};
///
/// // As many have a name as there are reasons; the other slots are for those to come.
/// let named = (0..REASONS as u32).filter(|code| reason_name(*code) != "unknown");
/// assert_eq!(named.count(), 12);
/// ```
#[must_use]
pub const fn reason_name(code: u32) -> &'static str {
    match code {
        REASON_NOT_FINITE => "not finite",
        REASON_OUT_OF_RANGE => "out of range",
        REASON_STAMP_NOT_AFTER => "stamp not after the last",
        REASON_GAP => "gap too long",
        REASON_UNKNOWN_SOURCE => "unknown source",
        REASON_BAD_COVARIANCE => "bad covariance",
        REASON_BAD_FLAGS => "bad flags",
        REASON_WRONG_MODEL => "not an input of this model",
        REASON_BUFFER_FULL => "buffer full",
        REASON_INTERNAL => "internal",
        REASON_BAD_DIMENSION => "bad dimension",
        REASON_NOT_READY => "not ready",
        _ => "unknown",
    }
}

/// Number of input topics: the length of [`Health::received`].
pub const INPUTS: usize = 6;

/// Index of the IMU topic in [`Health::received`].
pub const INPUT_IMU: usize = 0;
/// Index of the planar odometry topic in [`Health::received`].
pub const INPUT_ODOMETRY_2D: usize = 1;
/// Index of the spatial odometry topic in [`Health::received`].
pub const INPUT_ODOMETRY_3D: usize = 2;
/// Index of the position topic in [`Health::received`].
pub const INPUT_POSITION: usize = 3;
/// Index of the velocity topic in [`Health::received`].
pub const INPUT_VELOCITY: usize = 4;
/// Index of the heading topic in [`Health::received`].
pub const INPUT_HEADING: usize = 5;

/// Name of the input topic at an index of [`Health::received`]; `"unknown"` beyond them.
///
/// ```
/// use inekf_shared::message::{INPUT_VELOCITY, INPUTS, input_name};
///
/// assert_eq!(input_name(INPUT_VELOCITY), "velocity");
/// assert_eq!(input_name(INPUTS), "unknown");
/// ```
#[must_use]
pub const fn input_name(index: usize) -> &'static str {
    match index {
        INPUT_IMU => "imu",
        INPUT_ODOMETRY_2D => "odometry2d",
        INPUT_ODOMETRY_3D => "odometry3d",
        INPUT_POSITION => "position",
        INPUT_VELOCITY => "velocity",
        INPUT_HEADING => "heading",
        _ => "unknown",
    }
}

/// Sources of fixes that [`Health`] tells apart: [`MAX_SOURCES`] of each of position, velocity and heading, in this
/// order. The place of one is [`source_index`].
pub const SOURCES: usize = 3 * MAX_SOURCES;

/// Place of a source of the topic with the `INPUT_*` index `input` in [`Health::fused_stamp_ns`] and
/// [`Health::delivered_ns`]: `8 (input - INPUT_POSITION) + source`; `None` if there is no such source.
///
/// ```
/// use inekf_shared::message::{INPUT_HEADING, INPUT_IMU, INPUT_POSITION, MAX_SOURCES, SOURCES, source_index};
///
/// assert_eq!(source_index(INPUT_POSITION, 2), Some(2));
/// // The last place of all.
/// assert_eq!(source_index(INPUT_HEADING, MAX_SOURCES as u32 - 1), Some(SOURCES - 1));
/// // An IMU has no sources.
/// assert_eq!(source_index(INPUT_IMU, 0), None);
/// ```
#[must_use]
pub const fn source_index(input: usize, source: u32) -> Option<usize> {
    if input < INPUT_POSITION || input >= INPUTS || source as usize >= MAX_SOURCES {
        return None;
    }
    Some((input - INPUT_POSITION) * MAX_SOURCES + source as usize)
}

/// Flag: the estimate began with the state of a checkpoint.
pub const HEALTH_RESUMED: u32 = 1;
/// Flag: there was a checkpoint, and it could not be used; the log says why.
pub const HEALTH_NOT_RESUMED: u32 = 2;
/// Every flag that is defined.
pub const HEALTH_FLAGS: u32 = HEALTH_RESUMED | HEALTH_NOT_RESUMED;

/// How the daemon is, about once a second.
///
/// ```
/// use inekf_shared::message::{Health, INPUT_POSITION, Zero, source_index};
///
/// let gnss = source_index(INPUT_POSITION, 0).expect("there is such a source");
/// let mut health = Health { stamp_ns: 9_000, last_imu_stamp_ns: 700, ..Health::ZERO };
/// health.delivered_ns[gnss] = 8_000;
/// // It was heard 1 us ago by the host's clock, and nothing of it has been fused.
/// assert_eq!(health.delivery_age_ns(health.delivered_ns[gnss]), Some(1_000));
/// assert_eq!(health.fix_age_ns(health.fused_stamp_ns[gnss]), None);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.Health.v4")]
pub struct Health {
    /// When it was written, CLOCK_MONOTONIC, nanoseconds.
    pub stamp_ns: u64,
    /// Since the daemon's start, nanoseconds.
    pub uptime_ns: u64,
    /// Process id of the daemon.
    pub instance_pid: u64,
    /// `STATE_*` code.
    pub state: u32,
    /// `WAITING_FOR_*` code.
    pub waiting_for: u32,
    /// `MODEL_*` code.
    pub model: u32,
    /// `HEALTH_*` flags.
    pub flags: u32,
    /// Stamp of the last accepted IMU or odometry sample, nanoseconds of the sensor clock; 0 before the first.
    pub last_imu_stamp_ns: u64,
    /// Rate at which such samples arrive, Hz.
    pub imu_rate_hz: f64,
    /// What became of the inputs.
    pub counters: Counters,
    /// Rejected inputs, indexed by `REASON_*` code.
    pub rejected_by_reason: [u64; REASONS],
    /// Messages received, indexed by `INPUT_*`.
    pub received: [u64; INPUTS],
    /// Checkpoints written since the daemon's start.
    pub checkpoints: u64,
    /// Checkpoints that could not be written.
    pub checkpoint_failures: u64,
    /// Entries that are missing from the journal because they could not be published.
    pub journal_failures: u64,
    /// Stamp of the newest fix, of any source, that was fused since the state was last set, nanoseconds of the sensor
    /// clock; 0 if none was. Its age, in sensor time, is [`Health::fix_age_ns`].
    pub last_fix_stamp_ns: u64,
    /// When the daemon last took a message of any of its inputs, CLOCK_MONOTONIC, nanoseconds; 0 before the first. How
    /// long ago that is does not depend on any stamp of a sensor: [`Health::delivery_age_ns`].
    pub last_delivery_ns: u64,
    /// Stamp of the newest fix of each source that was fused since the state was last set, nanoseconds of the sensor
    /// clock, 0 if none was; indexed by [`source_index`].
    pub fused_stamp_ns: [u64; SOURCES],
    /// When the daemon last took a message of each source, whatever became of it, CLOCK_MONOTONIC, nanoseconds, 0 before
    /// the first; indexed by [`source_index`]. A fix ahead of the samples is taken once they have caught up.
    pub delivered_ns: [u64; SOURCES],
    /// How often, in event mode, a sample was found at the end of a bounded wait that nobody had ended: its wake-up was
    /// lost, or its sender does not send any.
    pub stalls: u64,
    /// The longest that such a sample had been on its way, from its sending, nanoseconds.
    pub longest_stall_ns: u64,
}

impl Health {
    /// Sensor time from a stamp of this message to the last accepted sample, nanoseconds: the age of an observation.
    /// `None` for a stamp of 0: there was none.
    ///
    /// ```
    /// use inekf_shared::message::{Health, Zero};
    ///
    /// let health = Health { last_imu_stamp_ns: 5_000, ..Health::ZERO };
    /// assert_eq!(health.fix_age_ns(4_000), Some(1_000));
    /// // A fix ahead of the samples is not old at all; none is none.
    /// assert_eq!((health.fix_age_ns(6_000), health.fix_age_ns(0)), (Some(0), None));
    /// ```
    #[must_use]
    pub const fn fix_age_ns(&self, stamp_ns: u64) -> Option<u64> {
        if stamp_ns == 0 {
            return None;
        }
        Some(self.last_imu_stamp_ns.saturating_sub(stamp_ns))
    }

    /// Time from a delivery to this message, nanoseconds of CLOCK_MONOTONIC. `None` for 0: there was none.
    ///
    /// ```
    /// use inekf_shared::message::{Health, Zero};
    ///
    /// let health = Health { stamp_ns: 5_000, last_delivery_ns: 3_500, ..Health::ZERO };
    /// assert_eq!(health.delivery_age_ns(health.last_delivery_ns), Some(1_500));
    /// assert_eq!(health.delivery_age_ns(0), None);
    /// ```
    #[must_use]
    pub const fn delivery_age_ns(&self, delivered_ns: u64) -> Option<u64> {
        if delivered_ns == 0 {
            return None;
        }
        Some(self.stamp_ns.saturating_sub(delivered_ns))
    }
}

layout! {
    Health as "inekf.Health.v4", size 720, align 8 {
        stamp_ns: 0, uptime_ns: 8, instance_pid: 16, state: 24, waiting_for: 28, model: 32,
        flags: 36, last_imu_stamp_ns: 40, imu_rate_hz: 48, counters: 56, rejected_by_reason: 104,
        received: 232, checkpoints: 280, checkpoint_failures: 288, journal_failures: 296,
        last_fix_stamp_ns: 304, last_delivery_ns: 312, fused_stamp_ns: 320, delivered_ns: 512,
        stalls: 704, longest_stall_ns: 712,
    }
}
