//! A state of the window of a smoother.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;
use super::{NAV_TRI, serde_array};

/// Flag: the state left the window before its time, because the window began anew: after a set-state request, a reset,
/// a long gap or a lock-out.
pub const SMOOTHED_CUT: u32 = 1;
/// All flags that are defined.
pub const SMOOTHED_FLAGS: u32 = SMOOTHED_CUT;

/// The last estimate of a state that has left the window, or the present one of a state in it.
///
/// ```
/// use inekf_shared::message::{SMOOTHED_CUT, SmoothedState, Zero};
///
/// let left = SmoothedState { index: 41, ..SmoothedState::ZERO };
/// let answer = SmoothedState { request_id: 3, index: 0, count: 10, ..SmoothedState::ZERO };
/// // Its last estimate, after 41 others; and the oldest of the ten that are in the window now.
/// assert!(left.request_id == 0 && left.flags & SMOOTHED_CUT == 0);
/// assert!(answer.request_id != 0 && answer.index < answer.count);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.SmoothedState.v2")]
pub struct SmoothedState {
    /// Time of the state: that of the fix that made it, nanoseconds of the sensor clock.
    pub stamp_ns: u64,
    /// The request that this answers; 0: the state has left the window, and this is its last estimate.
    pub request_id: u64,
    /// In an answer the place in the window, oldest 0; else how many states have left before this one.
    pub index: u64,
    /// In an answer how many states the window holds; else 0.
    pub count: u64,
    /// Dimension of the error of the state: 15 with biases, 9 without.
    pub dimension: u32,
    /// `SMOOTHED_*` flags.
    pub flags: u32,
    /// Attitude, body to world, unit quaternion x, y, z, w.
    pub q_wb: [f64; 4],
    /// Velocity, world frame, m/s.
    pub v_w_mps: [f64; 3],
    /// Position, world frame, m.
    pub p_w_m: [f64; 3],
    /// Gyroscope bias, body frame, rad/s.
    pub gyro_bias_rps: [f64; 3],
    /// Accelerometer bias, body frame, m/s^2.
    pub accel_bias_mps2: [f64; 3],
    /// Upper triangle of the covariance of the left-invariant error given all fixes that the window has seen, before and
    /// after this state. With 9 states the triangle of the 9 x 9 fills the first 45 entries and the rest is zero.
    #[serde(with = "serde_array")]
    pub covariance: [f64; NAV_TRI],
}

layout! {
    SmoothedState as "inekf.SmoothedState.v2", size 1128, align 8 {
        stamp_ns: 0, request_id: 8, index: 16, count: 24, dimension: 32, flags: 36, q_wb: 40, v_w_mps: 72,
        p_w_m: 96, gyro_bias_rps: 120, accel_bias_mps2: 144,
        covariance: 168,
    }
}
