//! Late fixes in constant time: the interval in which a fix lies is replayed, split at its stamp, and what that changes
//! at its end is carried to the newest state in one step ([`inekf::filter::late`]), however many samples have come
//! since.
//!
//! The knots between are left as they are, and a fix that is carried past them is remembered. A later fix that goes
//! back to one of them first gives it what it has missed, in the same way. Fixes are carried in the order of their
//! stamps alone: each is the last one before the newest state, or it is replayed.
//!
//! What is carried is the replayed estimate but for rounding, below 1e-12 of the scale of each number. A fix that is late
//! by a few samples only is cheaper to replay, and then is bit for bit what it would have been on time; so is one with
//! which too little would remain of a variance, by it and by those carried before it.

use inekf::filter::{LEAST_SHARE, UpdateError};

use super::{Interval, Knot, Passed, Timeline};
use crate::config::LateMethod;
use crate::engine::model::{Fused, Model};
use crate::engine::settings::FusionSettings;

/// Carried fixes that are remembered at one time; what comes beyond is replayed.
const MAX_CARRIED: usize = 32;
/// Replaying this many samples costs no more than carrying one fix.
const BREAK_EVEN: usize = 8;

/// A fix that was fused at its own stamp and carried to the newest state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carried<X> {
    /// Stamp of the first knot that it is due by.
    from_ns: u64,
    /// Knots from there on that are older than this do not know of it.
    until_ns: u64,
    /// The state of that knot without it, and with it.
    states: (X, X),
    /// The least share that it left of a variance of the newest state.
    share: f64,
}

impl<X> Carried<X> {
    /// Whether `knot` should know of it and does not.
    fn is_missed_by<I>(&self, knot: &Knot<I, X>) -> bool {
        (self.from_ns..self.until_ns).contains(&knot.stamp_ns)
    }
}

/// What came of the attempt to carry a fix.
pub(super) enum Attempt {
    /// The newest state knows of it.
    Carried(Result<Fused, UpdateError>),
    /// It was judged, and must be replayed: too little of a variance remains.
    Judged(Result<Fused, UpdateError>),
    /// It must be replayed.
    Refused,
}

/// How many carried fixes a timeline has room for.
pub(super) fn capacity<M: Model>(model: &M, fusion: &FusionSettings) -> usize {
    if fusion.late_method == LateMethod::Carry && model.carries() {
        MAX_CARRIED
    } else {
        0
    }
}

impl<M: Model> Timeline<M> {
    /// Fuses the fix at `index` at its own stamp, which the knot `back_to` is the last before, moves on to the next
    /// knot, and carries what has changed there to the newest state, if that is exact and cheaper than a replay.
    pub(super) fn attempt_to_carry(&mut self, model: &M, index: usize, back_to: usize) -> Attempt {
        self.forget_carried();
        let (Some(newest), Some(next)) = (self.knots.back(), self.knots.get(back_to + 1)) else {
            return Attempt::Refused;
        };
        let (newest_ns, from_ns) = (newest.stamp_ns, next.stamp_ns);
        let Some(input) = next.input else {
            return Attempt::Refused;
        };
        let knot = self.knots[back_to];
        let missed = || self.carried.iter().filter(|fix| fix.is_missed_by(&knot));
        let is_cheaper = self.knots.len() - 1 - back_to > BREAK_EVEN + missed().count();
        // What those before it have taken away, whose rounding no fix has taken back yet.
        let remaining: f64 = missed().map(|fix| fix.share.min(1.0)).product();
        let is_last = self
            .entries
            .get(index + 1)
            .is_none_or(|later| later.fix.stamp_ns > newest_ns);
        let has_room = self.carried.len() < capacity(model, &self.fusion);
        if !(is_cheaper && is_last && has_room) {
            return Attempt::Refused;
        }
        let interval = Interval {
            from_ns: knot.stamp_ns,
            before: knot.input,
            stamp_ns: from_ns,
            input,
        };
        let before = self.current(model, back_to + 1);
        let mut after = self.current(model, back_to);
        let mut outcome = Err(UpdateError::NotFinite);
        self.run_interval(model, &interval, &mut after, &mut |timeline, at, event| {
            if let Passed::Fix(state) = event {
                let judged = timeline.judge(model, at, state, at == index);
                if at == index {
                    outcome = judged;
                }
            }
        });
        let Some(newest) = self.knots.back_mut() else {
            return Attempt::Judged(outcome);
        };
        let (state, share) = model.carry(&before, &after, newest_ns - from_ns, &newest.state);
        if share.min(1.0) * remaining < LEAST_SHARE {
            return Attempt::Judged(outcome);
        }
        newest.state = state;
        self.carried.push_back(Carried {
            from_ns,
            until_ns: newest_ns,
            states: (before, after),
            share,
        });
        Attempt::Carried(outcome)
    }

    /// Gives the knot `at` the fixes that were carried past it. The knots after it are about to be replayed.
    pub(super) fn catch_up(&mut self, model: &M, at: usize) {
        if self.carried.is_empty() {
            return;
        }
        self.knots[at].state = self.current(model, at);
        let stamp_ns = self.knots[at].stamp_ns;
        for fix in &mut self.carried {
            fix.until_ns = fix.until_ns.min(stamp_ns);
        }
        self.forget_carried();
    }

    /// The state of the knot `at` with all fixes that it should know of.
    fn current(&self, model: &M, at: usize) -> M::State {
        let knot = &self.knots[at];
        let missed = self.carried.iter().filter(|fix| fix.is_missed_by(knot));
        missed.fold(knot.state, |state, fix| {
            let (before, after) = &fix.states;
            let elapsed_ns = knot.stamp_ns - fix.from_ns;
            model.carry(before, after, elapsed_ns, &state).0
        })
    }

    /// Forgets the carried fixes that every knot knows of.
    fn forget_carried(&mut self) {
        let oldest_ns = self.knots.front().map_or(0, |knot| knot.stamp_ns);
        self.carried
            .retain(|fix| fix.until_ns > fix.from_ns.max(oldest_ns));
    }
}
