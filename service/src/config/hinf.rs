//! `[hinf]`: the invariant extended H-infinity filter, `P+^-1 = P^-1 - gamma I + H^T N^-1 H`.

use super::choice::{Estimator, HinfGain};
use super::interval::Interval;
use super::section::Section;

/// The H-infinity filter.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("estimator = 'invariant-hinf'\n{ODOMETRY}[hinf]\ngamma = 0.01\n");
/// let hinf = read(text)?.hinf.expect("it is the estimator");
/// assert_eq!((hinf.gamma, hinf.gain), (0.01, HinfGain::Widened));
/// // It is there if and only if it is asked for.
/// assert!(read(format!("{ODOMETRY}[hinf]\ngamma = 0.01\n")).is_err());
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Hinf {
    /// Bound on the amplification of disturbances, 1/rad^2 and 1/m^2; 0 is the Kalman filter.
    pub gamma: f64,
    /// Which gain goes with the widened covariance.
    pub gain: HinfGain,
    /// Multiplies the standard deviations of process and measurement noise: here they are bounds.
    pub noise_factor: f64,
}

impl Hinf {
    /// Reads the table; there is one if and only if the estimator is invariant-hinf. None for `estimator` says that
    /// it is not known.
    pub(super) fn read_if_wanted(
        root: &mut Section<'_, '_>,
        estimator: Option<Estimator>,
    ) -> Option<Self> {
        match estimator {
            Some(Estimator::InvariantHinf) => Some(root.required_section("hinf", Self::read)),
            Some(other) => {
                let reason = format!("needs estimator = \"invariant-hinf\", not \"{other}\"");
                root.section("hinf", |hinf| {
                    hinf.refuse_whole(&reason);
                    Self::read(hinf);
                });
                None
            }
            None => Some(root.section("hinf", Self::read)),
        }
    }

    fn read(hinf: &mut Section<'_, '_>) -> Self {
        Self {
            // The fallback is taken only where a fault has been noted.
            gamma: hinf
                .required_ratio("gamma", Interval::closed(0.0, 1e6))
                .unwrap_or_default(),
            gain: hinf.choice("gain", HinfGain::Widened),
            noise_factor: hinf.ratio("noise_factor", Interval::closed(1.0, 100.0), 3.0),
        }
    }
}
