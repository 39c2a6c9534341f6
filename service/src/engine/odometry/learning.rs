//! Mismatches as states beside the pose: learned, or only considered (Schmidt).

use inekf::filter::{
    Belief, Consider, Covariance, Left, UpdateError, UpdateOptions, Verdict, propagate_augmented,
    update, update_with,
};
use inekf::lie::LieGroup;
use inekf::model::{Augmented, OdometryStep, Points, Unknowns};
use inekf_shared::message::MAX_MISMATCHES;
use nalgebra::{SMatrix, SVector};

use super::super::model::Fused;
use super::super::recovery::Widening;
use super::doubted;
use super::filter::{PoseFilter, Report};
use super::vehicle::Vehicle;

/// A filter whose state has the P parameters of the mismatches beside the pose, A in all.
#[derive(Clone, Copy, Debug)]
pub struct Learning<const P: usize, const A: usize> {
    /// What the parameters mean.
    pub unknowns: Unknowns,
    /// How many of them mean something.
    pub parameters: usize,
    /// How many mismatches these belong to: one may have three.
    pub declared: usize,
    /// Their standard deviations at the start; zero for those that mean nothing.
    pub sigmas: SVector<f64, P>,
    /// Their random walks, per square root of a second.
    pub walks: SVector<f64, P>,
    /// Whether they are only considered.
    pub considers: bool,
}

/// The state of [`Learning`].
#[derive(Clone, Copy, Debug)]
pub struct LearningState<G, const D: usize, const P: usize, const A: usize> {
    belief: Belief<Augmented<G, D, P, A>, Left, A>,
    active: u32,
}

/// The parameters of an augmented belief, as a filter reports them: the first `count`.
pub fn report<G, const D: usize, const P: usize, const A: usize>(
    belief: &Belief<Augmented<G, D, P, A>, Left, A>,
    count: usize,
    active: u32,
) -> Report {
    let mut report = Report {
        active,
        ..Report::NOTHING
    };
    for k in 0..count.min(MAX_MISMATCHES) {
        report.parameters[k] = belief.mean.parameters[k];
        report.sigmas[k] = belief.covariance.matrix()[(D + k, D + k)].sqrt();
    }
    report
}

/// The pose of an augmented belief.
pub fn pose<G: LieGroup<D>, const D: usize, const P: usize, const A: usize>(
    belief: &Belief<Augmented<G, D, P, A>, Left, A>,
) -> Belief<G, Left, D> {
    let own = belief.covariance.matrix().fixed_view::<D, D>(0, 0);
    Belief::new(belief.mean.pose, Covariance::from_upper(own.into_owned()))
}

/// One bit for each of `count` mismatches.
pub fn bits(count: usize) -> u32 {
    (1 << count.min(MAX_MISMATCHES)) - 1
}

impl<G, const D: usize, const N: usize, const P: usize, const A: usize> PoseFilter<G, D, N>
    for Learning<P, A>
where
    G: Vehicle<D, N>,
{
    type State = LearningState<G, D, P, A>;

    fn begin(&self, prior: &Belief<G, Left, D>) -> Self::State {
        let mut p = SMatrix::<f64, A, A>::zeros();
        p.fixed_view_mut::<D, D>(0, 0)
            .copy_from(prior.covariance.matrix());
        for k in 0..P {
            p[(D + k, D + k)] = self.sigmas[k] * self.sigmas[k];
        }
        LearningState {
            belief: Belief::new(
                Augmented::new(prior.mean, SVector::zeros()),
                Covariance::from_upper(p),
            ),
            active: 0,
        }
    }

    fn advance(&self, state: &mut Self::State, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>) {
        let mut noise = SMatrix::<f64, A, A>::zeros();
        noise.fixed_view_mut::<D, D>(0, 0).copy_from(q);
        for k in 0..P {
            noise[(D + k, D + k)] = self.walks[k] * self.walks[k] * step.dt_s;
        }
        state.belief = propagate_augmented(&state.belief, &self.unknowns, step, &noise);
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
        let correction = if self.considers {
            update_with(&mut state.belief, &seen, &Consider { first: D }, options)
        } else {
            update(&mut state.belief, &seen, options)
        }?;
        if correction.verdict == Verdict::Accepted {
            state.active = bits(self.declared);
        }
        Ok(Fused {
            verdict: correction.verdict,
            nis: correction.nis,
        })
    }

    fn widened(&self, state: &Self::State, widening: &Widening) -> Self::State {
        let covariance = doubted::<G, D, N, A>(&state.belief.covariance, widening);
        LearningState {
            belief: Belief::new(state.belief.mean, covariance),
            ..*state
        }
    }

    fn belief(&self, state: &Self::State) -> Belief<G, Left, D> {
        pose(&state.belief)
    }

    fn report(&self, state: &Self::State) -> Report {
        report(&state.belief, self.parameters, state.active)
    }
}
