//! The models `odometry2d` and `odometry3d`: increments move a pose, positions correct it.
//!
//! - [`vehicle`]: the plane and space, and their messages; [`row`]: what an increment says and how far to trust it
//! - [`sighting`]: position fixes, alone or two together
//! - [`filter`]: what the model asks of a filter; [`single`]: one belief, with or without constraints;
//!   [`learning`]: mismatches as states; [`bank`]: mismatches of unknown behaviour
//! - [`build`]: from a configuration to one of these

use core::fmt::Debug;

use inekf::filter::{Alignment, Belief, Covariance, UpdateError, Verdict};
use inekf::lie::SO3;
use inekf_shared::message::{
    EstimateMessage, PositionFix, ProcessNoise, REASON_NOT_FINITE, REASON_OUT_OF_RANGE,
    StateVector, model_name,
};
use inekf_shared::transport::InputMessage;
use nalgebra::{SMatrix, Vector3};

use super::fix::{Fix, Measurement};
use super::model::{Fused, Preceding, Workings};
use super::recovery::Widening;
use super::resume::Doubt;
use super::set_state::{checked_attitude, covariance};
use super::settings::{FusionSettings, InitialSettings, LevelSource};
use super::tally::Refusal;
use crate::config::OdometryNoise;

mod bank;
pub(super) mod build;
mod filter;
mod learning;
mod row;
mod sighting;
mod single;
mod vehicle;

use filter::{PoseFilter, Report};
use row::{Row, RowMotion};
use sighting::Sighting;
use vehicle::{Vehicle, marginal, snapshot};

/// The rows: which are believed, and what happens when none come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSettings {
    /// Largest believable turn of a row, rad.
    pub max_rotation: f64,
    /// Largest believable way of a row along any axis, m.
    pub max_translation: f64,
    /// A longer interval is a gap: the row that ends it is doubted.
    pub max_gap_ns: u64,
    /// After a gap longer than this the state starts anew.
    pub restart_gap_ns: u64,
    /// The time that the first row speaks for.
    pub first_period_ns: u64,
    /// How rows are trusted.
    pub noise: OdometryNoise,
    /// What the configured noise was multiplied by to give it.
    pub noise_factor: f64,
}

/// A filter F on the pose G, moved by odometry. `PAIR = 2 N` is the dimension of two positions.
#[derive(Debug)]
pub struct Odometry<G, F, const D: usize, const N: usize, const PAIR: usize> {
    rows: RowSettings,
    initial: InitialSettings,
    fusion: FusionSettings,
    filter: F,
    pose: core::marker::PhantomData<G>,
}

impl<G, F, const D: usize, const N: usize, const PAIR: usize> Odometry<G, F, D, N, PAIR> {
    /// The model with this filter.
    pub fn new(
        rows: RowSettings,
        initial: InitialSettings,
        fusion: FusionSettings,
        filter: F,
    ) -> Self {
        Self {
            rows,
            initial,
            fusion,
            filter,
            pose: core::marker::PhantomData,
        }
    }
}

impl<G, F, const D: usize, const N: usize, const PAIR: usize> Workings
    for Odometry<G, F, D, N, PAIR>
where
    G: Vehicle<D, N>,
    F: PoseFilter<G, D, N>,
{
    type Sample = G::Row;
    type Estimate = G::Estimate;
    type Input = Row<D>;
    type Motion = RowMotion<G, D>;
    type Measurement = Sighting<N>;
    type State = F::State;
    const INPUT: usize = G::INPUT;

    fn initial(&self) -> &InitialSettings {
        &self.initial
    }

    fn restart_gap_ns(&self) -> u64 {
        self.rows.restart_gap_ns
    }

    fn max_gap_ns(&self) -> u64 {
        self.rows.max_gap_ns
    }

    fn sample(&self, message: &G::Row, before: &Preceding<Row<D>>) -> Result<Row<D>, Refusal> {
        let increment = G::increment(message);
        if !increment.iter().all(|part| part.is_finite()) {
            return Err(Refusal(REASON_NOT_FINITE));
        }
        let turn = increment.rows(0, G::ROTATION_DIM);
        let way = increment.rows(G::POSITION, N);
        if turn.norm() > self.rows.max_rotation || way.amax() > self.rows.max_translation {
            return Err(Refusal(REASON_OUT_OF_RANGE));
        }
        let stamp_ns = message.header().stamp_ns;
        let continued = before.sample.and_then(|(before_ns, row)| {
            let interval_ns = stamp_ns.saturating_sub(before_ns);
            let known = (1..=self.rows.restart_gap_ns).contains(&interval_ns);
            known.then(|| Row::after(&row, increment, interval_ns, before.missing))
        });
        Ok(continued.unwrap_or(Row {
            increment,
            // Time begins at zero.
            span_ns: self.rows.first_period_ns.min(stamp_ns).max(1),
            follows_loss: false,
        }))
    }

    fn position(&self, message: &PositionFix) -> Result<Fix<Sighting<N>>, Refusal> {
        sighting::checked(message, &self.fusion.sources)
    }

    fn attitude(&mut self, _stamp_ns: u64, _input: &Row<D>) -> Option<SO3> {
        let (roll, pitch) = match self.initial.level {
            LevelSource::Given { roll, pitch } => (roll, pitch),
            // There is no accelerometer: the configuration refuses it.
            LevelSource::Accelerometer { .. } => (0.0, 0.0),
        };
        Some(SO3::from_roll_pitch_heading(
            roll,
            pitch,
            self.initial.heading,
        ))
    }

    /// Within the row: it says nothing of the time before it.
    fn start_ns(&self, given_ns: Option<u64>, stamp_ns: u64, row: &Row<D>) -> u64 {
        let begins_ns = stamp_ns.saturating_sub(row.span_ns);
        given_ns.map_or(begins_ns, |given_ns| given_ns.clamp(begins_ns, stamp_ns))
    }

    fn aligned(&self, alignment: &Alignment) -> F::State {
        self.filter.begin(&marginal(&alignment.belief()))
    }

    fn requested(&self, state: &StateVector) -> Result<F::State, &'static str> {
        if state.model != G::MODEL {
            return Err(if model_name(state.model) == "unknown" {
                "the state's model is unknown to this version"
            } else {
                "the state is of another model than this daemon's: see the daemon's ready line"
            });
        }
        let r_wb = checked_attitude(state)?;
        let mean = G::of_state(&r_wb, state)?;
        let covariance = match state.dimension as usize {
            0 => {
                let (r_wb, position_w) = mean.in_space();
                let alignment = self.initial.alignment_at(r_wb, position_w);
                marginal::<G, D, N>(&alignment.belief()).covariance
            }
            d if d == D => covariance::<D>(state)?,
            _ => {
                return Err(
                    "the state's dimension must be 3 for odometry2d and 6 for odometry3d, or 0 for the configured covariance",
                );
            }
        };
        let prior = Belief::new(mean, covariance);
        match state.parameter_count {
            0 => Ok(self.filter.begin(&prior)),
            _ => self.filter.recall(&prior, state),
        }
    }

    fn motion(&self, _before: Option<&Row<D>>, row: &Row<D>, interval_ns: u64) -> RowMotion<G, D> {
        RowMotion::new(row, interval_ns, self.rows.max_gap_ns, &self.rows.noise)
    }

    fn advance(&self, state: &mut F::State, motion: &RowMotion<G, D>, part_ns: u64) {
        let (step, q) = motion.part(part_ns);
        self.filter.advance(state, &step, &q);
    }

    fn endure(&self, state: &mut F::State, silence_ns: u64, doubt: &Doubt) {
        if silence_ns > 0 {
            let (step, q) = RowMotion::of_silence(silence_ns, &self.rows.noise, doubt);
            self.filter.advance(state, &step, &q);
        }
    }

    fn reload_noise(&mut self, noise: &ProcessNoise) -> Result<(), &'static str> {
        let noise = OdometryNoise::from_numbers(noise)?;
        self.rows.noise = noise.scaled(self.rows.noise_factor);
        Ok(())
    }

    fn is_sound(&self, state: &F::State) -> bool {
        let belief = self.filter.belief(state);
        belief.mean.is_finite()
            && belief.mean.position_w().amax() <= MAX_POSITION_M
            && belief.covariance.is_plausible()
    }

    fn fuse(
        &self,
        state: &mut F::State,
        fix: &Fix<Sighting<N>>,
        gated: bool,
    ) -> Result<Fused, UpdateError> {
        let options = self.fusion.options(gated);
        let fused = match fix.measurement {
            Sighting::One(source, one) => {
                let points = sighting::points::<1, N, N>([one]);
                self.filter.fuse(state, &[source], &points, &options)
            }
            Sighting::Two(sources, both) => {
                let points = sighting::points::<2, N, PAIR>(both);
                self.filter.fuse(state, &sources, &points, &options)
            }
        }?;
        if fused.verdict == Verdict::Accepted && fix.is_mended() {
            self.filter.mend(state);
        }
        Ok(fused)
    }

    fn widening(&self, state: &F::State, fix: &Fix<Sighting<N>>, nis: f64) -> Widening {
        let mean = self.filter.belief(state).mean;
        let (squared, noise) = fix.measurement.surprise(|fix| fix.expected_w(&mean));
        Widening::new(squared, noise, fix.measurement.dimension(), nis)
    }

    fn fuse_widened(
        &self,
        state: &mut F::State,
        fix: &Fix<Sighting<N>>,
        widening: &Widening,
    ) -> Result<Fused, UpdateError> {
        let mut wide = self.filter.widened(state, widening);
        let fused = self.fuse(&mut wide, fix, false)?;
        *state = wide;
        Ok(fused)
    }

    fn carries(&self) -> bool {
        self.filter.carries()
    }

    fn carry(
        &self,
        before: &F::State,
        after: &F::State,
        _elapsed_ns: u64,
        now: &F::State,
    ) -> (F::State, f64) {
        self.filter.carry(before, after, now)
    }

    fn place_w(&self, state: &F::State) -> Vector3<f64> {
        self.filter.belief(state).mean.in_space().1
    }

    fn write(&self, state: &F::State, message: &mut G::Estimate) {
        let Report { active, mode, .. } = self.filter.report(state);
        let head = message.head_mut();
        head.dimension = D as u32;
        head.active_mismatches = active;
        head.mode = mode;
        G::write(
            &self.filter.belief(state),
            &self.filter.report(state),
            message,
        );
    }

    fn snapshot(&self, stamp_ns: u64, state: &F::State) -> StateVector {
        let mut vector = snapshot(stamp_ns, &self.filter.belief(state));
        self.filter.write_learned(state, &mut vector);
        vector
    }
}

/// Beyond this, m, an estimate is not of this world: the filter has diverged.
const MAX_POSITION_M: f64 = 1e10;

/// The covariance of a pose, doubted by `widening`: all of it a little more, the position by what was seen.
fn doubted<G: Vehicle<D, N>, const D: usize, const N: usize, const A: usize>(
    covariance: &Covariance<A>,
    widening: &Widening,
) -> Covariance<A> {
    let mut p: SMatrix<f64, A, A> = *covariance.scaled(widening.scale).matrix();
    for axis in 0..N {
        p[(G::POSITION + axis, G::POSITION + axis)] += widening.variance;
    }
    Covariance::from_upper(p)
}
