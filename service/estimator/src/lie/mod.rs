//! Matrix Lie groups of rotations and extended poses, on the stack, in closed form.
//!
//! One interface, [`LieGroup`], and one file per group. The conventions that hold for all of them:
//!
//! * Tangent vectors put the rotation first: SO(3) `(rotation)`, SE(3) `(rotation, position)`, SE_2(3)
//!   `(rotation, velocity, position)`, two frames `(rotation, velocity, position, gyro bias, accelerometer
//!   bias)`, SO(2) `(theta)`, SE(2) `(theta, x, y)`. Radians and metres (per second).
//! * Rotations are active and take body coordinates to world coordinates, `x_w = R x_b`. In three
//!   dimensions they are stored as a unit Hamilton quaternion.
//! * Errors are `chi = chi_hat exp(xi)` on the left-invariant (body) side and `chi = exp(xi) chi_hat` on
//!   the right-invariant (world) side. [`LieGroup::adjoint`] changes sides.
//! * Nothing here allocates, fails or panics. Input that is not finite gives a result that is not finite;
//!   ask [`LieGroup::is_finite`].
//!
//! Every method of the trait is an identity that `tests/lie_identities.rs` runs for every group.
//!
//! ```
//! use inekf::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3};
//! use nalgebra::SVector;
//!
//! /// What holds in every group: `exp` and `log` are inverse, and the adjoint changes sides.
//! fn identities<G: LieGroup<D>, const D: usize>() {
//!     let xi = SVector::<f64, D>::from_fn(|i, _| 0.1 * (i as f64 + 1.0));
//!     let chi = G::exp(&xi);
//!     assert!((chi.log() - xi).norm() < 1e-12);
//!     assert!(chi.compose(&chi.inverse()).log().norm() < 1e-12);
//!     let d = SVector::<f64, D>::repeat(0.02);
//!     let (right, left) = (chi.compose(&G::exp(&d)), G::exp(&(chi.adjoint() * d)).compose(&chi));
//!     assert!(right.inverse().compose(&left).log().norm() < 1e-12);
//! }
//! identities::<SO2, 1>();
//! identities::<SE2, 3>();
//! identities::<SO3, 3>();
//! identities::<SE3, 6>();
//! identities::<SE23, 9>();
//! ```

use core::fmt::{self, Debug};

use nalgebra::{SMatrix, SVector};

mod se2;
mod se23;
mod se3;
pub(crate) mod sek3;
pub mod series;
mod so2;
mod so3;
mod two_frames;

pub use se2::SE2;
pub use se3::SE3;
pub use se23::SE23;
pub use so2::SO2;
pub use so3::{SO3, hat};
pub use two_frames::TwoFrames;

/// A matrix Lie group of dimension `D`, its exponential coordinates and their Jacobians.
///
/// `xi` and `d` stand for tangent vectors, `X` and `Y` for elements; the order of `xi` is the group's own.
pub trait LieGroup<const D: usize>: Copy + Clone + Debug + PartialEq {
    /// How many of the leading tangent coordinates are the rotation: 1 in the plane, 3 in space.
    const ROTATION_DIM: usize;

    /// How many of the tangent coordinates that follow the rotation are a velocity: 3 in the groups of inertial
    /// navigation, 0 in those of poses.
    const VELOCITY_DIM: usize = 0;

    /// The neutral element: `X identity = identity X = X`.
    fn identity() -> Self;

    /// The exponential map, defined for every finite `xi` (also for rotations beyond pi).
    fn exp(xi: &SVector<f64, D>) -> Self;

    /// The principal logarithm: `exp(X.log()) = X`, with the angle of rotation in `[0, pi]`.
    ///
    /// At an angle of exactly pi two logarithms exist and one of them is returned.
    fn log(&self) -> SVector<f64, D>;

    /// The product `X Y`.
    fn compose(&self, other: &Self) -> Self;

    /// The inverse: `X X^-1 = identity`.
    fn inverse(&self) -> Self;

    /// The element that leads from `X` to `Y`, `X^-1 Y`.
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// The adjoint matrix, `X exp(xi) X^-1 = exp(Ad_X xi)`.
    fn adjoint(&self) -> SMatrix<f64, D, D>;

    /// The adjoint of the algebra, `Ad_exp(xi) = expm(ad_xi)`.
    fn ad(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// The left Jacobian, `exp(xi + d) = exp(Jl d) exp(xi)` to first order in `d`.
    fn left_jacobian(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// The inverse of the left Jacobian. It exists while the rotation is below 2 pi, and is exact there.
    fn left_jacobian_inverse(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// The right Jacobian, `exp(xi + d) = exp(xi) exp(Jr d)` to first order in `d`.
    fn right_jacobian(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        Self::left_jacobian(&-xi)
    }

    /// The inverse of the right Jacobian. It exists while the rotation is below 2 pi, and is exact there.
    fn right_jacobian_inverse(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        Self::left_jacobian_inverse(&-xi)
    }

    /// Makes the symmetric matrix P `A P A^T`, exactly symmetric, where A has zeros wherever the adjoint, `ad` or
    /// the Jacobians of this group have them (identity where they have one). Groups that know their zeros are
    /// faster than this.
    fn congruence(p: &mut SMatrix<f64, D, D>, a: &SMatrix<f64, D, D>) {
        *p = a * *p * a.transpose();
        p.fill_lower_triangle_with_upper_triangle();
    }

    /// `H A`, where A has the zeros of [`congruence`](Self::congruence).
    fn row_product<const M: usize>(
        h: &SMatrix<f64, M, D>,
        a: &SMatrix<f64, D, D>,
    ) -> SMatrix<f64, M, D> {
        h * a
    }

    /// Whether every stored number is finite.
    fn is_finite(&self) -> bool;

    /// The element with its rotation put back on the group exactly.
    ///
    /// [`compose`](Self::compose) already keeps the norm of the rotation, so that a chain of products of
    /// any length does not need this; it is for states that came from elsewhere.
    fn normalized(&self) -> Self;
}

/// Why numbers were refused as a rotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RotationError {
    /// An entry is infinite or not a number.
    NotFinite,
    /// The quaternion is zero (or its norm overflows), so that it has no direction.
    NoDirection,
    /// The matrix is farther than 0.1 in some entry from its nearest rotation.
    NotARotation,
}

impl fmt::Display for RotationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => {
                "the rotation has an entry that is infinite or not a number: give finite numbers"
            }
            Self::NoDirection => {
                "the quaternion is zero or too large to normalise: give x, y, z, w of norm 1"
            }
            Self::NotARotation => {
                "the matrix is not a rotation (its columns must be orthonormal, its determinant +1): \
                 check its scale, its handedness and the order of its entries"
            }
        })
    }
}

impl std::error::Error for RotationError {}

/// Lets `X * Y` be written for [`LieGroup::compose`], by value and by reference.
macro_rules! multiply_by_composing {
    ($group:ty) => {
        impl core::ops::Mul for $group {
            type Output = $group;

            fn mul(self, other: $group) -> $group {
                $crate::lie::LieGroup::compose(&self, &other)
            }
        }

        impl core::ops::Mul<&$group> for &$group {
            type Output = $group;

            fn mul(self, other: &$group) -> $group {
                $crate::lie::LieGroup::compose(self, other)
            }
        }
    };
}
use multiply_by_composing;
