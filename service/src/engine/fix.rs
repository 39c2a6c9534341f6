//! Fixes of any aiding sensor, in the one order in which they are fused.

use inekf::filter::{Belief, Correction, Side, UpdateError, UpdateOptions, update};
use inekf::model::{HeadingObservation, InertialState, PositionObservation, VelocityObservation};
use nalgebra::{Matrix3, Vector3};

/// What a fix measures. The order breaks ties between equal stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FixKind {
    /// Position of an antenna.
    Position = 0,
    /// Velocity over ground.
    Velocity = 1,
    /// Heading.
    Heading = 2,
}

impl FixKind {
    /// Number of kinds.
    pub const COUNT: usize = 3;
}

/// The measured values, with the lever arm and scale of their source already applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measurement {
    /// Position of an antenna.
    Position(PositionObservation),
    /// Velocity over ground.
    Velocity(VelocityObservation),
    /// Heading.
    Heading(HeadingObservation),
}

/// A checked measurement with its time and source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Time of the measurement, nanoseconds of the sensor clock.
    pub stamp_ns: u64,
    /// Id of the source, below `MAX_SOURCES`.
    pub source: u32,
    /// `seq` of the message.
    pub seq: u64,
    /// What was measured.
    pub measurement: Measurement,
}

impl Fix {
    /// What it measures.
    pub fn kind(&self) -> FixKind {
        match self.measurement {
            Measurement::Position(_) => FixKind::Position,
            Measurement::Velocity(_) => FixKind::Velocity,
            Measurement::Heading(_) => FixKind::Heading,
        }
    }

    /// Dimension of the measurement.
    pub fn dimension(&self) -> usize {
        match self.measurement {
            Measurement::Position(_) | Measurement::Velocity(_) => 3,
            Measurement::Heading(_) => 1,
        }
    }

    /// What orders fixes: time, kind, source, number. A log therefore gives the same estimates
    /// whatever the order in which its topics happened to arrive.
    pub fn order(&self) -> (u64, FixKind, u32, u64) {
        (self.stamp_ns, self.kind(), self.source, self.seq)
    }

    /// Corrects `belief` with the fix.
    ///
    /// # Errors
    /// As [`update()`]; the belief is then unchanged.
    pub fn fuse<G: InertialState<D>, S: Side, const D: usize>(
        &self,
        belief: &mut Belief<G, S, D>,
        options: &UpdateOptions,
    ) -> Result<Correction<D>, UpdateError> {
        match &self.measurement {
            Measurement::Position(observation) => update(belief, observation, options),
            Measurement::Velocity(observation) => update(belief, observation, options),
            Measurement::Heading(observation) => update(belief, observation, options),
        }
    }
}

/// A position fix as the first belief needs it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstPosition {
    /// Time of the fix, nanoseconds of the sensor clock.
    pub stamp_ns: u64,
    /// Position of the antenna, m, world frame.
    pub position_w: Vector3<f64>,
    /// Its covariance, m^2.
    pub covariance_w: Matrix3<f64>,
    /// From the IMU to the antenna, m, body frame.
    pub lever_arm_b: Vector3<f64>,
}

impl FirstPosition {
    /// The position of `fix`, if it is one.
    pub fn of(fix: &Fix) -> Option<Self> {
        match fix.measurement {
            Measurement::Position(observation) => Some(Self {
                stamp_ns: fix.stamp_ns,
                position_w: observation.position_w,
                covariance_w: observation.covariance_w,
                lever_arm_b: observation.lever_arm_b,
            }),
            Measurement::Velocity(_) | Measurement::Heading(_) => None,
        }
    }
}
