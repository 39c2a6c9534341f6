//! Mismatches of unknown behaviour: the adaptive bank of augmented filters.

use inekf::filter::{
    Adaptive, Belief, Left, Mode, STANDARD_MODES, Switching, UpdateError, UpdateOptions, Verdict,
};
use inekf::model::{Augmented, OdometryStep, Points, Unknowns};
use nalgebra::SMatrix;

use super::super::model::Fused;
use super::super::recovery::Widening;
use super::doubted;
use super::filter::{PoseFilter, Report};
use super::learning::{bits, pose, report};
use super::vehicle::Vehicle;

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
