//! How often a fault is inflicted, and at which moments.

use std::path::PathBuf;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What all rows are told.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How often each fault is inflicted.
    pub rounds: u32,
    /// Seed of the moments.
    pub seed: u64,
    /// The program `inekf-tests`, which is the feeder and the reader that are killed.
    pub party: PathBuf,
}

impl Plan {
    /// The moments of one row.
    pub fn moments(&self, row: &str) -> Moments {
        let salt = row.bytes().fold(0_u64, |sum, byte| {
            sum.wrapping_mul(31).wrapping_add(byte.into())
        });
        Moments(ChaCha8Rng::seed_from_u64(self.seed ^ salt))
    }

    /// The same, with no more rounds than this: for faults that take seconds each.
    pub fn at_most(&self, rounds: u32) -> u32 {
        self.rounds.min(rounds)
    }
}

/// Seeded random moments.
#[derive(Clone, Debug)]
pub struct Moments(ChaCha8Rng);

impl Moments {
    /// A time up to `longest`, to the microsecond.
    pub fn up_to(&mut self, longest: Duration) -> Duration {
        Duration::from_micros(self.0.random_range(0..=longest.as_micros() as u64))
    }

    /// A number below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.0.random_range(0..end)
    }
}
