//! Where the two processors are: a virtual machine's are moved between the threads of one core and
//! two cores while it runs, which changes every figure two to three times and shows in a raw
//! cache-line ping-pong only. So one is taken before and after every chunk of rounds.

use hdrhistogram::Histogram;

use super::cache_line::CacheLine;
use super::partner::RoundTrip;
use super::row::{self, MEDIAN};

/// Rounds of one ping-pong.
const ROUNDS: u64 = 2000;
/// Rounds before them that do not count.
const WARM_UP: u64 = 200;

/// How the two processors lie to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// Two threads of one core.
    SiblingThreads,
    /// Two cores.
    SeparateCores,
}

/// Both, in the order of the report.
pub const PLACEMENTS: [Placement; 2] = [Placement::SeparateCores, Placement::SiblingThreads];

impl Placement {
    /// Its name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::SiblingThreads => "sibling threads",
            Self::SeparateCores => "separate cores",
        }
    }

    /// What a ping-pong says, given the median below which it stays within a core.
    fn judge(pings: &Histogram<u64>, sibling_below_ns: u64) -> Self {
        if pings.value_at_quantile(MEDIAN) < sibling_below_ns {
            Self::SiblingThreads
        } else {
            Self::SeparateCores
        }
    }

    /// The placement of a chunk between two ping-pongs; `None` if it changed.
    pub fn between(
        before: &Histogram<u64>,
        after: &Histogram<u64>,
        sibling_below_ns: u64,
    ) -> Option<Self> {
        let [first, last] = [before, after].map(|pings| Self::judge(pings, sibling_below_ns));
        (first == last).then_some(first)
    }
}

/// A ping-pong between this processor and `cpu`, ns, while `partner` is held.
///
/// # Errors
/// The partner cannot be held, or has gone.
pub fn ping_pong(partner: &mut dyn RoundTrip, cpu: usize) -> anyhow::Result<Histogram<u64>> {
    partner.pause()?;
    let mut line = CacheLine::start(cpu);
    let mut pings = row::histogram()?;
    for _ in 0..WARM_UP {
        line.round()?;
    }
    for _ in 0..ROUNDS {
        pings.saturating_record(line.round()?);
    }
    drop(line);
    partner.resume()?;
    Ok(pings)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pings(median_ns: u64) -> Histogram<u64> {
        let mut pings = row::histogram().expect("bounds");
        pings.record_n(median_ns, 100).expect("in range");
        // A few interruptions say nothing about the placement.
        pings.record_n(1_000_000, 10).expect("in range");
        pings
    }

    #[test]
    fn a_chunk_has_a_placement_only_if_both_ends_agree() {
        let (near, far) = (pings(120), pings(390));
        assert_eq!(
            Placement::between(&near, &near, 220),
            Some(Placement::SiblingThreads)
        );
        assert_eq!(
            Placement::between(&far, &far, 220),
            Some(Placement::SeparateCores)
        );
        assert_eq!(Placement::between(&near, &far, 220), None);
        assert_eq!(Placement::between(&far, &near, 220), None);
    }
}
