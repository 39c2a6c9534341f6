//! Velocity fixes: world frame (east-north-up), metres per second.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::Header;
use super::layout::layout;

/// A measured velocity of one source.
///
/// ```
/// use inekf_shared::message::{VelocityFix, Zero};
///
/// // Northwards at 3 m/s, whatever the attitude; 0.1 m/s on each axis.
/// let variance = 0.1_f64 * 0.1;
/// let fix = VelocityFix {
///     velocity_w_mps: [0.0, 3.0, 0.0],
///     covariance_w: [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance],
///     ..VelocityFix::ZERO
/// };
/// // A flag that is not defined would have it refused.
/// assert_eq!(fix.flags, 0);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.VelocityFix.v1")]
pub struct VelocityFix {
    /// Stamp, number and sender.
    pub header: Header,
    /// Id of the source, `0..MAX_SOURCES`.
    pub source: u32,
    /// No flag is defined: zero. Anything else is refused.
    pub flags: u32,
    /// Velocity, world frame, m/s.
    pub velocity_w_mps: [f64; 3],
    /// Covariance of the velocity, world frame, (m/s)^2, row-major.
    pub covariance_w: [f64; 9],
}

layout! {
    VelocityFix as "inekf.VelocityFix.v1", size 136, align 8 {
        header: 0, source: 32, flags: 36, velocity_w_mps: 40, covariance_w: 64,
    }
}
