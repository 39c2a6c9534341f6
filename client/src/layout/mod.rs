//! The wire contract written down for other languages: `inekf-client layout`.
//!
//! What is written comes from the very types that the daemon uses ([`LAYOUTS`]): the size, the alignment and the offset
//! of every field, the names under which iceoryx2 knows the types, the codes, and which topic carries what. iceoryx2
//! compares name, size and alignment only when a process attaches, so the files check every offset themselves: in
//! Python when the module is imported, in C and C++ when the header is compiled.

mod c;
mod json;
mod python;

use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_REFUSED,
    CONTROL_RELOAD_NOISE, CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED,
    CONTROL_SNAPSHOT, CONTROL_TAKE, ESTIMATE_DEGRADED, ESTIMATE_PROPAGATED, ESTIMATE_REPLAYED,
    ESTIMATE_RESET, ESTIMATE_RESUMED, ESTIMATE_SMOOTHED, ESTIMATE_UPDATED, FieldType, MODEL_IMU,
    MODEL_ODOMETRY_2D, MODEL_ODOMETRY_3D, NO_MODE, NO_SOURCE, SMOOTHED_CUT, STATE_ALIGNING,
    STATE_DEGRADED, STATE_PAUSED, STATE_RUNNING, STATE_STALE, STATE_WAITING, WAITING_FOR_IMU,
    WAITING_FOR_LEVEL, WAITING_FOR_NOTHING, WAITING_FOR_POSITION, WAITING_FOR_REQUEST,
};

pub use c::c;
pub use inekf_shared::message::LAYOUTS;
pub use json::json;
pub use python::python;

/// Every code of the contract that a reader or feeder needs, by name.
pub const CODES: [(&str, u32); 36] = [
    ("ESTIMATE_PROPAGATED", ESTIMATE_PROPAGATED),
    ("ESTIMATE_UPDATED", ESTIMATE_UPDATED),
    ("ESTIMATE_RESET", ESTIMATE_RESET),
    ("ESTIMATE_DEGRADED", ESTIMATE_DEGRADED),
    ("ESTIMATE_REPLAYED", ESTIMATE_REPLAYED),
    ("ESTIMATE_RESUMED", ESTIMATE_RESUMED),
    ("ESTIMATE_SMOOTHED", ESTIMATE_SMOOTHED),
    ("SMOOTHED_CUT", SMOOTHED_CUT),
    ("MODEL_IMU", MODEL_IMU),
    ("MODEL_ODOMETRY_3D", MODEL_ODOMETRY_3D),
    ("MODEL_ODOMETRY_2D", MODEL_ODOMETRY_2D),
    ("NO_SOURCE", NO_SOURCE),
    ("NO_MODE", NO_MODE),
    ("STATE_WAITING", STATE_WAITING),
    ("STATE_ALIGNING", STATE_ALIGNING),
    ("STATE_RUNNING", STATE_RUNNING),
    ("STATE_DEGRADED", STATE_DEGRADED),
    ("STATE_STALE", STATE_STALE),
    ("STATE_PAUSED", STATE_PAUSED),
    ("WAITING_FOR_NOTHING", WAITING_FOR_NOTHING),
    ("WAITING_FOR_IMU", WAITING_FOR_IMU),
    ("WAITING_FOR_POSITION", WAITING_FOR_POSITION),
    ("WAITING_FOR_LEVEL", WAITING_FOR_LEVEL),
    ("WAITING_FOR_REQUEST", WAITING_FOR_REQUEST),
    ("CONTROL_RESET", CONTROL_RESET),
    ("CONTROL_SET_STATE", CONTROL_SET_STATE),
    ("CONTROL_SNAPSHOT", CONTROL_SNAPSHOT),
    ("CONTROL_BARRIER", CONTROL_BARRIER),
    ("CONTROL_SMOOTHED", CONTROL_SMOOTHED),
    ("CONTROL_PAUSE", CONTROL_PAUSE),
    ("CONTROL_RESUME", CONTROL_RESUME),
    ("CONTROL_RELOAD_NOISE", CONTROL_RELOAD_NOISE),
    ("CONTROL_CONFIG", CONTROL_CONFIG),
    ("CONTROL_TAKE", CONTROL_TAKE),
    ("CONTROL_OK", CONTROL_OK),
    ("CONTROL_REFUSED", CONTROL_REFUSED),
];

/// The element of a field and how many of it there are in each dimension, outermost first.
fn element(holds: FieldType) -> (FieldType, Vec<usize>) {
    let (mut inner, mut counts) = (holds, Vec::new());
    while let FieldType::Array(of, count) = inner {
        counts.push(count);
        inner = *of;
    }
    (inner, counts)
}
