//! Heading fixes: radians counter-clockwise from east.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::Header;
use super::layout::layout;

/// A measured heading of one source.
///
/// ```
/// use inekf_shared::message::{HeadingFix, Message, Zero};
///
/// // North, known to two degrees.
/// let fix = HeadingFix {
///     heading_rad: 90_f64.to_radians(),
///     sigma_rad: 2_f64.to_radians(),
///     ..HeadingFix::ZERO
/// };
/// assert_eq!(HeadingFix::from_bytes(fix.as_bytes()), Some(fix));
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.HeadingFix.v1")]
pub struct HeadingFix {
    /// Stamp, number and sender.
    pub header: Header,
    /// Id of the source, `0..MAX_SOURCES`.
    pub source: u32,
    /// No flag is defined: zero. Anything else is refused.
    pub flags: u32,
    /// Heading of the body's forward axis, rad, counter-clockwise from east.
    pub heading_rad: f64,
    /// Standard deviation of the heading, rad.
    pub sigma_rad: f64,
}

layout! {
    HeadingFix as "inekf.HeadingFix.v1", size 56, align 8 {
        header: 0, source: 32, flags: 36, heading_rad: 40, sigma_rad: 48,
    }
}
