//! `[odometry]`: which rows are believed, and what happens when none come.

use super::choice::GapPolicy;
use super::interval::Interval;
use super::operation::nanoseconds;
use super::section::Section;

/// Checks on the rows of odometry: each is the motion of the body since the row before.
///
/// ```
#[doc = include_str!("example.txt")]
/// let rows = odometry(format!("{ODOMETRY}[odometry]\nmax_translation_m = 2.0\n"))?.rows;
/// assert_eq!((rows.max_translation_m, rows.on_gap), (2.0, GapPolicy::Inflate));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The longest time between two rows that is still propagated over as usual, s.
    pub max_gap_s: f64,
    /// What happens after a longer one.
    pub on_gap: GapPolicy,
    /// A row that turns further is rejected, rad.
    pub max_rotation_rad: f64,
    /// A row that goes further is rejected, m.
    pub max_translation_m: f64,
    /// The time that the first row speaks for, s: no row before it says.
    pub first_period_s: f64,
}

impl Rows {
    pub(super) fn read(odometry: &mut Section<'_, '_>) -> Self {
        let time = Interval::above(0.0, 60.0);
        Self {
            max_gap_s: odometry.float("max_gap_s", "s", time, 1.0),
            on_gap: odometry.choice("on_gap", GapPolicy::Inflate),
            max_rotation_rad: odometry.float(
                "max_rotation_rad",
                "rad",
                Interval::above(0.0, 3.1),
                3.0,
            ),
            max_translation_m: odometry.float(
                "max_translation_m",
                "m",
                Interval::above(0.0, 1000.0),
                10.0,
            ),
            first_period_s: odometry.float("first_period_s", "s", time, 0.1),
        }
    }

    /// [`max_gap_s`](Self::max_gap_s) in nanoseconds of sensor time.
    ///
    /// ```
    /// use inekf_service::config::Rows;
    ///
    /// assert_eq!(Rows { max_gap_s: 0.25, ..Rows::default() }.max_gap_ns(), 250_000_000);
    /// ```
    pub fn max_gap_ns(&self) -> u64 {
        nanoseconds(self.max_gap_s)
    }

    /// [`first_period_s`](Self::first_period_s) in nanoseconds of sensor time.
    ///
    /// ```
    /// use inekf_service::config::Rows;
    ///
    /// assert_eq!(Rows { first_period_s: 0.02, ..Rows::default() }.first_period_ns(), 20_000_000);
    /// ```
    pub fn first_period_ns(&self) -> u64 {
        nanoseconds(self.first_period_s)
    }
}

impl Default for Rows {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}
