//! `[update]`: how a fix corrects the estimate.

use super::choice::Transport;
use super::interval::Interval;
use super::section::Section;
use super::smoother::NOT_SMOOTHED;

/// The measurement update.
///
/// ```
#[doc = include_str!("example.txt")]
/// let update = read(format!("{IMU}[update]\ngate_probability = 0.999\n"))?.update;
/// assert_eq!((update.gate_probability, update.iterations), (Some(0.999), 10));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Update {
    /// Gauss-Newton iterations at most; 1 with [`Transport::None`] is the paper's plain filter.
    pub iterations: u32,
    /// How the covariance reaches the new linearisation point.
    pub transport: Transport,
    /// A fix is gated when its NIS exceeds the chi-square quantile of this probability. None: no gate.
    pub gate_probability: Option<f64>,
    /// After this many fixes of one source gated in a row, the next is accepted with inflated covariance. 0: never.
    pub recover_after: u32,
}

impl Update {
    /// Reads the table for a filter, or for a smoother if it `smooths`.
    pub(super) fn read(update: &mut Section<'_, '_>, smooths: bool) -> Self {
        let read = Self {
            iterations: update.integer("iterations", None, 1..=50, 10),
            transport: update.choice("transport", Transport::Jacobian),
            gate_probability: update.optional_float(
                "gate_probability",
                None,
                Interval::open(0.0, 1.0),
            ),
            recover_after: update.integer("recover_after", None, 0..=1_000_000, 10),
        };
        if smooths {
            update.refuse_all(&["iterations", "transport"], NOT_SMOOTHED);
        }
        read
    }
}

impl Default for Update {
    fn default() -> Self {
        Section::defaults(|update| Self::read(update, false))
    }
}
