//! Mismatches as states beside the pose: learned, or only considered (Schmidt).

use inekf::filter::{
    Belief, Consider, Covariance, Left, UpdateError, UpdateOptions, Verdict, propagate_augmented,
    update, update_with,
};
use inekf::lie::LieGroup;
use inekf::model::{Augmented, OdometryStep, Points, Unknowns};
use inekf_shared::message::{MAX_MISMATCHES, StateVector};
use nalgebra::{SMatrix, SVector};

use super::super::model::Fused;
use super::super::recovery::Widening;
use super::super::set_state::is_positive_semidefinite;
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

/// Writes the first `count` parameters of an augmented belief, and their covariance, into a state whose pose it is.
pub fn write_learned<G, const D: usize, const P: usize, const A: usize>(
    belief: &Belief<Augmented<G, D, P, A>, Left, A>,
    count: usize,
    state: &mut StateVector,
) {
    let p = belief.covariance.matrix();
    let count = count.min(P).min(MAX_MISMATCHES);
    state.parameter_count = count as u32;
    let mut entries = state.parameter_covariance.iter_mut();
    for k in 0..count {
        state.parameters[k] = belief.mean.parameters[k];
        for (row, entry) in (0..=D + k).zip(entries.by_ref()) {
            *entry = p[(row, D + k)];
        }
    }
}

/// The augmented belief that `state` describes, whose pose is that of `prior`.
///
/// # Errors
/// A sentence that names the fault and the remedy.
pub fn recalled<G: LieGroup<D>, const D: usize, const P: usize, const A: usize>(
    prior: &Belief<G, Left, D>,
    state: &StateVector,
    count: usize,
) -> Result<Belief<Augmented<G, D, P, A>, Left, A>, &'static str> {
    if state.parameter_count as usize != count.min(P) || state.dimension as usize != D {
        return Err(
            "the state has other mismatches than this daemon's: set the number of its parameters to 0 to begin with the configured ones",
        );
    }
    let count = count.min(P).min(MAX_MISMATCHES);
    let mut p = SMatrix::<f64, A, A>::zeros();
    p.fixed_view_mut::<D, D>(0, 0)
        .copy_from(prior.covariance.matrix());
    let mut parameters = SVector::<f64, P>::zeros();
    let mut entries = state.parameter_covariance.iter();
    for k in 0..count {
        parameters[k] = state.parameters[k];
        for (row, entry) in (0..=D + k).zip(entries.by_ref()) {
            p[(row, D + k)] = *entry;
        }
    }
    let covariance = Covariance::from_upper(p);
    if !parameters.iter().chain(p.iter()).all(|x| x.is_finite()) {
        return Err("the state has a parameter of a mismatch that is not finite");
    }
    if !is_positive_semidefinite(covariance.matrix()) {
        return Err(
            "the covariance with the parameters of mismatches is not positive semidefinite",
        );
    }
    Ok(Belief::new(
        Augmented::new(prior.mean, parameters),
        covariance,
    ))
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

    fn recall(
        &self,
        prior: &Belief<G, Left, D>,
        state: &StateVector,
    ) -> Result<Self::State, &'static str> {
        Ok(LearningState {
            belief: recalled(prior, state, self.parameters)?,
            active: 0,
        })
    }

    fn write_learned(&self, state: &Self::State, vector: &mut StateVector) {
        write_learned(&state.belief, self.parameters, vector);
    }

    fn mend(&self, state: &mut Self::State) {
        state.belief.covariance = state.belief.covariance.made_definite();
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
