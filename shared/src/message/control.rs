//! Control requests and their responses.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;
use super::{Counters, INPUTS, MAX_MISMATCHES, NAV_TRI, ProcessNoise, REASONS, serde_array};

/// Request: forget the state and initialise anew.
pub const CONTROL_RESET: u32 = 1;
/// Request: continue from the state in the request.
pub const CONTROL_SET_STATE: u32 = 2;
/// Request: answer with the current state.
pub const CONTROL_SNAPSHOT: u32 = 3;
/// Request: answer when every input sent before has been processed.
pub const CONTROL_BARRIER: u32 = 4;
/// Request: publish the states in the window of the smoother.
pub const CONTROL_SMOOTHED: u32 = 5;

/// Request: take no sample and no fix until [`CONTROL_RESUME`]; they are counted as refused (not ready).
pub const CONTROL_PAUSE: u32 = 6;
/// Request: end a pause. What follows is to the estimate as if the samples had been silent for as long.
pub const CONTROL_RESUME: u32 = 7;
/// Request: use [`ControlRequest::noise`] from the next sample on.
pub const CONTROL_RELOAD_NOISE: u32 = 8;
/// Request: answer with the text of the configuration from byte [`ControlRequest::argument`] on.
pub const CONTROL_CONFIG: u32 = 9;
/// Request: take a journal's entry, whose kind is [`ControlRequest::argument`]. Only of a daemon that was started to
/// be fed by requests (`--stepped`), so that a journal can be replayed in its own order.
pub const CONTROL_TAKE: u32 = 10;

/// Name of a kind of request; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{CONTROL_SET_STATE, control_kind_name};
///
/// assert_eq!(control_kind_name(CONTROL_SET_STATE), "set-state");
/// assert_eq!(control_kind_name(99), "unknown");
/// ```
#[must_use]
pub const fn control_kind_name(code: u32) -> &'static str {
    match code {
        CONTROL_RESET => "reset",
        CONTROL_SET_STATE => "set-state",
        CONTROL_SNAPSHOT => "snapshot",
        CONTROL_BARRIER => "barrier",
        CONTROL_SMOOTHED => "smoothed",
        CONTROL_PAUSE => "pause",
        CONTROL_RESUME => "resume",
        CONTROL_RELOAD_NOISE => "reload-noise",
        CONTROL_CONFIG => "config",
        CONTROL_TAKE => "take",
        _ => "unknown",
    }
}

/// Status: done.
pub const CONTROL_OK: u32 = 0;
/// Status: refused; [`ControlResponse::reason`] says why.
pub const CONTROL_REFUSED: u32 = 1;

/// Name of a status; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{CONTROL_REFUSED, control_status_name};
///
/// assert_eq!(control_status_name(CONTROL_REFUSED), "refused");
/// ```
#[must_use]
pub const fn control_status_name(code: u32) -> &'static str {
    match code {
        CONTROL_OK => "ok",
        CONTROL_REFUSED => "refused",
        _ => "unknown",
    }
}

/// Bytes of the longest input message.
pub const MAX_INPUT_LEN: usize = 136;

/// Bytes of the text of a refusal.
pub const REASON_TEXT_LEN: usize = 256;

/// Entries of [`StateVector::parameter_covariance`]: [`MAX_MISMATCHES`] columns beside a pose of 6 dimensions.
pub const PARAMETER_TRI: usize = 6 * MAX_MISMATCHES + MAX_MISMATCHES * (MAX_MISMATCHES + 1) / 2;

/// Hypotheses of an adaptive filter on how its mismatches behave: entries of [`StateVector::mode_weights`].
pub const MODES: usize = 9;

/// A state of any model with its covariance, and what a filter has learned beside the pose.
///
/// In the plane `q_wb` turns about z, `p_w_m` is `(x, y, 0)` and `dimension` is 3. The covariance is that of the
/// left-invariant error, as in the estimates.
///
/// ```
/// use inekf_shared::message::{MODEL_ODOMETRY_2D, StateVector, Zero, triangle_index};
///
/// // A start in the plane, heading north, known to 0.1 rad and 2 m.
/// let half_turn_rad = 90_f64.to_radians() / 2.0;
/// let mut start = StateVector {
///     model: MODEL_ODOMETRY_2D,
///     dimension: 3,
///     q_wb: [0.0, 0.0, half_turn_rad.sin(), half_turn_rad.cos()],
///     ..StateVector::ZERO
/// };
/// for (index, sigma) in [0.1, 2.0, 2.0].into_iter().enumerate() {
///     let at = triangle_index(index, index, 3).expect("on the diagonal");
///     start.covariance[at] = sigma * sigma;
/// }
/// assert_eq!(start.covariance[..6], [0.1 * 0.1, 0.0, 0.0, 4.0, 0.0, 4.0]);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.StateVector.v2")]
pub struct StateVector {
    /// `MODEL_*` code.
    pub model: u32,
    /// Dimension of the covariance: 15 or 9 (SE_2(3)), 6 (SE(3)), 3 (SE(2)). In a request 0 means the configured one.
    pub dimension: u32,
    /// Time the state holds at, nanoseconds of the sensor clock.
    pub stamp_ns: u64,
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
    /// Upper triangle of the `dimension` x `dimension` covariance, row by row, then zeros.
    #[serde(with = "serde_array")]
    pub covariance: [f64; NAV_TRI],
    /// Parameters of mismatches in `parameters`. In a request 0 means that what is estimated beside the pose begins as
    /// configured.
    pub parameter_count: u32,
    /// Weights in `mode_weights`: all of an adaptive filter, else 0.
    pub mode_count: u32,
    /// Estimated parameters of the declared mismatches, as in the estimates, then zeros.
    pub parameters: [f64; MAX_MISMATCHES],
    /// Their covariance, a column for each: with the `dimension` components of the pose, then with the parameters up to
    /// itself; then zeros.
    #[serde(with = "serde_array")]
    pub parameter_covariance: [f64; PARAMETER_TRI],
    /// Weights of the modes of an adaptive filter (`inekf::filter::standard_modes`), which add up to one; else zeros.
    pub mode_weights: [f64; MODES],
}

layout! {
    StateVector as "inekf.StateVector.v2", size 1688, align 8 {
        model: 0, dimension: 4, stamp_ns: 8, q_wb: 16, v_w_mps: 48, p_w_m: 72, gyro_bias_rps: 96,
        accel_bias_mps2: 120, covariance: 144, parameter_count: 1104, mode_count: 1108,
        parameters: 1112, parameter_covariance: 1160, mode_weights: 1616,
    }
}

/// What a client asks of the daemon.
///
/// ```
/// use inekf_shared::message::{CONTROL_CONFIG, ControlRequest};
///
/// // The configuration's text from byte 256 on.
/// let request = ControlRequest {
///     kind: CONTROL_CONFIG,
///     argument: 256,
///     request_id: 2,
///     ..ControlRequest::default()
/// };
/// assert_eq!(request.state.dimension, 0);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.ControlRequest.v3")]
pub struct ControlRequest {
    /// `CONTROL_*` kind.
    pub kind: u32,
    /// With [`CONTROL_CONFIG`] an offset in bytes, with [`CONTROL_TAKE`] a `JOURNAL_*` kind, else zero.
    pub argument: u32,
    /// Chosen by the client; the response repeats it.
    pub request_id: u64,
    /// The state to continue from with [`CONTROL_SET_STATE`], or with [`CONTROL_TAKE`] of the kind `JOURNAL_RESUME`;
    /// else zero.
    pub state: StateVector,
    /// Process noise with [`CONTROL_RELOAD_NOISE`], else zero.
    pub noise: ProcessNoise,
    /// The bytes of an input message with [`CONTROL_TAKE`], then zeros; else zero.
    #[serde(with = "serde_array")]
    pub input: [u8; MAX_INPUT_LEN],
}

layout! {
    ControlRequest as "inekf.ControlRequest.v3", size 1912, align 8 {
        kind: 0, argument: 4, request_id: 8, state: 16, noise: 1704, input: 1776,
    }
}

/// What the daemon answers.
///
/// ```
/// use inekf_shared::message::{CONTROL_REFUSED, ControlResponse};
///
/// let mut response = ControlResponse { request_id: 7, status: CONTROL_REFUSED, ..Default::default() };
/// response.set_reason("the model has no smoother");
/// assert_eq!(response.reason(), "the model has no smoother");
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.ControlResponse.v5")]
pub struct ControlResponse {
    /// The id of the request.
    pub request_id: u64,
    /// [`CONTROL_OK`] or [`CONTROL_REFUSED`].
    pub status: u32,
    /// `STATE_*` code of the daemon after the request.
    pub state_code: u32,
    /// `WAITING_FOR_*` code of the daemon after the request.
    pub waiting_for: u32,
    /// Bytes of `reason` in use.
    pub reason_len: u32,
    /// Why the request was refused, UTF-8; read it with [`ControlResponse::reason`]. With [`CONTROL_CONFIG`], as many
    /// bytes of the text as fit.
    #[serde(with = "serde_array")]
    pub reason: [u8; REASON_TEXT_LEN],
    /// What became of the inputs.
    pub counters: Counters,
    /// Messages received, indexed by `INPUT_*`.
    pub received: [u64; INPUTS],
    /// Rejected inputs, indexed by `REASON_*` code.
    pub rejected_by_reason: [u64; REASONS],
    /// With [`CONTROL_SMOOTHED`] how many states have been published on the topic `smoothed`, else zero.
    pub smoothed: u64,
    /// With [`CONTROL_CONFIG`] how many bytes the whole text has, else zero.
    pub config_len: u64,
    /// The current state with [`CONTROL_SNAPSHOT`], else zero.
    pub state: StateVector,
}

layout! {
    ControlResponse as "inekf.ControlResponse.v5", size 2208, align 8 {
        request_id: 0, status: 8, state_code: 12, waiting_for: 16, reason_len: 20, reason: 24,
        counters: 280, received: 328, rejected_by_reason: 376, smoothed: 504, config_len: 512,
        state: 520,
    }
}

impl ControlResponse {
    /// Writes the text of a refusal, cut at a character boundary if it exceeds [`REASON_TEXT_LEN`] bytes.
    ///
    /// ```
    /// use inekf_shared::message::{ControlResponse, REASON_TEXT_LEN};
    ///
    /// let mut response = ControlResponse::default();
    /// // Two bytes a letter: what does not fit is cut between letters.
    /// response.set_reason(&"ä".repeat(200));
    /// assert_eq!(response.reason().len(), REASON_TEXT_LEN);
    /// assert!(response.reason().chars().all(|letter| letter == 'ä'));
    /// ```
    pub fn set_reason(&mut self, text: &str) {
        let mut end = text.len().min(REASON_TEXT_LEN);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        self.reason = [0; REASON_TEXT_LEN];
        self.reason[..end].copy_from_slice(&text.as_bytes()[..end]);
        self.reason_len = end as u32;
    }

    /// Writes a page of the configuration's text: what there is of it from `offset` on and fits.
    ///
    /// ```
    /// use inekf_shared::message::ControlResponse;
    ///
    /// let text = "model = 'imu'";
    /// let mut response = ControlResponse::default();
    /// response.set_page(text, 8);
    /// // What there is from there on, and how long the whole is.
    /// assert_eq!((response.page(), response.config_len), (&b"'imu'"[..], 13));
    /// // Beyond the end there is nothing, and no panic.
    /// response.set_page(text, 500);
    /// assert!(response.page().is_empty());
    /// ```
    pub fn set_page(&mut self, text: &str, offset: usize) {
        let rest = text.as_bytes().get(offset..).unwrap_or_default();
        let len = rest.len().min(REASON_TEXT_LEN);
        self.reason = [0; REASON_TEXT_LEN];
        self.reason[..len].copy_from_slice(&rest[..len]);
        self.reason_len = len as u32;
        self.config_len = text.len() as u64;
    }

    /// The page of the configuration's text that a response to [`CONTROL_CONFIG`] holds.
    ///
    /// ```
    /// use inekf_shared::message::ControlResponse;
    ///
    /// // A faulty writer's length is cut to the field.
    /// let response = ControlResponse { reason_len: u32::MAX, ..ControlResponse::default() };
    /// assert_eq!(response.page().len(), inekf_shared::message::REASON_TEXT_LEN);
    /// ```
    #[must_use]
    pub fn page(&self) -> &[u8] {
        &self.reason[..(self.reason_len as usize).min(REASON_TEXT_LEN)]
    }

    /// The text of a refusal. Whatever a faulty writer left, this is text: the length is cut to the field, and what
    /// is not UTF-8 ends it.
    ///
    /// ```
    /// use inekf_shared::message::ControlResponse;
    ///
    /// // Whatever a faulty writer left, this is text: what is none ends it.
    /// let mut response = ControlResponse { reason_len: 3, ..ControlResponse::default() };
    /// response.reason[..3].copy_from_slice(b"ok\xff");
    /// assert_eq!(response.reason(), "ok");
    /// ```
    #[must_use]
    pub fn reason(&self) -> &str {
        let used = (self.reason_len as usize).min(REASON_TEXT_LEN);
        match str::from_utf8(&self.reason[..used]) {
            Ok(text) => text,
            Err(error) => str::from_utf8(&self.reason[..error.valid_up_to()]).unwrap_or_default(),
        }
    }
}
