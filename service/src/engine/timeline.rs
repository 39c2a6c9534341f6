//! The estimate along time: samples move it forward, fixes correct it at their own stamps.
//!
//! A ring of knots (one per sample: the sample and the belief after every fix due at its stamp)
//! reaches back over a bounded window. A fix between two samples splits the interval. A fix that
//! comes late goes back to the last knot before it and the samples since are replayed: the result
//! is bit for bit what it would have been on time. Nothing here allocates after construction.

use std::collections::VecDeque;

use inekf::filter::{
    Belief, Correction, Gate, Side, UpdateError, UpdateOptions, Verdict, propagate,
};
use inekf::model::{ImuInput, InertialState};
use inekf_shared::message::MAX_SOURCES;

use super::fix::{Fix, FixKind};
use super::recovery::Widening;
use super::settings::{FusionSettings, ImuSettings, seconds};
use crate::config::Hold;

/// Fixes that may wait or be remembered at one time.
const MAX_FIXES: usize = 1024;

/// A sample, and what was believed at its stamp after the fixes due by then.
#[derive(Clone, Copy, Debug)]
struct Knot<G, S, const D: usize> {
    stamp_ns: u64,
    /// `None` where the belief was set rather than propagated to.
    input: Option<ImuInput>,
    belief: Belief<G, S, D>,
}

/// A fix on the timeline; once decided, a replay repeats how it was let in.
#[derive(Clone, Copy, Debug)]
struct Entry {
    fix: Fix,
    /// How the covariance was widened to recover from a lock-out.
    widened: Option<Widening>,
}

/// Something worth publishing.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a, G, S, const D: usize> {
    /// The belief was propagated to `stamp_ns`.
    Propagated {
        /// Time of the belief.
        stamp_ns: u64,
        /// After the sample.
        belief: &'a Belief<G, S, D>,
    },
    /// A fix was judged.
    Judged {
        /// Time of the belief: the fix's own stamp, or the newest one after a replay.
        stamp_ns: u64,
        /// After the fix.
        belief: &'a Belief<G, S, D>,
        /// The fix.
        fix: &'a Fix,
        /// What it did.
        outcome: Result<Correction<D>, UpdateError>,
        /// Whether samples were replayed.
        replayed: bool,
    },
}

/// What became of a fix that was handed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Insertion {
    /// It lies ahead and waits for the next sample.
    Waiting,
    /// It was judged; an event was emitted.
    Judged,
    /// It is older than the window.
    TooLate,
    /// No room for more fixes.
    Full,
}

/// The belief broke down (not finite, or diverged); the timeline must be started anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Breakdown;

/// The moving window of knots and fixes.
#[derive(Debug)]
pub struct Timeline<G, S, const D: usize> {
    imu: ImuSettings,
    fusion: FusionSettings,
    knots: VecDeque<Knot<G, S, D>>,
    /// Sorted by [`Fix::order`].
    entries: Vec<Entry>,
    gated_in_a_row: [[u32; MAX_SOURCES]; FixKind::COUNT],
}

impl<G: InertialState<D>, S: Side, const D: usize> Timeline<G, S, D> {
    /// An empty timeline with all the memory it will ever use.
    pub fn new(imu: ImuSettings, fusion: FusionSettings) -> Self {
        Self {
            imu,
            fusion,
            knots: VecDeque::with_capacity(fusion.late_capacity.max(2)),
            entries: Vec::with_capacity(MAX_FIXES),
            gated_in_a_row: Default::default(),
        }
    }

    /// Forgets everything and starts from `belief` at `stamp_ns`; `input` is the sample of that
    /// stamp if there is one.
    pub fn start(&mut self, stamp_ns: u64, input: Option<ImuInput>, belief: Belief<G, S, D>) {
        self.clear();
        self.knots.push_back(Knot {
            stamp_ns,
            input,
            belief,
        });
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.knots.clear();
        self.entries.clear();
        self.gated_in_a_row = Default::default();
    }

    /// Number of fixes that lie ahead of the newest knot.
    pub fn waiting(&self) -> usize {
        let newest_ns = self.knots.back().map_or(0, |knot| knot.stamp_ns);
        let passed = self
            .entries
            .partition_point(|entry| entry.fix.stamp_ns <= newest_ns);
        self.entries.len() - passed
    }

    /// The newest stamp and belief, if started.
    pub fn newest(&self) -> Option<(u64, &Belief<G, S, D>)> {
        self.knots.back().map(|knot| (knot.stamp_ns, &knot.belief))
    }

    /// Whether the belief was set at `stamp_ns` and the sample of that stamp has not come yet.
    pub fn awaits_input_at(&self, stamp_ns: u64) -> bool {
        self.knots
            .back()
            .is_some_and(|knot| knot.stamp_ns == stamp_ns && knot.input.is_none())
    }

    /// Gives the newest knot its sample.
    pub fn set_input(&mut self, input: ImuInput) {
        if let Some(knot) = self.knots.back_mut() {
            knot.input = Some(input);
        }
    }

    /// Moves on to a sample at `stamp_ns`, which must be later than the newest knot, fusing the
    /// waiting fixes on the way. Emits an event for the sample and for each fix.
    ///
    /// # Errors
    /// [`Breakdown`] if the belief is no longer sound.
    pub fn advance(
        &mut self,
        stamp_ns: u64,
        input: ImuInput,
        mut emit: impl FnMut(Event<'_, G, S, D>),
    ) -> Result<(), Breakdown> {
        let Some(&from) = self.knots.back() else {
            return Err(Breakdown);
        };
        let mut sound = true;
        let to = self.run_interval(
            &from,
            stamp_ns,
            input,
            &mut |timeline, index, event| match event {
                Passed::Sample(belief) => {
                    sound &= is_sound(belief, &timeline.imu);
                    if sound {
                        emit(Event::Propagated { stamp_ns, belief });
                    }
                }
                Passed::Fix(belief) => {
                    let outcome = timeline.judge(index, belief, true);
                    emit(Event::Judged {
                        stamp_ns: timeline.entries[index].fix.stamp_ns,
                        belief,
                        fix: &timeline.entries[index].fix,
                        outcome,
                        replayed: false,
                    });
                }
            },
        );
        self.push(to);
        if sound { Ok(()) } else { Err(Breakdown) }
    }

    /// Takes in a fix: ahead of the newest knot it waits, at or before it it is fused at once.
    pub fn insert(&mut self, fix: Fix, mut emit: impl FnMut(Event<'_, G, S, D>)) -> Insertion {
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

        let mut outcome = Err(UpdateError::NotFinite);
        if self.knots[back_to].stamp_ns == fix.stamp_ns {
            let mut belief = self.knots[back_to].belief;
            outcome = self.judge(index, &mut belief, true);
            self.knots[back_to].belief = belief;
        }
        for later in back_to + 1..self.knots.len() {
            let (from, to) = (self.knots[later - 1], self.knots[later]);
            let Some(input) = to.input else { continue };
            self.knots[later] =
                self.run_interval(&from, to.stamp_ns, input, &mut |timeline, at, event| {
                    if let Passed::Fix(belief) = event {
                        let judged = timeline.judge(at, belief, at == index);
                        if at == index {
                            outcome = judged;
                        }
                    }
                });
        }
        if let Some(newest) = self.knots.back() {
            emit(Event::Judged {
                stamp_ns: newest.stamp_ns,
                belief: &newest.belief,
                fix: &fix,
                outcome,
                replayed: lateness_ns > 0,
            });
        }
        Insertion::Judged
    }

    /// Propagates from a knot to the sample at `stamp_ns`, stopping at each fix on the way (and,
    /// after the sample, at those of its very stamp) to hand the belief to `pass`.
    fn run_interval(
        &mut self,
        from: &Knot<G, S, D>,
        stamp_ns: u64,
        input: ImuInput,
        pass: &mut impl FnMut(&mut Self, usize, Passed<'_, G, S, D>),
    ) -> Knot<G, S, D> {
        let interval_ns = stamp_ns - from.stamp_ns;
        let held = self.held(from.input, input, interval_ns);
        let noise = self.imu.noise(interval_ns);
        let (g_w, discretisation) = (self.imu.g_w, self.imu.discretisation);
        let move_to = |belief: &mut Belief<G, S, D>, now_ns: &mut u64, to_ns: u64| {
            if to_ns > *now_ns {
                let dt_s = seconds(to_ns - *now_ns);
                *belief = propagate(belief, &held, &g_w, dt_s, discretisation, &noise);
                *now_ns = to_ns;
            }
        };

        let mut belief = from.belief;
        let mut now_ns = from.stamp_ns;
        let mut index = self
            .entries
            .partition_point(|entry| entry.fix.stamp_ns <= from.stamp_ns);
        while let Some(entry) = self.entries.get(index) {
            let fix_ns = entry.fix.stamp_ns;
            if fix_ns >= stamp_ns {
                break;
            }
            move_to(&mut belief, &mut now_ns, fix_ns);
            pass(self, index, Passed::Fix(&mut belief));
            index += 1;
        }
        move_to(&mut belief, &mut now_ns, stamp_ns);
        pass(self, index, Passed::Sample(&belief));
        while self
            .entries
            .get(index)
            .is_some_and(|entry| entry.fix.stamp_ns == stamp_ns)
        {
            pass(self, index, Passed::Fix(&mut belief));
            index += 1;
        }
        Knot {
            stamp_ns,
            input: Some(input),
            belief,
        }
    }

    /// The input that speaks for an interval. Over a gap neither end does: their mean is the best
    /// guess, and [`ImuSettings::noise`] doubts it.
    fn held(&self, before: Option<ImuInput>, after: ImuInput, interval_ns: u64) -> ImuInput {
        let Some(before) = before else { return after };
        if interval_ns > self.imu.max_gap_ns {
            return before.midpoint(&after);
        }
        match self.imu.hold {
            Hold::Backward => after,
            Hold::Forward => before,
            Hold::Midpoint => before.midpoint(&after),
        }
    }

    /// Fuses the fix at `index` into `belief`, or gates it. Only a `fresh` decision counts towards
    /// lock-out recovery; a replay repeats the widening decided then.
    fn judge(
        &mut self,
        index: usize,
        belief: &mut Belief<G, S, D>,
        fresh: bool,
    ) -> Result<Correction<D>, UpdateError> {
        let Entry { fix, widened } = self.entries[index];
        let open = UpdateOptions {
            gate: Gate::OPEN,
            ..self.fusion.update
        };
        if let (false, Some(widening)) = (fresh, widened) {
            return widening.fuse(&fix, belief, &open);
        }
        let outcome = fix.fuse(belief, &self.fusion.update);
        if !fresh {
            return outcome;
        }
        let in_a_row = &mut self.gated_in_a_row[fix.kind() as usize][fix.source as usize];
        match outcome {
            Ok(correction) if correction.verdict == Verdict::Gated => {
                *in_a_row += 1;
                if self.fusion.recover_after > 0 && *in_a_row > self.fusion.recover_after {
                    *in_a_row = 0;
                    let widening = Widening::new(&fix, &belief.mean, correction.nis);
                    self.entries[index].widened = Some(widening);
                    return widening.fuse(&fix, belief, &open);
                }
            }
            _ => *in_a_row = 0,
        }
        outcome
    }

    /// Appends a knot, forgetting what has left the window.
    fn push(&mut self, knot: Knot<G, S, D>) {
        let capacity = self.fusion.late_capacity.max(2);
        while self.knots.len() >= capacity {
            self.knots.pop_front();
        }
        self.knots.push_back(knot);
        // Two knots always stay: the newest, and the one before it for fixes of its stamp.
        while self.knots.len() > 2
            && knot.stamp_ns - self.knots[1].stamp_ns > self.fusion.late_window_ns
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

/// What [`Timeline::run_interval`] passes on its way.
enum Passed<'a, G, S, const D: usize> {
    Sample(&'a Belief<G, S, D>),
    Fix(&'a mut Belief<G, S, D>),
}

/// Beyond this, m, an estimate is not of this world: the filter has diverged.
const MAX_POSITION_M: f64 = 1e10;
/// Likewise, m/s.
const MAX_VELOCITY_MPS: f64 = 1e6;

/// A cheap check that the belief has not broken down. A bias beyond what its sensor can read is
/// none.
fn is_sound<G: InertialState<D>, S: Side, const D: usize>(
    belief: &Belief<G, S, D>,
    imu: &ImuSettings,
) -> bool {
    let mean = &belief.mean;
    let pose = mean.pose();
    mean.is_finite()
        && pose.position.amax() <= MAX_POSITION_M
        && pose.velocity.amax() <= MAX_VELOCITY_MPS
        && mean.gyro_bias().amax() <= imu.max_gyro
        && mean.accel_bias().amax() <= imu.max_accel
        && (0..D).all(|i| {
            let variance = belief.covariance.matrix()[(i, i)];
            variance.is_finite() && variance >= 0.0
        })
}
