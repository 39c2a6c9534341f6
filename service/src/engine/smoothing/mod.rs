//! The estimate of a smoother along time: the newest smoothed state, composed with the motion since.
//!
//! Each accepted fix makes a state of the window at its own stamp, a second one of that stamp a state of its own. What
//! is published for a sample is the newest of them, moved along the samples since as a filter would: nothing of the
//! window is touched before. Then come the fixes that are due: each is judged against the estimate at its stamp, and
//! if it is let in the newest state is smoothed and the samples after it are gone through again. The other states
//! follow in pieces of bounded work, some after each sample (`behind`). Where the window is not ready for a fix it
//! corrects the estimate as a plain filter's would, and the smoothed estimate takes its place some samples later, published
//! under the same stamp as the sample then.
//!
//! A fix that is late, but not older than the last one, is fused as if it had been on time: once the window has seen it,
//! the estimate is the same bit for bit (`since`); an older one is too late. A fix that comes between two samples waits
//! for [`settle`](super::Engine::settle), or for the next sample to be out.
//!
//! A lock-out ends with a new window: it begins with the widened estimate, for what the old one believed is doubted.
//!
//! After an alignment the smoother can hand over: from then on there is no window, and a fix corrects the estimate as
//! the filter's update does.

use inekf::filter::{Belief, Gate, Left, Transport, UpdateError, UpdateOptions, Verdict};
use inekf::model::{ImuInput, InertialState};
use inekf::smoother::WindowError;
use inekf_shared::message::{NO_SOURCE, SmoothedState};
use nalgebra::Vector3;

use super::driver::Engine;
use super::fix::Fix;
use super::history::{Breakdown, Event, Insertion, MAX_FIXES, Past};
use super::inertial::Inertial;
use super::inertial::aiding::Aiding;
use super::model::{Fused, Workings};
use super::recovery::Lockout;
use super::settings::{FusionSettings, Settings, SmootherSettings};

mod behind;
mod left;
mod pace;
mod since;
mod window;

pub use behind::Effort;

use behind::Behind;
use since::{Since, Stand};

/// A fix that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    fix: Fix<Aiding>,
    /// Whether later samples had come before it.
    late: bool,
}

/// The estimate, the window behind it, and the fixes that wait.
///
/// ```
#[doc = include_str!("../example.txt")]
/// use inekf_service::engine::smoothing::Smoothing;
/// use inekf_service::engine::{Engine, Inertial};
///
/// let settings = settings("smoother");
/// let smoother = settings.smoother.expect("it is asked for");
/// let engine: Engine<Inertial<NavState, Left, 15>, Smoothing<NavState, 15>> =
///     SmoothingEngine::smoothing(settings, &smoother);
/// assert_eq!(engine.state().1, WAITING_FOR_IMU);
/// ```
#[derive(Debug)]
pub struct Smoothing<G, const D: usize> {
    late_window_ns: u64,
    /// How a fix is judged, and corrects the estimate.
    judging: UpdateOptions,
    behind: Behind<G, D>,
    since: Since<G, D>,
    /// Source of the last fix.
    source: u32,
    /// Sorted by [`Fix::order`].
    waiting: Vec<Waiting>,
    lockout: Lockout,
    has_started: bool,
    /// Below this standard deviation of the heading, rad, the filter goes on alone.
    hand_over_sigma: Option<f64>,
    /// How a fix corrects the estimate then.
    filtering: UpdateOptions,
    /// Whether the filter goes on alone.
    is_handed_over: bool,
}

/// Of the turn about the vertical, rad^2.
fn heading_variance<G: InertialState<D>, const D: usize>(belief: &Belief<G, Left, D>) -> f64 {
    let up_b = belief.mean.pose().rotation.inverse_rotate(&Vector3::z());
    let attitude = belief.covariance.matrix().fixed_view::<3, 3>(0, 0);
    up_b.dot(&(attitude * up_b))
}

/// What the counters know.
fn update_error(error: WindowError) -> UpdateError {
    match error {
        WindowError::InnovationNotPositiveDefinite => UpdateError::InnovationNotPositiveDefinite,
        WindowError::NotFinite | WindowError::AlreadySeen => UpdateError::NotFinite,
    }
}

/// An engine of the model `imu` that smooths.
pub type SmoothingEngine<G, const D: usize> = Engine<Inertial<G, Left, D>, Smoothing<G, D>>;

impl<G: InertialState<D> + 'static, const D: usize> SmoothingEngine<G, D> {
    /// An engine that waits for its first samples, with all the memory it will ever use.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// let settings = settings("smoother");
    /// let smoother = settings.smoother.expect("it is asked for");
    /// let mut engine = SmoothingEngine::<NavState, 15>::smoothing(settings, &smoother);
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// // At first the window holds the start.
    /// assert_eq!(engine.smoothed(&mut |_| {}), Ok(1));
    /// ```
    pub fn smoothing(settings: Settings, smoother: &SmootherSettings) -> Self {
        let history = Smoothing::new(&settings.fusion, smoother);
        Self::with_history(Inertial::new(&settings), settings.fusion, history)
    }

    /// How the smoothing keeps up with the samples.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// let settings = settings("smoother");
    /// let smoother = settings.smoother.expect("it is asked for");
    /// let mut engine = SmoothingEngine::<NavState, 15>::smoothing(settings, &smoother);
    /// for step in 1..=40 {
    ///     engine.sample(&at_rest(10 * step), 0, &mut estimates);
    /// }
    /// engine.position(&east(400, 0.0), &mut estimates);
    /// engine.settle(&mut estimates);
    /// // One fix, and the window was ready for it.
    /// assert_eq!((engine.effort().early, engine.effort().failed), (0, 0));
    /// ```
    pub fn effort(&self) -> Effort {
        self.history().behind.effort()
    }
}

impl<G: InertialState<D>, const D: usize> Smoothing<G, D> {
    /// An empty history with all the memory it will ever use.
    fn new(fusion: &FusionSettings, smoother: &SmootherSettings) -> Self
    where
        G: 'static,
    {
        Self {
            late_window_ns: fusion.late_window_ns,
            judging: UpdateOptions {
                iterations: 1,
                transport: Transport::None,
                ..fusion.update
            },
            behind: Behind::new(smoother),
            since: Since::new(fusion),
            source: NO_SOURCE,
            waiting: Vec::with_capacity(MAX_FIXES),
            lockout: Lockout::new(fusion.recover_after),
            has_started: false,
            hand_over_sigma: smoother.hand_over_sigma,
            filtering: fusion.update,
            is_handed_over: false,
        }
    }

    /// Has the window see all fixes at once, and takes its estimate over.
    fn catch_up(&mut self, model: &Inertial<G, Left, D>) {
        if let Some(ready) = self.behind.catch_up(model, &self.since) {
            self.since.take_over(&ready);
        }
    }

    /// Corrects the estimate with a fix whose time has come, and hands it to the window; or gates it.
    fn judge(
        &mut self,
        model: &Inertial<G, Left, D>,
        fix: &Fix<Aiding>,
    ) -> Result<Fused, UpdateError> {
        let seen = fix.measurement.for_window();
        if self.behind.is_full() {
            self.catch_up(model);
        }
        self.hand_over_if_due(model);
        let options = if self.is_handed_over {
            self.filtering
        } else {
            self.judging
        };
        let mut stand = self.since.at(model, fix.stamp_ns);
        let mut belief = stand.belief;
        let mut outcome = fix.measurement.fuse(&mut belief, &options);
        if let Some(nis) = self.lockout.broken_by(fix, &outcome) {
            self.catch_up(model);
            let widening = model.widening(&stand.belief, fix, nis);
            let wide = fix.measurement.widened(&stand.belief, &widening);
            if !self.is_handed_over {
                self.behind.begin(fix.stamp_ns, &wide);
            }
            stand = Stand::new(fix.stamp_ns, &wide);
            belief = wide;
            let open = UpdateOptions {
                gate: Gate::OPEN,
                ..options
            };
            outcome = fix.measurement.fuse(&mut belief, &open);
        }
        let fused = outcome?;
        if fused.verdict == Verdict::Accepted {
            self.source = fix.source;
            if self.is_handed_over {
                // The belief is the filter's.
            } else if self.behind.is_ready_for(fix.stamp_ns, &seen) {
                belief = self.behind.lead(&stand, seen).map_err(update_error)?;
            } else {
                self.behind.add(&stand, seen);
            }
            self.since.restart(model, fix.stamp_ns, &belief);
        }
        Ok(fused)
    }

    /// Ends the window once the heading is known well enough, if that is wanted; its states leave.
    fn hand_over_if_due(&mut self, model: &Inertial<G, Left, D>) {
        let Some(sigma) = self.hand_over_sigma else {
            return;
        };
        if self.is_handed_over || heading_variance(&self.since.newest().belief) >= sigma * sigma {
            return;
        }
        self.catch_up(model);
        self.behind.give_up();
        self.is_handed_over = true;
    }

    /// Judges the fixes that are due.
    fn judge_due(
        &mut self,
        model: &Inertial<G, Left, D>,
        emit: &mut impl FnMut(Event<'_, Belief<G, Left, D>, Aiding>),
    ) {
        let now_ns = self.since.newest().stamp_ns;
        let due = self
            .waiting
            .partition_point(|waiting| waiting.fix.stamp_ns <= now_ns);
        for index in 0..due {
            let Waiting { fix, late } = self.waiting[index];
            let outcome = self.judge(model, &fix);
            emit(Event::Judged {
                stamp_ns: now_ns,
                state: &self.since.newest().belief,
                fix: &fix,
                outcome,
                replayed: late,
            });
        }
        self.waiting.drain(..due);
    }
}

impl<G: InertialState<D>, const D: usize> Past<Inertial<G, Left, D>> for Smoothing<G, D> {
    fn start(
        &mut self,
        model: &Inertial<G, Left, D>,
        stamp_ns: u64,
        input: Option<ImuInput>,
        state: Belief<G, Left, D>,
    ) {
        self.clear(model);
        self.has_started = true;
        self.behind.begin(stamp_ns, &state);
        self.since.start(stamp_ns, input, &state);
    }

    fn clear(&mut self, model: &Inertial<G, Left, D>) {
        // The states that leave are to have seen every fix.
        self.behind.catch_up(model, &self.since);
        self.behind.give_up();
        (self.has_started, self.is_handed_over) = (false, false);
        self.waiting.clear();
        self.lockout.clear();
    }

    fn waiting(&self) -> u64 {
        self.waiting.len() as u64
    }

    fn newest(&self) -> Option<(u64, &Belief<G, Left, D>)> {
        let newest = self.since.newest();
        self.has_started
            .then_some((newest.stamp_ns, &newest.belief))
    }

    fn awaits_input_at(&self, stamp_ns: u64) -> bool {
        self.has_started && self.since.awaits_input_at(stamp_ns)
    }

    fn set_input(&mut self, input: ImuInput) {
        self.since.set_input(input);
    }

    fn advance(
        &mut self,
        model: &Inertial<G, Left, D>,
        stamp_ns: u64,
        input: ImuInput,
        mut emit: impl FnMut(Event<'_, Belief<G, Left, D>, Aiding>),
    ) -> Result<(), Breakdown> {
        if !self.has_started {
            return Err(Breakdown);
        }
        let (motion, state) = self.since.step(model, stamp_ns, &input);
        if !model.is_sound(&state) {
            return Err(Breakdown);
        }
        emit(Event::Propagated {
            stamp_ns,
            state: &state,
        });
        if self.since.is_full() {
            self.catch_up(model);
        }
        self.since.push(model, stamp_ns, input, &motion, &state);
        self.judge_due(model, &mut emit);
        if !self.is_handed_over
            && let Some(ready) = self.behind.keep_up(model, &self.since)
        {
            self.since.take_over(&ready);
            emit(Event::Smoothed {
                stamp_ns,
                state: &self.since.newest().belief,
                source: self.source,
            });
        }
        self.since.forget_old(model, self.behind.needs_from_ns());
        Ok(())
    }

    fn insert(
        &mut self,
        _model: &Inertial<G, Left, D>,
        fix: Fix<Aiding>,
        _emit: impl FnMut(Event<'_, Belief<G, Left, D>, Aiding>),
    ) -> Insertion {
        let now_ns = self.since.newest().stamp_ns;
        let is_too_late = now_ns.saturating_sub(fix.stamp_ns) > self.late_window_ns
            || fix.stamp_ns < self.since.oldest_ns();
        if !self.has_started || is_too_late {
            return Insertion::TooLate;
        }
        if self.waiting.len() >= MAX_FIXES {
            return Insertion::Full;
        }
        let index = self
            .waiting
            .partition_point(|waiting| waiting.fix.order() < fix.order());
        let late = fix.stamp_ns < now_ns;
        self.waiting.insert(index, Waiting { fix, late });
        Insertion::Waiting
    }

    fn settle(
        &mut self,
        model: &Inertial<G, Left, D>,
        mut emit: impl FnMut(Event<'_, Belief<G, Left, D>, Aiding>),
    ) {
        self.judge_due(model, &mut emit);
    }

    fn take_left(&mut self) -> Option<SmoothedState> {
        self.behind.take_left()
    }

    fn smoothed(
        &mut self,
        model: &Inertial<G, Left, D>,
        give: &mut dyn FnMut(&SmoothedState),
    ) -> Option<usize> {
        self.behind.run_ahead(model, &self.since);
        Some(self.behind.each(give))
    }
}
