//! The engine: time, order, losses, the first state and restarts, whatever the model.

use inekf_shared::message::{
    Header, HeadingFix, INPUT_HEADING, INPUT_POSITION, INPUT_VELOCITY, PositionFix,
    REASON_INTERNAL, REASON_NOT_READY, STATE_ALIGNING, STATE_PAUSED, STATE_WAITING, SmoothedState,
    VelocityFix, WAITING_FOR_IMU, WAITING_FOR_LEVEL, WAITING_FOR_NOTHING, WAITING_FOR_POSITION,
    WAITING_FOR_REQUEST,
};
use inekf_shared::transport::InputMessage;

use super::fix::{Antenna, Fix};
use super::history::{Breakdown, History};
use super::model::{Model, Preceding};
use super::output::{Outbox, Output};
use super::resume::{Earlier, Resumption};
use super::settings::FusionSettings;
use super::stack::Stack;
use super::tally::{Refusal, Tally};
use super::time_base::{Continuity, TimeBase};
use super::timeline::Timeline;

mod fixes;
mod requests;
mod start;

/// A fix may be this far ahead of the last sample; beyond, its clock is not the samples' clock.
pub(crate) const MAX_AHEAD_NS: u64 = 60_000_000_000;

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
    pub(super) fn of(model: M, fusion: FusionSettings) -> Self {
        let timeline = Timeline::new(&model, fusion);
        Self::with_history(model, fusion, timeline)
    }
}

impl<M: Model, H: History<M>> Engine<M, H> {
    /// An engine that waits for its first samples, with all the memory it will ever use; `history` is empty.
    pub(super) fn with_history(model: M, fusion: FusionSettings, history: H) -> Self {
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// // Time does not stand still: the second one is refused.
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// let tally = engine.tally();
    /// assert_eq!((tally.received[INPUT_IMU], tally.counters.rejected), (2, 1));
    /// assert_eq!(tally.rejected_by_reason[REASON_STAMP_NOT_AFTER as usize], 1);
    /// ```
    pub fn tally(&self) -> &Tally {
        &self.output.tally
    }

    /// `STATE_*` and `WAITING_FOR_*` now.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// assert_eq!(engine.state(), (STATE_WAITING, WAITING_FOR_IMU));
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// assert_eq!(engine.state(), (STATE_RUNNING, WAITING_FOR_NOTHING));
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// assert_eq!(engine.last_sample_ns(), None);
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// assert_eq!(engine.last_sample_ns(), Some(10_000_000));
    /// ```
    pub fn last_sample_ns(&self) -> Option<u64> {
        self.time_base.last_ns()
    }

    /// How many estimates have been published.
    pub(crate) fn estimates(&self) -> u64 {
        self.output.published()
    }

    /// How many messages have fixes that were taken and not judged.
    pub(crate) fn waiting(&self) -> u64 {
        self.history.waiting()
    }

    /// What became of the state of an earlier life.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// use inekf_service::engine::resume::Resumption;
    ///
    /// // There is none, unless one is given.
    /// assert_eq!(engine.resumption(), Resumption::None);
    /// ```
    pub fn resumption(&self) -> Resumption {
        self.resumption
    }

    /// Takes a sample that was received at `received_ns` (CLOCK_MONOTONIC, for the latency
    /// stamps only), and publishes what follows from it.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// for step in 1..=100 {
    ///     engine.sample(&at_rest(10 * step), 0, &mut estimates);
    /// }
    /// // The first says where it starts; each other one moves the estimate, and publishes it under its own stamp.
    /// assert_eq!((estimates.len(), estimates[98].head.stamp_ns), (99, 1_000_000_000));
    /// assert!(estimates[98].v_w_mps[2].abs() < 1e-9);
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// engine.sample(&at_rest(20), 0, &mut estimates);
    /// engine.position(&east(20, 3.0), &mut estimates);
    /// // Ten metres were believed of the start, ten centimetres of the fix.
    /// let corrected = estimates.last().expect("published again");
    /// assert!((corrected.p_w_m[0] - 3.0).abs() < 0.01);
    /// assert_eq!((corrected.head.stamp_ns, corrected.head.flags), (20_000_000, ESTIMATE_UPDATED));
    /// ```
    pub fn position(&mut self, message: &PositionFix, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.receive(INPUT_POSITION, &message.header);
        self.offer(self.model.position(message), outbox);
    }

    /// Takes a velocity fix.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// engine.sample(&at_rest(20), 0, &mut estimates);
    /// let fix = VelocityFix {
    ///     header: header(20),
    ///     velocity_w_mps: [5.0, 0.0, 0.0],
    ///     covariance_w: VARIANCES,
    ///     ..VelocityFix::ZERO
    /// };
    /// engine.velocity(&fix, &mut estimates);
    /// assert!((estimates.last().expect("published again").v_w_mps[0] - 5.0).abs() < 0.01);
    /// ```
    pub fn velocity(&mut self, message: &VelocityFix, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.receive(INPUT_VELOCITY, &message.header);
        self.offer(self.model.velocity(message), outbox);
    }

    /// Takes a heading fix.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// engine.sample(&at_rest(20), 0, &mut estimates);
    /// let fix = HeadingFix {
    ///     header: header(20),
    ///     heading_rad: 0.5,
    ///     sigma_rad: 0.01,
    ///     ..HeadingFix::ZERO
    /// };
    /// engine.heading(&fix, &mut estimates);
    /// // Nothing was known of the heading but this: a turn of 0.5 rad about the vertical.
    /// let q_wb = estimates.last().expect("published again").q_wb;
    /// assert!((2.0 * q_wb[2].atan2(q_wb[3]) - 0.5).abs() < 0.01);
    /// ```
    pub fn heading(&mut self, message: &HeadingFix, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.receive(INPUT_HEADING, &message.header);
        self.offer(self.model.heading(message), outbox);
    }

    /// Notes that a fix of `input` has come and is kept elsewhere until its time: it is not lost. It is counted as
    /// received when it is handed over.
    pub(crate) fn announce(&mut self, input: usize, header: &Header) {
        self.output.tally.announce(input, header);
    }

    /// Counts a message of another model's topic as refused.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// use inekf_service::engine::tally::Refusal;
    ///
    /// // A row of odometry has come to an engine for an IMU.
    /// engine.refuse(INPUT_ODOMETRY_2D, &header(10), Refusal(REASON_WRONG_MODEL));
    /// let tally = engine.tally();
    /// assert_eq!((tally.received[INPUT_ODOMETRY_2D], tally.counters.rejected), (1, 1));
    /// ```
    pub fn refuse(&mut self, input: usize, header: &Header, refusal: Refusal) {
        self.output.tally.receive(input, header);
        self.output.tally.refuse(refusal);
    }

    /// Takes in the fixes that were put off so as not to hold up a sample: call it when no sample waits.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let settings = settings("smoother");
    /// let smoother = settings.smoother.expect("it is asked for");
    /// let mut engine = SmoothingEngine::<NavState, 15>::smoothing(settings, &smoother);
    /// for ms in [10, 20] {
    ///     engine.sample(&at_rest(ms), 0, &mut estimates);
    /// }
    /// // A smoother has more to do for a fix than a sample that comes meanwhile could wait for.
    /// engine.position(&east(20, 3.0), &mut estimates);
    /// assert_eq!(engine.tally().counters.accepted, 0);
    /// engine.settle(&mut estimates);
    /// assert_eq!(engine.tally().counters.accepted, 1);
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let settings = settings("smoother");
    /// let mut smoother = settings.smoother.expect("it is asked for");
    /// smoother.window.capacity = 2;
    /// let mut engine = SmoothingEngine::<NavState, 15>::smoothing(settings, &smoother);
    /// for step in 1..=200 {
    ///     engine.sample(&at_rest(10 * step), 0, &mut estimates);
    ///     if step % 20 == 0 {
    ///         engine.position(&east(10 * step, 0.0), &mut estimates);
    ///         engine.settle(&mut estimates);
    ///     }
    /// }
    /// // The window holds two, and there have been eleven: the start, and one for each fix.
    /// let left: Vec<SmoothedState> = std::iter::from_fn(|| engine.take_left()).collect();
    /// assert!(left.len() >= 8 && left.is_sorted_by_key(|state| state.stamp_ns));
    /// ```
    pub fn take_left(&mut self) -> Option<SmoothedState> {
        self.history.take_left()
    }

    /// Hands over the states in the window, oldest first, and says how many they are.
    ///
    /// # Errors
    /// A sentence that says why there is none.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let settings = settings("smoother");
    /// let smoother = settings.smoother.expect("it is asked for");
    /// let mut smoothing = SmoothingEngine::<NavState, 15>::smoothing(settings, &smoother);
    /// for step in 1..=60 {
    ///     smoothing.sample(&at_rest(10 * step), 0, &mut estimates);
    ///     if step % 20 == 0 {
    ///         smoothing.position(&east(10 * step, 0.0), &mut estimates);
    ///         smoothing.settle(&mut estimates);
    ///     }
    /// }
    /// let mut stamps_ns = Vec::new();
    /// assert!(smoothing.smoothed(&mut |state| stamps_ns.push(state.stamp_ns)).is_ok_and(|count| count >= 3));
    /// assert!(stamps_ns.is_sorted());
    /// // A filter has no window.
    /// assert!(engine.smoothed(&mut |_| {}).is_err_and(|reason| reason.contains("no smoother")));
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// // It lies ahead of the samples, and waits for one that does not come.
    /// engine.position(&east(500, 3.0), &mut estimates);
    /// engine.finish(&mut estimates);
    /// assert_eq!(engine.tally().rejected_by_reason[REASON_NOT_READY as usize], 1);
    /// ```
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
}
