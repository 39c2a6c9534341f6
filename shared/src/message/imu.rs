//! Inertial samples: body frame (forward-left-up), radians per second and metres per second squared.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use super::Header;
use super::layout::layout;

/// One sample of a gyroscope and an accelerometer.
///
/// ```
/// use inekf_shared::message::{ImuSample, Message, Zero};
///
/// let at_rest = ImuSample { accel_mps2: [0.0, 0.0, 9.80665], ..ImuSample::ZERO };
/// // The size and the name under which every language attaches.
/// assert_eq!((at_rest.as_bytes().len(), ImuSample::TYPE_NAME), (80, "inekf.ImuSample.v1"));
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend, Serialize, Deserialize)]
#[type_name("inekf.ImuSample.v1")]
pub struct ImuSample {
    /// Stamp, number and sender.
    pub header: Header,
    /// Angular rate of the body, body frame, rad/s.
    pub gyro_rps: [f64; 3],
    /// Specific force, body frame, m/s^2: at rest and level it reads about +9.81 on z.
    pub accel_mps2: [f64; 3],
}

layout! {
    ImuSample as "inekf.ImuSample.v1", size 80, align 8 {
        header: 0, gyro_rps: 32, accel_mps2: 56,
    }
}
