//! The way out of a lock-out: a belief so sure of itself that it gates every fix of a source.
//!
//! One fix is then let in against a wider covariance. What the fix measures is doubted by as much
//! as the fix contradicts it; everything else only by a little more each time. Widening all of it
//! alike would let a jump of the position turn the attitude over through their correlation.

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
