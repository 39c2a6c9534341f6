//! Fixes of any aiding sensor, in the one order in which they are fused.

use core::fmt::Debug;

#[cfg(doc)]
use inekf_shared::message::ZERO_VELOCITY_SOURCE;
use inekf_shared::message::{INPUT_HEADING, INPUT_POSITION, INPUT_VELOCITY};
use nalgebra::{Matrix3, Vector3};

/// Every so many fixes of a sender the covariance is looked at: far more often than it takes to become indefinite, and
/// too seldom to be noticed in the time of an update.
const MENDED_EVERY: u64 = 16;

/// What a fix measures. The order breaks ties between equal stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FixKind {
    /// Position of an antenna.
    Position = 0,
    /// Velocity over ground.
    Velocity = 1,
    /// Heading.
    Heading = 2,
    /// A velocity of zero that the engine proposes itself.
    Standstill = 3,
}

impl FixKind {
    /// Number of kinds that have sources: all but what the engine makes itself.
    pub const COUNT: usize = 3;

    /// The `INPUT_*` index of its topic; a standstill is a velocity.
    pub const fn input(self) -> usize {
        match self {
            Self::Position => INPUT_POSITION,
            Self::Velocity | Self::Standstill => INPUT_VELOCITY,
            Self::Heading => INPUT_HEADING,
        }
    }
}

/// The measured values of a model's fixes, with the settings of their source already applied.
pub trait Measurement: Copy + Debug {
    /// What it is.
    fn kind(&self) -> FixKind;

    /// Dimension.
    fn dimension(&self) -> usize;

    /// The position of an antenna, if that is what it is.
    fn antenna(&self) -> Option<Antenna>;

    /// This and a later one as a single measurement, if the model can take them together.
    fn paired_with(&self, later: &Self) -> Option<Self>;
}

/// A measured position of an antenna; z is 0 in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Antenna {
    /// Position, m, world frame.
    pub position_w: Vector3<f64>,
    /// Its covariance, m^2.
    pub covariance_w: Matrix3<f64>,
    /// From the body's origin to the antenna, m, body frame.
    pub lever_arm_b: Vector3<f64>,
}

/// A checked measurement with its time and source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix<Z> {
    /// Time of the measurement, nanoseconds of the sensor clock.
    pub stamp_ns: u64,
    /// Id of the source, below `MAX_SOURCES`; [`ZERO_VELOCITY_SOURCE`] if there is none.
    pub source: u32,
    /// The source that was stacked with it, if one was.
    pub partner: Option<u32>,
    /// `seq` of the message.
    pub seq: u64,
    /// What was measured.
    pub measurement: Z,
}

impl<Z: Measurement> Fix<Z> {
    /// What it measures.
    pub fn kind(&self) -> FixKind {
        self.measurement.kind()
    }

    /// Its source, and that of the one that was stacked with it.
    pub fn sources(&self) -> impl Iterator<Item = u32> {
        [Some(self.source), self.partner].into_iter().flatten()
    }

    /// Messages that it is made of: none, if the engine has made it.
    pub fn count(&self) -> u64 {
        match self.kind() {
            FixKind::Standstill => 0,
            _ => 1 + u64::from(self.partner.is_some()),
        }
    }

    /// Whether the covariance is looked at after this one, and mended if rounding has made it indefinite. Chosen by the
    /// fix's own number, so that a replay does the same.
    pub fn is_mended(&self) -> bool {
        self.seq.is_multiple_of(MENDED_EVERY)
    }

    /// What orders fixes: time, kind, source, number. A log therefore gives the same estimates
    /// whatever the order in which its topics happened to arrive.
    pub fn order(&self) -> (u64, FixKind, u32, u64) {
        (self.stamp_ns, self.kind(), self.source, self.seq)
    }
}
