//! `[smoother]`: how much of the past is smoothed, and how.

use super::choice::{Estimator, Jacobians, Parametrisation, Prior};
use super::interval::Interval;
use super::section::Section;

/// Why a key of the filters is refused.
pub(super) const NOT_SMOOTHED: &str =
    "estimator = \"smoother\" does not use this, but [smoother] iterations: remove it";
/// The smoother over the newest fixes.
///
/// ```
#[doc = include_str!("example.txt")]
/// let smoother = read(format!("estimator = 'smoother'\n{IMU}[smoother]\nwindow = 50\n"))?.smoother;
/// let smoother = smoother.expect("it is the estimator");
/// assert_eq!((smoother.window, smoother.prior, smoother.hand_over_deg), (50, Prior::Group, None));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Smoother {
    /// The most states that are smoothed: one for each accepted fix.
    pub window: usize,
    /// Gauss-Newton iterations for each fix.
    pub iterations: u32,
    /// What the states that have left the window leave behind.
    pub prior: Prior,
    /// How a correction is attached to a state.
    pub parametrisation: Parametrisation,
    /// The derivatives of the residuals.
    pub jacobians: Jacobians,
    /// Once the heading is known this well (standard deviation, degrees) the filter goes on alone; `None`: never.
    pub hand_over_deg: Option<f64>,
}

impl Smoother {
    /// Reads the table; there is a smoother if and only if it is the estimator. None for `estimator` says that
    /// it is not known.
    pub(super) fn read_if_wanted(
        root: &mut Section<'_, '_>,
        estimator: Option<Estimator>,
    ) -> Option<Self> {
        match estimator {
            Some(Estimator::Smoother) | None => Some(root.section("smoother", Self::read)),
            Some(other) => {
                let reason = format!("needs estimator = \"smoother\", not \"{other}\"");
                root.section("smoother", |smoother| {
                    smoother.refuse_whole(&reason);
                    Self::read(smoother);
                });
                None
            }
        }
    }

    fn read(smoother: &mut Section<'_, '_>) -> Self {
        Self {
            window: smoother.integer("window", Some("fixes"), 1..=1000, 20),
            iterations: smoother.integer("iterations", None, 1..=10, 1),
            prior: smoother.choice("prior", Prior::Group),
            parametrisation: smoother.choice("parametrisation", Parametrisation::Exponential),
            jacobians: smoother.choice("jacobians", Jacobians::Frozen),
            hand_over_deg: smoother.optional_float(
                "hand_over_deg",
                Some("deg"),
                Interval::above(0.0, 180.0),
            ),
        }
    }
}

impl Default for Smoother {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}
