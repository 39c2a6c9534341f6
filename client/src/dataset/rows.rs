//! One type per kind of row. World ENU, body FLU, SI units, radians; arrays in the order x, y, z.

/// An IMU sample.
///
/// ```
/// use inekf_client::dataset::ImuRow;
///
/// // At rest and level an accelerometer feels the ground push it upwards.
/// let at_rest = ImuRow { stamp_ns: 0, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.80665] };
/// assert!(at_rest.accel_mps2[2] > 0.0);
/// ```
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
///
/// ```
/// use inekf_client::dataset::Odometry2dRow;
///
/// // A quarter turn to the left on an arc of 1 m radius ends 1 m ahead and 1 m to the left.
/// let arc = Odometry2dRow {
///     stamp_ns: 100_000_000,
///     dtheta_rad: 90_f64.to_radians(),
///     translation_m: [1.0, 1.0],
/// };
/// let chord_m = arc.translation_m[0].hypot(arc.translation_m[1]);
/// assert!((chord_m - 2.0 * (arc.dtheta_rad / 2.0).sin()).abs() < 1e-15);
/// ```
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
///
/// ```
/// use inekf_client::dataset::Odometry3dRow;
/// use nalgebra::{UnitQuaternion, Vector3};
///
/// // A turn to the left is one about the body's z axis, upwards.
/// let row = Odometry3dRow { stamp_ns: 0, rotation_rad: [0.0, 0.0, 0.1], translation_m: [1.0, 0.0, 0.0] };
/// let turned = UnitQuaternion::from_scaled_axis(Vector3::from(row.rotation_rad)) * Vector3::x();
/// assert!(turned.y > 0.0);
/// ```
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
///
/// ```
/// use inekf_client::dataset::PositionRow;
/// use inekf_client::feed::Numbering;
///
/// let fix = PositionRow {
///     stamp_ns: 0,
///     source: 0,
///     dimension: 3,
///     position_w_m: [10.0, 20.0, 1.0],
///     sigma_m: [2.0, 2.0, 3.0],
/// };
/// // On the wire it is a covariance: squares, m^2.
/// let message = Numbering::new(1).position(&fix, 0);
/// assert_eq!(message.covariance_w_m2, [4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0]);
/// ```
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
///
/// ```
/// use inekf_client::dataset::{Event, VelocityRow};
///
/// let row = VelocityRow {
///     stamp_ns: 30,
///     source: 1,
///     velocity_w_mps: [0.0, 3.0, 0.0], // northwards, whatever the attitude
///     sigma_mps: [0.1; 3],
/// };
/// assert!(!Event::Velocity(row).is_motion());
/// ```
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
///
/// ```
/// use inekf_client::dataset::HeadingRow;
///
/// // A compass counts clockwise from north: 30 degrees of it are 60 degrees from east.
/// let compass_deg = 30.0_f64;
/// let row = HeadingRow {
///     stamp_ns: 0,
///     source: 0,
///     heading_rad: (90.0 - compass_deg).to_radians(),
///     sigma_rad: 2_f64.to_radians(),
/// };
/// assert!((row.heading_rad.to_degrees() - 60.0).abs() < 1e-12);
/// ```
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
///
/// ```
/// use inekf_client::dataset::Truth;
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions { duration_s: 0.1, ..SimulationOptions::default() }.noise_free();
/// let Truth::Spatial(truth) = simulate(Scenario::RoadCircuit, &options)?.truth else { unreachable!() };
/// // Without noise there is none either.
/// assert_eq!(truth[0].bias, Some(Default::default()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuBias {
    /// Gyro bias, rad/s, body frame.
    pub gyro_rps: [f64; 3],
    /// Accelerometer bias, m/s^2, body frame.
    pub accel_mps2: [f64; 3],
}

/// The truth in space at one time.
///
/// ```
/// use inekf_client::dataset::{Truth, TruthRow};
/// use inekf_client::evaluate::Trajectory;
///
/// let row = TruthRow {
///     stamp_ns: 0,
///     q_wb: [0.0, 0.0, 1.0, 1.0], // not of length one: x, y, z, w as a file had them
///     v_w_mps: [0.0; 3],
///     p_w_m: [0.0; 3],
///     bias: None,
/// };
/// let pose = Trajectory::from_truth(&Truth::Spatial(vec![row])).poses()[0];
/// assert!((pose.heading_rad().to_degrees() - 90.0).abs() < 1e-12);
/// ```
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
///
/// ```
/// use inekf_client::dataset::{Truth, Truth2dRow, read_truth, save_truth};
///
/// let truth = Truth::Planar(vec![Truth2dRow { stamp_ns: 5, theta_rad: 0.1, p_w_m: [0.3, -0.1] }]);
/// let folder = tempfile::tempdir()?;
/// save_truth(folder.path(), &truth)?;
/// // No bit is lost on the way through the file.
/// assert_eq!(read_truth(folder.path().join("truth.csv"))?, truth);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth2dRow {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Heading, rad, counter-clockwise from the world x axis.
    pub theta_rad: f64,
    /// Position, m.
    pub p_w_m: [f64; 2],
}
