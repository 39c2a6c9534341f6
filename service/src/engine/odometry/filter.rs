//! What every filter on a pose offers to the model: motion, fixes, and what it has to say.

use core::fmt::Debug;

use inekf::filter::{Belief, Left, UpdateError, UpdateOptions};
use inekf::model::{OdometryStep, Points};
use inekf_shared::message::{MAX_MISMATCHES, NO_MODE, StateVector};
use nalgebra::SMatrix;

use super::super::model::Fused;
use super::super::recovery::Widening;

/// What a filter says beside the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Bit i: the last update allowed for mismatch i.
    pub active: u32,
    /// The likeliest mode of a bank.
    pub mode: u32,
    /// The estimated parameters of the mismatches; NaN where none is.
    pub parameters: [f64; MAX_MISMATCHES],
    /// Their standard deviations.
    pub sigmas: [f64; MAX_MISMATCHES],
}

impl Report {
    /// Nothing to say.
    pub const NOTHING: Self = Self {
        active: 0,
        mode: NO_MODE,
        parameters: [f64::NAN; MAX_MISMATCHES],
        sigmas: [f64::NAN; MAX_MISMATCHES],
    };
}

/// A filter on the pose G of dimension D, in N dimensions.
pub trait PoseFilter<G, const D: usize, const N: usize>: Debug {
    /// What is believed, and what lasts from one update to the next.
    type State: Copy + Debug;

    /// The state that starts from `prior`.
    fn begin(&self, prior: &Belief<G, Left, D>) -> Self::State;

    /// The state that starts from `prior` with what `state`, whose pose it is, has learned beside it. A filter that learns
    /// nothing knows no such state.
    ///
    /// # Errors
    /// A sentence that names the fault and the remedy.
    fn recall(
        &self,
        prior: &Belief<G, Left, D>,
        state: &StateVector,
    ) -> Result<Self::State, &'static str> {
        let _ = (prior, state);
        Err(
            "the state has parameters of mismatches, and this daemon estimates none: set their number to 0",
        )
    }

    /// Writes what was learned beside the pose.
    fn write_learned(&self, state: &Self::State, vector: &mut StateVector) {
        let _ = (state, vector);
    }

    /// Makes the covariance definite if rounding has made it indefinite.
    fn mend(&self, state: &mut Self::State);

    /// Moves the state by one step of odometry with the noise covariance `q`.
    fn advance(&self, state: &mut Self::State, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>);

    /// Corrects the state with the fixes of `sources`, unless they are beyond the gate of `options`.
    ///
    /// # Errors
    /// [`UpdateError`]; the state is then unchanged, as it is when the fix is gated.
    fn fuse<const K: usize, const M: usize>(
        &self,
        state: &mut Self::State,
        sources: &[u32; K],
        points: &Points<K, N, M>,
        options: &UpdateOptions,
    ) -> Result<Fused, UpdateError>;

    /// The state, doubted by `widening`.
    fn widened(&self, state: &Self::State, widening: &Widening) -> Self::State;

    /// Whether what a fix changes can be [carried](Self::carry) over rows that follow it.
    fn carries(&self) -> bool {
        false
    }

    /// `now`, to which rows and no fix have led from `before`, as if they had led to it from `after`; and the least
    /// share of a variance of `now` that remains. Only of filters that [carry](Self::carries).
    fn carry(
        &self,
        before: &Self::State,
        after: &Self::State,
        now: &Self::State,
    ) -> (Self::State, f64) {
        let _ = (before, after);
        (*now, 0.0)
    }

    /// The pose and its covariance.
    fn belief(&self, state: &Self::State) -> Belief<G, Left, D>;

    /// What else there is to say.
    fn report(&self, state: &Self::State) -> Report;
}
