//! A row of the report: the chunks of one case at one pace, kept apart by the placement of the
//! processors, and which of its figures say more about the machine than about the mechanism. All
//! lengths are nanoseconds.

use hdrhistogram::Histogram;
use hdrhistogram::errors::CreationError;

use super::mechanism::{Case, Mechanism, Pace};
use super::placement::{PLACEMENTS, Placement};

/// The median.
pub const MEDIAN: f64 = 0.5;
/// Quantile in a thousand of which one is slower.
pub const P999: f64 = 0.999;
/// The figures of a row, by name. The last is the slowest round.
pub const FIGURES: [(&str, f64); 5] = [
    ("p50", MEDIAN),
    ("p99", 0.99),
    ("p999", P999),
    ("p9999", 0.9999),
    ("max", 1.0),
];

/// A round that much longer than the median was stopped by something else.
const HALT_NS: u64 = 10_000;
/// A quantile needs so many rounds beyond it to be more than chance.
const ROUNDS_BEYOND: f64 = 10.0;
/// The middle half of the chunks may differ by this factor.
const SPREAD: f64 = 1.5;
/// A quantile of the ping-pong so many times its median shows the machine, not the cache line.
const DISTURBED: u64 = 2;

/// An empty histogram: up to 10 s, three digits.
///
/// # Errors
/// Never with these bounds.
pub fn histogram() -> Result<Histogram<u64>, CreationError> {
    Histogram::new_with_bounds(1, 10_000_000_000, 3)
}

/// Rounds of one case at one pace without a break, between two ping-pongs.
#[derive(Clone, Debug)]
pub struct Chunk {
    /// Lengths of the rounds.
    pub rounds: Histogram<u64>,
    /// What of each the daemon needed from a sample in hand to its estimate sent; empty for what is no daemon.
    pub inside: Histogram<u64>,
    /// Times at which a round should have begun, but one was still under way.
    pub missed: u64,
    /// How often others took a processor from one of the two sides.
    pub preempted: u64,
    /// Both ping-pongs, together.
    pub pings: Histogram<u64>,
}

/// Why a figure is dominated by noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noise {
    /// Fewer than ten rounds were slower.
    FewRounds,
    /// Others took the processor at least half as often as a round was slower.
    Preempted,
    /// The chunks disagree: their middle half spans more than a factor 1.5.
    Varies,
    /// The raw cache line, disturbed, takes half as long or longer at the same quantile.
    Disturbed,
}

impl Noise {
    /// Its name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::FewRounds => "few rounds beyond it",
            Self::Preempted => "preempted as often",
            Self::Varies => "chunks disagree",
            Self::Disturbed => "raw cache line as disturbed",
        }
    }
}

/// All chunks of one case, pace and placement.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// All rounds.
    pub rounds: Histogram<u64>,
    /// The daemon's part of them, as in [`Chunk::inside`].
    pub inside: Histogram<u64>,
    /// The ping-pongs around all chunks.
    pub pings: Histogram<u64>,
    /// Times that were missed.
    pub missed: u64,
    /// How often others took a processor from one of the two sides.
    pub preempted: u64,
    /// Of each chunk: the figures, in the order of [`FIGURES`].
    chunks: Vec<[u64; FIGURES.len()]>,
    /// Of each chunk: its median by that of its own ping-pongs.
    ratios: Vec<f64>,
}

impl Distribution {
    fn new() -> Result<Self, CreationError> {
        Ok(Self {
            rounds: histogram()?,
            inside: histogram()?,
            pings: histogram()?,
            missed: 0,
            preempted: 0,
            chunks: Vec::new(),
            ratios: Vec::new(),
        })
    }

    fn add(&mut self, chunk: &Chunk) -> anyhow::Result<()> {
        self.rounds.add(&chunk.rounds)?;
        self.inside.add(&chunk.inside)?;
        self.pings.add(&chunk.pings)?;
        self.missed += chunk.missed;
        self.preempted += chunk.preempted;
        let figures = FIGURES.map(|(_, quantile)| chunk.rounds.value_at_quantile(quantile));
        self.chunks.push(figures);
        let raw = chunk.pings.value_at_quantile(MEDIAN).max(1);
        self.ratios.push(figures[0] as f64 / raw as f64);
        Ok(())
    }

    /// How many chunks it has.
    pub fn chunks(&self) -> usize {
        self.chunks.len()
    }

    /// A quantile of all rounds, ns.
    pub fn figure(&self, quantile: f64) -> u64 {
        self.rounds.value_at_quantile(quantile)
    }

    /// Median of a round by that of the raw cache line: the middle one of the chunks' own ratios.
    pub fn ratio_to_raw(&self) -> f64 {
        let mut ratios = self.ratios.clone();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// A quantile by that of another distribution.
    pub fn ratio_to(&self, base: &Self, quantile: f64) -> f64 {
        self.figure(quantile) as f64 / base.figure(quantile).max(1) as f64
    }

    /// Rounds that took 10 µs longer than the median, for each second of rounds: what stops the machine now and
    /// then, timer ticks above all, stops all mechanisms about as often in a second, and the longer round more often.
    pub fn halts_per_s(&self) -> f64 {
        let limit = self.figure(MEDIAN) + HALT_NS;
        let slow = self.rounds.iter_recorded();
        let halts: u64 = slow
            .filter(|value| value.value_iterated_to() > limit)
            .map(|value| value.count_at_value())
            .sum();
        let seconds = self.rounds.mean() * self.rounds.len() as f64 * 1e-9;
        halts as f64 / seconds
    }

    /// Whether noise dominates a quantile, and why.
    pub fn noise(&self, quantile: f64, is_raw: bool) -> Option<Noise> {
        let beyond = |histogram: &Histogram<u64>| histogram.len() as f64 * (1.0 - quantile);
        if beyond(&self.rounds) < ROUNDS_BEYOND {
            return Some(Noise::FewRounds);
        }
        if 2.0 * self.preempted as f64 >= beyond(&self.rounds) {
            return Some(Noise::Preempted);
        }
        let index = FIGURES.iter().position(|(_, known)| *known == quantile);
        if index.is_some_and(|index| self.spread(index) > SPREAD) {
            return Some(Noise::Varies);
        }
        let raw = self.pings.value_at_quantile(quantile);
        let is_disturbed = raw > DISTURBED * self.pings.value_at_quantile(MEDIAN)
            && beyond(&self.pings) >= ROUNDS_BEYOND
            && 2 * raw > self.figure(quantile);
        (!is_raw && is_disturbed).then_some(Noise::Disturbed)
    }

    /// The factor between the upper and the lower end of the middle half of the chunks.
    fn spread(&self, index: usize) -> f64 {
        let mut values: Vec<u64> = self.chunks.iter().map(|figures| figures[index]).collect();
        values.sort_unstable();
        let aside = values.len() / 4;
        let middle = values.get(aside..values.len() - aside).unwrap_or(&[]);
        match middle {
            [low, .., high] => *high as f64 / (*low).max(1) as f64,
            _ => 1.0,
        }
    }
}

/// One case at one pace.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: Case,
    /// The pace.
    pub pace: Pace,
    /// Chunks that were left out because the placement changed meanwhile.
    pub mixed: usize,
    /// By placement, in the order of [`PLACEMENTS`].
    distributions: [Option<Distribution>; PLACEMENTS.len()],
}

impl Row {
    /// An empty one.
    pub fn new(case: Case, pace: Pace) -> Self {
        Self {
            case,
            pace,
            mixed: 0,
            distributions: [None, None],
        }
    }

    /// Takes a chunk of this row; `None` is a placement that changed.
    ///
    /// # Errors
    /// Never with histograms of [`histogram`].
    pub fn add(&mut self, placement: Option<Placement>, chunk: &Chunk) -> anyhow::Result<()> {
        let Some(placement) = placement else {
            self.mixed += 1;
            return Ok(());
        };
        let places = PLACEMENTS.into_iter().zip(&mut self.distributions);
        for (_, distribution) in places.filter(|(known, _)| *known == placement) {
            match distribution {
                Some(distribution) => distribution.add(chunk)?,
                None => distribution.insert(Distribution::new()?).add(chunk)?,
            }
        }
        Ok(())
    }

    /// What was measured in a placement.
    pub fn at(&self, placement: Placement) -> Option<&Distribution> {
        let places = PLACEMENTS.into_iter().zip(&self.distributions);
        let mut found = places.filter(|(known, _)| *known == placement);
        found
            .next()
            .and_then(|(_, distribution)| distribution.as_ref())
    }

    /// Whether it is the raw cache line itself.
    pub fn is_raw(&self) -> bool {
        self.case.mechanism == Mechanism::CacheLine
    }
}

#[cfg(test)]
mod tests {
    use super::super::mechanism::Wait;
    use super::*;

    fn chunk(rounds: &[(u64, u64)], pings: &[(u64, u64)]) -> Chunk {
        let of = |values: &[(u64, u64)]| {
            let mut histogram = histogram().expect("bounds");
            for (value, count) in values {
                histogram.record_n(*value, *count).expect("in range");
            }
            histogram
        };
        Chunk {
            rounds: of(rounds),
            inside: of(&[]),
            missed: 1,
            preempted: 2,
            pings: of(pings),
        }
    }

    fn row(chunks: &[&Chunk]) -> Row {
        let case = Case {
            mechanism: Mechanism::Echo,
            wait: Wait::Spin,
        };
        let mut row = Row::new(case, Pace::Saturated);
        for chunk in chunks {
            row.add(Some(Placement::SeparateCores), chunk)
                .expect("same bounds");
        }
        row
    }

    #[test]
    fn chunks_add_up_and_mixed_ones_are_left_out() {
        let quiet = chunk(&[(1000, 100)], &[(100, 100)]);
        let mut row = row(&[&quiet; 3]);
        row.add(None, &quiet).expect("same bounds");
        assert_eq!(row.mixed, 1);
        assert!(row.at(Placement::SiblingThreads).is_none());
        let at = row.at(Placement::SeparateCores).expect("three chunks");
        assert_eq!((at.chunks(), at.rounds.len()), (3, 300));
        assert_eq!((at.missed, at.preempted), (3, 6));
        assert_eq!(at.figure(MEDIAN), 1000);
        assert_eq!(at.ratio_to_raw(), 10.0);
        assert_eq!(at.halts_per_s(), 0.0);
    }

    #[test]
    fn halts_are_counted_by_the_time_that_they_fall_in() {
        let rounds = chunk(&[(1000, 900), (100_000, 1)], &[(100, 1)]);
        let row = row(&[&rounds]);
        let at = row.at(Placement::SeparateCores).expect("a chunk");
        // One in a millisecond of rounds, to the histogram's three digits.
        assert!((at.halts_per_s() / 1000.0 - 1.0).abs() < 2e-3);
    }

    #[test]
    fn noise_is_told_by_its_cause() {
        let noise = |chunks: &[&Chunk], quantile| {
            let row = row(chunks);
            let at = row.at(Placement::SeparateCores);
            at.and_then(|at| at.noise(quantile, false))
        };
        let quiet = chunk(&[(1000, 990), (3000, 10)], &[(100, 1000)]);
        assert_eq!(noise(&[&quiet], MEDIAN), None);
        assert_eq!(noise(&[&quiet], 0.99), None);
        // One of 1000 rounds lies beyond.
        assert_eq!(noise(&[&quiet], P999), Some(Noise::FewRounds));
        let slow = chunk(&[(2000, 1000)], &[(100, 1000)]);
        let chunks = [&quiet, &slow, &quiet, &slow];
        assert_eq!(noise(&chunks, MEDIAN), Some(Noise::Varies));
        // The cache line is as slow as the rounds, because both are interrupted.
        let interrupted = chunk(&[(1000, 980), (5000, 20)], &[(100, 980), (4000, 20)]);
        assert_eq!(noise(&[&interrupted], 0.99), Some(Noise::Disturbed));
        assert_eq!(noise(&[&interrupted], MEDIAN), None);
        // Others had the processor six times, and ten rounds are slower.
        let preempted = Chunk {
            preempted: 6,
            ..interrupted.clone()
        };
        assert_eq!(noise(&[&preempted], 0.99), Some(Noise::Preempted));
        assert_eq!(noise(&[&preempted], MEDIAN), None);
    }
}
