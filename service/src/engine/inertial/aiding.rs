//! What corrects an inertial state: position, velocity, heading.

use inekf::filter::{Belief, Covariance, Side, UpdateError, UpdateOptions, update};
use inekf::model::{
    HeadingObservation, InertialState, Observation, PositionObservation, VelocityObservation,
};

use inekf::smoother;

use super::super::fix::{Antenna, FixKind, Measurement};
use super::super::model::Fused;
use super::super::recovery::Widening;

/// The measured values, with the lever arm and scale of their source already applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aiding {
    /// Position of an antenna.
    Position(PositionObservation),
    /// Velocity over ground.
    Velocity(VelocityObservation),
    /// Heading.
    Heading(HeadingObservation),
    /// The engine's own guess that the vehicle stands.
    Standstill(VelocityObservation),
}

impl Measurement for Aiding {
    fn kind(&self) -> FixKind {
        match self {
            Self::Position(_) => FixKind::Position,
            Self::Velocity(_) => FixKind::Velocity,
            Self::Heading(_) => FixKind::Heading,
            Self::Standstill(_) => FixKind::Standstill,
        }
    }

    fn dimension(&self) -> usize {
        match self {
            Self::Position(_) | Self::Velocity(_) | Self::Standstill(_) => 3,
            Self::Heading(_) => 1,
        }
    }

    fn antenna(&self) -> Option<Antenna> {
        match self {
            Self::Position(observation) => Some(Antenna {
                position_w: observation.position_w,
                covariance_w: observation.covariance_w,
                lever_arm_b: observation.lever_arm_b,
            }),
            Self::Velocity(_) | Self::Heading(_) | Self::Standstill(_) => None,
        }
    }

    fn paired_with(&self, _later: &Self) -> Option<Self> {
        None
    }
}

impl Aiding {
    /// The same for the window of a smoother.
    pub fn for_window(&self) -> smoother::Fix {
        match self {
            Self::Position(observation) => (*observation).into(),
            Self::Velocity(observation) | Self::Standstill(observation) => (*observation).into(),
            Self::Heading(observation) => (*observation).into(),
        }
    }

    /// Corrects `belief`.
    ///
    /// # Errors
    /// As [`update()`]; the belief is then unchanged.
    pub fn fuse<G: InertialState<D>, S: Side, const D: usize>(
        &self,
        belief: &mut Belief<G, S, D>,
        options: &UpdateOptions,
    ) -> Result<Fused, UpdateError> {
        let correction = match self {
            Self::Position(observation) => update(belief, observation, options),
            Self::Velocity(observation) | Self::Standstill(observation) => {
                update(belief, observation, options)
            }
            Self::Heading(observation) => update(belief, observation, options),
        }?;
        Ok(Fused {
            verdict: correction.verdict,
            nis: correction.nis,
        })
    }

    /// The widening that brings this, whose normalised innovation squared is `nis`, within what `mean` may be
    /// expected to be wrong by.
    pub fn widening<G: InertialState<D>, const D: usize>(&self, mean: &G, nis: f64) -> Widening {
        let (squared, noise) = match self {
            Self::Position(observation) => (
                observation.residual(mean).norm_squared(),
                observation.covariance_w.trace(),
            ),
            Self::Velocity(observation) | Self::Standstill(observation) => (
                observation.residual(mean).norm_squared(),
                observation.covariance_w.trace(),
            ),
            Self::Heading(observation) => (
                observation.residual(mean).norm_squared(),
                observation.sigma * observation.sigma,
            ),
        };
        Widening::new(squared, noise, self.dimension(), nis)
    }

    /// `belief`, doubted where this measures.
    pub fn widened<G: InertialState<D>, S: Side, const D: usize>(
        &self,
        belief: &Belief<G, S, D>,
        widening: &Widening,
    ) -> Belief<G, S, D> {
        let mut p = *belief.left_covariance().scaled(widening.scale).matrix();
        let mut doubt = |first: usize| {
            for axis in first..first + 3 {
                p[(axis, axis)] += widening.variance;
            }
        };
        match self {
            Self::Velocity(_) | Self::Standstill(_) => doubt(3),
            Self::Position(_) => doubt(6),
            Self::Heading(_) => {
                // A turn about the vertical, in body coordinates.
                let to_body = belief.mean.pose().rotation.matrix().transpose();
                let up_b = to_body.column(2).into_owned();
                let mut attitude = p.fixed_view_mut::<3, 3>(0, 0);
                attitude += up_b * up_b.transpose() * widening.variance;
            }
        }
        Belief::from_left_covariance(belief.mean, Covariance::from_upper(p))
    }
}
