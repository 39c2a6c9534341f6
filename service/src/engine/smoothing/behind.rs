//! The window, and what it has still to do after the estimate has been published.
//!
//! To smooth a window of fifty states with biases takes longer than the next sample can wait. So it is done in pieces,
//! some after each sample. When a fix comes, its own state is all that is left of the forward pass, and the newest
//! state is smoothed at once; the way back, the marginalisation of the oldest state and the forward pass up to the next
//! fix follow piece by piece.
//!
//! A fix that comes before that is done (or a fix that changes what has been anticipated) corrects the estimate as a
//! plain filter's would, and waits for the window. Once the window has seen all that wait, and has gone through the
//! samples since, its estimate is taken over; likewise where each fix has several iterations.
//!
//! Work is counted in units, never timed: how much is done after a sample depends on how many samples have come for
//! each of the last fixes, so a replay does the same after the same sample, whatever the clock says. What is done beyond
//! that, because the window has been asked for, is owed, and the samples after do the less: a look at the window changes
//! no estimate.

use std::collections::VecDeque;

use inekf::filter::{Belief, Covariance, Left};
use inekf::model::InertialState;
use inekf::smoother::{self, Preintegration, WindowError};
use inekf_shared::message::SmoothedState;
use nalgebra::SVector;

use super::super::history::MAX_FIXES;
use super::super::inertial::Inertial;
use super::super::settings::SmootherSettings;
use super::left::{self, Left as LeftStates};
use super::pace::Pace;
use super::since::{Since, Stand};
use super::window::{self, AnyWindow};

/// Fixes that may wait for the window; one more, and all of them are smoothed at once.
const MAX_QUEUED: usize = 16;

/// A fix that the estimate has taken in already.
#[derive(Clone, Copy, Debug)]
struct Queued {
    stamp_ns: u64,
    seen: smoother::Fix,
}

/// What the window is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// All done; ready for the next fix.
    Idle,
    /// An update of the window is under way.
    Solving,
    /// The estimate of the newest state is moved along the samples after it, as far as the next fix.
    Following,
    /// The next update is prepared. The estimate is the smoothed one.
    Anticipating,
}

/// How the smoothing keeps up.
///
/// ```
/// use inekf_service::engine::smoothing::Effort;
///
/// // Of an engine that is fed no faster than it can smooth, the last three stay at zero.
/// let effort = Effort { last: 120, most: 300, ..Effort::default() };
/// assert_eq!((effort.early, effort.forced, effort.failed), (0, 0, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Units of work done after the last sample.
    pub last: i64,
    /// The most after any sample.
    pub most: i64,
    /// Fixes that came before the window was ready for them, and were fused as a filter does at first.
    pub early: u64,
    /// Times that all work was done in one go, because too many fixes waited or the window had to begin anew.
    pub forced: u64,
    /// Fixes that the window could not take after the estimate had.
    pub failed: u64,
}

/// A smoothed estimate that is ready: at the newest state of the window, at the last sample but one, at the last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ready<G, const D: usize> {
    pub anchor: Stand<G, D>,
    pub previous: Stand<G, D>,
    pub newest: Stand<G, D>,
}

impl<G: InertialState<D>, const D: usize> Ready<G, D> {
    fn at(stand: &Stand<G, D>) -> Self {
        Self {
            anchor: *stand,
            previous: *stand,
            newest: *stand,
        }
    }
}

/// The window and the way to the newest sample.
#[derive(Debug)]
pub(super) struct Behind<G, const D: usize> {
    window: Box<dyn AnyWindow<G, D>>,
    /// Of the states in the window, oldest first; empty before the start.
    stamps: VecDeque<u64>,
    /// Whether a fix has been given to the newest of them.
    is_seen: bool,
    queue: VecDeque<Queued>,
    phase: Phase,
    /// Whether the estimate since the last fix comes from the newest state of the window already, though the update of
    /// the others is under way.
    leads: bool,
    iterations: usize,
    /// At the newest state of the window; `newest` is the way from there on.
    ready: Ready<G, D>,
    pace: Pace,
    left: LeftStates,
    /// Of the states in the window, while they are handed over.
    covariances: Vec<Covariance<D>>,
    effort: Effort,
}

impl<G: InertialState<D>, const D: usize> Behind<G, D> {
    /// An empty window with all the memory it will ever use.
    pub fn new(settings: &SmootherSettings) -> Self
    where
        G: 'static,
    {
        let capacity = settings.window.capacity.max(1);
        Self {
            window: window::of(settings),
            stamps: VecDeque::with_capacity(capacity + 1),
            is_seen: false,
            queue: VecDeque::with_capacity(MAX_QUEUED),
            phase: Phase::Idle,
            leads: false,
            iterations: settings.window.iterations.max(1),
            ready: Ready::at(&Stand::new(0, &window::nowhere())),
            pace: Pace::default(),
            left: LeftStates::new(capacity + MAX_FIXES),
            covariances: Vec::with_capacity(capacity),
            effort: Effort::default(),
        }
    }

    /// Begins the window anew with one state; those in it leave.
    pub fn begin(&mut self, stamp_ns: u64, first: &Belief<G, Left, D>) {
        self.give_up();
        self.window.restart(first);
        self.stamps.push_back(stamp_ns);
        self.is_seen = false;
        self.stand_at(stamp_ns);
    }

    /// Lets every state leave as it is. What is still to do should be done before.
    pub fn give_up(&mut self) {
        // Half an update leaves the states on their way; without a fix that waits there is nothing else.
        let mut rest = i64::MAX;
        self.window.advance(&mut rest);
        self.find_covariances();
        let Self {
            window,
            stamps,
            left,
            covariances,
            ..
        } = self;
        let mut states = stamps.iter().zip(covariances.iter());
        window.each(&mut |chi| {
            if let Some((&stamp_ns, covariance)) = states.next() {
                left.cut(stamp_ns, chi, covariance);
            }
        });
        stamps.clear();
        self.queue.clear();
        self.phase = Phase::Anticipating;
        self.leads = false;
        self.pace = Pace::default();
    }

    /// From when on samples are still needed, nanoseconds.
    pub fn needs_from_ns(&self) -> Option<u64> {
        let is_moving = matches!(self.phase, Phase::Solving | Phase::Following);
        is_moving.then_some(self.ready.anchor.stamp_ns)
    }

    /// Whether no other fix can wait.
    pub fn is_full(&self) -> bool {
        self.pace.pending >= MAX_QUEUED
    }

    /// How the smoothing keeps up.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// Whether the state at `stamp_ns` can be smoothed as soon as it is `seen`.
    pub fn is_ready_for(&self, stamp_ns: u64, seen: &smoother::Fix) -> bool {
        let is_new = self.is_seen || self.stamps.back() != Some(&stamp_ns);
        self.phase == Phase::Idle && is_new && self.window.is_ready_for(seen)
    }

    /// Takes a fix of where the estimate stands, and smooths the newest state: the estimate from now on. For a fix that
    /// the window [is ready for](Self::is_ready_for).
    ///
    /// # Errors
    /// The fix cannot be used; the estimate is as it was.
    pub fn lead(
        &mut self,
        stand: &Stand<G, D>,
        seen: smoother::Fix,
    ) -> Result<Belief<G, Left, D>, WindowError> {
        let stamp_ns = stand.stamp_ns;
        let step = if self.iterations > 1 {
            Stand::<G, D>::WORK
        } else {
            0
        };
        self.pace.fix(self.window.work(), step);
        self.push(stamp_ns, &stand.motion);
        self.phase = Phase::Solving;
        let outcome = match self.window.begin(seen) {
            Ok(()) => self.window.lead(),
            Err(error) => Some(Err(error)),
        };
        self.leads = self.iterations == 1;
        self.ready = Ready::at(&Stand::new(stamp_ns, &self.window.newest()));
        if let Some(outcome) = outcome {
            self.solved(outcome.map(drop));
            outcome?;
        }
        Ok(self.ready.anchor.belief)
    }

    /// Takes a fix that the estimate has taken in as a filter does; `stand` is where that was, before the fix.
    pub fn add(&mut self, stand: &Stand<G, D>, seen: smoother::Fix) {
        let stamp_ns = stand.stamp_ns;
        self.queue.push_back(Queued { stamp_ns, seen });
        self.pace.fix(self.window.work(), Stand::<G, D>::WORK);
        self.effort.early += 1;
        self.leads = false;
        if matches!(self.phase, Phase::Idle | Phase::Anticipating) {
            // The estimate is the smoothed one: it has come from the newest state of the window.
            self.ready = Ready::at(stand);
            self.phase = Phase::Following;
        }
    }

    /// The work after a sample: as much as is due. The smoothed estimate, if it is to be taken over now.
    pub fn keep_up(
        &mut self,
        model: &Inertial<G, Left, D>,
        since: &Since<G, D>,
    ) -> Option<Ready<G, D>> {
        let due = self.pace.sample();
        self.effort.last = 0;
        if self.phase == Phase::Idle {
            return None;
        }
        let before = self.pace.credit + due;
        self.pace.credit = before;
        let mut taken_over = None;
        while self.pace.credit > 0 {
            if self.piece(model, since, self.pace.credit) {
                continue;
            }
            match self.phase {
                Phase::Following => taken_over = Some(self.hand_over()),
                _ => break,
            }
        }
        self.effort.last = before - self.pace.credit;
        self.effort.most = self.effort.most.max(self.effort.last);
        if self.pace.credit > 0 {
            self.pace.rest();
            self.phase = Phase::Idle;
        }
        taken_over
    }

    /// All updates that are left, at once. The smoothed estimate, if it is another one.
    pub fn catch_up(
        &mut self,
        model: &Inertial<G, Left, D>,
        since: &Since<G, D>,
    ) -> Option<Ready<G, D>> {
        if matches!(self.phase, Phase::Idle | Phase::Anticipating) {
            return None;
        }
        self.effort.forced += 1;
        self.run_ahead(model, since);
        (self.phase == Phase::Following).then(|| self.hand_over())
    }

    /// The work of samples to come, for the window to have seen all fixes.
    pub fn run_ahead(&mut self, model: &Inertial<G, Left, D>, since: &Since<G, D>) {
        while matches!(self.phase, Phase::Solving | Phase::Following)
            && self.piece(model, since, i64::MAX)
        {}
    }

    /// One of the states that have left the window.
    pub fn take_left(&mut self) -> Option<SmoothedState> {
        self.left.take()
    }

    /// Hands over the states in the window, oldest first.
    pub fn each(&mut self, give: &mut dyn FnMut(&SmoothedState)) -> usize {
        self.find_covariances();
        let count = self.stamps.len();
        let mut states = self.stamps.iter().zip(&self.covariances).enumerate();
        self.window.each(&mut |chi| {
            if let Some((index, (&stamp_ns, covariance))) = states.next() {
                give(&SmoothedState {
                    index: index as u64,
                    count: count as u64,
                    ..left::message(stamp_ns, chi, covariance)
                });
            }
        });
        count
    }

    /// The covariances of the states in the window.
    fn find_covariances(&mut self) {
        let Self {
            window,
            stamps,
            covariances,
            ..
        } = self;
        let nothing = Covariance::from_variances(&SVector::zeros());
        covariances.clear();
        covariances.resize(stamps.len(), nothing);
        window.covariances(&mut |index, covariance| {
            if let Some(slot) = covariances.get_mut(index) {
                *slot = *covariance;
            }
        });
    }

    fn hand_over(&mut self) -> Ready<G, D> {
        self.phase = Phase::Anticipating;
        self.pace.pending = 0;
        self.ready
    }

    /// Begins to follow from the newest state of the window.
    fn stand_at(&mut self, stamp_ns: u64) {
        self.ready = Ready::at(&Stand::new(stamp_ns, &self.window.newest()));
    }

    /// Does one piece of work, of about `budget` units at most; false if there is none.
    fn piece(&mut self, model: &Inertial<G, Left, D>, since: &Since<G, D>, budget: i64) -> bool {
        match self.phase {
            Phase::Idle => return false,
            Phase::Solving => {
                self.solve(budget);
                return true;
            }
            Phase::Anticipating => {
                let mut rest = budget;
                if !self.window.is_full() || self.window.cover_oldest(&mut rest) {
                    self.window.anticipate(&mut rest);
                }
                self.pace.credit -= budget - rest;
                return rest < budget;
            }
            Phase::Following => {}
        }
        let here_ns = self.ready.newest.stamp_ns;
        match self.queue.front().copied() {
            Some(fix) if fix.stamp_ns <= here_ns => {
                let mut rest = budget;
                let is_known = !self.window.is_full() || self.window.cover_oldest(&mut rest);
                self.pace.credit -= budget - rest;
                if is_known {
                    self.queue.pop_front();
                    self.see(&fix);
                }
                true
            }
            next => {
                let until_ns = next.map_or(u64::MAX, |fix| fix.stamp_ns);
                let further = since.step_on(model, &self.ready.newest, until_ns);
                if further.stamp_ns == here_ns {
                    return false;
                }
                self.ready.previous = self.ready.newest;
                self.ready.newest = further;
                self.pace.credit -= Stand::<G, D>::WORK;
                true
            }
        }
    }

    /// Gives the fix to the state of its time, which is made unless the newest one is there and unseen.
    fn see(&mut self, fix: &Queued) {
        if self.is_seen || self.stamps.back() != Some(&fix.stamp_ns) {
            self.pace.credit -= self.window.work_of_push();
            let motion = self.ready.newest.motion;
            self.push(fix.stamp_ns, &motion);
        }
        let begun = self.window.begin(fix.seen);
        self.phase = Phase::Solving;
        if begun.is_err() {
            self.solved(begun);
        }
    }

    fn push(&mut self, stamp_ns: u64, motion: &Preintegration<G, D>) {
        if let Some(leaving) = self.window.push(motion)
            && let Some(stamp_ns) = self.stamps.pop_front()
        {
            self.left.push(stamp_ns, &leaving);
        }
        self.stamps.push_back(stamp_ns);
        self.is_seen = false;
    }

    fn solve(&mut self, budget: i64) {
        let mut rest = budget;
        let outcome = self.window.advance(&mut rest);
        self.pace.credit -= budget - rest;
        if let Some(outcome) = outcome {
            self.solved(outcome.map(drop));
        }
    }

    fn solved(&mut self, outcome: Result<(), WindowError>) {
        self.is_seen = outcome.is_ok();
        self.effort.failed += u64::from(outcome.is_err());
        if core::mem::take(&mut self.leads) && outcome.is_ok() {
            self.phase = Phase::Anticipating;
            self.pace.pending = 0;
            return;
        }
        self.stand_at(self.stamps.back().copied().unwrap_or(0));
        self.phase = Phase::Following;
    }
}
