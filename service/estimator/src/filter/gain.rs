//! How an innovation becomes a correction: the part of the update that tells the filters apart.
//!
//! | rule | filter |
//! |---|---|
//! | [`Kalman`] | InEKF (left, right), EKF ([`Additive`](super::Additive)), and their iterated forms |
//! | [`Constrained`](super::Constrained) | LC-InEKF, LC-EKF, \[LC\] (22); with finite sigmas the soft constraint |
//! | [`HInfinity`](super::HInfinity) | invariant extended H-infinity filter |
//! | [`Consider`] | Schmidt's filter: some states are considered, not corrected |

use nalgebra::{SMatrix, SVector};

use super::covariance::Covariance;
use super::linearised::Linearised;
use super::update::UpdateError;
use crate::lie::LieGroup;

/// How surprising an innovation is.
///
/// ```
/// use inekf::filter::{Gate, Judgement};
///
/// let judgement = Judgement { nis: 9.0, degrees: 3 };
/// assert!(Gate::of_probability(0.99).admits(judgement.nis, judgement.degrees));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Normalised innovation squared.
    pub nis: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
}

/// An iterate of Gauss-Newton: `xi` with its dual `eta = P^-1 xi`, which exists even where P is
/// singular because every step lies in the range of P.
///
/// ```
/// use inekf::filter::gain::Iterate;
/// use nalgebra::Vector3;
///
/// // Where Gauss-Newton begins: at the prior.
/// let start = Iterate { xi: Vector3::zeros(), eta: Vector3::zeros() };
/// assert_eq!(start.xi.norm(), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterate<const D: usize> {
    /// The correction, in the error of the belief's side.
    pub xi: SVector<f64, D>,
    /// Its dual; without meaning for rules that minimise no cost.
    pub eta: SVector<f64, D>,
}

/// The gain of a filter.
///
/// ```
/// use inekf::filter::{
///     Belief, Covariance, GainRule, Left, Linearised, UpdateError, UpdateOptions, update_with,
/// };
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use nalgebra::{SMatrix, SVector};
///
/// /// Learns nothing from anything.
/// struct Stubborn;
///
/// impl GainRule<SE23, 9, 1> for Stubborn {
///     fn gain(
///         &self,
///         _prior: &Covariance<9>,
///         _linearised: &Linearised<SE23, 9, 1>,
///     ) -> Result<SMatrix<f64, 9, 1>, UpdateError> {
///         Ok(SMatrix::zeros())
///     }
/// }
///
/// let start =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// let mut belief = start;
/// let fix = HeadingObservation { heading: 0.2, sigma: 0.1 };
/// // The innovation is judged all the same.
/// let correction = update_with(&mut belief, &fix, &Stubborn, &UpdateOptions::PLAIN)?;
/// assert!(belief.mean == start.mean && correction.nis > 0.0);
/// # Ok::<(), UpdateError>(())
/// ```
pub trait GainRule<G: LieGroup<D>, const D: usize, const M: usize> {
    /// Whether the rule is the minimiser of the Kalman cost, so that a step that raises it is shortened.
    /// Others take every step as it is.
    const MINIMISES_COST: bool = false;

    /// How surprising the innovation is.
    ///
    /// # Errors
    /// [`UpdateError`].
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, GainRule, Kalman, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    ///
    /// // A metre off along both axes, of variance 1 + 1 each.
    /// let judgement = Kalman.judge(&linearised)?;
    /// assert!((judgement.nis - 1.0).abs() < 1e-12 && judgement.degrees == 2);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    fn judge(&self, linearised: &Linearised<G, D, M>) -> Result<Judgement, UpdateError> {
        Ok(Judgement {
            nis: linearised.normalised_square(),
            degrees: M,
        })
    }

    /// The gain, D x M.
    ///
    /// # Errors
    /// [`UpdateError`].
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::Matrix2;
    /// use inekf::filter::{Belief, Covariance, GainRule, Kalman, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{SVector, Vector2, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    ///
    /// // K = P H^T S^-1: half, where the fix is as good as what was known, and nothing of the heading.
    /// let gain = Kalman.gain(&p, &linearised)?;
    /// assert!((gain * Vector2::new(1.0, 2.0) - Vector3::new(0.0, 0.5, 1.0)).norm() < 1e-12);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    fn gain(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError>;

    /// The next iterate, `gain * target` with `target = z_i + H_i xi_i`.
    ///
    /// # Errors
    /// [`UpdateError`].
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, GainRule, Kalman, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    ///
    /// // From the prior the target is the residual. P eta = xi.
    /// let iterate = Kalman.step(&p, &linearised, &linearised.residual)?;
    /// assert!((iterate.xi - Vector3::new(0.0, 0.5, 0.5)).norm() < 1e-12);
    /// assert!((p.matrix() * iterate.eta - iterate.xi).norm() < 1e-12);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    fn step(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
        target: &SVector<f64, M>,
    ) -> Result<Iterate<D>, UpdateError> {
        Ok(Iterate {
            xi: self.gain(prior, linearised)? * target,
            eta: SVector::zeros(),
        })
    }

    /// The covariance after a correction with the [`gain`](Self::gain): Joseph's form, unless the rule says more.
    ///
    /// # Errors
    /// [`UpdateError`].
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, GainRule, Kalman, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    ///
    /// // As good as what was known: half of the variance is left. The heading is not seen.
    /// let after = Kalman.covariance(&p, &linearised)?;
    /// assert!((after.matrix().diagonal() - Vector3::new(0.01, 0.5, 0.5)).norm() < 1e-12);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    fn covariance(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Covariance<D>, UpdateError> {
        Ok(linearised.josephs(prior, &self.gain(prior, linearised)?))
    }
}

/// `K = P H^T S^-1`.
pub(super) fn kalman_gain<G: LieGroup<D>, const D: usize, const M: usize>(
    linearised: &Linearised<G, D, M>,
) -> SMatrix<f64, D, M> {
    // An M x M inverse is cheap, and the corrected covariance forgives a rounded gain.
    let inverse = linearised.innovation.inverse();
    let mut gain = SMatrix::<f64, D, M>::zeros();
    for column in 0..M {
        for k in 0..M {
            for row in 0..D {
                gain[(row, column)] += linearised.p_ht[(row, k)] * inverse[(k, column)];
            }
        }
    }
    gain
}

/// The minimum of `xi^T P^-1 xi + z^T N^-1 z`.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Kalman, Left, UpdateOptions, update_with};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use nalgebra::SVector;
///
/// let mut belief =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.01)));
/// let fix = HeadingObservation { heading: 0.2, sigma: 0.1 };
/// update_with(&mut belief, &fix, &Kalman, &UpdateOptions::PLAIN)?;
/// // A fix as good as what was known: half way.
/// assert!((belief.mean.rotation.heading_rad() - 0.1).abs() < 1e-9);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kalman;

impl<G: LieGroup<D>, const D: usize, const M: usize> GainRule<G, D, M> for Kalman {
    const MINIMISES_COST: bool = true;

    fn gain(
        &self,
        _prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        Ok(kalman_gain(linearised))
    }

    #[inline(always)]
    fn step(
        &self,
        _prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
        target: &SVector<f64, M>,
    ) -> Result<Iterate<D>, UpdateError> {
        Ok(linearised.optimum(target))
    }

    /// Joseph's form where the measurement is much more precise than the prior, `P - W D^-1 W^T` with
    /// `W = P H^T L^-T`, `S = L D L^T`, where it is not: there no digits are lost.
    #[inline(always)]
    fn covariance(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Covariance<D>, UpdateError> {
        Ok(if linearised.is_mild() {
            prior.reduced(
                &linearised.decorrelated(),
                linearised.innovation.reciprocals(),
            )
        } else {
            linearised.josephs(prior, &kalman_gain(linearised))
        })
    }
}

/// Schmidt's rule: the states from `first` on are not corrected, but their uncertainty counts.
///
/// On an [`Augmented`](crate::model::Augmented) state with `first` the dimension of the pose, the mismatches
/// are considered: they widen S and P and never move.
///
/// ```
/// use inekf::filter::{Belief, Consider, Covariance, Left, UpdateOptions, update_with};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Augmented, OutputMismatch, PlanarFix, PointFix, Unknowns};
/// use nalgebra::{Matrix2, Vector1, Vector2, Vector4};
///
/// // A source whose scale is uncertain by a tenth, a hundred metres from the origin.
/// let unknowns = Unknowns::new::<2, 1>(&[], &[OutputMismatch::MeasurementScale { source: 0 }]).expect("fits");
/// let mut mean = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.0));
/// mean.pose.position.x = 100.0;
/// let variances = Vector4::new(0.0, 1.0, 1.0, 0.01);
/// let mut belief = Belief::<_, Left, 4>::new(mean, Covariance::from_variances(&variances));
/// let fix = unknowns.observe(PlanarFix::new([PointFix {
///     position_w: Vector2::new(101.0, 0.0),
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// }]));
/// update_with(&mut belief, &fix, &Consider { first: 3 }, &UpdateOptions::PLAIN)?;
/// // It counts (so little is believed) and does not move.
/// assert_eq!(belief.mean.parameters[0], 0.0);
/// assert!(belief.mean.pose.position.x < 100.05);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Consider {
    /// Index of the first state that is considered.
    pub first: usize,
}

impl<G: LieGroup<D>, const D: usize, const M: usize> GainRule<G, D, M> for Consider {
    fn gain(
        &self,
        _prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        let mut gain = kalman_gain(linearised);
        for row in self.first..D {
            gain.row_mut(row).fill(0.0);
        }
        Ok(gain)
    }
}
