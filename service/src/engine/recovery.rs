//! The way out of a lock-out: a belief so sure of itself that it gates every fix of a source.
//!
//! One fix is then let in against a wider covariance. What the fix measures is doubted by as much
//! as the fix contradicts it; everything else only by a little more each time. Widening all of it
//! alike would let a jump of the position turn the attitude over through their correlation.

use inekf::filter::{UpdateError, Verdict};
use inekf_shared::message::MAX_SOURCES;

use super::fix::{Fix, FixKind, Measurement};
use super::model::Fused;

/// Most that the whole covariance is scaled by: twice the standard deviations.
const MAX_SCALE: f64 = 4.0;
/// Most variance that is added, as a multiple of the fix's own: with more, the update that takes
/// nearly all of it away again would leave rounding errors of the size of what remains.
const MAX_RATIO: f64 = 1e8;

/// How a covariance is widened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widening {
    /// Factor on all of it.
    pub scale: f64,
    /// Variance added in every direction that the fix measures, in the square of its unit.
    pub variance: f64,
}

impl Widening {
    /// The widening for a fix of `dimension` whose residual has the square `squared` and whose noise the trace
    /// `noise`, both in the square of its unit, and whose normalised innovation squared is `nis`.
    pub fn new(squared: f64, noise: f64, dimension: usize, nis: f64) -> Self {
        let dimension = dimension as f64;
        Self {
            scale: (nis / dimension).clamp(1.0, MAX_SCALE),
            variance: squared.min(MAX_RATIO * noise) / dimension,
        }
    }
}

/// How many fixes of each source have been gated in a row, and when that is a lock-out.
#[derive(Clone, Copy, Debug)]
pub struct Lockout {
    /// After this many gated fixes of a source in a row one is let in; 0 never.
    after: u32,
    gated_in_a_row: [[u32; MAX_SOURCES]; FixKind::COUNT],
}

impl Lockout {
    /// Nothing gated yet.
    pub fn new(after: u32) -> Self {
        Self {
            after,
            gated_in_a_row: Default::default(),
        }
    }

    /// Forgets what was gated.
    pub fn clear(&mut self) {
        self.gated_in_a_row = Default::default();
    }

    /// Notes what became of `fix`. If it is the one that has to be let in, its normalised innovation squared.
    pub fn broken_by<Z: Measurement>(
        &mut self,
        fix: &Fix<Z>,
        outcome: &Result<Fused, UpdateError>,
    ) -> Option<f64> {
        // What the engine proposes itself is never forced on the state.
        if fix.kind() == FixKind::Standstill {
            return None;
        }
        let in_a_row = &mut self.gated_in_a_row[fix.kind() as usize][fix.source as usize];
        match outcome {
            Ok(fused) if fused.verdict == Verdict::Gated => {
                *in_a_row += 1;
                if self.after == 0 || *in_a_row <= self.after {
                    return None;
                }
                *in_a_row = 0;
                Some(fused.nis)
            }
            _ => {
                *in_a_row = 0;
                None
            }
        }
    }
}
