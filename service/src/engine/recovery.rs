//! The way out of a lock-out: a belief so sure of itself that it gates every fix of a source.
//!
//! One fix is then let in against a wider covariance. What the fix measures is doubted by as much
//! as the fix contradicts it; everything else only by a little more each time. Widening all of it
//! alike would let a jump of the position turn the attitude over through their correlation.

use inekf::filter::{Belief, Correction, Covariance, Side, UpdateError, UpdateOptions};
use inekf::model::{InertialState, Observation};

use super::fix::{Fix, Measurement};

/// Most that the whole covariance is scaled by: twice the standard deviations.
const MAX_SCALE: f64 = 4.0;
/// Most variance that is added, as a multiple of the fix's own: with more, the update that takes
/// nearly all of it away again would leave rounding errors of the size of what remains.
const MAX_RATIO: f64 = 1e8;

/// How a covariance is widened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widening {
    /// Factor on all of it.
    pub scale: f64,
    /// Variance added in every direction that the fix measures, in the square of its unit.
    pub variance: f64,
}

impl Widening {
    /// The widening that brings `fix`, whose normalised innovation squared is `nis`, within what
    /// `mean` may be expected to be wrong by.
    pub fn new<G: InertialState<D>, const D: usize>(fix: &Fix, mean: &G, nis: f64) -> Self {
        let (squared, noise) = match &fix.measurement {
            Measurement::Position(observation) => (
                observation.residual(mean).norm_squared(),
                observation.covariance_w.trace(),
            ),
            Measurement::Velocity(observation) => (
                observation.residual(mean).norm_squared(),
                observation.covariance_w.trace(),
            ),
            Measurement::Heading(observation) => (
                observation.residual(mean).norm_squared(),
                observation.sigma * observation.sigma,
            ),
        };
        let dimension = fix.dimension() as f64;
        Self {
            scale: (nis / dimension).clamp(1.0, MAX_SCALE),
            variance: squared.min(MAX_RATIO * noise) / dimension,
        }
    }

    /// Fuses `fix` into the widened belief. On failure the belief keeps its covariance.
    ///
    /// # Errors
    /// As [`Fix::fuse`].
    pub fn fuse<G: InertialState<D>, S: Side, const D: usize>(
        &self,
        fix: &Fix,
        belief: &mut Belief<G, S, D>,
        options: &UpdateOptions,
    ) -> Result<Correction<D>, UpdateError> {
        let mut wide = self.widened(fix, belief);
        let correction = fix.fuse(&mut wide, options)?;
        *belief = wide;
        Ok(correction)
    }

    fn widened<G: InertialState<D>, S: Side, const D: usize>(
        &self,
        fix: &Fix,
        belief: &Belief<G, S, D>,
    ) -> Belief<G, S, D> {
        let mut p = *belief.left_covariance().scaled(self.scale).matrix();
        let mut doubt = |first: usize| {
            for axis in first..first + 3 {
                p[(axis, axis)] += self.variance;
            }
        };
        match fix.measurement {
            Measurement::Velocity(_) => doubt(3),
            Measurement::Position(_) => doubt(6),
            Measurement::Heading(_) => {
                // A turn about the vertical, in body coordinates.
                let to_body = belief.mean.pose().rotation.matrix().transpose();
                let up_b = to_body.column(2).into_owned();
                let mut attitude = p.fixed_view_mut::<3, 3>(0, 0);
                attitude += up_b * up_b.transpose() * self.variance;
            }
        }
        Belief::from_left_covariance(belief.mean, Covariance::from_upper(p))
    }
}
