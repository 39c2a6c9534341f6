//! SE(3): poses in space.
//!
//! `(R, p)`: rotation body to world, position (m) in the world frame. Tangent: `(rotation, position)`.
//! Product: `(R1 R2, p1 + R1 p2)`. Barfoot and Furgale, *Associating uncertainty with three-dimensional
//! poses for use in estimation problems*, with the rotation put first.

use nalgebra::{SMatrix, SVector, Vector3};

use super::series::RotationSeries;
use super::so3::{SO3, left_jacobian_inverse_times};
use super::{LieGroup, multiply_by_composing, sek3};

/// A pose: attitude and position of a body in the world.
///
/// ```
/// use inekf::lie::{LieGroup, SE3, SO3};
/// use nalgebra::Vector3;
///
/// let pose = SE3 { rotation: SO3::identity(), position: Vector3::new(1.0, 2.0, 3.0) };
/// // Rotation first, then position.
/// assert_eq!(pose.log().as_slice(), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SE3 {
    /// The rotation, body to world.
    pub rotation: SO3,
    /// The position in the world frame, m.
    pub position: Vector3<f64>,
}

impl LieGroup<6> for SE3 {
    const ROTATION_DIM: usize = 3;

    fn identity() -> Self {
        Self {
            rotation: SO3::identity(),
            position: Vector3::zeros(),
        }
    }

    fn exp(xi: &SVector<f64, 6>) -> Self {
        let phi = sek3::part(xi, 0);
        let series = RotationSeries::at(&phi);
        Self {
            rotation: SO3::exp(&phi),
            position: series.gamma_times::<1>(&sek3::part(xi, 3)),
        }
    }

    fn log(&self) -> SVector<f64, 6> {
        let phi = self.rotation.log();
        let rho = left_jacobian_inverse_times(&phi, &[self.position]);
        sek3::join(&phi, &rho)
    }

    fn compose(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            position: self.position + self.rotation.rotate(&other.position),
        }
    }

    fn inverse(&self) -> Self {
        Self {
            rotation: self.rotation.inverse(),
            position: -self.rotation.inverse_rotate(&self.position),
        }
    }

    fn adjoint(&self) -> SMatrix<f64, 6, 6> {
        sek3::adjoint(&self.rotation, &[self.position])
    }

    fn ad(xi: &SVector<f64, 6>) -> SMatrix<f64, 6, 6> {
        sek3::ad::<1, 6>(xi)
    }

    fn left_jacobian(xi: &SVector<f64, 6>) -> SMatrix<f64, 6, 6> {
        sek3::left_jacobian::<1, 6>(xi)
    }

    fn left_jacobian_inverse(xi: &SVector<f64, 6>) -> SMatrix<f64, 6, 6> {
        sek3::left_jacobian_inverse::<1, 6>(xi)
    }

    fn congruence(p: &mut SMatrix<f64, 6, 6>, a: &SMatrix<f64, 6, 6>) {
        sek3::congruence::<6, 6>(p, a);
    }

    #[inline]
    fn row_product<const M: usize>(
        h: &SMatrix<f64, M, 6>,
        a: &SMatrix<f64, 6, 6>,
    ) -> SMatrix<f64, M, 6> {
        sek3::row_product::<M, 6, 6>(h, a)
    }

    fn is_finite(&self) -> bool {
        self.rotation.is_finite() && self.position.iter().all(|entry| entry.is_finite())
    }

    fn normalized(&self) -> Self {
        Self {
            rotation: self.rotation.normalized(),
            ..*self
        }
    }
}

multiply_by_composing!(SE3);
