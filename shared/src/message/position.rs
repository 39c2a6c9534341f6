//! Position fixes: world frame (east-north-up), metres.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::Header;
use super::layout::layout;

/// A measured position of one source (an antenna, say; its lever arm is in the daemon's configuration).
///
/// ```
/// use inekf_shared::message::{PositionFix, Zero};
///
/// // A fix in the plane: z and its row and column of the covariance do not count.
/// let (east_m, north_m) = (2.0_f64, 3.0_f64);
/// let fix = PositionFix {
///     dimension: 2,
///     position_w_m: [100.0, 50.0, 0.0],
///     covariance_w_m2: [east_m * east_m, 0.0, 0.0, 0.0, north_m * north_m, 0.0, 0.0, 0.0, 0.0],
///     ..PositionFix::ZERO
/// };
/// // Row-major, m^2.
/// assert_eq!((fix.covariance_w_m2[0], fix.covariance_w_m2[4]), (4.0, 9.0));
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.PositionFix.v1")]
pub struct PositionFix {
    /// Stamp, number and sender.
    pub header: Header,
    /// Id of the source, `0..MAX_SOURCES`.
    pub source: u32,
    /// 3, or 2: then z and its row and column of the covariance are ignored.
    pub dimension: u32,
    /// Position of the source, world frame, m.
    pub position_w_m: [f64; 3],
    /// Covariance of the position, world frame, m^2, row-major.
    pub covariance_w_m2: [f64; 9],
}

layout! {
    PositionFix as "inekf.PositionFix.v1", size 136, align 8 {
        header: 0, source: 32, dimension: 36, position_w_m: 40, covariance_w_m2: 64,
    }
}
