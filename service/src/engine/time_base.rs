//! Whether a sample's stamp continues the time of the ones before it.
//!
//! One wrong stamp must not move the clock, and a clock that really jumped must not lock the
//! sensor out: a jump is believed once several samples in a row agree on it.

use inekf_shared::message::{Header, REASON_GAP, REASON_STAMP_NOT_AFTER};

use super::tally::Refusal;

/// Samples in a row that must agree before a jump of time is believed.
const CONFIRMATIONS: u32 = 10;

/// What to do with a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Continuity {
    /// It follows the last one.
    Next,
    /// Time has jumped: start anew from it.
    Restart,
}

/// The time of the accepted samples, and a jump that is not believed yet.
#[derive(Clone, Copy, Debug)]
pub struct TimeBase {
    restart_gap_ns: u64,
    last_ns: Option<u64>,
    /// Of the last sample; none before the first.
    epoch: Option<u64>,
    suspect_ns: u64,
    agreeing: u32,
}

impl TimeBase {
    /// A time base that takes gaps up to `restart_gap_ns` as continuous.
    pub fn new(restart_gap_ns: u64) -> Self {
        Self {
            restart_gap_ns,
            last_ns: None,
            epoch: None,
            suspect_ns: 0,
            agreeing: 0,
        }
    }

    /// The time of now: stamp of the last accepted sample, or of a state set after it.
    pub fn last_ns(&self) -> Option<u64> {
        self.last_ns
    }

    /// Takes the time of a sample as now: what comes must be later.
    pub fn accept(&mut self, header: &Header) {
        self.last_ns = Some(header.stamp_ns);
        self.epoch = Some(header.epoch);
        self.agreeing = 0;
    }

    /// Takes `stamp_ns` as the time of now unless that would go back; the sender stays the same.
    pub fn advance_to(&mut self, stamp_ns: u64) {
        self.last_ns = self.last_ns.max(Some(stamp_ns));
    }

    /// Judges the next sample and, if it is let in, takes its time as now.
    ///
    /// A stamp at or before the last one is refused, and so is one too far ahead. A jump beyond the
    /// restart gap, forward or back, is believed once others confirm it, and so is any step back of
    /// a sender that has restarted (a new epoch); a small step back of the same sender is waited out.
    ///
    /// # Errors
    /// The reason of the refusal.
    pub fn judge(&mut self, header: &Header) -> Result<Continuity, Refusal> {
        let Some(last_ns) = self.last_ns else {
            self.accept(header);
            return Ok(Continuity::Next);
        };
        let ahead_ns = header.stamp_ns.saturating_sub(last_ns);
        if (1..=self.restart_gap_ns).contains(&ahead_ns) {
            self.accept(header);
            return Ok(Continuity::Next);
        }
        let behind_ns = last_ns.saturating_sub(header.stamp_ns);
        let same_sender = self.epoch.is_none_or(|epoch| epoch == header.epoch);
        if ahead_ns == 0 && behind_ns <= self.restart_gap_ns && same_sender {
            return Err(Refusal(REASON_STAMP_NOT_AFTER));
        }
        let agrees = header.stamp_ns > self.suspect_ns
            && header.stamp_ns - self.suspect_ns <= self.restart_gap_ns;
        self.agreeing = if self.agreeing > 0 && agrees {
            self.agreeing + 1
        } else {
            1
        };
        self.suspect_ns = header.stamp_ns;
        if self.agreeing >= CONFIRMATIONS {
            self.accept(header);
            return Ok(Continuity::Restart);
        }
        Err(Refusal(if ahead_ns == 0 {
            REASON_STAMP_NOT_AFTER
        } else {
            REASON_GAP
        }))
    }
}

#[cfg(test)]
mod tests {
    use inekf_shared::message::Zero;

    use super::*;

    #[test]
    fn one_wrong_stamp_does_not_move_the_clock_and_ten_that_agree_do() {
        let mut time = TimeBase::new(1_000);
        let at = |stamp_ns| Header {
            stamp_ns,
            ..Header::ZERO
        };
        assert_eq!(time.judge(&at(500)), Ok(Continuity::Next));
        assert_eq!(time.judge(&at(900_000)), Err(Refusal(REASON_GAP)));
        assert_eq!(time.judge(&at(600)), Ok(Continuity::Next));
        let judged: Vec<_> = (0..10)
            .map(|i| time.judge(&at(900_000 + 100 * i)))
            .collect();
        assert!(judged[..9].iter().all(Result::is_err));
        assert_eq!(judged[9], Ok(Continuity::Restart));
    }
}
