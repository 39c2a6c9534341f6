//! `[imu]`: which samples are believed, and what happens when none come.

use super::choice::GapPolicy;
use super::interval::Interval;
use super::operation::nanoseconds;
use super::section::Section;

/// Checks on the IMU's samples.
///
/// ```
#[doc = include_str!("example.txt")]
/// let imu = inertial(format!("{IMU}[imu]\nmax_gyro_rps = 8.7\n"))?.imu;
/// assert_eq!((imu.max_gyro_rps, imu.max_gap_s), (8.7, 0.5));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Imu {
    /// The longest time between two samples that is still propagated over as usual, s.
    pub max_gap_s: f64,
    /// What happens after a longer one.
    pub on_gap: GapPolicy,
    /// A sample with a greater angular rate about any axis is rejected, rad/s.
    pub max_gyro_rps: f64,
    /// A sample with a greater specific force along any axis is rejected, m/s^2.
    pub max_accel_mps2: f64,
}

impl Imu {
    pub(super) fn read(imu: &mut Section<'_, '_>) -> Self {
        Self {
            max_gap_s: imu.float("max_gap_s", "s", Interval::above(0.0, 60.0), 0.5),
            on_gap: imu.choice("on_gap", GapPolicy::Inflate),
            max_gyro_rps: imu.float("max_gyro_rps", "rad/s", Interval::above(0.0, 1000.0), 50.0),
            max_accel_mps2: imu.float("max_accel_mps2", "m/s^2", Interval::above(0.0, 1e5), 500.0),
        }
    }

    /// [`max_gap_s`](Self::max_gap_s) in nanoseconds of sensor time.
    pub(crate) fn max_gap_ns(&self) -> u64 {
        nanoseconds(self.max_gap_s)
    }
}

impl Default for Imu {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}
