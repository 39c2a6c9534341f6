//! One belief on the pose: InEKF left or right, EKF, H-infinity, and the linearly constrained filters.
//!
//! Constraints are made anew at each update from what was declared: the process's from the way since the last
//! update, the sources' from those that are part of it. A source of a stack that comes alone has too few outputs for
//! the constraints of the stack, and is fused without any; the way's columns `d` then go on as `(I - K H) d`. A column
//! that the fix does not see (a bias while the body rests: `H d = 0`) goes on as it is.

use inekf::filter::{
    Belief, Constrained, GainRule, HInfinity, Kalman, LateCorrection, LateSide, Left, Linearised,
    Side, UpdateError, UpdateOptions, Verdict, update, update_with,
};
use inekf::model::{
    Declared, Drift, Observation, OdometryStep, OutputMismatch, Points, ProcessColumns,
};
use inekf_shared::message::MAX_MISMATCHES;
use nalgebra::{SMatrix, SVector};

use super::super::model::Fused;
use super::super::recovery::Widening;
use super::doubted;
use super::filter::{PoseFilter, Report};
use super::vehicle::Vehicle;

/// What the gain does about errors of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gain {
    /// Nothing.
    Kalman,
    /// Bounds their amplification.
    HInfinity(HInfinity),
    /// Is blind to those that are declared.
    Constrained,
}

/// The declared mismatches of the sources, by source id.
pub type SourceMismatches = [Option<Declared<OutputMismatch>>; MAX_MISMATCHES];

/// A filter with one belief, on the side S.
#[derive(Clone, Copy, Debug)]
pub struct Single<S, const D: usize> {
    /// The gain.
    pub gain: Gain,
    /// The declared mismatches of the process, no way yet.
    pub process: ProcessColumns<D>,
    /// How many these are: the bits of the sources' mismatches come after theirs.
    pub process_count: usize,
    /// The declared mismatches of the sources.
    pub outputs: SourceMismatches,
    /// The sources that are stacked.
    pub stacked: Option<[u32; 2]>,
    /// The side.
    pub side: core::marker::PhantomData<S>,
}

/// The state of [`Single`].
#[derive(Clone, Copy, Debug)]
pub struct SingleState<G, S, const D: usize> {
    belief: Belief<G, S, D>,
    /// The way since the last update.
    way: ProcessColumns<D>,
    /// Bits of the constraints of the last update.
    active: u32,
}

/// The outputs' mismatches of some sources, as indices of a stack.
struct Stacked {
    declared: [Declared<OutputMismatch>; MAX_MISMATCHES],
    count: usize,
    /// Bits.
    active: u32,
}

impl<S: Side, const D: usize> Single<S, D> {
    /// Whether an update with `sources` is constrained.
    fn constrains(&self, sources: &[u32]) -> bool {
        let incomplete = self
            .stacked
            .is_some_and(|stacked| sources.len() == 1 && stacked.contains(&sources[0]));
        self.gain == Gain::Constrained && !incomplete
    }

    /// The mismatches of `sources`, with the place in the stack in place of the id.
    fn of_sources(&self, sources: &[u32]) -> Stacked {
        let none = Declared::hard(OutputMismatch::MeasurementScale { source: 0 });
        let mut stacked = Stacked {
            declared: [none; MAX_MISMATCHES],
            count: 0,
            active: 0,
        };
        for (index, declared) in self.outputs.iter().enumerate() {
            let Some(declared) = declared else { continue };
            let id = declared.mismatch.source();
            let Some(place) = sources.iter().position(|source| *source as usize == id) else {
                continue;
            };
            stacked.declared[stacked.count] = Declared {
                mismatch: declared.mismatch.at(place),
                ..*declared
            };
            stacked.count += 1;
            stacked.active |= 1 << (self.process_count + index);
        }
        stacked
    }

    /// Whether the constraints of an update with `sources`, seen as `points`, have a solution.
    ///
    /// # Errors
    /// [`UpdateError`], which says why not.
    pub fn check<G, const K: usize, const N: usize, const M: usize>(
        &self,
        declared: &[Declared<inekf::model::ProcessMismatch>],
        sources: &[u32; K],
        points: &Points<K, N, M>,
    ) -> Result<(), UpdateError>
    where
        G: Vehicle<D, N>,
    {
        if !self.constrains(sources) {
            return Ok(());
        }
        let way = ProcessColumns::in_general_position::<G, N>(declared)
            .ok_or(UpdateError::TooManyConstraints)?;
        let outputs = self.of_sources(sources);
        Constrained::check::<G>(&way, &outputs.declared[..outputs.count], points).map(|_| ())
    }
}

impl<G, S, const D: usize, const N: usize> PoseFilter<G, D, N> for Single<S, D>
where
    G: Vehicle<D, N>,
    S: LateSide,
{
    type State = SingleState<G, S, D>;

    fn begin(&self, prior: &Belief<G, Left, D>) -> Self::State {
        SingleState {
            belief: Belief::from_left_covariance(prior.mean, prior.covariance),
            way: self.process,
            active: 0,
        }
    }

    fn mend(&self, state: &mut Self::State) {
        state.belief.covariance = state.belief.covariance.made_definite();
    }

    fn advance(&self, state: &mut Self::State, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>) {
        state.belief = inekf::filter::propagate_odometry(&state.belief, step, q);
        if self.gain == Gain::Constrained {
            state.way.advance(step, q);
        }
    }

    fn fuse<const K: usize, const M: usize>(
        &self,
        state: &mut Self::State,
        sources: &[u32; K],
        points: &Points<K, N, M>,
        options: &UpdateOptions,
    ) -> Result<Fused, UpdateError> {
        let mut next = *state;
        next.active = 0;
        let correction = if self.constrains(sources) {
            let outputs = self.of_sources(sources);
            let declared = &outputs.declared[..outputs.count];
            let h = Observation::<G, D, M>::left_jacobian(points, &state.belief.mean);
            next.way.hide_unseen::<G, N, M>(&h);
            let rule = Constrained::new(&state.belief, &next.way, declared, points);
            next.active = outputs.active | next.way.active_bits();
            next.way.reset();
            update_with(&mut next.belief, points, &rule, options)
        } else if let Gain::HInfinity(rule) = self.gain {
            update_with(&mut next.belief, points, &rule, options)
        } else {
            if self.gain == Gain::Constrained {
                next.way.transform(&remainder(&state.belief, points)?);
            }
            update(&mut next.belief, points, options)
        }?;
        if correction.verdict == Verdict::Accepted {
            *state = next;
        }
        Ok(Fused {
            verdict: correction.verdict,
            nis: correction.nis,
        })
    }

    fn widened(&self, state: &Self::State, widening: &Widening) -> Self::State {
        let covariance = doubted::<G, D, N, D>(&state.belief.left_covariance(), widening);
        SingleState {
            belief: Belief::from_left_covariance(state.belief.mean, covariance),
            ..*state
        }
    }

    /// With constraints the way since the last update would have to be gathered anew.
    fn carries(&self) -> bool {
        self.gain != Gain::Constrained
    }

    fn carry(
        &self,
        before: &Self::State,
        after: &Self::State,
        now: &Self::State,
    ) -> (Self::State, f64) {
        let (belief, share) = LateCorrection::between(&before.belief, &after.belief)
            .carried_with_share(&Drift::none(), &now.belief);
        let carried = SingleState {
            belief,
            active: after.active,
            ..*now
        };
        (carried, share)
    }

    fn belief(&self, state: &Self::State) -> Belief<G, Left, D> {
        Belief::new(state.belief.mean, state.belief.left_covariance())
    }

    fn report(&self, state: &Self::State) -> Report {
        Report {
            active: state.active,
            ..Report::NOTHING
        }
    }
}

/// `I - K H` of the Kalman update with `points`, left-invariant: what it leaves of an error.
fn remainder<G, S, const D: usize, const K: usize, const N: usize, const M: usize>(
    belief: &Belief<G, S, D>,
    points: &Points<K, N, M>,
) -> Result<SMatrix<f64, D, D>, UpdateError>
where
    G: Vehicle<D, N>,
    S: Side,
{
    let prior = Belief::<G, Left, D>::new(belief.mean, belief.left_covariance());
    let noise = points.noise_covariance();
    let linearised = Linearised::at(&prior, points, &prior.mean, &SVector::zeros(), &noise)
        .ok_or(UpdateError::InnovationNotPositiveDefinite)?;
    let gain = Kalman.gain(&prior.covariance, &linearised)?;
    let h: SMatrix<f64, M, D> = Observation::<G, D, M>::left_jacobian(points, &prior.mean);
    Ok(SMatrix::identity() - gain * h)
}
