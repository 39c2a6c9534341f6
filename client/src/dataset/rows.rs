//! One type per kind of row. World ENU, body FLU, SI units, radians; arrays in the order x, y, z.

/// An IMU sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuRow {
    /// Stamp, ns of the sensor clock.
    pub stamp_ns: u64,
    /// Angular rate, rad/s, body frame.
    pub gyro_rps: [f64; 3],
    /// Specific force, m/s^2, body frame: at rest and level `(0, 0, +9.81)`.
    pub accel_mps2: [f64; 3],
}

/// A planar odometry increment: the motion since the row before, in the body frame of the row
/// before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry2dRow {
    /// Stamp of the end of the motion, ns.
    pub stamp_ns: u64,
    /// Rotation, rad, counter-clockwise.
    pub dtheta_rad: f64,
    /// Translation `(dx, dy)`, m.
    pub translation_m: [f64; 2],
}

/// A spatial odometry increment: the motion since the row before, in the body frame of the row
/// before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry3dRow {
    /// Stamp of the end of the motion, ns.
    pub stamp_ns: u64,
    /// Rotation vector, rad.
    pub rotation_rad: [f64; 3],
    /// Translation, m.
    pub translation_m: [f64; 3],
}

/// A position fix of one source: of its antenna, in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionRow {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Which sensor.
    pub source: u32,
    /// 2 in the plane, 3 in space.
    pub dimension: u32,
    /// Position, m; z is 0 in the plane.
    pub position_w_m: [f64; 3],
    /// Standard deviation per axis, m; z is 0 in the plane.
    pub sigma_m: [f64; 3],
}

/// A velocity fix of one source, in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityRow {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Which sensor.
    pub source: u32,
    /// Velocity, m/s.
    pub velocity_w_mps: [f64; 3],
    /// Standard deviation per axis, m/s.
    pub sigma_mps: [f64; 3],
}

/// A heading fix of one source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingRow {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Which sensor.
    pub source: u32,
    /// Heading of the body x axis, rad, counter-clockwise from east.
    pub heading_rad: f64,
    /// Standard deviation, rad.
    pub sigma_rad: f64,
}

/// True sensor biases at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuBias {
    /// Gyro bias, rad/s, body frame.
    pub gyro_rps: [f64; 3],
    /// Accelerometer bias, m/s^2, body frame.
    pub accel_mps2: [f64; 3],
}

/// The truth in space at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthRow {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Attitude `[x, y, z, w]`, Hamilton, body to world, as written in the file (the norm may be
    /// off by its rounding).
    pub q_wb: [f64; 4],
    /// Velocity of the IMU, m/s, world frame.
    pub v_w_mps: [f64; 3],
    /// Position of the IMU, m, world frame.
    pub p_w_m: [f64; 3],
    /// The true biases, which only a simulation knows.
    pub bias: Option<ImuBias>,
}

/// The truth in the plane at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth2dRow {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Heading, rad, counter-clockwise from the world x axis.
    pub theta_rad: f64,
    /// Position, m.
    pub p_w_m: [f64; 2],
}
