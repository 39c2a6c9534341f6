//! The fixed-layout messages that cross shared memory.
//!
//! Every message is `#[repr(C)]`, [`Copy`], free of implicit padding and made of `u8`, `u32`, `u64`, `f64` and
//! arrays of them only. There is no `bool`, `enum` or `Option`, so whatever bytes a faulty writer leaves are still a
//! value: the reader rejects it, it is never undefined behaviour.
//!
//! Units are SI with radians. The world frame `w` is east-north-up, the body frame `b` forward-left-up. Quaternions
//! are Hamilton, body to world, stored `x, y, z, w`. Stamps are `u64` nanoseconds.
//!
//! iceoryx2 compares type name, size and alignment when a process attaches, nothing else. So the type name carries
//! the version of the layout ([`Message::TYPE_NAME`]), and size, alignment and every offset are pinned as numbers
//! beside each struct: a field that moves stops the build, and whoever moves one raises the version.

mod layout;

pub mod control;
pub mod estimate;
pub mod header;
pub mod heading;
pub mod health;
pub mod imu;
pub mod journal;
pub mod noise;
pub mod odometry;
pub mod position;
mod serde_array;
pub mod smoothed;
pub mod velocity;

pub use control::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_REFUSED,
    CONTROL_RELOAD_NOISE, CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED,
    CONTROL_SNAPSHOT, CONTROL_TAKE, ControlRequest, ControlResponse, MAX_INPUT_LEN, MODES,
    PARAMETER_TRI, REASON_TEXT_LEN, StateVector, control_kind_name, control_status_name,
};
pub use estimate::{
    Counters, ESTIMATE_DEGRADED, ESTIMATE_FLAGS, ESTIMATE_PROPAGATED, ESTIMATE_REPLAYED,
    ESTIMATE_RESET, ESTIMATE_RESUMED, ESTIMATE_SMOOTHED, ESTIMATE_UPDATED, EstimateHead,
    EstimateMessage, EstimateSe2, EstimateSe3, EstimateSe23, MODEL_IMU, MODEL_ODOMETRY_2D,
    MODEL_ODOMETRY_3D, NO_MODE, NO_SOURCE, ZERO_VELOCITY_SOURCE, estimate_flag_name, model_name,
};
pub use header::Header;
pub use heading::HeadingFix;
pub use health::{
    HEALTH_FLAGS, HEALTH_NOT_RESUMED, HEALTH_RESUMED, Health, INPUT_HEADING, INPUT_IMU,
    INPUT_ODOMETRY_2D, INPUT_ODOMETRY_3D, INPUT_POSITION, INPUT_VELOCITY, INPUTS,
    REASON_BAD_COVARIANCE, REASON_BAD_DIMENSION, REASON_BAD_FLAGS, REASON_BUFFER_FULL, REASON_GAP,
    REASON_INTERNAL, REASON_NOT_FINITE, REASON_NOT_READY, REASON_OUT_OF_RANGE,
    REASON_STAMP_NOT_AFTER, REASON_UNKNOWN_SOURCE, REASON_WRONG_MODEL, REASONS, SOURCES,
    STATE_ALIGNING, STATE_DEGRADED, STATE_PAUSED, STATE_RUNNING, STATE_STALE, STATE_WAITING,
    WAITING_FOR_IMU, WAITING_FOR_LEVEL, WAITING_FOR_NOTHING, WAITING_FOR_POSITION,
    WAITING_FOR_REQUEST, input_name, reason_name, source_index, state_name, waiting_for_name,
};
pub use imu::ImuSample;
pub use journal::{
    JOURNAL_CONTROL, JOURNAL_HEADING, JOURNAL_IMU, JOURNAL_ODOMETRY_2D, JOURNAL_ODOMETRY_3D,
    JOURNAL_PAYLOAD_LEN, JOURNAL_POSITION, JOURNAL_RESUME, JOURNAL_SETTLE, JOURNAL_VELOCITY,
    JournalEntry, journal_kind_name,
};
pub use layout::{Field, FieldType, Layout, Message, Zero};
pub use noise::{NOISE_DENSITY, NOISE_PER_SAMPLE, ProcessNoise};
pub use odometry::{Odometry2d, Odometry3d};
pub use position::PositionFix;
pub use smoothed::{SMOOTHED_CUT, SMOOTHED_FLAGS, SmoothedState};
pub use velocity::VelocityFix;

/// Every struct of the contract, each after those that it holds.
pub const LAYOUTS: [&Layout; 19] = [
    &Header::WIRE,
    &ImuSample::WIRE,
    &Odometry2d::WIRE,
    &Odometry3d::WIRE,
    &PositionFix::WIRE,
    &VelocityFix::WIRE,
    &HeadingFix::WIRE,
    &Counters::WIRE,
    &EstimateHead::WIRE,
    &EstimateSe23::WIRE,
    &EstimateSe3::WIRE,
    &EstimateSe2::WIRE,
    &SmoothedState::WIRE,
    &Health::WIRE,
    &StateVector::WIRE,
    &ProcessNoise::WIRE,
    &ControlRequest::WIRE,
    &ControlResponse::WIRE,
    &JournalEntry::WIRE,
];

/// How many sources of position an estimate reports on: source ids are `0..MAX_SOURCES`.
pub const MAX_SOURCES: usize = 8;

/// How many parameters of mismatches an estimate reports on.
pub const MAX_MISMATCHES: usize = 6;

/// Dimension of the navigation error with biases: rotation, velocity, position, gyro bias, accelerometer bias.
pub const NAV_DIM: usize = 15;

/// Entries of the upper triangle of a `NAV_DIM` x `NAV_DIM` covariance.
pub const NAV_TRI: usize = 120;

/// Entries of the upper triangle of an SE(3) covariance (rotation, position).
pub const SE3_TRI: usize = 21;

/// Entries of the upper triangle of an SE(2) covariance (theta, x, y).
pub const SE2_TRI: usize = 6;

/// Position of entry `(row, col)` of a symmetric `dim` x `dim` matrix in its upper triangle, stored row by row:
/// `(0,0) (0,1) .. (0,dim-1) (1,1) ..`.
///
/// The order of `row` and `col` does not matter, the matrix being symmetric.
/// `None` if either lies outside the matrix.
///
/// ```
/// use inekf_shared::message::{NAV_DIM, NAV_TRI, triangle_index};
///
/// assert_eq!(triangle_index(0, 2, 3), Some(2));
/// assert_eq!(triangle_index(2, 0, 3), triangle_index(0, 2, 3));
/// assert_eq!(triangle_index(NAV_DIM - 1, NAV_DIM - 1, NAV_DIM), Some(NAV_TRI - 1));
/// assert_eq!(triangle_index(0, 3, 3), None);
/// ```
#[must_use]
pub const fn triangle_index(row: usize, col: usize, dim: usize) -> Option<usize> {
    let (low, high) = if row <= col { (row, col) } else { (col, row) };
    if high >= dim {
        return None;
    }
    // Rows before `low` hold dim, dim - 1, .. entries.
    Some(low * dim - low * (low + 1) / 2 + high)
}
