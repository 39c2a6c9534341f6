//! The estimate of a smoother along time: the newest smoothed state, composed with the motion since.
//!
//! Each accepted fix makes a state of the window at its own stamp, a second one of that stamp a state of its own. What
//! is published for a sample is the newest of them, moved along the samples since as a filter would: nothing of the
//! window is touched before. Then come the fixes that are due: each is judged against the estimate at its stamp, and
//! if it is let in the window is solved and the samples after it are gone through again.
//!
//! A fix that is late, but not older than the newest state of the window, is fused as if it had been on time,
//! bit for bit ([`since`]); an older one is too late. A fix that comes between two samples waits for
//! [`settle`](History::settle), or for the next sample to be out.
//!
//! A lock-out ends with a new window: it begins with the widened estimate, for what the old one believed is doubted.

use std::collections::VecDeque;

use inekf::filter::{Belief, Left, Transport, UpdateError, UpdateOptions, Verdict};
use inekf::model::{ImuInput, InertialState};
use inekf::smoother::WindowError;
use inekf_shared::message::SmoothedState;

use super::driver::Engine;
use super::fix::Fix;
use super::history::{Breakdown, Event, History, Insertion, MAX_FIXES};
use super::inertial::Inertial;
use super::inertial::aiding::Aiding;
use super::model::{Fused, Model};
use super::recovery::Lockout;
use super::settings::{FusionSettings, Settings, SmootherSettings};

mod left;
pub mod since;
pub mod window;

use left::Left as LeftStates;
use since::{Since, Stand};
use window::AnyWindow;

/// A fix that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    fix: Fix<Aiding>,
    /// Whether later samples had come before it.
    late: bool,
}

/// The window, what has moved since its newest state, and the fixes that wait.
#[derive(Debug)]
pub struct Smoothing<G, const D: usize> {
    late_window_ns: u64,
    /// How a fix is judged before it is let into the window.
    judging: UpdateOptions,
    window: Box<dyn AnyWindow<G, D>>,
    /// Of the states in the window, oldest first; empty before the start.
    stamps: VecDeque<u64>,
    /// Whether a fix has been given to the newest of them.
    is_seen: bool,
    since: Since<G, D>,
    /// Sorted by [`Fix::order`].
    waiting: Vec<Waiting>,
    lockout: Lockout,
    left: LeftStates,
}

/// An engine of the model `imu` that smooths.
pub type SmoothingEngine<G, const D: usize> = Engine<Inertial<G, Left, D>, Smoothing<G, D>>;

impl<G: InertialState<D> + 'static, const D: usize> SmoothingEngine<G, D> {
    /// An engine that waits for its first samples, with all the memory it will ever use.
    pub fn smoothing(settings: Settings, smoother: &SmootherSettings) -> Self {
        let history = Smoothing::new(&settings.fusion, smoother);
        Self::with_history(Inertial::new(&settings), settings.fusion, history)
    }
}

impl<G: InertialState<D>, const D: usize> Smoothing<G, D> {
    /// An empty history with all the memory it will ever use.
    pub fn new(fusion: &FusionSettings, smoother: &SmootherSettings) -> Self
    where
        G: 'static,
    {
        let capacity = smoother.window.capacity.max(1);
        Self {
            late_window_ns: fusion.late_window_ns,
            judging: UpdateOptions {
                iterations: 1,
                transport: Transport::None,
                ..fusion.update
            },
            window: window::of(smoother),
            stamps: VecDeque::with_capacity(capacity + 1),
            is_seen: false,
            since: Since::new(fusion),
            waiting: Vec::with_capacity(MAX_FIXES),
            lockout: Lockout::new(fusion.recover_after),
            left: LeftStates::new(capacity + MAX_FIXES),
        }
    }

    /// Begins the window anew with one state; those in it leave.
    fn begin(&mut self, stamp_ns: u64, first: &Belief<G, Left, D>) {
        self.give_up_window();
        self.window.restart(first);
        self.stamps.push_back(stamp_ns);
        self.is_seen = false;
    }

    /// Lets every state leave as it is.
    fn give_up_window(&mut self) {
        let Self {
            window,
            stamps,
            left,
            ..
        } = self;
        let mut states = stamps.iter();
        window.each(&mut |chi| {
            if let Some(&stamp_ns) = states.next() {
                left.cut(stamp_ns, chi);
            }
        });
        stamps.clear();
    }

    /// Makes a state of the window where the estimate stands, unless the newest one is there and unseen.
    fn reach(&mut self, stand: &Stand<G, D>) {
        if !self.is_seen && self.stamps.back() == Some(&stand.stamp_ns) {
            return;
        }
        if let Some(chi) = self.window.push(&stand.motion)
            && let Some(stamp_ns) = self.stamps.pop_front()
        {
            self.left.push(stamp_ns, &chi);
        }
        self.stamps.push_back(stand.stamp_ns);
        self.is_seen = false;
    }

    /// Takes a fix whose time has come into the window, or gates it.
    fn judge(
        &mut self,
        model: &Inertial<G, Left, D>,
        fix: &Fix<Aiding>,
    ) -> Result<Fused, UpdateError> {
        let stand = self.since.at(model, fix.stamp_ns);
        let Some(observation) = fix.measurement.for_window() else {
            return Err(UpdateError::NotFinite);
        };
        let outcome = fix
            .measurement
            .fuse(&mut stand.belief.clone(), &self.judging);
        match (self.lockout.broken_by(fix, &outcome), outcome) {
            (Some(nis), _) => {
                let widening = model.widening(&stand.belief, fix, nis);
                let wide = fix.measurement.widened(&stand.belief, &widening);
                self.begin(fix.stamp_ns, &wide);
            }
            (None, Ok(fused)) if fused.verdict == Verdict::Accepted => self.reach(&stand),
            (None, refused) => return refused,
        }
        let corrected = self.window.update(observation);
        self.is_seen = corrected.is_ok();
        let newest = self.window.newest();
        self.since.restart(model, fix.stamp_ns, &newest);
        let corrected = corrected.map_err(|error| match error {
            WindowError::InnovationNotPositiveDefinite => {
                UpdateError::InnovationNotPositiveDefinite
            }
            WindowError::NotFinite | WindowError::AlreadySeen => UpdateError::NotFinite,
        })?;
        Ok(Fused {
            verdict: Verdict::Accepted,
            nis: outcome.map_or(corrected.nis, |fused| fused.nis),
        })
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

impl<G: InertialState<D>, const D: usize> History<Inertial<G, Left, D>> for Smoothing<G, D> {
    fn start(&mut self, stamp_ns: u64, input: Option<ImuInput>, state: Belief<G, Left, D>) {
        self.clear();
        self.begin(stamp_ns, &state);
        self.since.start(stamp_ns, input, &state);
    }

    fn clear(&mut self) {
        self.give_up_window();
        self.waiting.clear();
        self.lockout.clear();
    }

    fn waiting(&self) -> u64 {
        self.waiting.len() as u64
    }

    fn newest(&self) -> Option<(u64, &Belief<G, Left, D>)> {
        let newest = self.since.newest();
        (!self.stamps.is_empty()).then_some((newest.stamp_ns, &newest.belief))
    }

    fn awaits_input_at(&self, stamp_ns: u64) -> bool {
        !self.stamps.is_empty() && self.since.awaits_input_at(stamp_ns)
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
        if self.stamps.is_empty() {
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
        self.since.push(model, stamp_ns, input, &motion, &state);
        self.judge_due(model, &mut emit);
        self.since.forget_old(model);
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
        if self.stamps.is_empty() || is_too_late {
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
        self.left.take()
    }

    fn smoothed(&self, give: &mut dyn FnMut(&SmoothedState)) -> Option<usize> {
        let count = self.stamps.len();
        let mut states = self.stamps.iter().enumerate();
        self.window.each(&mut |chi| {
            if let Some((index, &stamp_ns)) = states.next() {
                give(&SmoothedState {
                    index: index as u64,
                    count: count as u64,
                    ..left::message(stamp_ns, chi)
                });
            }
        });
        Some(count)
    }
}
