//! What the daemon says about itself: the health message, and changes of state in the log.
//!
//! Everything here runs once per period, never between a sample and its estimate.

use inekf_shared::message::{
    Health, SOURCES, STATE_DEGRADED, STATE_RUNNING, STATE_STALE, source_index, state_name,
    waiting_for_name,
};
use tracing::{info, warn};

use super::supervisor;
use crate::engine::resume::Resumption;
use crate::engine::tally::Tally;

/// A sample may be seen so long before the wake-up that its sender makes next, ns.
const WAKE_UP_UNDER_WAY_NS: u64 = 1_000_000;

/// What the loop knows at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// CLOCK_MONOTONIC, nanoseconds.
    pub now_ns: u64,
    /// `MODEL_*` code.
    pub model: u32,
    /// `STATE_*` and `WAITING_FOR_*` of the engine.
    pub state: (u32, u32),
    /// Stamp of the last accepted sample, nanoseconds of the sensor clock.
    pub last_sample_ns: u64,
    /// Estimates that could not be published.
    pub failures: u64,
    /// `HEALTH_*` flags.
    pub flags: u32,
    /// What became of the checkpoint of an earlier life.
    pub resumption: Resumption,
    /// Checkpoints written.
    pub checkpoints: u64,
    /// Checkpoints that could not be written; their writer says why.
    pub checkpoint_failures: u64,
    /// Entries of the journal that could not be published.
    pub journal_failures: u64,
}

/// Makes the health messages.
#[derive(Debug)]
pub struct Watch {
    started_ns: u64,
    period_ns: u64,
    stale_after_ns: u64,
    next_ns: u64,
    last_arrival_ns: u64,
    /// When a message of any input was last taken; 0 before the first.
    last_delivery_ns: u64,
    /// When one of each source of fixes was.
    delivered_ns: [u64; SOURCES],
    /// Whether the last sleep, if any, was ended by a sender.
    was_woken: bool,
    stalls: u64,
    longest_stall_ns: u64,
    arrivals_at_last: u64,
    said: (u32, u32),
    failures_said: u64,
    resumption_said: Resumption,
}

impl Watch {
    /// A watch that starts at `now_ns` (CLOCK_MONOTONIC), when so many motion samples have arrived.
    pub fn new(now_ns: u64, arrivals: u64, period_ns: u64, stale_after_ns: u64) -> Self {
        Self {
            started_ns: now_ns,
            period_ns,
            stale_after_ns,
            next_ns: now_ns,
            last_arrival_ns: now_ns,
            last_delivery_ns: 0,
            delivered_ns: [0; SOURCES],
            was_woken: true,
            stalls: 0,
            longest_stall_ns: 0,
            arrivals_at_last: arrivals,
            said: (0, 0),
            failures_said: 0,
            resumption_said: Resumption::None,
        }
    }

    /// Notes that a motion sample that was sent at `sent_ns` arrived at `now_ns`.
    pub fn arrival(&mut self, now_ns: u64, sent_ns: u64) {
        self.last_arrival_ns = now_ns;
        self.last_delivery_ns = now_ns;
        let on_its_way_ns = now_ns.saturating_sub(sent_ns);
        if !core::mem::replace(&mut self.was_woken, true) && on_its_way_ns > WAKE_UP_UNDER_WAY_NS {
            self.stalls += 1;
            self.longest_stall_ns = self.longest_stall_ns.max(on_its_way_ns);
        }
    }

    /// Notes that the loop has slept, and whether a sender woke it. If none did and there is a sample, that one stalled.
    pub fn slept(&mut self, was_woken: bool) {
        self.was_woken = was_woken;
    }

    /// Notes that a fix of this topic and source was taken at `now_ns`.
    pub fn delivery(&mut self, input: usize, source: u32, now_ns: u64) {
        self.last_delivery_ns = now_ns;
        if let Some(last) = source_index(input, source).and_then(|at| self.delivered_ns.get_mut(at))
        {
            *last = now_ns;
        }
    }

    /// Whether a health message is due.
    pub fn is_due(&self, now_ns: u64) -> bool {
        now_ns >= self.next_ns
    }

    /// The health message of this moment; also logs what has changed since the last one.
    pub fn report(&mut self, moment: &Moment, arrivals: u64, tally: &Tally) -> Health {
        let elapsed_s = (moment.now_ns.saturating_sub(self.next_ns) + self.period_ns) as f64 * 1e-9;
        let imu_rate_hz = (arrivals - self.arrivals_at_last) as f64 / elapsed_s;
        self.arrivals_at_last = arrivals;
        self.next_ns = moment.now_ns + self.period_ns;

        let (mut state, waiting_for) = moment.state;
        let silent = moment.now_ns.saturating_sub(self.last_arrival_ns) > self.stale_after_ns;
        if silent && matches!(state, STATE_RUNNING | STATE_DEGRADED) {
            state = STATE_STALE;
        }
        let failures = moment.failures + moment.journal_failures;
        self.log((state, waiting_for), failures, tally);
        self.log_resumption(moment.resumption);
        supervisor::alive(state_name(state));
        Health {
            stamp_ns: moment.now_ns,
            uptime_ns: moment.now_ns - self.started_ns,
            instance_pid: u64::from(std::process::id()),
            state,
            waiting_for,
            model: moment.model,
            flags: moment.flags,
            last_imu_stamp_ns: moment.last_sample_ns,
            imu_rate_hz,
            counters: tally.counters,
            rejected_by_reason: tally.rejected_by_reason,
            received: tally.received,
            checkpoints: moment.checkpoints,
            checkpoint_failures: moment.checkpoint_failures,
            journal_failures: moment.journal_failures,
            last_fix_stamp_ns: tally.last_fix_stamp_ns,
            last_delivery_ns: self.last_delivery_ns,
            fused_stamp_ns: tally.fused_stamp_ns,
            delivered_ns: self.delivered_ns,
            stalls: self.stalls,
            longest_stall_ns: self.longest_stall_ns,
        }
    }

    fn log_resumption(&mut self, now: Resumption) {
        if core::mem::replace(&mut self.resumption_said, now) == now {
            return;
        }
        let seconds = |ns: u64| ns as f64 * 1e-9;
        match now {
            Resumption::None | Resumption::Waiting => {}
            Resumption::Resumed { age_ns } => {
                info!(age_s = seconds(age_ns), "resumed from the checkpoint");
            }
            Resumption::TooOld { age_ns } => warn!(
                age_s = seconds(age_ns),
                "checkpoint not used, starting as configured: it is older than max_age_s"
            ),
            Resumption::FromFuture { ahead_ns } => warn!(
                ahead_s = seconds(ahead_ns),
                "checkpoint not used, starting as configured: it lies ahead of the first sample, whose clock has \
                 started anew"
            ),
            Resumption::Unsound => warn!(
                "checkpoint not used, starting as configured: its numbers grow beyond belief over the time since"
            ),
        }
    }

    fn log(&mut self, now: (u32, u32), failures: u64, tally: &Tally) {
        if now != self.said {
            let counters = tally.counters;
            info!(
                state = state_name(now.0),
                waiting_for = waiting_for_name(now.1),
                accepted = counters.accepted,
                gated = counters.gated,
                late = counters.late,
                lost = counters.lost,
                rejected = counters.rejected,
                "state"
            );
            self.said = now;
        }
        if failures > self.failures_said {
            warn!(
                failures,
                "estimates could not be published: is there space in /dev/shm?"
            );
            self.failures_said = failures;
        }
    }
}
