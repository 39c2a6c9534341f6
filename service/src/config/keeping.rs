//! `[checkpoint]`, `[journal]`: what outlives the daemon.

use super::choice::Model;
use super::interval::Interval;
use super::motion::{ONLY_IMU, ONLY_ODOMETRY};
use super::operation::nanoseconds;
use super::section::Section;

/// The newest state on disk, for the next start.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("{IMU}[checkpoint]\npath = '/var/lib/inekf/{{instance}}.checkpoint'\n");
/// let checkpoint = read(text)?.checkpoint;
/// assert_eq!((checkpoint.period_s, checkpoint.max_age_s), (1.0, 10.0));
/// // Without a file there are none.
/// assert_eq!(read(IMU.to_owned())?.checkpoint.path, None);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The file; without one there are no checkpoints.
    pub path: Option<String>,
    /// Time between two checkpoints, s.
    pub period_s: f64,
    /// An older one is not continued, s of sensor time.
    pub max_age_s: f64,
    /// Doubt about the mean angular rate in the time between, each axis, rad/s.
    pub turn_sigma_rps: f64,
    /// Doubt about the mean acceleration in the time between, each axis, m/s^2; with an IMU.
    pub accel_sigma_mps2: f64,
    /// Doubt about the mean velocity in the time between, each axis, m/s; with odometry.
    pub speed_sigma_mps: f64,
}

/// What the daemon publishes about its inputs.
///
/// ```
#[doc = include_str!("example.txt")]
/// assert!(!read(IMU.to_owned())?.journal.publish);
/// assert!(read(format!("{IMU}[journal]\npublish = true\n"))?.journal.publish);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Journal {
    /// Whether everything that the engine takes is published in its order, to be recorded.
    pub publish: bool,
}

impl Checkpoint {
    pub(super) fn read(checkpoint: &mut Section<'_, '_>, model: Option<Model>) -> Self {
        let read = Self {
            path: checkpoint.optional_text("path", "the name of a file"),
            period_s: checkpoint.float("period_s", "s", Interval::closed(0.01, 3600.0), 1.0),
            max_age_s: checkpoint.float("max_age_s", "s", Interval::above(0.0, 3600.0), 10.0),
            turn_sigma_rps: checkpoint.float(
                "turn_sigma_rps",
                "rad/s",
                Interval::closed(0.0, 10.0),
                0.2,
            ),
            accel_sigma_mps2: checkpoint.float(
                "accel_sigma_mps2",
                "m/s^2",
                Interval::closed(0.0, 1000.0),
                2.0,
            ),
            speed_sigma_mps: checkpoint.float(
                "speed_sigma_mps",
                "m/s",
                Interval::closed(0.0, 1000.0),
                2.0,
            ),
        };
        match model.map(Model::is_odometry) {
            Some(true) => checkpoint.refuse("accel_sigma_mps2", ONLY_IMU),
            Some(false) => checkpoint.refuse("speed_sigma_mps", ONLY_ODOMETRY),
            None => {}
        }
        read
    }

    /// [`period_s`](Self::period_s) in nanoseconds.
    pub(crate) fn period_ns(&self) -> u64 {
        nanoseconds(self.period_s)
    }

    /// [`max_age_s`](Self::max_age_s) in nanoseconds of sensor time.
    pub(crate) fn max_age_ns(&self) -> u64 {
        nanoseconds(self.max_age_s)
    }
}

impl Journal {
    pub(super) fn read(journal: &mut Section<'_, '_>) -> Self {
        Self {
            publish: journal.boolean("publish", false),
        }
    }
}

impl Default for Checkpoint {
    fn default() -> Self {
        Section::defaults(|checkpoint| Self::read(checkpoint, None))
    }
}

impl Default for Journal {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}
