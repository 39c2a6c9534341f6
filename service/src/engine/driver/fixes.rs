//! What an engine does with a fix: kept for the first state, held for its partner, handed to the history.

use inekf_shared::message::{REASON_BUFFER_FULL, REASON_NOT_READY, REASON_OUT_OF_RANGE};

use super::super::fix::{Fix, Measurement};
use super::super::history::{History, Insertion};
use super::super::model::Model;
use super::super::output::Outbox;
use super::super::stack::{Missing, Offered};
use super::super::tally::Refusal;
use super::{Engine, MAX_AHEAD_NS, MAX_EARLY};

impl<M: Model, H: History<M>> Engine<M, H> {
    /// Takes a checked fix, or counts its refusal.
    pub(super) fn offer(
        &mut self,
        fix: Result<Fix<M::Measurement>, Refusal>,
        outbox: &mut impl Outbox<M::Estimate>,
    ) {
        let fix = match fix {
            Ok(_) if self.paused => return self.output.tally.refuse(Refusal(REASON_NOT_READY)),
            Ok(fix) => fix,
            Err(refusal) => return self.output.tally.refuse(refusal),
        };
        if self.history.newest().is_none() {
            return self.keep_first(fix);
        }
        self.take(fix, outbox);
    }

    /// Hands a fix to the history, once it has its partner.
    fn take(&mut self, fix: Fix<M::Measurement>, outbox: &mut impl Outbox<M::Estimate>) {
        let ahead_ns = |now_ns| fix.stamp_ns.saturating_sub(now_ns);
        if self
            .last_sample_ns()
            .is_some_and(|now_ns| ahead_ns(now_ns) > MAX_AHEAD_NS)
        {
            return self.output.tally.refuse(Refusal(REASON_OUT_OF_RANGE));
        }
        match self.stack.offer(fix) {
            Offered::Ready(fix) => self.insert(fix, outbox),
            Offered::Waits => {}
            Offered::Displaced(oldest) => self.alone(oldest, outbox),
        }
    }

    /// Puts the fixes that came before the state on the timeline.
    pub(super) fn take_early(&mut self, outbox: &mut impl Outbox<M::Estimate>) {
        let mut early = core::mem::take(&mut self.early);
        for fix in early.drain(..) {
            self.take(fix, outbox);
        }
        self.early = early;
    }

    /// Lets go of the fixes whose partners have not come by `now_ns`.
    pub(super) fn unstack(&mut self, now_ns: u64, outbox: &mut impl Outbox<M::Estimate>) {
        while let Some(fix) = self.stack.overdue(now_ns) {
            self.alone(fix, outbox);
        }
    }

    /// A fix whose partner has not come.
    fn alone(&mut self, fix: Fix<M::Measurement>, outbox: &mut impl Outbox<M::Estimate>) {
        self.output.tally.counters.unpaired += 1;
        match self.stack.missing() {
            Missing::Unconstrained => self.insert(fix, outbox),
            Missing::Skip => {}
        }
    }

    pub(super) fn insert(
        &mut self,
        fix: Fix<M::Measurement>,
        outbox: &mut impl Outbox<M::Estimate>,
    ) {
        let Self {
            model,
            history,
            output,
            ..
        } = self;
        let insertion = history.insert(model, fix, |event| output.record(model, &event, outbox));
        match insertion {
            Insertion::Waiting | Insertion::Judged => {}
            Insertion::TooLate => self.output.tally.counters.late += fix.count(),
            Insertion::Full => {
                let tally = &mut self.output.tally;
                tally.refuse_all(Refusal(REASON_BUFFER_FULL), fix.count());
            }
        }
    }

    /// Before there is a state, a position fix is kept to start from, and all are kept for a requested state;
    /// otherwise they have nothing to correct. A fix that is replaced or unusable is counted as not ready.
    pub(super) fn keep_first(&mut self, fix: Fix<M::Measurement>) {
        let awaited = self.requested.is_some() || self.earlier.is_some();
        if awaited && self.early.len() < MAX_EARLY {
            return self.early.push(fix);
        }
        let initial = self.model.initial();
        let usable = initial.needs_fix() && !initial.wait_for_request;
        match fix.measurement.antenna() {
            Some(antenna) if usable => {
                if self
                    .first_position
                    .replace((fix.stamp_ns, fix.source, antenna))
                    .is_some()
                {
                    self.output.tally.refuse(Refusal(REASON_NOT_READY));
                }
            }
            _ => self.output.tally.refuse(Refusal(REASON_NOT_READY)),
        }
    }
}
