//! The journal: everything that the daemon's engine took, in the order in which it took it.
//!
//! The engine has no clock, so the journal and the configuration determine every byte of the estimates but the
//! latency stamps.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;
use super::{
    ControlRequest, HeadingFix, ImuSample, MAX_INPUT_LEN, Message, Odometry2d, Odometry3d,
    PositionFix, StateVector, VelocityFix, Zero, serde_array,
};

/// Entry: an IMU sample. The kinds of the inputs are one more than their `INPUT_*` index.
pub const JOURNAL_IMU: u32 = 1;
/// Entry: a planar odometry increment.
pub const JOURNAL_ODOMETRY_2D: u32 = 2;
/// Entry: a spatial odometry increment.
pub const JOURNAL_ODOMETRY_3D: u32 = 3;
/// Entry: a position fix.
pub const JOURNAL_POSITION: u32 = 4;
/// Entry: a velocity fix.
pub const JOURNAL_VELOCITY: u32 = 5;
/// Entry: a heading fix.
pub const JOURNAL_HEADING: u32 = 6;
/// Entry: a control request.
pub const JOURNAL_CONTROL: u32 = 7;
/// Entry: the daemon found no sample waiting, and took in the fixes that had been put off; without payload.
pub const JOURNAL_SETTLE: u32 = 8;
/// Entry: the daemon began with the state of a checkpoint.
pub const JOURNAL_RESUME: u32 = 9;

/// Name of a kind of entry; `"unknown"` for a code that is not defined.
///
/// ```
/// use inekf_shared::message::{INPUT_HEADING, JOURNAL_HEADING, input_name, journal_kind_name};
///
/// // The kinds of the inputs are one more than their index.
/// assert_eq!(JOURNAL_HEADING as usize, INPUT_HEADING + 1);
/// assert_eq!(journal_kind_name(JOURNAL_HEADING), input_name(INPUT_HEADING));
/// ```
#[must_use]
pub const fn journal_kind_name(code: u32) -> &'static str {
    match code {
        JOURNAL_IMU => "imu",
        JOURNAL_ODOMETRY_2D => "odometry2d",
        JOURNAL_ODOMETRY_3D => "odometry3d",
        JOURNAL_POSITION => "position",
        JOURNAL_VELOCITY => "velocity",
        JOURNAL_HEADING => "heading",
        JOURNAL_CONTROL => "control",
        JOURNAL_SETTLE => "settle",
        JOURNAL_RESUME => "resume",
        _ => "unknown",
    }
}

/// Bytes of the longest payload, a control request.
pub const JOURNAL_PAYLOAD_LEN: usize = size_of::<ControlRequest>();

const _: () = {
    assert!(size_of::<ImuSample>() <= MAX_INPUT_LEN);
    assert!(size_of::<Odometry2d>() <= MAX_INPUT_LEN);
    assert!(size_of::<Odometry3d>() <= MAX_INPUT_LEN);
    assert!(size_of::<PositionFix>() <= MAX_INPUT_LEN);
    assert!(size_of::<VelocityFix>() <= MAX_INPUT_LEN);
    assert!(size_of::<HeadingFix>() <= MAX_INPUT_LEN);
    assert!(
        size_of::<StateVector>() <= JOURNAL_PAYLOAD_LEN && MAX_INPUT_LEN <= JOURNAL_PAYLOAD_LEN
    );
};

/// Something that the engine took.
///
/// ```
/// use inekf_shared::message::{HeadingFix, ImuSample, JOURNAL_IMU, JournalEntry, Message, Zero};
///
/// let sample = ImuSample { gyro_rps: [0.0, 0.0, 0.3], ..ImuSample::ZERO };
/// let entry = JournalEntry::new(12, 40, JOURNAL_IMU, sample.as_bytes());
/// assert_eq!(entry.read::<ImuSample>(), Some(sample));
/// // It is none of another size.
/// assert_eq!(entry.read::<HeadingFix>(), None);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.JournalEntry.v2")]
pub struct JournalEntry {
    /// Counts the entries of one daemon, from 0 by one.
    pub index: u64,
    /// How many estimates had been published when it was done with: those of this entry and of all before.
    pub estimates: u64,
    /// `JOURNAL_*` kind.
    pub kind: u32,
    /// Bytes of `payload` in use.
    pub size: u32,
    /// The bytes of the message, then zeros.
    #[serde(with = "serde_array")]
    pub payload: [u8; JOURNAL_PAYLOAD_LEN],
}

layout! {
    JournalEntry as "inekf.JournalEntry.v2", size 1936, align 8 {
        index: 0, estimates: 8, kind: 16, size: 20, payload: 24,
    }
}

impl JournalEntry {
    /// The entry of this kind with the bytes of a message, as far as they fit.
    ///
    /// ```
    /// use inekf_shared::message::{JOURNAL_SETTLE, JournalEntry};
    ///
    /// let entry = JournalEntry::new(3, 7, JOURNAL_SETTLE, &[]);
    /// assert_eq!((entry.index, entry.estimates, entry.size), (3, 7, 0));
    /// ```
    #[must_use]
    pub fn new(index: u64, estimates: u64, kind: u32, message: &[u8]) -> Self {
        let size = message.len().min(JOURNAL_PAYLOAD_LEN);
        let mut entry = Self {
            index,
            estimates,
            kind,
            size: size as u32,
            ..Self::ZERO
        };
        entry.payload[..size].copy_from_slice(&message[..size]);
        entry
    }

    /// The bytes of the message; whatever a faulty writer left as size, no more than there are.
    ///
    /// ```
    /// use inekf_shared::message::{JOURNAL_IMU, JOURNAL_PAYLOAD_LEN, JournalEntry};
    ///
    /// let mut entry = JournalEntry::new(0, 0, JOURNAL_IMU, &[1, 2, 3]);
    /// assert_eq!(entry.message(), [1, 2, 3]);
    /// // A faulty writer's size is cut to what there is.
    /// entry.size = u32::MAX;
    /// assert_eq!(entry.message().len(), JOURNAL_PAYLOAD_LEN);
    /// ```
    #[must_use]
    pub fn message(&self) -> &[u8] {
        &self.payload[..(self.size as usize).min(JOURNAL_PAYLOAD_LEN)]
    }

    /// The message, if the entry has one of this type.
    ///
    /// ```
    /// use inekf_shared::message::{HeadingFix, JOURNAL_HEADING, JournalEntry, Message, Zero};
    ///
    /// let fix = HeadingFix { heading_rad: 0.5, ..HeadingFix::ZERO };
    /// let entry = JournalEntry::new(0, 0, JOURNAL_HEADING, fix.as_bytes());
    /// assert_eq!(entry.read(), Some(fix));
    /// ```
    #[must_use]
    pub fn read<M: Message>(&self) -> Option<M> {
        M::from_bytes(self.message())
    }
}
