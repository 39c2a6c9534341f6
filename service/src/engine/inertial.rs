//! The engine of the model `imu`: states, initialisation, and the path of every input.

use inekf::filter::{Alignment, Belief, Levelled, Side};
use inekf::lie::SO3;
use inekf::model::{ImuInput, InertialState};
use inekf_shared::message::{
    Header, HeadingFix, INPUT_HEADING, INPUT_IMU, INPUT_POSITION, INPUT_VELOCITY, ImuSample,
    PositionFix, REASON_BUFFER_FULL, REASON_INTERNAL, REASON_NOT_READY, REASON_OUT_OF_RANGE,
    STATE_ALIGNING, STATE_WAITING, StateVector, VelocityFix, WAITING_FOR_IMU, WAITING_FOR_LEVEL,
    WAITING_FOR_NOTHING, WAITING_FOR_POSITION, WAITING_FOR_REQUEST,
};
use nalgebra::Matrix3;

use super::fix::{FirstPosition, Fix};
use super::intake;
use super::levelling::Levelling;
use super::output::{Outbox, Output, state_vector};
use super::set_state;
use super::settings::{InitialSettings, LevelSource, PositionSource, Settings};
use super::tally::{Refusal, Tally};
use super::time_base::{Continuity, TimeBase};
use super::timeline::{Breakdown, Insertion, Timeline};

/// A fix may be this far ahead of the last sample; beyond, its clock is not the samples' clock.
pub const MAX_AHEAD_NS: u64 = 60_000_000_000;

/// An inertial filter of side S on the state G (9 or 15 dimensions), behind the wire messages.
#[derive(Debug)]
pub struct InertialEngine<G, S, const D: usize> {
    settings: Settings,
    timeline: Timeline<G, S, D>,
    time_base: TimeBase,
    levelling: Levelling,
    /// The last position fix that came before there was a state.
    first_position: Option<FirstPosition>,
    /// A state that was requested before the first sample, to hold from that sample's stamp.
    requested: Option<Belief<G, S, D>>,
    /// The last accepted sample with its stamp.
    last_input: Option<(u64, ImuInput)>,
    output: Output,
}

impl<G: InertialState<D>, S: Side, const D: usize> InertialEngine<G, S, D> {
    /// An engine that waits for its first samples, with all the memory it will ever use.
    pub fn new(settings: Settings) -> Self {
        let window_ns = match settings.initial.level {
            LevelSource::Accelerometer { window_ns } => window_ns,
            LevelSource::Given { .. } => 0,
        };
        Self {
            timeline: Timeline::new(settings.imu, settings.fusion),
            time_base: TimeBase::new(settings.imu.restart_gap_ns),
            levelling: Levelling::new(window_ns),
            first_position: None,
            requested: None,
            last_input: None,
            output: Output::new(settings.fusion.degraded_after_ns),
            settings,
        }
    }

    /// The counters.
    pub fn tally(&self) -> &Tally {
        &self.output.tally
    }

    /// `STATE_*` and `WAITING_FOR_*` now.
    pub fn state(&self) -> (u32, u32) {
        if let Some((stamp_ns, _)) = self.timeline.newest() {
            return (self.output.running_state(stamp_ns), WAITING_FOR_NOTHING);
        }
        let initial = &self.settings.initial;
        if self.requested.is_some() {
            (STATE_WAITING, WAITING_FOR_IMU)
        } else if initial.wait_for_request {
            (STATE_WAITING, WAITING_FOR_REQUEST)
        } else if self.time_base.last_ns().is_none() {
            (STATE_WAITING, WAITING_FOR_IMU)
        } else if initial.needs_fix() && self.first_position.is_none() {
            (STATE_WAITING, WAITING_FOR_POSITION)
        } else {
            (STATE_ALIGNING, WAITING_FOR_LEVEL)
        }
    }

    /// The time of now: stamp of the last accepted sample, or of a state set after it.
    pub fn last_sample_ns(&self) -> Option<u64> {
        self.time_base.last_ns()
    }

    /// The current state and covariance, if there is one.
    pub fn snapshot(&self) -> Option<StateVector> {
        self.timeline
            .newest()
            .map(|(stamp_ns, belief)| state_vector(stamp_ns, belief))
    }

    /// Takes an IMU sample that was received at `received_ns` (CLOCK_MONOTONIC, for the latency
    /// stamps only), and publishes what follows from it.
    pub fn imu(&mut self, sample: &ImuSample, received_ns: u64, outbox: &mut impl Outbox) {
        self.output.tally.receive(INPUT_IMU, &sample.header);
        let stamp_ns = sample.header.stamp_ns;
        let checked = intake::imu(sample, &self.settings.imu).and_then(|input| {
            // The sample of the very stamp the state was set at moves nothing, but it is the
            // input that holds from there on.
            if self.timeline.awaits_input_at(stamp_ns) {
                self.time_base.accept(&sample.header);
                return Ok((input, Continuity::Next));
            }
            Ok((input, self.time_base.judge(&sample.header)?))
        });
        let (input, continuity) = match checked {
            Ok(checked) => checked,
            Err(refusal) => return self.output.tally.refuse(refusal),
        };
        if continuity == Continuity::Restart {
            self.forget();
        }
        self.last_input = Some((stamp_ns, input));
        self.output
            .answer(sample.header.seq, sample.header.sent_ns, received_ns);
        if self.timeline.newest().is_none() && !self.try_start(stamp_ns, &input) {
            return;
        }
        if self
            .timeline
            .newest()
            .is_some_and(|(now, _)| now == stamp_ns)
        {
            self.timeline.set_input(input);
            return;
        }
        let Self {
            timeline, output, ..
        } = self;
        if let Err(Breakdown) =
            timeline.advance(stamp_ns, input, |event| output.record(&event, outbox))
        {
            self.output.tally.refuse(Refusal(REASON_INTERNAL));
            self.forget();
        }
    }

    /// Takes a position fix.
    pub fn position(&mut self, message: &PositionFix, outbox: &mut impl Outbox) {
        self.output.tally.receive(INPUT_POSITION, &message.header);
        let fix = intake::position(message, &self.settings.fusion.sources);
        self.take(fix, outbox);
    }

    /// Takes a velocity fix.
    pub fn velocity(&mut self, message: &VelocityFix, outbox: &mut impl Outbox) {
        self.output.tally.receive(INPUT_VELOCITY, &message.header);
        let fix = intake::velocity(message, &self.settings.fusion.sources);
        self.take(fix, outbox);
    }

    /// Takes a heading fix.
    pub fn heading(&mut self, message: &HeadingFix, outbox: &mut impl Outbox) {
        self.output.tally.receive(INPUT_HEADING, &message.header);
        let fix = intake::heading(message, &self.settings.fusion.sources);
        self.take(fix, outbox);
    }

    /// Counts a message of another model's topic as refused.
    pub fn refuse(&mut self, input: usize, header: &Header, refusal: Refusal) {
        self.output.tally.receive(input, header);
        self.output.tally.refuse(refusal);
    }

    /// Forgets the state and initialises anew.
    pub fn reset(&mut self) {
        self.time_base = TimeBase::new(self.settings.imu.restart_gap_ns);
        self.requested = None;
        self.last_input = None;
        self.forget();
    }

    /// Continues from `state`; a stamp of 0 means the stamp of the last sample, or of the first one
    /// if none has come yet.
    ///
    /// # Errors
    /// A sentence that names the fault and the remedy; the estimate is then unchanged.
    pub fn set_state(&mut self, state: &StateVector) -> Result<(), &'static str> {
        let given_ns = (state.stamp_ns != 0).then_some(state.stamp_ns);
        let last_ns = self.last_sample_ns();
        if let (Some(given_ns), Some(last_ns)) = (given_ns, last_ns) {
            if given_ns < last_ns {
                return Err(
                    "the state is older than the last sample: send it with a stamp of 0 (now) or \
                     reset first",
                );
            }
            if given_ns - last_ns > self.settings.imu.restart_gap_ns {
                return Err("the state lies too far ahead of the last sample: check its clock");
            }
        }
        let belief = set_state::belief_of::<G, S, D>(state, &self.settings.initial)?;
        let Some(stamp_ns) = given_ns.or(last_ns) else {
            self.requested = Some(belief);
            return Ok(());
        };
        let input = self
            .last_input
            .and_then(|(input_ns, input)| (input_ns == stamp_ns).then_some(input));
        self.start(stamp_ns, input, belief);
        Ok(())
    }

    fn take(&mut self, fix: Result<Fix, Refusal>, outbox: &mut impl Outbox) {
        let fix = match fix {
            Ok(fix) => fix,
            Err(refusal) => return self.output.tally.refuse(refusal),
        };
        if self.timeline.newest().is_none() {
            return self.keep_first(&fix);
        }
        let ahead_ns = |now_ns| fix.stamp_ns.saturating_sub(now_ns);
        if self
            .last_sample_ns()
            .is_some_and(|now_ns| ahead_ns(now_ns) > MAX_AHEAD_NS)
        {
            return self.output.tally.refuse(Refusal(REASON_OUT_OF_RANGE));
        }
        let Self {
            timeline, output, ..
        } = self;
        match timeline.insert(fix, |event| output.record(&event, outbox)) {
            Insertion::Waiting | Insertion::Judged => {}
            Insertion::TooLate => self.output.tally.counters.late += 1,
            Insertion::Full => self.output.tally.refuse(Refusal(REASON_BUFFER_FULL)),
        }
    }

    /// Before there is a state, a position fix is kept to start from; others have nothing to
    /// correct. A fix that is replaced or unusable is counted as not ready.
    fn keep_first(&mut self, fix: &Fix) {
        let usable = self.settings.initial.needs_fix() && !self.settings.initial.wait_for_request;
        match FirstPosition::of(fix) {
            Some(position) if usable => {
                if self.first_position.replace(position).is_some() {
                    self.output.tally.refuse(Refusal(REASON_NOT_READY));
                }
            }
            _ => self.output.tally.refuse(Refusal(REASON_NOT_READY)),
        }
    }

    /// Starts if everything that the first belief needs has come. True if there is a state.
    fn try_start(&mut self, stamp_ns: u64, input: &ImuInput) -> bool {
        if let Some(belief) = self.requested.take() {
            self.start(stamp_ns, Some(*input), belief);
            return true;
        }
        let initial = self.settings.initial;
        if initial.wait_for_request {
            return false;
        }
        let r_wb = match initial.level {
            LevelSource::Given { roll, pitch } => {
                SO3::from_roll_pitch_heading(roll, pitch, initial.heading)
            }
            LevelSource::Accelerometer { .. } => {
                self.levelling.push(stamp_ns, input);
                if !self.levelling.is_full() {
                    return false;
                }
                let Some(levelled) = self
                    .levelling
                    .mean_force()
                    .and_then(|force_b| Levelled::from_force(&force_b, initial.heading))
                else {
                    return false;
                };
                levelled.r_wb
            }
        };
        let first = match initial.position {
            PositionSource::Given { position_w, sigma } => FirstPosition {
                stamp_ns,
                position_w,
                covariance_w: Matrix3::identity() * (sigma * sigma),
                lever_arm_b: nalgebra::Vector3::zeros(),
            },
            PositionSource::FirstFix => match self.first_position {
                // A fix ahead of the samples waits for them; an old one is no place to start from.
                Some(first) if first.stamp_ns <= stamp_ns => {
                    self.first_position = None;
                    if stamp_ns - first.stamp_ns > self.oldest_start_ns() {
                        self.output.tally.refuse(Refusal(REASON_NOT_READY));
                        return false;
                    }
                    self.output.tally.counters.accepted += 1;
                    first
                }
                _ => return false,
            },
        };
        let belief = initial.alignment(r_wb, &first).belief();
        let input = (first.stamp_ns == stamp_ns).then_some(*input);
        self.start(first.stamp_ns, input, belief);
        true
    }

    /// How old the fix may be that the state starts from: as late as any fix may be, or as long as
    /// the samples need not be doubted.
    fn oldest_start_ns(&self) -> u64 {
        let Settings { imu, fusion, .. } = &self.settings;
        imu.max_gap_ns.max(fusion.late_window_ns)
    }

    fn start(&mut self, stamp_ns: u64, input: Option<ImuInput>, belief: Belief<G, S, D>) {
        self.forget();
        self.requested = None;
        self.output.started(stamp_ns, &belief.mean.pose().position);
        self.timeline.start(stamp_ns, input, belief);
        self.time_base.advance_to(stamp_ns);
    }

    /// Forgets the state. The fixes that still waited for a sample are counted, as every input is.
    fn forget(&mut self) {
        let waiting = self.timeline.waiting() + usize::from(self.first_position.is_some());
        for _ in 0..waiting {
            self.output.tally.refuse(Refusal(REASON_NOT_READY));
        }
        self.timeline.clear();
        self.levelling.clear();
        self.first_position = None;
    }
}

impl InitialSettings {
    /// Whether the start waits for a position fix.
    fn needs_fix(&self) -> bool {
        self.position == PositionSource::FirstFix
    }

    /// The first belief's parts, from an attitude and a position.
    pub(super) fn alignment(&self, r_wb: SO3, first: &FirstPosition) -> Alignment {
        Alignment {
            r_wb,
            tilt_sigma: self.level_sigma,
            heading_sigma: self.heading_sigma,
            velocity_w: self.velocity_w,
            velocity_sigma: self.velocity_sigma,
            position_w: first.position_w,
            position_covariance_w: first.covariance_w,
            lever_arm_b: first.lever_arm_b,
            biases: self.biases,
        }
    }
}
