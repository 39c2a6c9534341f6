//! Group-affine dynamics, `chi+ = W * phi(chi) * U` with `phi` an automorphism of the group:
//! \[IS\] (6), where W is called Gamma and U Upsilon.
//!
//! For such a step the error propagates exactly and without knowing the state (\[IS\] (7)):
//! `xi+ = F xi`, with `F = Ad_{U^-1} M` in the left-invariant error and `F = Ad_W M` in the
//! right-invariant one; M is the differential of `phi` at the identity.

use core::marker::PhantomData;

use nalgebra::SMatrix;

use crate::lie::{LieGroup, SE23};

/// A bijective map of the group onto itself with `phi(a b) = phi(a) phi(b)`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Automorphism, FreeMotion};
/// use nalgebra::SVector;
///
/// // phi(a b) = phi(a) phi(b).
/// let phi = FreeMotion { dt_s: 0.5 };
/// let (a, b) = (SE23::exp(&SVector::repeat(0.3)), SE23::exp(&SVector::from_fn(|i, _| 0.1 * i as f64)));
/// let (whole, parts) = (phi.apply(&a.compose(&b)), phi.apply(&a).compose(&phi.apply(&b)));
/// assert!(whole.between(&parts).log().norm() < 1e-12);
/// ```
pub trait Automorphism<G: LieGroup<D>, const D: usize> {
    /// `phi(chi)`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Automorphism, FreeMotion};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// // The neutral element stays where it is.
    /// let free = FreeMotion { dt_s: 0.5 };
    /// assert_eq!(free.apply(&SE23::identity()), SE23::identity());
    /// assert_eq!(free.apply(&chi).position, chi.position + chi.velocity * 0.5);
    /// ```
    fn apply(&self, chi: &G) -> G;
    /// M, D x D, with `phi(chi exp(xi)) = phi(chi) exp(M xi)` (\[IS\] (3)).
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Automorphism, FreeMotion};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// // An error of any size goes through it by one matrix.
    /// let (free, xi) = (FreeMotion { dt_s: 0.5 }, SVector::<f64, 9>::from_fn(|i, _| 0.2 - 0.04 * i as f64));
    /// let error = free.apply(&chi).between(&free.apply(&chi.compose(&SE23::exp(&xi))));
    /// assert!((error.log() - free.differential() * xi).norm() < 1e-12);
    /// ```
    fn differential(&self) -> SMatrix<f64, D, D>;
    /// `a M`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Automorphism, FreeMotion};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// let (free, a) = (FreeMotion { dt_s: 0.5 }, chi.adjoint());
    /// assert!((free.times_differential(a) - a * free.differential()).norm() < 1e-12);
    /// ```
    fn times_differential(&self, a: SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        a * self.differential()
    }
    /// Makes the symmetric matrix P `M P M^T`.
    ///
    /// ```
    /// use inekf::model::{Automorphism, FreeMotion};
    /// use nalgebra::{SMatrix, SVector};
    ///
    /// let (free, m) = (FreeMotion { dt_s: 0.5 }, FreeMotion { dt_s: 0.5 }.differential());
    /// let variances = SVector::<f64, 9>::from_fn(|i, _| 1.0 + i as f64);
    /// let before = SMatrix::<f64, 9, 9>::from_diagonal(&variances);
    /// let mut p = before;
    /// free.congruence(&mut p);
    /// assert!((p - m * before * m.transpose()).norm() < 1e-12);
    /// ```
    fn congruence(&self, p: &mut SMatrix<f64, D, D>) {
        let m = self.differential();
        *p = m * *p * m.transpose();
        p.fill_lower_triangle_with_upper_triangle();
    }
}

/// Motion without force for `dt_s` seconds on SE_2(3): the position advances by `v_w * dt_s`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Automorphism, FreeMotion};
/// use nalgebra::Vector3;
///
/// let gliding = SE23 { velocity: Vector3::new(3.0, 0.0, 0.0), ..SE23::identity() };
/// assert_eq!(FreeMotion { dt_s: 2.0 }.apply(&gliding).position.x, 6.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeMotion {
    /// Duration of the step, s.
    pub dt_s: f64,
}

impl Automorphism<SE23, 9> for FreeMotion {
    fn apply(&self, chi: &SE23) -> SE23 {
        SE23 {
            position: chi.position + chi.velocity * self.dt_s,
            ..*chi
        }
    }

    fn differential(&self) -> SMatrix<f64, 9, 9> {
        let mut m = SMatrix::<f64, 9, 9>::identity();
        for axis in 0..3 {
            m[(6 + axis, 3 + axis)] = self.dt_s;
        }
        m
    }

    /// The columns of the velocity gain `dt_s` times those of the position: a product of matrices would cost
    /// more than the rest of a step.
    fn times_differential(&self, mut a: SMatrix<f64, 9, 9>) -> SMatrix<f64, 9, 9> {
        for column in 3..6 {
            for row in 0..9 {
                a[(row, column)] += self.dt_s * a[(row, column + 3)];
            }
        }
        a
    }

    /// `dt_s` times the velocity's columns added to those of the position, then the same with the rows.
    fn congruence(&self, p: &mut SMatrix<f64, 9, 9>) {
        for column in 6..9 {
            for row in 0..9 {
                p[(row, column)] += self.dt_s * p[(row, column - 3)];
            }
        }
        for column in 0..9 {
            for row in 6..9 {
                p[(row, column)] += self.dt_s * p[(row - 3, column)];
            }
        }
        p.fill_lower_triangle_with_upper_triangle();
    }
}

/// One step `chi+ = W * phi(chi) * U`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{FreeMotion, GroupAffineStep};
/// use nalgebra::SVector;
///
/// let (world, body) = (SE23::exp(&SVector::repeat(0.1)), SE23::exp(&SVector::from_fn(|i, _| 0.05 * i as f64)));
/// let step = GroupAffineStep::new(world, FreeMotion { dt_s: 0.2 }, body);
/// // The error goes through it exactly, wherever the estimate is: xi+ = F xi, for an error of any size.
/// let xi = SVector::<f64, 9>::from_fn(|i, _| 0.2 - 0.04 * i as f64);
/// for chi in [SE23::identity(), SE23::exp(&SVector::repeat(0.7))] {
///     let error = step.apply(&chi).between(&step.apply(&chi.compose(&SE23::exp(&xi))));
///     assert!((error.log() - step.left_jacobian() * xi).norm() < 1e-12);
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupAffineStep<G, A, const D: usize> {
    /// W (Gamma in \[IS\]): acts from the world side, e.g. gravity.
    pub world: G,
    /// phi.
    pub automorphism: A,
    /// U (Upsilon in \[IS\]): acts from the body side, e.g. what the IMU measured.
    pub body: G,
    dimension: PhantomData<[(); D]>,
}

impl<G: LieGroup<D>, A: Automorphism<G, D>, const D: usize> GroupAffineStep<G, A, D> {
    /// The step with the given parts.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{FreeMotion, GroupAffineStep};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// // Nothing acts and no time goes by.
    /// let nothing = SE23::identity();
    /// let step = GroupAffineStep::new(nothing, FreeMotion { dt_s: 0.0 }, nothing);
    /// assert!(step.apply(&chi).between(&chi).log().norm() < 1e-12);
    /// ```
    pub fn new(world: G, automorphism: A, body: G) -> Self {
        Self {
            world,
            automorphism,
            body,
            dimension: PhantomData,
        }
    }

    /// `W * phi(chi) * U`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{FreeMotion, GroupAffineStep};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// let other = SE23::exp(&SVector::repeat(-0.4));
    /// // The world acts from the left, the body from the right.
    /// let step = GroupAffineStep::new(other, FreeMotion { dt_s: 0.0 }, SE23::identity());
    /// assert!(step.apply(&chi).between(&(other * chi)).log().norm() < 1e-12);
    /// let step = GroupAffineStep::new(SE23::identity(), FreeMotion { dt_s: 0.0 }, other);
    /// assert!(step.apply(&chi).between(&(chi * other)).log().norm() < 1e-12);
    /// ```
    pub fn apply(&self, chi: &G) -> G {
        self.world
            .compose(&self.automorphism.apply(chi))
            .compose(&self.body)
    }

    /// F, D x D, of the left-invariant error: `Ad_{U^-1} M` (\[IS\], Proposition 1).
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{FreeMotion, GroupAffineStep};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// let other = SE23::exp(&SVector::repeat(-0.4));
    /// // The body's share alone decides, not gravity.
    /// let step = |world| GroupAffineStep::new(world, FreeMotion { dt_s: 0.2 }, chi);
    /// assert_eq!(step(SE23::identity()).left_jacobian(), step(other).left_jacobian());
    /// ```
    pub fn left_jacobian(&self) -> SMatrix<f64, D, D> {
        self.automorphism
            .times_differential(self.body.inverse().adjoint())
    }

    /// F, D x D, of the right-invariant error: `Ad_W M`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{FreeMotion, GroupAffineStep};
    /// use nalgebra::SVector;
    ///
    /// // The world's share alone decides: another sample of the body leaves it as it is.
    /// let step = |body| GroupAffineStep::new(SE23::exp(&SVector::repeat(0.1)), FreeMotion { dt_s: 0.2 }, body);
    /// let other = SE23::exp(&SVector::repeat(-0.4));
    /// assert_eq!(step(SE23::identity()).right_jacobian(), step(other).right_jacobian());
    /// ```
    pub fn right_jacobian(&self) -> SMatrix<f64, D, D> {
        self.automorphism.times_differential(self.world.adjoint())
    }
}
