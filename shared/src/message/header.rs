//! The header every input starts with.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::layout::layout;

/// When an input was measured, which one it is, and when it was sent.
///
/// iceoryx2's own header has neither a number nor a time and an overflow of a buffer is silent, so both are here:
/// within one `epoch`, a step of `seq` by more than one is that many messages lost, less one.
///
/// ```
/// use inekf_shared::message::{Header, Zero};
///
/// let before = Header { seq: 7, epoch: 1, ..Header::ZERO };
/// let now = Header { seq: 10, epoch: 1, ..Header::ZERO };
/// // Two messages were lost; a new epoch would have begun anew instead.
/// assert_eq!(now.seq - before.seq - 1, 2);
/// assert_eq!(now.epoch, before.epoch);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.Header.v1")]
pub struct Header {
    /// Time of the measurement, nanoseconds of the sensor clock, monotonic per instance.
    pub stamp_ns: u64,
    /// Counts the messages of one sender on one topic, by one.
    pub seq: u64,
    /// CLOCK_MONOTONIC at the send, nanoseconds ([`crate::clock::monotonic_ns`]).
    pub sent_ns: u64,
    /// Names one life of the sender (its start time or a random number). A new epoch restarts `seq`.
    pub epoch: u64,
}

layout! {
    Header as "inekf.Header.v1", size 32, align 8 {
        stamp_ns: 0, seq: 8, sent_ns: 16, epoch: 24,
    }
}
