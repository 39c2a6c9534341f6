//! The wire contract written down for other languages: `inekf-client layout`.
//!
//! What is written comes from the very types that the daemon uses ([`LAYOUTS`]): the size, the alignment and the offset
//! of every field, the names under which iceoryx2 knows the types, the codes, and which topic carries what. iceoryx2
//! compares name, size and alignment only when a process attaches, so the files check every offset themselves: in
//! Python when the module is imported, in C and C++ when the header is compiled.

mod c;
mod json;
mod python;

use std::fmt::{self, Write};

use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_REFUSED,
    CONTROL_RELOAD_NOISE, CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED,
    CONTROL_SNAPSHOT, CONTROL_TAKE, ESTIMATE_DEGRADED, ESTIMATE_PROPAGATED, ESTIMATE_REPLAYED,
    ESTIMATE_RESET, ESTIMATE_RESUMED, ESTIMATE_SMOOTHED, ESTIMATE_UPDATED, FieldType, MODEL_IMU,
    MODEL_ODOMETRY_2D, MODEL_ODOMETRY_3D, NO_MODE, NO_SOURCE, SMOOTHED_CUT, STATE_ALIGNING,
    STATE_DEGRADED, STATE_PAUSED, STATE_RUNNING, STATE_STALE, STATE_WAITING, WAITING_FOR_IMU,
    WAITING_FOR_LEVEL, WAITING_FOR_NOTHING, WAITING_FOR_POSITION, WAITING_FOR_REQUEST,
    ZERO_VELOCITY_SOURCE,
};

pub use c::c;
pub use inekf_shared::message::LAYOUTS;
pub use json::json;
pub use python::python;

/// Every code of the contract that a reader or feeder needs, by name.
///
/// ```
/// use inekf_client::layout;
///
/// let found = layout::CODES.iter().any(|(name, code)| *name == "NO_SOURCE" && *code == u32::MAX);
/// assert!(found);
/// assert!(layout::c().contains("} InekfImuSample;"));
/// assert!(layout::python().contains("class ImuSample(ctypes.Structure):"));
/// assert!(layout::json().contains("\"inekf.ImuSample"));
/// ```
pub const CODES: [(&str, u32); 37] = [
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
    ("ZERO_VELOCITY_SOURCE", ZERO_VELOCITY_SOURCE),
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

/// Writes `line` at the end of `text`.
fn push(text: &mut String, line: fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = text.write_fmt(line);
}

/// How a language calls the types of the elements; a struct has a name of its own there.
struct Names {
    u8: &'static str,
    u32: &'static str,
    u64: &'static str,
    f64: &'static str,
    /// What stands before the name of a struct.
    prefix: &'static str,
}

impl Names {
    /// The type and the name of a field without its arrays, and how many of it there are in each dimension.
    fn of(&self, holds: FieldType) -> (String, Vec<usize>) {
        let (inner, counts) = element(holds);
        let name = match inner {
            FieldType::U8 => self.u8.to_owned(),
            FieldType::U32 => self.u32.to_owned(),
            FieldType::U64 => self.u64.to_owned(),
            FieldType::F64 => self.f64.to_owned(),
            FieldType::Struct(layout) => format!("{}{}", self.prefix, layout.name),
            // `element` has taken the arrays off.
            FieldType::Array(of, _) => return self.of(*of),
        };
        (name, counts)
    }
}

/// The element of a field and how many of it there are in each dimension, outermost first.
fn element(holds: FieldType) -> (FieldType, Vec<usize>) {
    let (mut inner, mut counts) = (holds, Vec::new());
    while let FieldType::Array(of, count) = inner {
        counts.push(count);
        inner = *of;
    }
    (inner, counts)
}
