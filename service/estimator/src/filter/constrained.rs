//! The linearly constrained rule, \[LC\] (22): LC-InEKF on the left or right, LC-EKF on the additive error.
//!
//! The columns are `(Delta, T) = (H d, d)` for each process mismatch, with d the direction accumulated since
//! the last update, and `(dh, 0)` for each output mismatch, at the iterate.

use nalgebra::{SMatrix, SVector};

use super::belief::Belief;
use super::constraint::Constraints;
use super::covariance::Covariance;
use super::gain::{GainRule, Judgement};
use super::linearised::Linearised;
use super::side::{Left, Side};
use super::update::UpdateError;
use crate::model::process::MAX_PROCESS_MISMATCHES;
use crate::model::{
    Columns, Declared, MeanMismatch, Observation, OutputMismatch, Points, Pose, ProcessColumns,
};

/// The gain that the declared mismatches do not reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constrained<'a, const D: usize, const K: usize, const N: usize, const M: usize> {
    process: [(SVector<f64, D>, f64); MAX_PROCESS_MISMATCHES],
    process_count: usize,
    outputs: &'a [Declared<OutputMismatch>],
    points: &'a Points<K, N, M>,
}

impl<'a, const D: usize, const K: usize, const N: usize, const M: usize>
    Constrained<'a, D, K, N, M>
{
    /// The rule for an update of `belief` with `points`, after the motion of `process`.
    pub fn new<G: Pose<D, N>, S: Side>(
        belief: &Belief<G, S, D>,
        process: &ProcessColumns<D, impl MeanMismatch>,
        outputs: &'a [Declared<OutputMismatch>],
        points: &'a Points<K, N, M>,
    ) -> Self {
        let mut rule = Self {
            process: [(SVector::zeros(), 0.0); MAX_PROCESS_MISMATCHES],
            process_count: 0,
            outputs,
            points,
        };
        for (declared, direction) in process.active() {
            let direction = if S::IS_LEFT {
                direction
            } else {
                S::from_left(&belief.mean) * direction
            };
            rule.process[rule.process_count] = (direction, declared.sigma);
            rule.process_count += 1;
        }
        rule
    }

    /// Whether the declared mismatches can be constrained with the sources of `points` at all, and how many
    /// dimensions of the measurement that takes: tried at a pose in general position. For use at start-up, with
    /// [`ProcessColumns::in_general_motion`]; accidents on the way are refused by the update itself.
    ///
    /// # Errors
    /// [`UpdateError::NoSuchSource`], [`UpdateError::UnsolvableConstraints`] or
    /// [`UpdateError::TooManyConstraints`].
    pub fn check<G: Pose<D, N>>(
        process: &ProcessColumns<D, impl MeanMismatch>,
        outputs: &'a [Declared<OutputMismatch>],
        points: &'a Points<K, N, M>,
    ) -> Result<usize, UpdateError> {
        for output in outputs {
            let source = output.mismatch.source();
            if source >= K {
                return Err(UpdateError::NoSuchSource { source, sources: K });
            }
        }
        // No coordinate vanishes, no two directions agree.
        let chi = G::exp(&SVector::from_fn(|i, _| 0.3 + 0.7 * (i as f64 * i as f64)));
        let belief = Belief::<G, Left, D>::new(chi, Covariance::from_variances(&SVector::zeros()));
        let rule = Self::new(&belief, process, outputs, points);
        rule.assembled(&chi, &points.left_jacobian(&chi))?.rank()
    }

    /// The columns of `L Delta = T` at the iterate.
    ///
    /// # Errors
    /// [`UpdateError::TooManyConstraints`].
    pub fn constraints<G: Pose<D, N>>(
        &self,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Constraints<D, M>, UpdateError> {
        self.assembled(&linearised.chi, &linearised.h)
    }

    fn assembled<G: Pose<D, N>>(
        &self,
        chi: &G,
        h: &SMatrix<f64, M, D>,
    ) -> Result<Constraints<D, M>, UpdateError> {
        let mut constraints = Constraints::default();
        for (direction, sigma) in &self.process[..self.process_count] {
            let t = Columns::one(*direction);
            constraints.push(&t.map(|t| h * t), &t, *sigma)?;
        }
        for output in self.outputs {
            let delta = output.mismatch.columns(self.points, chi);
            constraints.push(&delta, &delta.map(|_| SVector::zeros()), output.sigma)?;
        }
        Ok(constraints)
    }
}

impl<G: Pose<D, N>, const D: usize, const K: usize, const N: usize, const M: usize>
    GainRule<G, D, M> for Constrained<'_, D, K, N, M>
{
    fn judge(&self, linearised: &Linearised<G, D, M>) -> Result<Judgement, UpdateError> {
        self.constraints(linearised)?.judge(linearised)
    }

    fn gain(
        &self,
        _prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        self.constraints(linearised)?.gain(linearised)
    }

    fn covariance(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Covariance<D>, UpdateError> {
        let constraints = self.constraints(linearised)?;
        let gain = constraints.gain(linearised)?;
        Ok(constraints.covariance(prior, linearised, &gain))
    }
}
