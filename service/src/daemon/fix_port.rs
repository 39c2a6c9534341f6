//! An aiding topic, read in step with the samples.
//!
//! A fix that is ahead of the samples is held back until they have caught up, so that what a sender gets does not
//! depend on how far ahead of the samples its fixes come. Fixes keep the order in which they came, but for one that is
//! far ahead: it is set aside, and the others of its topic pass it by. So one source with a fast clock does not keep
//! the others waiting.

use anyhow::Context;
use inekf_shared::message::Header;
use inekf_shared::transport::{InputMessage, Subscriber};

use crate::engine::MAX_AHEAD_NS;

/// A fix that is further ahead is set aside. Where all is well, none is: fixes come after the samples they belong to, or
/// a little before.
const FAR_AHEAD_NS: u64 = 1_000_000_000;
/// Fixes of one topic that may be set aside at a time. Beyond these the topic waits in its queue.
const MAX_ASIDE: usize = 128;

/// An aiding topic, with the fixes that are ahead of the samples.
#[derive(Debug)]
pub struct FixPort<M: InputMessage> {
    subscriber: Subscriber<M>,
    next: Option<M>,
    aside: Aside<M>,
    is_used: bool,
}

impl<M: InputMessage + Copy> FixPort<M> {
    /// Reads from `subscriber`; `is_used` if a source is configured.
    pub fn new(subscriber: Subscriber<M>, is_used: bool) -> Self {
        Self {
            subscriber,
            next: None,
            aside: Aside::new(),
            is_used,
        }
    }

    /// Whether a source is configured. What comes without one is refused, so no sample has to wait for a look at it.
    pub fn is_used(&self) -> bool {
        self.is_used
    }

    /// The next fix with a stamp up to `horizon_ns`, or one so far ahead that its clock cannot be
    /// right (the engine refuses it). `set_aside` hears of those that others pass by.
    ///
    /// # Errors
    /// The port failed.
    #[inline]
    pub fn next_until(
        &mut self,
        horizon_ns: u64,
        set_aside: impl FnMut(&Header),
    ) -> anyhow::Result<Option<M>> {
        // Nearly always there is nothing, and a sample waits for this answer.
        let is_empty = self.next.is_none() && self.aside.is_empty();
        if is_empty && !self.has_message()? {
            return Ok(None);
        }
        self.take_until(horizon_ns, set_aside)
    }

    fn has_message(&self) -> anyhow::Result<bool> {
        let has = self.subscriber.has_samples();
        has.with_context(|| format!("looking at {:?}", M::TOPIC))
    }

    #[inline(never)]
    fn take_until(
        &mut self,
        horizon_ns: u64,
        mut set_aside: impl FnMut(&Header),
    ) -> anyhow::Result<Option<M>> {
        if let Some(due) = self.aside.take_due(horizon_ns) {
            return Ok(Some(due));
        }
        loop {
            let next = match self.next.take() {
                Some(next) => Some(next),
                None => self
                    .subscriber
                    .receive()
                    .with_context(|| format!("receiving from {:?}", M::TOPIC))?
                    .map(|sample| *sample),
            };
            let Some(fix) = next else { return Ok(None) };
            let ahead_ns = fix.header().stamp_ns.saturating_sub(horizon_ns);
            if !(1..=MAX_AHEAD_NS).contains(&ahead_ns) {
                return Ok(Some(fix));
            }
            if ahead_ns <= FAR_AHEAD_NS || self.aside.is_full() {
                self.next = Some(fix);
                return Ok(None);
            }
            set_aside(fix.header());
            self.aside.insert(fix);
        }
    }
}

/// Fixes in the order of their stamps, those of one stamp in the order in which they came. Never allocates after its
/// making.
#[derive(Debug)]
struct Aside<M>(Vec<M>);

impl<M: InputMessage> Aside<M> {
    fn new() -> Self {
        Self(Vec::with_capacity(MAX_ASIDE))
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn is_full(&self) -> bool {
        self.0.len() >= MAX_ASIDE
    }

    fn insert(&mut self, fix: M) {
        let stamp_ns = fix.header().stamp_ns;
        let at = self
            .0
            .partition_point(|other| other.header().stamp_ns <= stamp_ns);
        self.0.insert(at, fix);
    }

    /// The earliest, if its time has come.
    fn take_due(&mut self, horizon_ns: u64) -> Option<M> {
        let due = self.0.first()?.header().stamp_ns <= horizon_ns;
        due.then(|| self.0.remove(0))
    }
}

#[cfg(test)]
mod tests {
    use inekf_shared::message::{HeadingFix, Zero};

    use super::*;

    fn fix(stamp_ns: u64, seq: u64) -> HeadingFix {
        let mut fix = HeadingFix::ZERO;
        (fix.header.stamp_ns, fix.header.seq) = (stamp_ns, seq);
        fix
    }

    #[test]
    fn a_fix_far_ahead_lets_the_others_pass_and_equal_stamps_keep_their_order() {
        let mut aside = Aside::new();
        for (stamp_ns, seq) in [(50_000, 0), (20, 1), (10, 2), (20, 3), (30, 4)] {
            aside.insert(fix(stamp_ns, seq));
        }
        let mut due = |horizon_ns| aside.take_due(horizon_ns).map(|fix| fix.header.seq);
        assert_eq!(due(9), None);
        assert_eq!(
            [due(20), due(20), due(20), due(20)],
            [Some(2), Some(1), Some(3), None]
        );
        assert_eq!([due(49_999), due(49_999)], [Some(4), None]);
        assert_eq!(due(50_000), Some(0));
    }

    #[test]
    fn no_more_are_set_aside_than_there_is_room_for() {
        let mut aside = Aside::new();
        while !aside.is_full() {
            aside.insert(fix(1, 0));
        }
        assert_eq!(aside.0.len(), MAX_ASIDE);
        assert_eq!(aside.0.capacity(), MAX_ASIDE);
    }
}
