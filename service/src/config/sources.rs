//! `[[position_source]]`, `[[velocity_source]]`, `[[heading_source]]`: which aiding sensors are known.
//!
//! A kind that the file does not mention has one source, id 0, with the defaults; `velocity_source = []` before the
//! first table says that there is none. Fixes from an unknown source are rejected and counted.

use inekf_shared::message::MAX_SOURCES;

use super::choice::Model;
use super::interval::Interval;
use super::motion::ONLY_ODOMETRY;
use super::section::Section;

/// A sensor of position fixes, such as a GNSS receiver.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("{IMU}[[position_source]]\nid = 1\nlever_arm_m = [0.8, -0.3, 1.2]\n");
/// let source = &read(text)?.position_sources[0];
/// assert_eq!((source.id, source.lever_arm_m, source.sigma_scale), (1, [0.8, -0.3, 1.2], 1.0));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PositionSource {
    /// The id its fixes carry.
    pub id: u32,
    /// From the origin of the body (the IMU, with one) to the antenna, body FLU, m; z means nothing in the plane.
    pub lever_arm_m: [f64; 3],
    /// Multiplies the standard deviations of its fixes.
    pub sigma_scale: f64,
    /// The scale error eps that it is assumed to have: it sees `(1 + eps) x + R b`. Zero with an IMU.
    pub scale_error: f64,
}

/// A sensor of velocity in the world.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("{IMU}[[velocity_source]]\nid = 0\nsigma_scale = 2.0\n");
/// assert_eq!(inertial(text)?.velocity_sources[0].sigma_scale, 2.0);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct VelocitySource {
    /// The id its fixes carry.
    pub id: u32,
    /// Multiplies the standard deviations of its fixes.
    pub sigma_scale: f64,
}

/// A sensor of heading.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("{IMU}[[heading_source]]\nid = 7\n");
/// assert_eq!(inertial(text)?.heading_sources[0].id, 7);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct HeadingSource {
    /// The id its fixes carry.
    pub id: u32,
    /// Multiplies the standard deviations of its fixes.
    pub sigma_scale: f64,
}

impl PositionSource {
    /// Reads the tables for `model`, None if it is not known.
    pub(super) fn read_all(root: &mut Section<'_, '_>, model: Option<Model>) -> Vec<Self> {
        root.sources(
            "position_source",
            MAX_SOURCES,
            |source| Self::read(source, model),
            |source| source.id,
        )
    }

    fn read(source: &mut Section<'_, '_>, model: Option<Model>) -> Self {
        let arm = Interval::closed(-1000.0, 1000.0);
        let arm_lengths: &[usize] = match model {
            Some(Model::Imu | Model::Odometry3d) => &[3],
            Some(Model::Odometry2d) | None => &[2, 3],
        };
        let read = Self {
            id: id(source),
            lever_arm_m: source.place("lever_arm_m", "m", arm, arm_lengths),
            sigma_scale: sigma_scale(source),
            scale_error: source.ratio("scale_error", Interval::closed(-0.9, 10.0), 0.0),
        };
        if model == Some(Model::Imu) {
            source.refuse("scale_error", ONLY_ODOMETRY);
        }
        read
    }
}

impl VelocitySource {
    pub(super) fn read_all(root: &mut Section<'_, '_>) -> Vec<Self> {
        root.sources("velocity_source", MAX_SOURCES, Self::read, |source| {
            source.id
        })
    }

    fn read(source: &mut Section<'_, '_>) -> Self {
        Self {
            id: id(source),
            sigma_scale: sigma_scale(source),
        }
    }
}

impl HeadingSource {
    pub(super) fn read_all(root: &mut Section<'_, '_>) -> Vec<Self> {
        root.sources("heading_source", MAX_SOURCES, Self::read, |source| {
            source.id
        })
    }

    fn read(source: &mut Section<'_, '_>) -> Self {
        Self {
            id: id(source),
            sigma_scale: sigma_scale(source),
        }
    }
}

impl Default for PositionSource {
    fn default() -> Self {
        Section::defaults(|source| Self::read(source, None))
    }
}

impl Default for VelocitySource {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}

impl Default for HeadingSource {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}

fn id(source: &mut Section<'_, '_>) -> u32 {
    source.integer("id", None, 0..=MAX_SOURCES as u32 - 1, 0)
}

fn sigma_scale(source: &mut Section<'_, '_>) -> f64 {
    source.ratio("sigma_scale", Interval::above(0.0, 1000.0), 1.0)
}
