//! How much of a window is smoothed after each sample: as much as is needed to be done well before the next fix.
//!
//! Counted in samples and units of work, so that a replay keeps the same pace.

/// Fixes over which the samples between them are averaged.
const REMEMBERED: usize = 8;
/// Before that many have come, so many samples are taken to lie between two fixes.
const FIRST_GUESS: u64 = 20;
/// The least units for a sample: a few microseconds.
const LEAST: i64 = 32;
/// The most: a tenth of a millisecond. What needs more waits until too many fixes do.
const MOST: i64 = 1000;
/// The share of the samples between two fixes that the states of the window are passed in: a third. Following the
/// samples takes another third at most, and one is left.
const SHARE: i64 = 3;

/// The pace, and where it has come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Units that may be spent. Below zero what has been done ahead of time.
    pub credit: i64,
    /// Fixes since the estimate was last the smoothed one.
    pub pending: usize,
    /// For each sample.
    allowance: i64,
    /// Samples so far.
    samples: u64,
    /// How many there were at each of the last fixes.
    at: [u64; REMEMBERED],
    /// Fixes so far.
    fixes: usize,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            credit: 0,
            pending: 0,
            allowance: LEAST,
            samples: 0,
            at: [0; REMEMBERED],
            fixes: 0,
        }
    }
}

impl Pace {
    /// A sample has come: the units that are due for it.
    pub fn sample(&mut self) -> i64 {
        self.samples += 1;
        // Each sample adds a step to go after the others.
        self.allowance
    }

    /// A fix has come that takes `work` units, and each sample `step`, if the estimate is to be taken over.
    pub fn fix(&mut self, work: i64, step: i64) {
        let slot = &mut self.at[self.fixes % REMEMBERED];
        let span = self.samples - *slot;
        *slot = self.samples;
        let (span, count) = if self.fixes < REMEMBERED {
            (FIRST_GUESS, 1)
        } else {
            (span.max(1), REMEMBERED as i64)
        };
        self.fixes += 1;
        self.pending += 1;
        let solving = (SHARE * count * work + span as i64 - 1) / span as i64;
        // Each sample adds a step to go after the others.
        self.allowance = (solving + 2 * step).clamp(LEAST, MOST);
    }

    /// All is done.
    pub fn rest(&mut self) {
        (self.credit, self.pending) = (0, 0);
    }
}
