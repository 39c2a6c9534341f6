//! Odometry increments: the motion since the row before, in the body frame of the row before. Radians and metres.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::Header;
use super::layout::layout;

/// A planar increment: forward, left, counter-clockwise.
///
/// ```
/// use inekf_shared::message::{Odometry2d, Zero};
///
/// // Half a metre forwards and a little to the left while turning left.
/// let row = Odometry2d { dtheta_rad: 0.1, translation_m: [0.5, 0.025], ..Odometry2d::ZERO };
/// // On an arc the way points half the turn to the left.
/// let direction_rad = row.translation_m[1].atan2(row.translation_m[0]);
/// assert!((direction_rad - row.dtheta_rad / 2.0).abs() < 1e-4);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.Odometry2d.v1")]
pub struct Odometry2d {
    /// Stamp, number and sender.
    pub header: Header,
    /// Turn since the previous row, rad, counter-clockwise.
    pub dtheta_rad: f64,
    /// Translation since the previous row, in that row's body frame, m.
    pub translation_m: [f64; 2],
}

layout! {
    Odometry2d as "inekf.Odometry2d.v1", size 56, align 8 {
        header: 0, dtheta_rad: 32, translation_m: 40,
    }
}

/// A spatial increment.
///
/// ```
/// use inekf_shared::message::{Message, Odometry3d};
///
/// assert_eq!(Odometry3d::FIELDS, [("header", 0), ("rotation_rad", 32), ("translation_m", 56)]);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.Odometry3d.v1")]
pub struct Odometry3d {
    /// Stamp, number and sender.
    pub header: Header,
    /// Rotation vector since the previous row, in that row's body frame, rad.
    pub rotation_rad: [f64; 3],
    /// Translation since the previous row, in that row's body frame, m.
    pub translation_m: [f64; 3],
}

layout! {
    Odometry3d as "inekf.Odometry3d.v1", size 80, align 8 {
        header: 0, rotation_rad: 32, translation_m: 56,
    }
}
