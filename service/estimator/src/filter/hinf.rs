//! The invariant extended H-infinity filter, the robust baseline of \[LC\] VII.
//!
//! `P+^-1 = P^-1 - gamma I + H^T N^-1 H`, `K = P+ H^T N^-1` (Lavoie, Arsenault and Forbes, *An invariant
//! extended H-infinity filter*). With P* and K* the ordinary Kalman update this is
//!
//! ```text
//! P+ = (I - gamma P*)^-1 P*        K = (I - gamma P*)^-1 K*
//! ```
//!
//! which needs no inverse of P, and exists as long as `gamma < 1 / lambda_max(P*)`. The identity mixes
//! radians and metres, as in the papers. Its noise covariances are bounds, not variances: \[LC\] VII takes
//! three times the standard deviations.

use nalgebra::{Cholesky, Const, SMatrix};

use super::covariance::Covariance;
use super::gain::{GainRule, kalman_gain};
use super::linearised::Linearised;
use super::update::UpdateError;
use crate::lie::LieGroup;

/// Which gain goes with the H-infinity covariance.
///
/// ```
/// use inekf::filter::{HInfinity, HInfinityGain};
///
/// let rule = HInfinity { gamma: 0.01, gain: HInfinityGain::Widened };
/// assert_ne!(rule.gain, HInfinityGain::Kalman);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HInfinityGain {
    /// `P+ H^T N^-1`, with the widened P+.
    Widened,
    /// The Kalman gain of the prior; only the covariance is widened.
    Kalman,
}

/// The H-infinity rule.
///
/// ```
/// use inekf::filter::{
///     Belief, Covariance, HInfinity, HInfinityGain, Left, UpdateError, UpdateOptions, update, update_with,
/// };
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use nalgebra::SVector;
///
/// let start =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// let fix = HeadingObservation { heading: 0.2, sigma: 0.1 };
/// let rule = |gamma| HInfinity { gamma, gain: HInfinityGain::Widened };
/// let (mut kalman, mut robust) = (start, start);
/// update(&mut kalman, &fix, &UpdateOptions::PLAIN)?;
/// update_with(&mut robust, &fix, &rule(1.0), &UpdateOptions::PLAIN)?;
/// // It trusts itself less, and the fix more.
/// assert!(robust.covariance.matrix()[(2, 2)] > kalman.covariance.matrix()[(2, 2)]);
/// assert!(robust.mean.rotation.heading_rad() > kalman.mean.rotation.heading_rad());
/// // A gamma for which there is no such filter is refused, with its bound.
/// let refused = update_with(&mut robust, &fix, &rule(1e9), &UpdateOptions::PLAIN);
/// assert!(matches!(refused, Err(UpdateError::InfeasibleGamma { .. })));
/// # Ok::<(), UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HInfinity {
    /// The bound on the amplification of disturbances, in 1/rad^2 and 1/m^2; 0 is the Kalman filter.
    pub gamma: f64,
    /// The gain.
    pub gain: HInfinityGain,
}

impl HInfinity {
    /// Cholesky factor of `I - gamma P*`.
    fn margin<const D: usize>(
        &self,
        corrected: &Covariance<D>,
    ) -> Result<Cholesky<f64, Const<D>>, UpdateError> {
        let margin = SMatrix::<f64, D, D>::identity() - corrected.matrix() * self.gamma;
        Cholesky::new(margin).ok_or_else(|| UpdateError::InfeasibleGamma {
            bound: 1.0 / largest_eigenvalue(corrected.matrix()),
        })
    }
}

/// The largest eigenvalue of a symmetric positive semidefinite matrix, from its repeated square.
fn largest_eigenvalue<const D: usize>(p: &SMatrix<f64, D, D>) -> f64 {
    let mut power = *p;
    for _ in 0..40 {
        power /= power.trace();
        power *= power;
    }
    (p * power).trace() / power.trace()
}

impl<G: LieGroup<D>, const D: usize, const M: usize> GainRule<G, D, M> for HInfinity {
    fn gain(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        let kalman = kalman_gain(linearised);
        match self.gain {
            HInfinityGain::Kalman => Ok(kalman),
            HInfinityGain::Widened => {
                let corrected = prior.corrected(&kalman, &linearised.h, &linearised.noise);
                Ok(self.margin(&corrected)?.solve(&kalman))
            }
        }
    }

    fn covariance(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Covariance<D>, UpdateError> {
        let corrected = prior.corrected(&kalman_gain(linearised), &linearised.h, &linearised.noise);
        let margin = self.margin(&corrected)?;
        // P+ = P* + gamma P* (I - gamma P*)^-1 P*: symmetric, and never below P*.
        let widening = corrected.matrix() * margin.solve(corrected.matrix()) * self.gamma;
        Ok(corrected.plus(&widening))
    }
}
