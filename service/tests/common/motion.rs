//! A level circle of constant speed, counter-clockwise, nose along the path: its truth in closed
//! form, and what each sensor says of it.
//!
//! World frame ENU, body frame FLU, SI units.

use inekf_shared::message::{
    Header, HeadingFix, ImuSample, MODEL_IMU, NAV_TRI, PositionFix, StateVector, VelocityFix, Zero,
    triangle_index,
};
use nalgebra::Vector3;

use super::Input;

/// Stamp of sample 0.
pub const START_NS: u64 = 1_700_000_000_000_000_000;
/// Time between two samples: 100 Hz.
pub const PERIOD_NS: u64 = 10_000_000;
/// Epoch of the sender.
pub const EPOCH: u64 = 77;
/// Gravity, m/s^2.
pub const GRAVITY: f64 = 9.80665;
/// Turn rate of the circle, rad/s.
pub const TURN_RATE: f64 = 0.3;
/// Speed on the circle, m/s.
pub const SPEED: f64 = 5.0;
/// Standard deviation of the fixes: m, m/s; of a heading, rad.
pub const SIGMA: f64 = 0.5;
/// Standard deviation of the headings, rad.
pub const HEADING_SIGMA: f64 = 0.05;
/// Lever arm of position source 1, m, body frame.
pub const LEVER_ARM_B: [f64; 3] = [0.8, -0.3, 1.2];

/// Stamp of sample `k`.
pub fn stamp(k: u64) -> u64 {
    START_NS + k * PERIOD_NS
}

/// Angle on the circle at `stamp_ns`, rad; it is the heading too.
pub fn angle(stamp_ns: u64) -> f64 {
    TURN_RATE * (stamp_ns as f64 - START_NS as f64) * 1e-9
}

/// True position of the IMU, m, world frame.
pub fn true_position(stamp_ns: u64) -> Vector3<f64> {
    let (sin, cos) = angle(stamp_ns).sin_cos();
    Vector3::new(sin, 1.0 - cos, 0.0) * (SPEED / TURN_RATE)
}

/// True velocity, m/s, world frame.
pub fn true_velocity(stamp_ns: u64) -> Vector3<f64> {
    let (sin, cos) = angle(stamp_ns).sin_cos();
    Vector3::new(cos, sin, 0.0) * SPEED
}

/// A header of this stamp and number.
pub fn header(stamp_ns: u64, seq: u64) -> Header {
    Header {
        stamp_ns,
        seq,
        sent_ns: seq + 1,
        epoch: EPOCH,
    }
}

/// Sample `k` on the circle.
pub fn imu(k: u64) -> ImuSample {
    ImuSample {
        header: header(stamp(k), k),
        gyro_rps: [0.0, 0.0, TURN_RATE],
        accel_mps2: [0.0, SPEED * TURN_RATE, GRAVITY],
    }
}

/// Sample `k` of a body at rest, level.
pub fn imu_at_rest(k: u64) -> ImuSample {
    ImuSample {
        gyro_rps: [0.0; 3],
        accel_mps2: [0.0, 0.0, GRAVITY],
        ..imu(k)
    }
}

/// A row-major covariance with this standard deviation on every axis.
pub fn isotropic(sigma: f64) -> [f64; 9] {
    let v = sigma * sigma;
    [v, 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, v]
}

/// The true position of the antenna of `source` as a fix.
pub fn position(stamp_ns: u64, seq: u64, source: u32) -> PositionFix {
    let mut position_w = true_position(stamp_ns);
    if source == 1 {
        let (sin, cos) = angle(stamp_ns).sin_cos();
        let [x, y, z] = LEVER_ARM_B;
        position_w += Vector3::new(cos * x - sin * y, sin * x + cos * y, z);
    }
    PositionFix {
        header: header(stamp_ns, seq),
        source,
        dimension: 3,
        position_w_m: position_w.into(),
        covariance_w_m2: isotropic(SIGMA),
    }
}

/// The true velocity as a fix of source 0.
pub fn velocity(stamp_ns: u64, seq: u64) -> VelocityFix {
    VelocityFix {
        header: header(stamp_ns, seq),
        source: 0,
        flags: 0,
        velocity_w_mps: true_velocity(stamp_ns).into(),
        covariance_w: isotropic(SIGMA),
    }
}

/// The true heading as a fix of source 0.
pub fn heading(stamp_ns: u64, seq: u64) -> HeadingFix {
    HeadingFix {
        header: header(stamp_ns, seq),
        source: 0,
        flags: 0,
        heading_rad: angle(stamp_ns),
        sigma_rad: HEADING_SIGMA,
    }
}

/// `seconds` of the circle: samples, positions of both sources at 5 Hz (between and at sample
/// stamps), velocities at 4 Hz, headings at 2 Hz, each fix just before the sample that it is due by.
pub fn circle(seconds: u64) -> Vec<Input> {
    let mut inputs = Vec::new();
    for k in 0..seconds * 100 {
        let number = k / 10;
        match k % 100 {
            _ if k == 0 => {}
            r if r % 20 == 7 => {
                inputs.push(Input::Position(position(stamp(k) - 3_333_333, number, 0)));
            }
            r if r % 20 == 10 => inputs.push(Input::Position(position(stamp(k), number, 1))),
            r if r % 25 == 3 => inputs.push(Input::Velocity(velocity(stamp(k) - 1, number))),
            r if r % 50 == 31 => inputs.push(Input::Heading(heading(stamp(k) - 5_000_000, number))),
            _ => {}
        }
        inputs.push(Input::Imu(imu(k)));
    }
    inputs
}

/// A sample that differs from its neighbours on every axis.
pub fn lively_imu(k: u64) -> ImuSample {
    let t = k as f64;
    ImuSample {
        gyro_rps: [
            0.2 * (1.3 * t).sin(),
            0.1 * (0.7 * t).cos(),
            0.3 + 0.05 * t.sin(),
        ],
        accel_mps2: [
            0.8 * t.sin(),
            1.5 + 0.4 * (2.1 * t).cos(),
            GRAVITY + (0.9 * t).sin(),
        ],
        ..imu(k)
    }
}

/// A state on the circle at `stamp_ns` with these standard deviations everywhere (rad, m/s, m),
/// 1e-2 rad/s and 1e-1 m/s^2 for the biases.
pub fn state_on_circle(stamp_ns: u64, sigma: f64) -> StateVector {
    let (sin, cos) = (0.5 * angle(stamp_ns)).sin_cos();
    let mut covariance = [0.0; NAV_TRI];
    for i in 0..15 {
        covariance[triangle_index(i, i, 15).unwrap()] = match i {
            0..9 => sigma * sigma,
            9..12 => 1e-4,
            _ => 1e-2,
        };
    }
    StateVector {
        model: MODEL_IMU,
        dimension: 15,
        stamp_ns,
        q_wb: [0.0, 0.0, sin, cos],
        v_w_mps: true_velocity(stamp_ns).into(),
        p_w_m: true_position(stamp_ns).into(),
        covariance,
        ..StateVector::ZERO
    }
}

/// Distance of the estimated from the true position, m.
pub fn position_error(state: &StateVector) -> f64 {
    (Vector3::from(state.p_w_m) - true_position(state.stamp_ns)).norm()
}
