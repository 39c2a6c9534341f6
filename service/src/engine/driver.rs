//! The engine: time, order, losses, the first state and restarts, whatever the model.

use inekf_shared::message::{
    Header, HeadingFix, INPUT_HEADING, INPUT_POSITION, INPUT_VELOCITY, PositionFix, ProcessNoise,
    REASON_BUFFER_FULL, REASON_INTERNAL, REASON_NOT_READY, REASON_OUT_OF_RANGE, STATE_ALIGNING,
    STATE_PAUSED, STATE_WAITING, SmoothedState, StateVector, VelocityFix, WAITING_FOR_IMU,
    WAITING_FOR_LEVEL, WAITING_FOR_NOTHING, WAITING_FOR_POSITION, WAITING_FOR_REQUEST,
};
use inekf_shared::transport::InputMessage;
use nalgebra::{Matrix3, Vector3};

use super::fix::{Antenna, Fix, Measurement};
use super::history::{Breakdown, History, Insertion};
use super::model::{Model, Preceding};
use super::output::{Outbox, Output};
use super::resume::{Earlier, ResumeSettings, Resumption};
use super::settings::{FusionSettings, PositionSource};
use super::stack::{Missing, Offered, Stack};
use super::tally::{Refusal, Tally};
use super::time_base::{Continuity, TimeBase};
use super::timeline::Timeline;

/// A fix may be this far ahead of the last sample; beyond, its clock is not the samples' clock.
pub const MAX_AHEAD_NS: u64 = 60_000_000_000;

/// Fixes that may come between a requested state and the first sample that it waits for.
const MAX_EARLY: usize = 64;

/// A model behind the wire messages, with the history H of its estimate.
///
/// ```
/// use inekf::filter::Left;
/// use inekf::model::NavState;
/// use inekf_service::config::Config;
/// use inekf_service::engine::{InertialEngine, Settings};
/// use inekf_shared::message::{EstimateSe23, ImuSample, Zero};
///
/// let text = "\
/// model = 'imu'
/// [noise]
/// gyro_density = 3e-4
/// accel_density = 2e-2
/// [initial]
/// position_m = [1.0, 2.0, 0.0]
/// ";
/// let config = Config::from_toml_str(text, "example")?;
/// let run = || {
///     let mut engine = InertialEngine::<NavState, Left, 15>::new(Settings::new(&config));
///     let mut estimates: Vec<EstimateSe23> = Vec::new();
///     for i in 0..300 {
///         let mut sample = ImuSample { accel_mps2: [0.0, 0.0, 9.80665], ..ImuSample::ZERO };
///         (sample.header.seq, sample.header.stamp_ns) = (i, (i + 1) * 10_000_000);
///         engine.sample(&sample, 0, &mut estimates);
///     }
///     estimates
/// };
/// // At rest it levels itself, and stays where it was placed.
/// let estimates = run();
/// let last = estimates.last().expect("estimates came");
/// assert!((last.p_w_m[0] - 1.0).abs() < 1e-6 && (last.p_w_m[1] - 2.0).abs() < 1e-6);
/// // Without a clock: the same samples give the same estimates, bit for bit.
/// assert_eq!(format!("{estimates:?}"), format!("{:?}", run()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Engine<M: Model, H = Timeline<M>> {
    model: M,
    fusion: FusionSettings,
    history: H,
    stack: Stack<M::Measurement>,
    time_base: TimeBase,
    /// The last position fix that came before there was a state, with its time and source.
    first_position: Option<(u64, u32, Antenna)>,
    /// A state that was requested before the first sample, to hold from that sample on.
    requested: Option<M::State>,
    /// A state of an earlier life, to continue from if the first sample says that it can be.
    earlier: Option<Earlier<M::State>>,
    resumption: Resumption,
    /// Whether samples and fixes are only counted.
    paused: bool,
    /// Fixes that came after that request, or while the earlier state waited.
    early: Vec<Fix<M::Measurement>>,
    /// The last accepted sample with its stamp.
    last_input: Option<(u64, M::Input)>,
    /// Samples since then that were lost or refused.
    missing: u64,
    output: Output<M::Estimate>,
}

impl<M: Model> Engine<M> {
    /// A filter that waits for its first samples, with all the memory it will ever use.
    pub fn of(model: M, fusion: FusionSettings) -> Self {
        let timeline = Timeline::new(&model, fusion);
        Self::with_history(model, fusion, timeline)
    }
}

impl<M: Model, H: History<M>> Engine<M, H> {
    /// An engine that waits for its first samples, with all the memory it will ever use; `history` is empty.
    pub fn with_history(model: M, fusion: FusionSettings, history: H) -> Self {
        Self {
            history,
            stack: Stack::new(fusion.stack),
            time_base: TimeBase::new(model.restart_gap_ns()),
            first_position: None,
            requested: None,
            earlier: None,
            resumption: Resumption::None,
            paused: false,
            early: Vec::with_capacity(MAX_EARLY),
            last_input: None,
            missing: 0,
            output: Output::new(fusion.degraded_after_ns),
            fusion,
            model,
        }
    }

    /// What lies behind the newest estimate.
    pub(super) fn history(&self) -> &H {
        &self.history
    }

    /// The counters.
    pub fn tally(&self) -> &Tally {
        &self.output.tally
    }

    /// `STATE_*` and `WAITING_FOR_*` now.
    pub fn state(&self) -> (u32, u32) {
        if self.paused {
            return (STATE_PAUSED, WAITING_FOR_NOTHING);
        }
        if let Some((stamp_ns, _)) = self.history.newest() {
            return (self.output.running_state(stamp_ns), WAITING_FOR_NOTHING);
        }
        let initial = self.model.initial();
        if self.requested.is_some() || self.earlier.is_some() {
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

    /// How many estimates have been published.
    pub fn estimates(&self) -> u64 {
        self.output.published()
    }

    /// How many messages have fixes that were taken and not judged.
    pub fn waiting(&self) -> u64 {
        self.history.waiting()
    }

    /// What became of the state of an earlier life.
    pub fn resumption(&self) -> Resumption {
        self.resumption
    }

    /// Takes no sample and no fix until [`Engine::unpause`]; they are counted as refused.
    pub fn pause(&mut self) {
        self.paused = true;
    }

    /// Takes samples and fixes again. The time since the last sample is to the estimate what a silence is.
    pub fn unpause(&mut self) {
        self.paused = false;
    }

    /// Uses this process noise from the next sample on.
    ///
    /// # Errors
    /// A sentence that names the fault and the range; the noise is then as it was.
    pub fn reload_noise(&mut self, noise: &ProcessNoise) -> Result<(), &'static str> {
        self.model.reload_noise(noise)
    }

    /// The current state and covariance, if there is one.
    pub fn snapshot(&self) -> Option<StateVector> {
        self.history
            .newest()
            .map(|(stamp_ns, state)| self.model.snapshot(stamp_ns, state))
    }

    /// Takes a sample that was received at `received_ns` (CLOCK_MONOTONIC, for the latency
    /// stamps only), and publishes what follows from it.
    pub fn sample(
        &mut self,
        sample: &M::Sample,
        received_ns: u64,
        outbox: &mut impl Outbox<M::Estimate>,
    ) {
        let header = sample.header();
        let heard = self.output.tally.receive(M::INPUT, header);
        self.missing = self.missing.saturating_add(heard.lost);
        if self.paused {
            self.missing = self.missing.saturating_add(1);
            return self.output.tally.refuse(Refusal(REASON_NOT_READY));
        }
        let before = Preceding {
            sample: self.last_input,
            missing: self.missing,
        };
        let stamp_ns = header.stamp_ns;
        let checked = self.model.sample(sample, &before).and_then(|input| {
            // The sample of the very stamp the state was set at moves nothing, but it is the
            // input that holds from there on.
            if self.history.awaits_input_at(stamp_ns) {
                self.time_base.accept(header);
                return Ok((input, Continuity::Next));
            }
            Ok((input, self.time_base.judge(header)?))
        });
        let (input, continuity) = match checked {
            Ok(checked) => checked,
            Err(refusal) => {
                // What it said is missing from now on, whatever its stamp, unless it only repeats what was heard.
                if self.last_input.is_some() && !heard.repeated {
                    self.missing = self.missing.saturating_add(1);
                }
                return self.output.tally.refuse(refusal);
            }
        };
        if continuity == Continuity::Restart {
            self.forget();
        }
        self.last_input = Some((stamp_ns, input));
        self.missing = 0;
        self.output.answer(header.seq, header.sent_ns, received_ns);
        let proposed = self.model.propose(stamp_ns, &input);
        if self.history.newest().is_none() && !self.try_start(stamp_ns, &input) {
            return;
        }
        self.take_early(outbox);
        self.unstack(stamp_ns, outbox);
        if self
            .history
            .newest()
            .is_some_and(|(now, _)| now == stamp_ns)
        {
            self.history.set_input(input);
            return;
        }
        if let Some(fix) = proposed {
            self.insert(fix, outbox);
        }
        let Self {
            model,
            history,
            output,
            ..
        } = self;
        let advanced = history.advance(model, stamp_ns, input, |event| {
            output.record(model, &event, outbox);
        });
        if let Err(Breakdown) = advanced {
            self.output.tally.refuse(Refusal(REASON_INTERNAL));
            self.forget();
        }
    }

    /// Takes a position fix.
    pub fn position(&mut self, message: &PositionFix, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.receive(INPUT_POSITION, &message.header);
        self.offer(self.model.position(message), outbox);
    }

    /// Takes a velocity fix.
    pub fn velocity(&mut self, message: &VelocityFix, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.receive(INPUT_VELOCITY, &message.header);
        self.offer(self.model.velocity(message), outbox);
    }

    /// Takes a heading fix.
    pub fn heading(&mut self, message: &HeadingFix, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.receive(INPUT_HEADING, &message.header);
        self.offer(self.model.heading(message), outbox);
    }

    /// Notes that a fix of `input` has come and is kept elsewhere until its time: it is not lost. It is counted as
    /// received when it is handed over.
    pub fn announce(&mut self, input: usize, header: &Header) {
        self.output.tally.announce(input, header);
    }

    /// Counts a message of another model's topic as refused.
    pub fn refuse(&mut self, input: usize, header: &Header, refusal: Refusal) {
        self.output.tally.receive(input, header);
        self.output.tally.refuse(refusal);
    }

    /// Takes in the fixes that were put off so as not to hold up a sample: call it when no sample waits.
    pub fn settle(&mut self, outbox: &mut impl Outbox<M::Estimate>) {
        let Self {
            model,
            history,
            output,
            ..
        } = self;
        history.settle(model, |event| output.record(model, &event, outbox));
    }

    /// Takes one of the states that have left the window of a smoother, in the order in which they left it.
    pub fn take_left(&mut self) -> Option<SmoothedState> {
        self.history.take_left()
    }

    /// Hands over the states in the window, oldest first, and says how many they are.
    ///
    /// # Errors
    /// A sentence that says why there is none.
    pub fn smoothed(
        &mut self,
        give: &mut dyn FnMut(&SmoothedState),
    ) -> Result<usize, &'static str> {
        match self.history.smoothed(&self.model, give) {
            None => Err("the estimator is no smoother: there is no window of smoothed states"),
            Some(_) if self.history.newest().is_none() => {
                Err("there is no state yet: the daemon is not initialised")
            }
            Some(count) => Ok(count),
        }
    }

    /// Lets go of everything that still waits, because no sample will come any more: fixes without a partner as if
    /// they had waited in vain, all others as not ready. After this every message that was received is accounted for.
    pub fn finish(&mut self, outbox: &mut impl Outbox<M::Estimate>) {
        self.settle(outbox);
        self.unstack(u64::MAX, outbox);
        let waiting = self.history.waiting()
            + self.early.len() as u64
            + u64::from(self.first_position.is_some());
        self.output
            .tally
            .refuse_all(Refusal(REASON_NOT_READY), waiting);
        self.early.clear();
        self.first_position = None;
    }

    /// Forgets the state and initialises anew.
    pub fn reset(&mut self) {
        self.time_base = TimeBase::new(self.model.restart_gap_ns());
        self.requested = None;
        self.give_up_earlier();
        self.last_input = None;
        self.missing = 0;
        self.forget();
    }

    /// Continues from a state of an earlier life at the first sample, if that is not too late by `settings` and nothing
    /// else sets the state before. To be called before the first input.
    ///
    /// # Errors
    /// A sentence that names the fault; the estimate then starts as configured.
    pub fn resume_from(
        &mut self,
        state: &StateVector,
        settings: ResumeSettings,
    ) -> Result<(), &'static str> {
        let stamp_ns = state.stamp_ns;
        let state = self.model.requested(state)?;
        self.earlier = Some(Earlier {
            stamp_ns,
            state,
            settings,
        });
        self.resumption = Resumption::Waiting;
        Ok(())
    }

    /// Continues from `state`; a stamp of 0 means the stamp of the last sample, or where the first one
    /// begins if none has come yet.
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
            if given_ns - last_ns > self.model.restart_gap_ns() {
                return Err("the state lies too far ahead of the last sample: check its clock");
            }
        }
        let requested = self.model.requested(state)?;
        let Some(stamp_ns) = given_ns.or(last_ns) else {
            self.give_up_earlier();
            self.requested = Some(requested);
            return Ok(());
        };
        let input = self
            .last_input
            .and_then(|(input_ns, input)| (input_ns == stamp_ns).then_some(input));
        self.start(stamp_ns, input, requested);
        Ok(())
    }

    /// Takes a checked fix, or counts its refusal.
    fn offer(
        &mut self,
        fix: Result<Fix<M::Measurement>, Refusal>,
        outbox: &mut impl Outbox<M::Estimate>,
    ) {
        let fix = match fix {
            Ok(_) if self.paused => return self.output.tally.refuse(Refusal(REASON_NOT_READY)),
            Ok(fix) => fix,
            Err(refusal) => return self.output.tally.refuse(refusal),
        };
        if self.history.newest().is_none() {
            return self.keep_first(fix);
        }
        self.take(fix, outbox);
    }

    /// Hands a fix to the history, once it has its partner.
    fn take(&mut self, fix: Fix<M::Measurement>, outbox: &mut impl Outbox<M::Estimate>) {
        let ahead_ns = |now_ns| fix.stamp_ns.saturating_sub(now_ns);
        if self
            .last_sample_ns()
            .is_some_and(|now_ns| ahead_ns(now_ns) > MAX_AHEAD_NS)
        {
            return self.output.tally.refuse(Refusal(REASON_OUT_OF_RANGE));
        }
        match self.stack.offer(fix) {
            Offered::Ready(fix) => self.insert(fix, outbox),
            Offered::Waits => {}
            Offered::Displaced(oldest) => self.alone(oldest, outbox),
        }
    }

    /// Puts the fixes that came before the state on the timeline.
    fn take_early(&mut self, outbox: &mut impl Outbox<M::Estimate>) {
        let mut early = core::mem::take(&mut self.early);
        for fix in early.drain(..) {
            self.take(fix, outbox);
        }
        self.early = early;
    }

    /// Lets go of the fixes whose partners have not come by `now_ns`.
    fn unstack(&mut self, now_ns: u64, outbox: &mut impl Outbox<M::Estimate>) {
        while let Some(fix) = self.stack.overdue(now_ns) {
            self.alone(fix, outbox);
        }
    }

    /// A fix whose partner has not come.
    fn alone(&mut self, fix: Fix<M::Measurement>, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.counters.unpaired += 1;
        match self.stack.missing() {
            Missing::Unconstrained => self.insert(fix, outbox),
            Missing::Skip => {}
        }
    }

    fn insert(&mut self, fix: Fix<M::Measurement>, outbox: &mut impl Outbox<M::Estimate>) {
        let Self {
            model,
            history,
            output,
            ..
        } = self;
        let insertion = history.insert(model, fix, |event| output.record(model, &event, outbox));
        match insertion {
            Insertion::Waiting | Insertion::Judged => {}
            Insertion::TooLate => self.output.tally.counters.late += fix.count(),
            Insertion::Full => {
                let tally = &mut self.output.tally;
                tally.refuse_all(Refusal(REASON_BUFFER_FULL), fix.count());
            }
        }
    }

    /// Before there is a state, a position fix is kept to start from, and all are kept for a requested state;
    /// otherwise they have nothing to correct. A fix that is replaced or unusable is counted as not ready.
    fn keep_first(&mut self, fix: Fix<M::Measurement>) {
        let awaited = self.requested.is_some() || self.earlier.is_some();
        if awaited && self.early.len() < MAX_EARLY {
            return self.early.push(fix);
        }
        let initial = self.model.initial();
        let usable = initial.needs_fix() && !initial.wait_for_request;
        match fix.measurement.antenna() {
            Some(antenna) if usable => {
                if self
                    .first_position
                    .replace((fix.stamp_ns, fix.source, antenna))
                    .is_some()
                {
                    self.output.tally.refuse(Refusal(REASON_NOT_READY));
                }
            }
            _ => self.output.tally.refuse(Refusal(REASON_NOT_READY)),
        }
    }

    /// Starts if everything that the first state needs has come. True if there is one.
    fn try_start(&mut self, stamp_ns: u64, input: &M::Input) -> bool {
        let without_ns = self.model.start_ns(None, stamp_ns, input);
        let of_stamp = |start_ns| (start_ns == stamp_ns).then_some(*input);
        if let Some(state) = self.requested.take() {
            self.start(without_ns, of_stamp(without_ns), state);
            return true;
        }
        if self.try_resume(without_ns, stamp_ns, input) {
            return true;
        }
        if self.model.initial().wait_for_request {
            return false;
        }
        let Some(r_wb) = self.model.attitude(stamp_ns, input) else {
            return false;
        };
        let mut started_by = None;
        let (start_ns, antenna) = match self.model.initial().position {
            PositionSource::Given { position_w, sigma } => (
                without_ns,
                Antenna {
                    position_w,
                    covariance_w: Matrix3::identity() * (sigma * sigma),
                    lever_arm_b: Vector3::zeros(),
                },
            ),
            PositionSource::FirstFix => match self.first_position {
                // A fix ahead of the samples waits for them; an old one is no place to start from.
                Some((fix_ns, source, antenna)) if fix_ns <= stamp_ns => {
                    self.first_position = None;
                    if stamp_ns - fix_ns > self.oldest_start_ns() {
                        self.output.tally.refuse(Refusal(REASON_NOT_READY));
                        return false;
                    }
                    self.output.tally.counters.accepted += 1;
                    started_by = Some((source, fix_ns));
                    (self.model.start_ns(Some(fix_ns), stamp_ns, input), antenna)
                }
                _ => return false,
            },
        };
        let alignment = self.model.initial().alignment(r_wb, &antenna);
        let state = self.model.aligned(&alignment);
        self.start(start_ns, of_stamp(start_ns), state);
        if let Some((source, fix_ns)) = started_by {
            self.output.tally.fused(INPUT_POSITION, source, fix_ns);
        }
        true
    }

    /// Continues from the state of an earlier life, if there is one that can be. Of odometry the first row, which
    /// begins at `begins_ns`, speaks for a part of the time since.
    fn try_resume(&mut self, begins_ns: u64, stamp_ns: u64, input: &M::Input) -> bool {
        let Some(earlier) = self.earlier.take() else {
            return false;
        };
        self.resumption = earlier.judge(stamp_ns);
        if let Resumption::Resumed { .. } = self.resumption {
            let start_ns = begins_ns.max(earlier.stamp_ns).min(stamp_ns);
            let silence_ns = start_ns - earlier.stamp_ns;
            let mut state = earlier.state;
            self.model
                .endure(&mut state, silence_ns, &earlier.settings.doubt);
            if self.model.is_sound(&state) {
                self.start(start_ns, (start_ns == stamp_ns).then_some(*input), state);
                self.output.resumed();
                return true;
            }
            self.resumption = Resumption::Unsound;
        }
        // What came for it is now as if there had been none.
        let mut early = core::mem::take(&mut self.early);
        for fix in early.drain(..) {
            self.keep_first(fix);
        }
        self.early = early;
        false
    }

    /// Something else sets the state.
    fn give_up_earlier(&mut self) {
        if self.earlier.take().is_some() {
            self.resumption = Resumption::None;
        }
    }

    /// How old the fix may be that the state starts from: as late as any fix may be, or as long as
    /// the samples need not be doubted.
    fn oldest_start_ns(&self) -> u64 {
        self.model.max_gap_ns().max(self.fusion.late_window_ns)
    }

    fn start(&mut self, stamp_ns: u64, input: Option<M::Input>, state: M::State) {
        let early = core::mem::take(&mut self.early);
        self.forget();
        self.early = early;
        self.requested = None;
        self.give_up_earlier();
        self.output.started(stamp_ns, &self.model.place_w(&state));
        self.history.start(&self.model, stamp_ns, input, state);
        self.time_base.advance_to(stamp_ns);
    }

    /// Forgets the state. The fixes that still waited for a sample are counted, as every input is.
    fn forget(&mut self) {
        let waiting = self.history.waiting()
            + self.stack.clear() as u64
            + self.early.len() as u64
            + u64::from(self.first_position.is_some());
        let tally = &mut self.output.tally;
        tally.refuse_all(Refusal(REASON_NOT_READY), waiting);
        self.history.clear(&self.model);
        self.early.clear();
        self.model.forget_attitude();
        self.first_position = None;
    }
}
