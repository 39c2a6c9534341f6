//! What has moved since the newest state of the window: the samples, and the estimate along them.
//!
//! A [`Stand`] is the estimate at one time: the newest smoothed state composed with the motion since, and that motion
//! as one step for the window. Three are kept, for the walk along the samples to be short: at the oldest sample that
//! a late fix may go back to, at the last but one, at the last. Wherever a walk begins, it takes the same steps,
//! sample by sample: its end is the same bit for bit.
//!
//! The samples are bounded in number and in time: the motion over those that are forgotten is in the oldest stand. Those
//! that the window has still to follow are kept as well.

use std::collections::VecDeque;

use inekf::filter::{Belief, Left};
use inekf::model::{ImuInput, InertialState};
use inekf::smoother::Preintegration;

use super::super::inertial::{ImuMotion, Inertial};
use super::super::model::Workings;
use super::super::settings::FusionSettings;
use super::behind::Ready;
use super::window::nowhere;

/// Samples that the window may be behind.
const MAX_BEHIND: usize = 4096;
/// Samples that are forgotten after each: two, for their number to fall.
const FORGOTTEN_AT_ONCE: usize = 2;

/// An estimate, and the motion that led to it from the newest state of the window.
#[derive(Clone, Copy, Debug)]
pub struct Stand<G, const D: usize> {
    /// When, nanoseconds.
    pub stamp_ns: u64,
    /// What is believed then.
    pub belief: Belief<G, Left, D>,
    /// All motion since the newest state of the window.
    pub motion: Preintegration<G, D>,
}

impl<G: InertialState<D>, const D: usize> Stand<G, D> {
    /// Units of work of one sample, as those of [`Window`](inekf::smoother::Window).
    pub const WORK: i64 = 2 + (D * D / 12) as i64;

    /// At a state of the window.
    pub(super) fn new(stamp_ns: u64, belief: &Belief<G, Left, D>) -> Self {
        Self {
            stamp_ns,
            belief: *belief,
            motion: Preintegration::new(&belief.mean),
        }
    }

    /// Moves on to `stamp_ns` within the interval of `motion`.
    fn advance(&mut self, model: &Inertial<G, Left, D>, motion: &ImuMotion, stamp_ns: u64) {
        let part_ns = stamp_ns - self.stamp_ns;
        model.advance(&mut self.belief, motion, part_ns);
        model.integrate(&mut self.motion, motion, part_ns);
        self.stamp_ns = stamp_ns;
    }
}

/// A sample; none where the state was set rather than propagated to.
#[derive(Clone, Copy, Debug)]
struct Sample {
    stamp_ns: u64,
    input: Option<ImuInput>,
}

/// The samples since the newest state of the window, and the stands along them.
#[derive(Debug)]
pub struct Since<G, const D: usize> {
    late_window_ns: u64,
    capacity: usize,
    /// One at least is not after the oldest stand.
    samples: VecDeque<Sample>,
    oldest: Stand<G, D>,
    /// At the last sample but one, or where the motion began after it.
    previous: Stand<G, D>,
    newest: Stand<G, D>,
}

impl<G: InertialState<D>, const D: usize> Since<G, D> {
    /// Nothing yet, with all the memory it will ever use.
    pub fn new(fusion: &FusionSettings) -> Self {
        let capacity = fusion.late_capacity.max(2);
        let stand = Stand::new(0, &nowhere());
        Self {
            late_window_ns: fusion.late_window_ns,
            capacity,
            samples: VecDeque::with_capacity(capacity + MAX_BEHIND + 1),
            oldest: stand,
            previous: stand,
            newest: stand,
        }
    }

    /// Forgets everything and starts with `belief` at `stamp_ns`, the time of `input` if there is a sample of that time.
    pub fn start(&mut self, stamp_ns: u64, input: Option<ImuInput>, belief: &Belief<G, Left, D>) {
        self.samples.clear();
        self.samples.push_back(Sample { stamp_ns, input });
        let stand = Stand::new(stamp_ns, belief);
        (self.oldest, self.previous, self.newest) = (stand, stand, stand);
    }

    /// The newest estimate.
    pub fn newest(&self) -> &Stand<G, D> {
        &self.newest
    }

    /// The earliest time that can be gone back to, nanoseconds.
    pub fn oldest_ns(&self) -> u64 {
        self.oldest.stamp_ns
    }

    /// Whether the state was set at `stamp_ns` and the sample of that stamp has not come yet.
    pub fn awaits_input_at(&self, stamp_ns: u64) -> bool {
        self.samples
            .back()
            .is_some_and(|sample| sample.stamp_ns == stamp_ns && sample.input.is_none())
    }

    /// Gives the last time its sample.
    pub fn set_input(&mut self, input: ImuInput) {
        if let Some(sample) = self.samples.back_mut() {
            sample.input = Some(input);
        }
    }

    /// The motion to a sample at `stamp_ns`, and the estimate there: all that has to be known before it is published.
    pub fn step(
        &self,
        model: &Inertial<G, Left, D>,
        stamp_ns: u64,
        input: &ImuInput,
    ) -> (ImuMotion, Belief<G, Left, D>) {
        let before = self.samples.back().and_then(|sample| sample.input.as_ref());
        let interval_ns = stamp_ns - self.newest.stamp_ns;
        let motion = model.motion(before, input, interval_ns);
        let mut belief = self.newest.belief;
        model.advance(&mut belief, &motion, interval_ns);
        (motion, belief)
    }

    /// Takes the sample in, with what [`step`](Self::step) said of it.
    pub fn push(
        &mut self,
        model: &Inertial<G, Left, D>,
        stamp_ns: u64,
        input: ImuInput,
        motion: &ImuMotion,
        belief: &Belief<G, Left, D>,
    ) {
        self.previous = self.newest;
        model.integrate(
            &mut self.newest.motion,
            motion,
            stamp_ns - self.newest.stamp_ns,
        );
        self.newest.belief = *belief;
        self.newest.stamp_ns = stamp_ns;
        self.samples.push_back(Sample {
            stamp_ns,
            input: Some(input),
        });
    }

    /// Whether there is no room for another sample.
    pub fn is_full(&self) -> bool {
        self.samples.len() >= self.capacity + MAX_BEHIND
    }

    /// The estimate at `stamp_ns`, which lies between the oldest stand and the newest.
    pub fn at(&self, model: &Inertial<G, Left, D>, stamp_ns: u64) -> Stand<G, D> {
        let from = [&self.newest, &self.previous]
            .into_iter()
            .find(|stand| stand.stamp_ns <= stamp_ns)
            .unwrap_or(&self.oldest);
        self.walk(model, from, stamp_ns)
    }

    /// The estimate is now `belief` at `stamp_ns`: goes through the samples after it.
    pub fn restart(
        &mut self,
        model: &Inertial<G, Left, D>,
        stamp_ns: u64,
        belief: &Belief<G, Left, D>,
    ) {
        self.oldest = Stand::new(stamp_ns, belief);
        let last_but_one_ns = match self.samples.len() {
            0 | 1 => stamp_ns,
            count => self.samples[count - 2].stamp_ns.max(stamp_ns),
        };
        self.previous = self.walk(model, &self.oldest, last_but_one_ns);
        self.newest = self.walk(model, &self.previous, u64::MAX);
    }

    /// The estimate is now the smoothed one.
    pub(super) fn take_over(&mut self, ready: &Ready<G, D>) {
        (self.oldest, self.previous, self.newest) = (ready.anchor, ready.previous, ready.newest);
    }

    /// Forgets some of the samples that no late fix may go back to and that are before `needed_ns`. The last two stay.
    pub fn forget_old(&mut self, model: &Inertial<G, Left, D>, needed_ns: Option<u64>) {
        for _ in 0..FORGOTTEN_AT_ONCE {
            let next = self.after(self.oldest.stamp_ns);
            let later = self.samples.len() - next;
            let is_old = |sample: &Sample| {
                self.newest.stamp_ns - sample.stamp_ns > self.late_window_ns
                    || later >= self.capacity
            };
            match self.samples.get(next) {
                Some(sample) if later > 1 && is_old(sample) => {
                    self.oldest = self.walk(model, &self.oldest, sample.stamp_ns);
                }
                _ => break,
            }
        }
        let needed_ns = needed_ns.map_or(self.oldest.stamp_ns, |ns| ns.min(self.oldest.stamp_ns));
        while self.samples.len() > 2 && self.samples[1].stamp_ns <= needed_ns {
            self.samples.pop_front();
        }
    }

    /// The index of the first sample after `stamp_ns`.
    fn after(&self, stamp_ns: u64) -> usize {
        self.samples
            .partition_point(|sample| sample.stamp_ns <= stamp_ns)
    }

    /// From a stand along one sample, or up to `until_ns`; where there is no later one, the same.
    pub fn step_on(
        &self,
        model: &Inertial<G, Left, D>,
        from: &Stand<G, D>,
        until_ns: u64,
    ) -> Stand<G, D> {
        let next = self.samples.get(self.after(from.stamp_ns));
        match next {
            Some(next) => self.walk(model, from, next.stamp_ns.min(until_ns)),
            None => *from,
        }
    }

    /// From a stand along the samples, up to `stamp_ns` or the last of them.
    fn walk(&self, model: &Inertial<G, Left, D>, from: &Stand<G, D>, stamp_ns: u64) -> Stand<G, D> {
        let mut stand = *from;
        let next = self.after(stand.stamp_ns);
        for (before, after) in (next.max(1)..self.samples.len())
            .map(|index| (&self.samples[index - 1], &self.samples[index]))
        {
            if stand.stamp_ns >= stamp_ns {
                break;
            }
            let Some(input) = &after.input else { continue };
            let interval_ns = after.stamp_ns - before.stamp_ns;
            let motion = model.motion(before.input.as_ref(), input, interval_ns);
            stand.advance(model, &motion, after.stamp_ns.min(stamp_ns));
        }
        stand
    }
}
