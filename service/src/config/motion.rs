//! What moves the estimate between measurements: an IMU or odometry, and everything that only one of them has.

use super::choice::{Discretisation, Estimator, Hold, Model};
use super::imu::Imu;
use super::interval::Interval;
use super::noise::{self, InertialNoise, OdometryNoise};
use super::odometry::Rows;
use super::section::Section;
use super::sources::{HeadingSource, VelocitySource};
use super::zero_velocity::ZeroVelocity;

/// Why a key of inertial navigation is refused.
pub(super) const ONLY_IMU: &str = "only for model \"imu\": remove it";
/// Why a key of odometry is refused.
pub(super) const ONLY_ODOMETRY: &str =
    "only for models \"odometry3d\" and \"odometry2d\": remove it";

/// The sensor of motion.
///
/// ```
#[doc = include_str!("example.txt")]
/// assert!(matches!(read(IMU.to_owned())?.motion, Motion::Inertial(_)));
/// assert!(matches!(read(ODOMETRY.to_owned())?.motion, Motion::Odometry(_)));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// An IMU: [`Model::Imu`].
    Inertial(Inertial),
    /// Increments of odometry: [`Model::Odometry3d`], [`Model::Odometry2d`].
    Odometry(Odometry),
}

/// Inertial navigation.
///
/// ```
#[doc = include_str!("example.txt")]
/// let inertial = inertial(format!("gravity_mps2 = 9.81\n{IMU}[[velocity_source]]\nid = 0\n"))?;
/// assert_eq!((inertial.gravity_mps2, inertial.velocity_sources.len()), (9.81, 1));
/// assert!(inertial.biases && inertial.zero_velocity.is_none());
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Whether the IMU's biases are part of the state: 15 error states with them, 9 without.
    pub biases: bool,
    /// How the motion is stepped over one sample.
    pub discretisation: Discretisation,
    /// Which interval an IMU sample speaks for.
    pub hold: Hold,
    /// Gravity, m/s^2, pointing down: `g_w = (0, 0, -gravity_mps2)`.
    pub gravity_mps2: f64,
    /// Checks on the IMU's samples.
    pub imu: Imu,
    /// Process noise.
    pub noise: InertialNoise,
    /// The sensors of velocity, each with its own id.
    pub velocity_sources: Vec<VelocitySource>,
    /// The sensors of heading, each with its own id.
    pub heading_sources: Vec<HeadingSource>,
    /// Zero-velocity detection, if it is wanted.
    pub zero_velocity: Option<ZeroVelocity>,
}

/// Motion by odometry.
///
/// ```
#[doc = include_str!("example.txt")]
/// let odometry = odometry(format!("{ODOMETRY}[odometry]\nmax_gap_s = 0.5\n"))?;
/// assert_eq!(odometry.rows.max_gap_s, 0.5);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Odometry {
    /// Checks on the rows.
    pub rows: Rows,
    /// Process noise.
    pub noise: OdometryNoise,
}

/// The keys at the top of the file that only inertial navigation has.
#[derive(Clone, Copy, Debug)]
pub(super) struct InertialTop {
    pub(super) biases: bool,
    discretisation: Discretisation,
    hold: Hold,
    gravity_mps2: f64,
}

/// The tables of both kinds of motion.
#[derive(Clone, Debug)]
pub(super) struct Tables {
    imu: Imu,
    rows: Rows,
    noise: (InertialNoise, OdometryNoise),
}

impl InertialTop {
    pub(super) fn read(root: &mut Section<'_, '_>, model: Option<Model>) -> Self {
        let top = Self {
            biases: root.boolean("biases", true),
            discretisation: root.choice("discretisation", Discretisation::Zoh),
            hold: root.choice("hold", Hold::Backward),
            gravity_mps2: root.float(
                "gravity_mps2",
                "m/s^2",
                Interval::closed(0.0, 30.0),
                9.80665,
            ),
        };
        if model.is_some_and(Model::is_odometry) {
            let keys = ["biases", "discretisation", "hold", "gravity_mps2"];
            root.refuse_all(&keys, ONLY_IMU);
        }
        top
    }
}

impl Tables {
    pub(super) fn read(root: &mut Section<'_, '_>, model: Option<Model>) -> Self {
        let is_odometry = model.map(Model::is_odometry);
        Self {
            imu: root.section("imu", |imu| {
                if is_odometry == Some(true) {
                    imu.refuse_whole(ONLY_IMU);
                }
                Imu::read(imu)
            }),
            rows: root.section("odometry", |odometry| {
                if is_odometry == Some(false) {
                    odometry.refuse_whole(ONLY_ODOMETRY);
                }
                Rows::read(odometry)
            }),
            noise: root.required_section("noise", |noise| noise::read(noise, model)),
        }
    }
}

impl Motion {
    /// Puts together what belongs to `model`, and refuses the sensors that it has no use for.
    pub(super) fn read(
        root: &mut Section<'_, '_>,
        model: Option<Model>,
        estimator: Option<Estimator>,
        top: InertialTop,
        tables: Tables,
    ) -> Self {
        if model.is_some_and(Model::is_odometry) {
            root.refuse_unread(
                &["velocity_source", "heading_source", "zero_velocity"],
                ONLY_IMU,
            );
            return Self::Odometry(Odometry {
                rows: tables.rows,
                noise: tables.noise.1,
            });
        }
        let noise = tables.noise.0;
        let velocity_sources = VelocitySource::read_all(root);
        let heading_sources = HeadingSource::read_all(root);
        let zero_velocity = ZeroVelocity::read_if_given(root, estimator);
        Self::Inertial(Inertial {
            velocity_sources,
            heading_sources,
            zero_velocity,
            ..Inertial::new(top, tables.imu, noise)
        })
    }
}

impl Inertial {
    /// Without velocity and heading sources.
    fn new(top: InertialTop, imu: Imu, noise: InertialNoise) -> Self {
        Self {
            biases: top.biases,
            discretisation: top.discretisation,
            hold: top.hold,
            gravity_mps2: top.gravity_mps2,
            imu,
            noise,
            velocity_sources: Vec::new(),
            heading_sources: Vec::new(),
            zero_velocity: None,
        }
    }
}

impl Default for Inertial {
    /// The defaults, without sources, and with no noise: of that there is no default.
    fn default() -> Self {
        let top = Section::defaults(|root| InertialTop::read(root, Some(Model::Imu)));
        let (noise, _) = Section::defaults(|noise| noise::read(noise, None));
        Self::new(top, Imu::default(), noise)
    }
}

impl Model {
    /// Whether the motion comes from increments of odometry.
    pub(super) const fn is_odometry(self) -> bool {
        matches!(self, Self::Odometry3d | Self::Odometry2d)
    }
}
