//! An observation linearised around one iterate, with the factors that every gain needs.

use nalgebra::{SMatrix, SVector};

use super::belief::Belief;
use super::covariance::Covariance;
use super::factor::Factor;
use super::gain::Iterate;
use super::seen::Seen;
use super::side::Side;
use crate::lie::LieGroup;
use crate::model::Observation;

/// `z = H xi + v` around an iterate `chi_i = retract(chi_hat, xi_i)`, v of covariance N.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, Linearised};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use nalgebra::{Matrix1, SVector};
///
/// let belief =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.03)));
/// let fix = HeadingObservation { heading: 0.2, sigma: 0.1 };
/// let noise = Matrix1::new(fix.sigma * fix.sigma);
/// let at_prior =
///     Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("S is definite");
/// // S = P + N: 0.03 + 0.01; z^T S^-1 z = 0.04 / 0.04.
/// assert!((at_prior.innovation_covariance()[(0, 0)] - 0.04).abs() < 1e-12);
/// assert!((at_prior.normalised_square() - 1.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Linearised<G, const D: usize, const M: usize> {
    /// `chi_i`.
    pub chi: G,
    /// `z_i = y - h(chi_i)`.
    pub residual: SVector<f64, M>,
    /// `H_i = H(chi_i) J(xi_i)`, in the error of the belief's side.
    pub h: SMatrix<f64, M, D>,
    /// N.
    pub noise: SMatrix<f64, M, M>,
    /// `P H_i^T`.
    pub p_ht: SMatrix<f64, D, M>,
    /// Factor of `S_i = H_i P H_i^T + N`.
    pub innovation: Factor<M>,
    seen: Seen<D>,
    /// S.
    covariance: SMatrix<f64, M, M>,
    /// Factor of N.
    noise_factor: Factor<M>,
}

/// `N + H B`, passing over the states that the sensor does not see.
#[inline(always)]
fn sum_of_product<const D: usize, const M: usize>(
    noise: &SMatrix<f64, M, M>,
    h: &SMatrix<f64, M, D>,
    seen: &Seen<D>,
    b: &SMatrix<f64, D, M>,
) -> SMatrix<f64, M, M> {
    let mut sum = *noise;
    for &k in seen.states() {
        for column in 0..M {
            for row in 0..M {
                sum[(row, column)] += h[(row, k)] * b[(k, column)];
            }
        }
    }
    sum
}

/// Whether `P - K S K^T` loses no more than three of the digits of P: the update leaves of no variance less than
/// the thousandth part, for `tr(N^-1 S)` is above the largest ratio of S and N along any direction.
#[inline(always)]
pub(crate) fn is_mild<const M: usize>(noise: &Factor<M>, innovation: &SMatrix<f64, M, M>) -> bool {
    const LARGEST_RATIO: f64 = 1e3;
    noise.trace_of_quotient(innovation) < LARGEST_RATIO
}

impl<G: LieGroup<D>, const D: usize, const M: usize> Linearised<G, D, M> {
    /// `observation` around `chi`, which lies `xi` away from the mean of `belief`. `None` if the noise or the
    /// innovation covariance is not positive definite.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::Matrix2;
    /// use inekf::filter::{Belief, Covariance, Left, Linearised};
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
    /// // At another point on the way: y - h(chi_i), with a Jacobian there.
    /// let xi = Vector3::new(0.1, 0.5, 0.0);
    /// let chi = SE2::exp(&xi);
    /// let half_way = Linearised::at(&belief, &fix, &chi, &xi, &noise).expect("definite");
    /// assert!((half_way.residual - (Vector2::new(1.0, 1.0) - chi.position)).norm() < 1e-12);
    /// // No noise is negative.
    /// assert!(Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &(-2.0 * noise)).is_none());
    /// ```
    pub fn at<S, O>(
        belief: &Belief<G, S, D>,
        observation: &O,
        chi: &G,
        xi: &SVector<f64, D>,
        noise: &SMatrix<f64, M, M>,
    ) -> Option<Self>
    where
        S: Side,
        O: Observation<G, D, M>,
    {
        let noise_factor = Factor::new(noise)?;
        Self::with_noise(belief, observation, chi, xi, (noise, &noise_factor))
    }

    /// The same with the noise and its factor.
    #[inline(always)]
    pub(super) fn with_noise<S, O>(
        belief: &Belief<G, S, D>,
        observation: &O,
        chi: &G,
        xi: &SVector<f64, D>,
        (noise, noise_factor): (&SMatrix<f64, M, M>, &Factor<M>),
    ) -> Option<Self>
    where
        S: Side,
        O: Observation<G, D, M>,
    {
        let mut h = observation.left_jacobian(chi);
        if !S::IS_LEFT {
            h = G::row_product(&h, &S::to_left(chi));
        }
        if xi.iter().any(|component| *component != 0.0) {
            h = G::row_product(&h, &S::jacobian::<G, D>(xi));
        }
        let seen = Seen::by(&h);
        let p_ht = belief.covariance.times_transposed_of(&seen, &h);
        let covariance = sum_of_product(noise, &h, &seen, &p_ht);
        let innovation = Factor::new(&covariance)?;
        Some(Self {
            chi: *chi,
            residual: observation.residual(chi),
            h,
            noise: *noise,
            p_ht,
            innovation,
            seen,
            covariance,
            noise_factor: *noise_factor,
        })
    }

    /// S, M x M.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::Vector2;
    /// use inekf::filter::{Belief, Covariance, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{Matrix2, SVector, Vector3};
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
    /// // P + N, 1 + 1 on each axis.
    /// assert!((linearised.innovation_covariance() - Matrix2::from_diagonal_element(2.0)).norm() < 1e-12);
    /// ```
    pub fn innovation_covariance(&self) -> SMatrix<f64, M, M> {
        self.covariance
    }

    /// `z_i + H_i xi`.
    #[inline]
    pub(super) fn target(&self, xi: &SVector<f64, D>) -> SVector<f64, M> {
        let mut target = self.residual;
        for &k in self.seen.states() {
            for row in 0..M {
                target[row] += self.h[(row, k)] * xi[k];
            }
        }
        target
    }

    /// The Gauss-Newton iterate: `lambda = S^-1 target`, `xi = P H^T lambda`, `eta = H^T lambda`.
    #[inline(always)]
    pub(super) fn optimum(&self, target: &SVector<f64, M>) -> Iterate<D> {
        let lambda = self.innovation.solve(target);
        let (mut xi, mut eta) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
        for row in 0..D {
            for m in 0..M {
                xi[row] += self.p_ht[(row, m)] * lambda[m];
            }
        }
        for &k in self.seen.states() {
            for m in 0..M {
                eta[k] += self.h[(m, k)] * lambda[m];
            }
        }
        Iterate { xi, eta }
    }

    /// `is_mild`, of this one.
    #[inline(always)]
    pub(super) fn is_mild(&self) -> bool {
        is_mild(&self.noise_factor, &self.covariance)
    }

    /// `P H^T L^-T`, with `S = L D L^T`.
    #[inline(always)]
    pub(super) fn decorrelated(&self) -> SMatrix<f64, D, M> {
        self.innovation.decorrelated_rows(&self.p_ht)
    }

    /// The covariance after a correction with `gain`, in Joseph's form.
    pub(super) fn josephs(
        &self,
        prior: &Covariance<D>,
        gain: &SMatrix<f64, D, M>,
    ) -> Covariance<D> {
        prior.corrected_with(&self.p_ht, gain, &self.seen, &self.h, &self.noise)
    }

    /// `z^T S^-1 z`.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left, Linearised};
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
    /// // A metre off along both axes, of variance 2: a half each.
    /// assert!((linearised.normalised_square() - 1.0).abs() < 1e-12);
    /// ```
    pub fn normalised_square(&self) -> f64 {
        self.innovation.normalised_square(&self.residual)
    }

    /// `ln det S`.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left, Linearised};
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
    /// let s = linearised.innovation_covariance();
    /// assert!((linearised.log_determinant() - s.determinant().ln()).abs() < 1e-12);
    /// ```
    pub fn log_determinant(&self) -> f64 {
        self.innovation.log_determinant()
    }
}
