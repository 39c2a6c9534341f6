//! `[zero_velocity]`: whether rest is looked for, and what counts as rest.

use super::choice::Estimator;
use super::interval::Interval;
use super::operation::nanoseconds;
use super::section::Section;

/// Zero-velocity detection. The defaults are those of a car with a MEMS IMU and its engine running.
///
/// ```
#[doc = include_str!("example.txt")]
/// let found = inertial(format!("{IMU}[zero_velocity]\nafter_s = 5.0\n"))?.zero_velocity;
/// assert_eq!(found.map(|zero_velocity| zero_velocity.after_s), Some(5.0));
/// // It is not looked for unless it is asked for.
/// assert!(inertial(IMU.to_owned())?.zero_velocity.is_none());
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroVelocity {
    /// How long the IMU has to be quiet before the first fix, s.
    pub after_s: f64,
    /// Length of the blocks that the samples are looked at in, and time between two fixes, s.
    pub period_s: f64,
    /// Largest standard deviation of the angular rate in a block, by axis, rad/s.
    pub gyro_std_rps: f64,
    /// Largest standard deviation of the specific force in a block, by axis, m/s^2.
    pub accel_std_mps2: f64,
    /// Largest change of the mean angular rate from the blocks before, by axis, rad/s.
    pub gyro_change_rps: f64,
    /// Largest change of the mean specific force from the blocks before, by axis, m/s^2.
    pub accel_change_mps2: f64,
    /// Largest estimated speed that is taken for rest, and largest standard deviation of it by axis, m/s.
    pub speed_mps: f64,
    /// Standard deviation of the zero, by axis, m/s.
    pub sigma_mps: f64,
}

/// Why it is refused beside a smoother.
const NO_WINDOW: &str = "not with estimator \"smoother\", whose window it would fill: remove it";

impl ZeroVelocity {
    /// Reads the table, if there is one. `estimator` is None if it is not known for certain.
    pub(super) fn read_if_given(
        root: &mut Section<'_, '_>,
        estimator: Option<Estimator>,
    ) -> Option<Self> {
        let given = root.has("zero_velocity");
        let zero_velocity = root.section("zero_velocity", |section| {
            if estimator == Some(Estimator::Smoother) {
                section.refuse_whole(NO_WINDOW);
            }
            Self::read(section)
        });
        given.then_some(zero_velocity)
    }

    fn read(section: &mut Section<'_, '_>) -> Self {
        let rate = Interval::above(0.0, 10.0);
        let force = Interval::above(0.0, 100.0);
        Self {
            after_s: section.float("after_s", "s", Interval::closed(0.0, 60.0), 2.0),
            period_s: section.float("period_s", "s", Interval::closed(0.05, 10.0), 0.25),
            gyro_std_rps: section.float("gyro_std_rps", "rad/s", rate, 0.06),
            accel_std_mps2: section.float("accel_std_mps2", "m/s^2", force, 0.3),
            gyro_change_rps: section.float("gyro_change_rps", "rad/s", rate, 0.02),
            accel_change_mps2: section.float("accel_change_mps2", "m/s^2", force, 0.1),
            speed_mps: section.float("speed_mps", "m/s", Interval::above(0.0, 10.0), 2.0),
            sigma_mps: section.float("sigma_mps", "m/s", Interval::closed(0.001, 10.0), 0.05),
        }
    }

    /// [`period_s`](Self::period_s) in nanoseconds of sensor time.
    pub(crate) fn period_ns(&self) -> u64 {
        nanoseconds(self.period_s)
    }
}
