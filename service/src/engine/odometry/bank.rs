//! Mismatches of unknown behaviour: the adaptive bank of augmented filters.

use inekf::filter::{
    Adaptive, Belief, Covariance, Left, Mode, STANDARD_MODES, Switching, UpdateError,
    UpdateOptions, Verdict,
};
use inekf::model::{Augmented, OdometryStep, Points, Unknowns};
use inekf_shared::message::{MODES, StateVector};
use nalgebra::SMatrix;

use super::super::model::Fused;
use super::super::recovery::Widening;
use super::doubted;
use super::filter::{PoseFilter, Report};
use super::learning::{bits, pose, recalled, report, write_learned};
use super::vehicle::Vehicle;

const _: () = assert!(STANDARD_MODES == MODES, "a state has room for every weight");

/// A bank of filters with P parameters beside the pose, A in all.
#[derive(Clone, Copy, Debug)]
pub struct Bank<const P: usize, const A: usize> {
    /// What the parameters mean.
    pub unknowns: Unknowns,
    /// How many of them mean something.
    pub parameters: usize,
    /// How many mismatches these belong to: one may have three.
    pub declared: usize,
    /// The hypotheses.
    pub modes: [Mode<P>; STANDARD_MODES],
    /// How they follow each other.
    pub switching: Switching<STANDARD_MODES>,
    /// How a fix is fused.
    pub options: UpdateOptions,
}

/// The state of [`Bank`].
#[derive(Clone, Copy, Debug)]
pub struct BankState<G, const D: usize, const P: usize, const A: usize> {
    bank: Adaptive<G, D, P, A, STANDARD_MODES>,
    /// The one Gaussian that is published.
    merged: Belief<Augmented<G, D, P, A>, Left, A>,
    active: u32,
}

impl<G, const D: usize, const N: usize, const P: usize, const A: usize> PoseFilter<G, D, N>
    for Bank<P, A>
where
    G: Vehicle<D, N>,
{
    type State = BankState<G, D, P, A>;

    fn begin(&self, prior: &Belief<G, Left, D>) -> Self::State {
        let bank = Adaptive::new(prior, self.modes, self.switching, self.options);
        BankState {
            bank,
            merged: bank.estimate(),
            active: 0,
        }
    }

    fn recall(
        &self,
        prior: &Belief<G, Left, D>,
        state: &StateVector,
    ) -> Result<Self::State, &'static str> {
        let belief = recalled(prior, state, self.parameters)?;
        let weights = state.mode_weights;
        let total: f64 = weights.iter().sum();
        if state.mode_count as usize != STANDARD_MODES
            || !weights.iter().all(|weight| *weight >= 0.0)
            || !(total.is_finite() && total > 0.0)
        {
            return Err("the weights of the modes are no weights: nine numbers that add up to one");
        }
        let bank = Adaptive::resumed(&belief, weights, self.modes, self.switching, self.options);
        Ok(BankState {
            bank,
            merged: bank.estimate(),
            active: 0,
        })
    }

    fn write_learned(&self, state: &Self::State, vector: &mut StateVector) {
        write_learned(&state.merged, self.parameters, vector);
        vector.mode_count = STANDARD_MODES as u32;
        vector.mode_weights = *state.bank.weights();
    }

    fn mend(&self, state: &mut Self::State) {
        state.bank = state.bank.with_covariances(Covariance::made_definite);
        state.merged = state.bank.estimate();
    }

    fn advance(&self, state: &mut Self::State, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>) {
        state.bank.advance(&self.unknowns, step, q);
        state.merged = state.bank.estimate();
    }

    fn fuse<const K: usize, const M: usize>(
        &self,
        state: &mut Self::State,
        sources: &[u32; K],
        points: &Points<K, N, M>,
        options: &UpdateOptions,
    ) -> Result<Fused, UpdateError> {
        let seen = self
            .unknowns
            .observe_by(sources.map(|id| id as usize), *points);
        let weighed = state.bank.update_through(&seen, &options.gate)?;
        if weighed.verdict == Verdict::Accepted {
            state.merged = state.bank.estimate();
            state.active = bits(self.declared);
        }
        Ok(Fused {
            verdict: weighed.verdict,
            nis: weighed.nis,
        })
    }

    fn widened(&self, state: &Self::State, widening: &Widening) -> Self::State {
        let bank = state
            .bank
            .with_covariances(|p| doubted::<G, D, N, A>(p, widening));
        BankState {
            bank,
            merged: bank.estimate(),
            ..*state
        }
    }

    fn belief(&self, state: &Self::State) -> Belief<G, Left, D> {
        pose(&state.merged)
    }

    fn report(&self, state: &Self::State) -> Report {
        let mut report = report(&state.merged, self.parameters, state.active);
        let weights = state.bank.weights().iter().enumerate();
        let likeliest = weights.max_by(|(_, one), (_, other)| one.total_cmp(other));
        report.mode = likeliest.map_or(report.mode, |(mode, _)| mode as u32);
        report
    }
}
