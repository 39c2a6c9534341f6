//! From beliefs to messages: what is published, with its stamps, flags and counters.

use inekf::filter::Verdict;
use inekf_shared::message::{
    ESTIMATE_DEGRADED, ESTIMATE_PROPAGATED, ESTIMATE_REPLAYED, ESTIMATE_RESET, ESTIMATE_RESUMED,
    ESTIMATE_SMOOTHED, ESTIMATE_UPDATED, EstimateHead, EstimateMessage, NO_SOURCE, REASON_INTERNAL,
    STATE_DEGRADED, STATE_RUNNING,
};
use nalgebra::Vector3;

use super::fix::{Fix, FixKind, Measurement};
use super::history::Event;
use super::model::{Fused, Model};
use super::tally::{Refusal, Tally};

/// Where estimates go. The daemon's publishes them; a test's collects them.
///
/// ```
/// use inekf_service::engine::Outbox;
/// use inekf_shared::message::{EstimateSe2, Zero};
///
/// /// Only the newest is kept.
/// struct Newest(Option<EstimateSe2>);
///
/// impl Outbox<EstimateSe2> for Newest {
///     fn publish(&mut self, estimate: &mut EstimateSe2) {
///         self.0 = Some(*estimate);
///     }
/// }
///
/// let mut newest = Newest(None);
/// newest.publish(&mut EstimateSe2 { theta_rad: 0.1, ..EstimateSe2::ZERO });
/// newest.publish(&mut EstimateSe2 { theta_rad: 0.2, ..EstimateSe2::ZERO });
/// assert_eq!(newest.0.map(|estimate| estimate.theta_rad), Some(0.2));
/// ```
pub trait Outbox<E> {
    /// Takes one estimate, whose `published_ns` it may set. Must neither block nor allocate in the daemon.
    ///
    /// ```
    /// use inekf_service::engine::Outbox;
    /// use inekf_shared::message::{EstimateSe2, Zero};
    ///
    /// // A list keeps them all.
    /// let mut outbox: Vec<EstimateSe2> = Vec::new();
    /// outbox.publish(&mut EstimateSe2 { theta_rad: 0.1, ..EstimateSe2::ZERO });
    /// assert_eq!(outbox[0].theta_rad, 0.1);
    /// ```
    fn publish(&mut self, estimate: &mut E);
}

impl<E: Copy> Outbox<E> for Vec<E> {
    fn publish(&mut self, estimate: &mut E) {
        self.push(*estimate);
    }
}

/// Everything that is said about the estimate beside the estimate itself.
#[derive(Debug)]
pub(super) struct Output<E> {
    /// The counters.
    pub tally: Tally,
    /// The message under construction; its head carries what lasts from one to the next.
    message: E,
    /// Where the body was in the last message, or is at the start.
    place_w: Vector3<f64>,
    degraded_after_ns: u64,
    /// Stamp of the last accepted fix, or of the start.
    last_aided_ns: u64,
    has_started: bool,
    /// Set at a restart, until the next estimate has said so.
    announce_reset: bool,
    /// Likewise, where the state is that of an earlier life.
    announce_resumed: bool,
}

impl<E: EstimateMessage> Output<E> {
    /// Nothing published yet.
    pub fn new(degraded_after_ns: u64) -> Self {
        let mut message = E::ZERO;
        *message.head_mut() = EstimateHead::UNSTARTED;
        Self {
            tally: Tally::default(),
            message,
            place_w: Vector3::zeros(),
            degraded_after_ns,
            last_aided_ns: 0,
            has_started: false,
            announce_reset: false,
            announce_resumed: false,
        }
    }

    /// The sample that the next estimates answer.
    pub fn answer(&mut self, seq: u64, sent_ns: u64, received_ns: u64) {
        let head = self.message.head_mut();
        (head.seq, head.sent_ns, head.received_ns) = (seq, sent_ns, received_ns);
    }

    /// Notes that the state was set to `place_w` at `stamp_ns`.
    pub fn started(&mut self, stamp_ns: u64, place_w: &Vector3<f64>) {
        self.announce_resumed = false;
        self.tally.forget_fused();
        if self.has_started {
            let head = self.message.head_mut();
            head.reset_count += 1;
            head.reset_jump_m = (place_w - self.place_w).norm();
            self.announce_reset = true;
        }
        self.has_started = true;
        self.last_aided_ns = stamp_ns;
        self.place_w = *place_w;
    }

    /// Notes that the state that was set is that of an earlier life.
    pub fn resumed(&mut self) {
        self.announce_resumed = true;
    }

    /// How many estimates have been published.
    pub fn published(&self) -> u64 {
        self.message.head().estimate_seq
    }

    /// `STATE_RUNNING` or `STATE_DEGRADED` at `stamp_ns`.
    pub fn running_state(&self, stamp_ns: u64) -> u32 {
        if stamp_ns.saturating_sub(self.last_aided_ns) > self.degraded_after_ns {
            STATE_DEGRADED
        } else {
            STATE_RUNNING
        }
    }

    /// Counts and publishes what happened on the timeline.
    pub fn record<M: Model<Estimate = E>>(
        &mut self,
        model: &M,
        event: &Event<'_, M::State, M::Measurement>,
        outbox: &mut impl Outbox<E>,
    ) {
        match event {
            Event::Propagated { stamp_ns, state } => {
                let flags = ESTIMATE_PROPAGATED;
                self.publish(model, *stamp_ns, state, flags, NO_SOURCE, outbox);
            }
            Event::Judged {
                stamp_ns,
                state,
                fix,
                outcome,
                replayed,
            } => {
                let Ok(fused) = outcome else {
                    self.tally.refuse_all(Refusal(REASON_INTERNAL), fix.count());
                    return;
                };
                self.note_nis(fix, fused);
                if fused.verdict == Verdict::Gated {
                    self.tally.counters.gated += fix.count();
                    return;
                }
                self.tally.counters.accepted += fix.count();
                self.last_aided_ns = self.last_aided_ns.max(fix.stamp_ns);
                // What the engine proposes itself is nobody's message.
                for source in fix.sources().filter(|_| fix.count() > 0) {
                    let input = fix.kind().input();
                    self.tally.fused(input, source, fix.stamp_ns);
                }
                let flags = if *replayed {
                    ESTIMATE_UPDATED | ESTIMATE_REPLAYED
                } else {
                    ESTIMATE_UPDATED
                };
                self.publish(model, *stamp_ns, state, flags, fix.source, outbox);
            }
            Event::Smoothed {
                stamp_ns,
                state,
                source,
            } => self.publish(model, *stamp_ns, state, ESTIMATE_SMOOTHED, *source, outbox),
        }
    }

    /// The NIS of a position fix, under each of its sources.
    fn note_nis<Z: Measurement>(&mut self, fix: &Fix<Z>, fused: &Fused) {
        if fix.kind() != FixKind::Position {
            return;
        }
        for source in fix.sources() {
            if let Some(nis) = self.message.head_mut().nis.get_mut(source as usize) {
                *nis = fused.nis;
            }
        }
    }

    fn publish<M: Model<Estimate = E>>(
        &mut self,
        model: &M,
        stamp_ns: u64,
        of: &M::State,
        mut flags: u32,
        source: u32,
        outbox: &mut impl Outbox<E>,
    ) {
        let state = self.running_state(stamp_ns);
        if state == STATE_DEGRADED {
            flags |= ESTIMATE_DEGRADED;
        }
        if core::mem::take(&mut self.announce_reset) {
            flags |= ESTIMATE_RESET;
        }
        if core::mem::take(&mut self.announce_resumed) {
            flags |= ESTIMATE_RESUMED;
        }
        self.place_w = model.place_w(of);
        model.write(of, &mut self.message);
        let head = self.message.head_mut();
        head.stamp_ns = stamp_ns;
        head.estimate_seq += 1;
        (head.flags, head.state, head.source) = (flags, state, source);
        head.counters = self.tally.counters;
        outbox.publish(&mut self.message);
    }
}
