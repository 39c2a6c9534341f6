//! The estimate along time: samples move it forward, fixes correct it at their own stamps.
//!
//! A ring of knots (one per sample: the sample and the state after every fix due at its stamp)
//! reaches back over a bounded window. A fix between two samples splits the interval. A fix that
//! comes late goes back to the last knot before it and the samples since are replayed: the result
//! is bit for bit what it would have been on time. Where carrying (`timeline/carrying.rs`) what it changes to the newest
//! state is exact and cheaper, that is done instead. Nothing here allocates after construction.

use std::collections::VecDeque;

use inekf::filter::UpdateError;

use super::fix::Fix;
use super::history::{Breakdown, Event, Insertion, MAX_FIXES, Past};
use super::model::{Fused, Model};
use super::recovery::{Lockout, Widening};
use super::settings::FusionSettings;

mod carrying;

use carrying::{Attempt, Carried};

/// A sample, and the state at its stamp after the fixes due by then.
#[derive(Clone, Copy, Debug)]
struct Knot<I, X> {
    stamp_ns: u64,
    /// `None` where the state was set rather than propagated to.
    input: Option<I>,
    state: X,
}

/// What lies between two knots.
#[derive(Clone, Copy, Debug)]
struct Interval<I> {
    from_ns: u64,
    /// The sample at its beginning, if there is one.
    before: Option<I>,
    stamp_ns: u64,
    /// The sample at its end.
    input: I,
}

/// A fix on the timeline; once decided, a replay repeats how it was let in.
#[derive(Clone, Copy, Debug)]
struct Entry<Z> {
    fix: Fix<Z>,
    /// How the covariance was widened to recover from a lock-out.
    widened: Option<Widening>,
}

/// The moving window of knots and fixes.
#[derive(Debug)]
pub struct Timeline<M: Model> {
    fusion: FusionSettings,
    knots: VecDeque<Knot<M::Input, M::State>>,
    /// Sorted by [`Fix::order`].
    entries: Vec<Entry<M::Measurement>>,
    lockout: Lockout,
    /// Fixes that the newest state knows of and some knots before it do not, oldest first.
    carried: VecDeque<Carried<M::State>>,
}

impl<M: Model> Timeline<M> {
    /// An empty timeline with all the memory it will ever use.
    pub fn new(model: &M, fusion: FusionSettings) -> Self {
        Self {
            fusion,
            carried: VecDeque::with_capacity(carrying::capacity(model, &fusion)),
            knots: VecDeque::with_capacity(fusion.late_capacity.max(2)),
            entries: Vec::with_capacity(MAX_FIXES),
            lockout: Lockout::new(fusion.recover_after),
        }
    }

    /// Propagates `state` over an interval to its sample, stopping at each fix on the way (and,
    /// after the sample, at those of its very stamp) to hand the state to `pass`.
    fn run_interval(
        &mut self,
        model: &M,
        interval: &Interval<M::Input>,
        state: &mut M::State,
        pass: &mut impl FnMut(&mut Self, usize, Passed<'_, M::State>),
    ) {
        let Interval {
            from_ns,
            before,
            stamp_ns,
            input,
        } = *interval;
        let motion = model.motion(before.as_ref(), &input, stamp_ns - from_ns);
        let move_to = |state: &mut M::State, now_ns: &mut u64, to_ns: u64| {
            if to_ns > *now_ns {
                model.advance(state, &motion, to_ns - *now_ns);
                *now_ns = to_ns;
            }
        };

        let mut now_ns = from_ns;
        let mut index = self
            .entries
            .partition_point(|entry| entry.fix.stamp_ns <= from_ns);
        while let Some(entry) = self.entries.get(index) {
            let fix_ns = entry.fix.stamp_ns;
            if fix_ns >= stamp_ns {
                break;
            }
            move_to(state, &mut now_ns, fix_ns);
            pass(self, index, Passed::Fix(state));
            index += 1;
        }
        move_to(state, &mut now_ns, stamp_ns);
        pass(self, index, Passed::Sample(state));
        while self
            .entries
            .get(index)
            .is_some_and(|entry| entry.fix.stamp_ns == stamp_ns)
        {
            pass(self, index, Passed::Fix(state));
            index += 1;
        }
    }

    /// Fuses the fix at `index` into `state`, or gates it. Only a `fresh` decision counts towards
    /// lock-out recovery; a replay repeats the widening decided then.
    fn judge(
        &mut self,
        model: &M,
        index: usize,
        state: &mut M::State,
        fresh: bool,
    ) -> Result<Fused, UpdateError> {
        let Entry { fix, widened } = self.entries[index];
        if let (false, Some(widening)) = (fresh, widened) {
            return model.fuse_widened(state, &fix, &widening);
        }
        let outcome = model.fuse(state, &fix, true);
        if !fresh {
            return outcome;
        }
        if let Some(nis) = self.lockout.broken_by(&fix, &outcome) {
            let widening = model.widening(state, &fix, nis);
            self.entries[index].widened = Some(widening);
            return model.fuse_widened(state, &fix, &widening);
        }
        outcome
    }

    /// Emits what became of a fix that came `lateness_ns` behind the newest state.
    fn report(
        &self,
        fix: &Fix<M::Measurement>,
        outcome: Result<Fused, UpdateError>,
        lateness_ns: u64,
        mut emit: impl FnMut(Event<'_, M::State, M::Measurement>),
    ) {
        if let Some(newest) = self.knots.back() {
            emit(Event::Judged {
                stamp_ns: newest.stamp_ns,
                state: &newest.state,
                fix,
                outcome,
                replayed: lateness_ns > 0,
            });
        }
    }

    /// Appends a knot, forgetting what has left the window.
    fn push(&mut self, knot: Knot<M::Input, M::State>) {
        let stamp_ns = knot.stamp_ns;
        let capacity = self.fusion.late_capacity.max(2);
        while self.knots.len() >= capacity {
            self.knots.pop_front();
        }
        self.knots.push_back(knot);
        // Two knots always stay: the newest, and the one before it for fixes of its stamp.
        while self.knots.len() > 2 && stamp_ns - self.knots[1].stamp_ns > self.fusion.late_window_ns
        {
            self.knots.pop_front();
        }
        self.forget_old_entries();
    }

    /// Forgets the fixes that no replay can reach any more.
    fn forget_old_entries(&mut self) {
        let oldest_ns = self.knots.front().map_or(0, |knot| knot.stamp_ns);
        let forgotten = self
            .entries
            .partition_point(|entry| entry.fix.stamp_ns <= oldest_ns);
        self.entries.drain(..forgotten);
    }

    /// Makes room for one more fix where the window holds too many: shortens it, for a fix that is
    /// on time is worth more than the chance of a late one. False if all of them still wait.
    fn make_room(&mut self) -> bool {
        while self.entries.len() >= MAX_FIXES && self.knots.len() > 2 {
            self.knots.pop_front();
            self.forget_old_entries();
        }
        self.entries.len() < MAX_FIXES
    }
}

impl<M: Model> Past<M> for Timeline<M> {
    fn start(&mut self, model: &M, stamp_ns: u64, input: Option<M::Input>, state: M::State) {
        self.clear(model);
        self.knots.push_back(Knot {
            stamp_ns,
            input,
            state,
        });
    }

    fn clear(&mut self, _model: &M) {
        self.knots.clear();
        self.entries.clear();
        self.carried.clear();
        self.lockout.clear();
    }

    fn waiting(&self) -> u64 {
        let newest_ns = self.knots.back().map_or(0, |knot| knot.stamp_ns);
        let passed = self
            .entries
            .partition_point(|entry| entry.fix.stamp_ns <= newest_ns);
        let ahead = &self.entries[passed..];
        ahead.iter().map(|entry| entry.fix.count()).sum()
    }

    fn newest(&self) -> Option<(u64, &M::State)> {
        self.knots.back().map(|knot| (knot.stamp_ns, &knot.state))
    }

    fn awaits_input_at(&self, stamp_ns: u64) -> bool {
        self.knots
            .back()
            .is_some_and(|knot| knot.stamp_ns == stamp_ns && knot.input.is_none())
    }

    fn set_input(&mut self, input: M::Input) {
        if let Some(knot) = self.knots.back_mut() {
            knot.input = Some(input);
        }
    }

    fn advance(
        &mut self,
        model: &M,
        stamp_ns: u64,
        input: M::Input,
        mut emit: impl FnMut(Event<'_, M::State, M::Measurement>),
    ) -> Result<(), Breakdown> {
        let Some(from) = self.knots.back() else {
            return Err(Breakdown);
        };
        let interval = Interval {
            from_ns: from.stamp_ns,
            before: from.input,
            stamp_ns,
            input,
        };
        // In the place from which it goes into the ring: a state is two kilobytes.
        let mut knot = Knot {
            stamp_ns,
            input: Some(input),
            state: from.state,
        };
        let mut sound = true;
        self.run_interval(
            model,
            &interval,
            &mut knot.state,
            &mut |timeline, index, event| match event {
                Passed::Sample(state) => {
                    sound &= model.is_sound(state);
                    if sound {
                        emit(Event::Propagated { stamp_ns, state });
                    }
                }
                Passed::Fix(state) => {
                    let outcome = timeline.judge(model, index, state, true);
                    emit(Event::Judged {
                        stamp_ns: timeline.entries[index].fix.stamp_ns,
                        state,
                        fix: &timeline.entries[index].fix,
                        outcome,
                        replayed: false,
                    });
                }
            },
        );
        self.push(knot);
        if sound { Ok(()) } else { Err(Breakdown) }
    }

    fn insert(
        &mut self,
        model: &M,
        fix: Fix<M::Measurement>,
        emit: impl FnMut(Event<'_, M::State, M::Measurement>),
    ) -> Insertion {
        let Some((newest_ns, _)) = self.newest() else {
            return Insertion::TooLate;
        };
        if !self.make_room() {
            return Insertion::Full;
        }
        let lateness_ns = newest_ns.saturating_sub(fix.stamp_ns);
        if lateness_ns > self.fusion.late_window_ns {
            return Insertion::TooLate;
        }
        // The knot to go back to: the last one strictly before the fix, so that fixes of equal
        // stamp are fused in their one order. A fix at the very start has nothing before it.
        let back_to = if fix.stamp_ns > newest_ns {
            None
        } else {
            match self
                .knots
                .iter()
                .rposition(|knot| knot.stamp_ns < fix.stamp_ns)
            {
                Some(knot) => Some(knot),
                None if self.knots.len() == 1 && fix.stamp_ns == newest_ns => Some(0),
                None => return Insertion::TooLate,
            }
        };
        let index = self
            .entries
            .partition_point(|entry| entry.fix.order() < fix.order());
        self.entries.insert(index, Entry { fix, widened: None });
        let Some(back_to) = back_to else {
            return Insertion::Waiting;
        };

        let attempt = self.attempt_to_carry(model, index, back_to);
        if let Attempt::Carried(outcome) = attempt {
            self.report(&fix, outcome, lateness_ns, emit);
            return Insertion::Judged;
        }
        self.catch_up(model, back_to);
        let (fresh, mut outcome) = match attempt {
            Attempt::Judged(outcome) => (None, outcome),
            _ => (Some(index), Err(UpdateError::NotFinite)),
        };
        if self.knots[back_to].stamp_ns == fix.stamp_ns {
            let mut state = self.knots[back_to].state;
            outcome = self.judge(model, index, &mut state, true);
            self.knots[back_to].state = state;
        }
        for later in back_to + 1..self.knots.len() {
            let (from, to) = (&self.knots[later - 1], &self.knots[later]);
            let Some(input) = to.input else { continue };
            let interval = Interval {
                from_ns: from.stamp_ns,
                before: from.input,
                stamp_ns: to.stamp_ns,
                input,
            };
            let mut state = from.state;
            self.run_interval(model, &interval, &mut state, &mut |timeline, at, event| {
                if let Passed::Fix(state) = event {
                    let judged = timeline.judge(model, at, state, Some(at) == fresh);
                    if at == index {
                        outcome = judged;
                    }
                }
            });
            self.knots[later].state = state;
        }
        self.report(&fix, outcome, lateness_ns, emit);
        Insertion::Judged
    }
}

/// What [`Timeline::run_interval`] passes on its way.
enum Passed<'a, X> {
    Sample(&'a X),
    Fix(&'a mut X),
}
