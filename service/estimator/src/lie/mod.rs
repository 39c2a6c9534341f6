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
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::{Vector2, Vector3};
///
/// // A quarter turn to the left, then a metre forward: the metre goes to the left.
/// let turn = SE2::exp(&Vector3::new(90_f64.to_radians(), 0.0, 0.0));
/// let ahead = SE2::exp(&Vector3::new(0.0, 1.0, 0.0));
/// assert!((turn.compose(&ahead).position - Vector2::new(0.0, 1.0)).norm() < 1e-12);
/// ```
pub trait LieGroup<const D: usize>: Copy + Clone + Debug + PartialEq {
    /// How many of the leading tangent coordinates are the rotation: 1 in the plane, 3 in space.
    const ROTATION_DIM: usize;

    /// How many of the tangent coordinates that follow the rotation are a velocity: 3 in the groups of inertial
    /// navigation, 0 in those of poses.
    const VELOCITY_DIM: usize = 0;

    /// The neutral element: `X identity = identity X = X`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE3};
    ///
    /// assert_eq!(SE3::identity().log().norm(), 0.0);
    /// ```
    fn identity() -> Self;

    /// The exponential map, defined for every finite `xi` (also for rotations beyond pi).
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO3};
    /// use nalgebra::Vector3;
    ///
    /// // A rotation vector: its length is the angle, its direction the axis.
    /// let up = Vector3::new(0.0, 0.0, 90_f64.to_radians());
    /// assert!((SO3::exp(&up).rotate(&Vector3::x()) - Vector3::y()).norm() < 1e-12);
    /// ```
    fn exp(xi: &SVector<f64, D>) -> Self;

    /// The principal logarithm: `exp(X.log()) = X`, with the angle of rotation in `[0, pi]`.
    ///
    /// At an angle of exactly pi two logarithms exist and one of them is returned.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO2};
    /// use nalgebra::Vector1;
    ///
    /// // The principal one: 190 degrees to the left are 170 to the right.
    /// let turned = SO2::exp(&Vector1::new(190_f64.to_radians()));
    /// assert!((turned.log().x.to_degrees() + 170.0).abs() < 1e-9);
    /// ```
    fn log(&self) -> SVector<f64, D>;

    /// The product `X Y`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let (x, y) = (SE2::exp(&Vector3::new(0.3, 1.0, 2.0)), SE2::exp(&Vector3::new(-0.8, 0.5, 0.0)));
    /// // As a product; its order matters.
    /// assert_eq!(x.compose(&y), x * y);
    /// assert!((x * y).between(&(y * x)).log().norm() > 0.1);
    /// ```
    fn compose(&self, other: &Self) -> Self;

    /// The inverse: `X X^-1 = identity`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use nalgebra::SVector;
    ///
    /// let chi = SE23::exp(&SVector::from_fn(|i, _| 0.1 * i as f64));
    /// assert!(chi.compose(&chi.inverse()).log().norm() < 1e-14);
    /// ```
    fn inverse(&self) -> Self;

    /// The element that leads from `X` to `Y`, `X^-1 Y`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let here = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// let ahead = here * SE2::exp(&Vector3::new(0.0, 2.0, 0.0));
    /// // Seen from here: two metres ahead, wherever here is.
    /// assert!((here.between(&ahead).log() - Vector3::new(0.0, 2.0, 0.0)).norm() < 1e-12);
    /// ```
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// The adjoint matrix, `X exp(xi) X^-1 = exp(Ad_X xi)`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// // From the error in body axes to the one in world axes, of the same two poses.
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// let xi = Vector3::new(0.1, 0.2, -0.3);
    /// let (body, world) = (chi * SE2::exp(&xi), SE2::exp(&(chi.adjoint() * xi)) * chi);
    /// assert!(body.between(&world).log().norm() < 1e-12);
    /// ```
    fn adjoint(&self) -> SMatrix<f64, D, D>;

    /// The adjoint of the algebra, `Ad_exp(xi) = expm(ad_xi)`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO3};
    /// use nalgebra::Vector3;
    ///
    /// // On SO(3) it is the cross product.
    /// let (a, b) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(-1.0, 0.5, 2.0));
    /// assert!((SO3::ad(&a) * b - a.cross(&b)).norm() < 1e-15);
    /// ```
    fn ad(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// The left Jacobian, `exp(xi + d) = exp(Jl d) exp(xi)` to first order in `d`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let (xi, d) = (Vector3::new(0.5, 3.0, 1.0), Vector3::new(1.0, -2.0, 0.5) * 1e-6);
    /// let moved = SE2::exp(&(SE2::left_jacobian(&xi) * d)) * SE2::exp(&xi);
    /// // To first order: what is left is of the second.
    /// assert!(SE2::exp(&(xi + d)).between(&moved).log().norm() < 1e-10);
    /// ```
    fn left_jacobian(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// The inverse of the left Jacobian. It exists while the rotation is below 2 pi, and is exact there.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE3};
    /// use nalgebra::{Matrix6, Vector6};
    ///
    /// let xi = Vector6::new(0.3, -0.5, 0.8, 1.0, 2.0, 3.0);
    /// let product = SE3::left_jacobian(&xi) * SE3::left_jacobian_inverse(&xi);
    /// assert!((product - Matrix6::identity()).norm() < 1e-12);
    /// ```
    fn left_jacobian_inverse(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// The right Jacobian, `exp(xi + d) = exp(xi) exp(Jr d)` to first order in `d`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// // The two sides differ by the adjoint.
    /// let xi = Vector3::new(0.5, 3.0, 1.0);
    /// let from_left = SE2::exp(&-xi).adjoint() * SE2::left_jacobian(&xi);
    /// assert!((SE2::right_jacobian(&xi) - from_left).norm() < 1e-12);
    /// ```
    fn right_jacobian(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        Self::left_jacobian(&-xi)
    }

    /// The inverse of the right Jacobian. It exists while the rotation is below 2 pi, and is exact there.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO3};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let phi = Vector3::new(0.3, -0.5, 0.8);
    /// let product = SO3::right_jacobian_inverse(&phi) * SO3::right_jacobian(&phi);
    /// assert!((product - Matrix3::identity()).norm() < 1e-14);
    /// ```
    fn right_jacobian_inverse(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        Self::left_jacobian_inverse(&-xi)
    }

    /// Makes the symmetric matrix P `A P A^T`, exactly symmetric, where A has zeros wherever the adjoint, `ad` or
    /// the Jacobians of this group have them (identity where they have one). Groups that know their zeros are
    /// faster than this.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE3};
    /// use nalgebra::{Matrix6, Vector6};
    ///
    /// let ad = SE3::exp(&Vector6::new(0.3, -0.5, 0.8, 1.0, 2.0, 3.0)).adjoint();
    /// let mut p = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0));
    /// let dense = ad * p * ad.transpose();
    /// SE3::congruence(&mut p, &ad);
    /// assert!((p - dense).norm() < 1e-12);
    /// // Exactly symmetric, which the product of three matrices is not.
    /// assert_eq!(p, p.transpose());
    /// ```
    fn congruence(p: &mut SMatrix<f64, D, D>, a: &SMatrix<f64, D, D>) {
        *p = a * *p * a.transpose();
        p.fill_lower_triangle_with_upper_triangle();
    }

    /// `H A`, where A has the zeros of [`congruence`](Self::congruence).
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{Matrix2x3, Vector3};
    ///
    /// let ad = SE2::exp(&Vector3::new(0.5, 3.0, 1.0)).adjoint();
    /// let h = Matrix2x3::new(0.0, 1.0, 0.0, 0.5, 0.0, 1.0);
    /// assert!((SE2::row_product(&h, &ad) - h * ad).norm() < 1e-15);
    /// ```
    fn row_product<const M: usize>(
        h: &SMatrix<f64, M, D>,
        a: &SMatrix<f64, D, D>,
    ) -> SMatrix<f64, M, D> {
        h * a
    }

    /// Whether every stored number is finite.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// assert!(SE2::identity().is_finite());
    /// assert!(!SE2::exp(&Vector3::new(0.0, f64::NAN, 0.0)).is_finite());
    /// ```
    fn is_finite(&self) -> bool;

    /// The element with its rotation put back on the group exactly.
    ///
    /// [`compose`](Self::compose) already keeps the norm of the rotation, so that a chain of products of
    /// any length does not need this; it is for states that came from elsewhere.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO3};
    /// use nalgebra::Vector3;
    ///
    /// // A rotation of this library is normalised already.
    /// let r_wb = SO3::exp(&Vector3::new(0.3, -0.5, 0.8));
    /// assert!((r_wb.normalized().matrix() - r_wb.matrix()).norm() < 1e-15);
    /// ```
    fn normalized(&self) -> Self;
}

/// Why numbers were refused as a rotation.
///
/// ```
/// use inekf::lie::{RotationError, SO3};
/// use nalgebra::Matrix3;
///
/// assert_eq!(SO3::from_quaternion_xyzw([0.0; 4]), Err(RotationError::NoDirection));
/// // A reflection is no rotation.
/// let mirror = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, -1.0));
/// assert_eq!(SO3::from_matrix(&mirror), Err(RotationError::NotARotation));
/// ```
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
