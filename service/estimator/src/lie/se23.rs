//! SE_2(3): extended poses, the state of inertial navigation without biases.
//!
//! `(R, v, p)`: rotation body to world, velocity (m/s) and position (m) in the world frame. Tangent:
//! `(rotation, velocity, position)`. Product: `(R1 R2, v1 + R1 v2, p1 + R1 p2)`. Barrau and Bonnabel,
//! *The invariant extended Kalman filter as a stable observer*.

use nalgebra::{SMatrix, SVector, Vector3};

use super::series::RotationSeries;
use super::so3::{SO3, left_jacobian_inverse_times};
use super::{LieGroup, multiply_by_composing, sek3};

/// An extended pose: attitude, velocity and position of a body in the world.
///
/// ```
/// use inekf::lie::{LieGroup, SE23, SO3};
/// use nalgebra::Vector3;
///
/// let chi = SE23 {
///     rotation: SO3::from_roll_pitch_heading(0.0, 0.0, 90_f64.to_radians()),
///     velocity: Vector3::new(0.0, 5.0, 0.0), // northwards
///     position: Vector3::zeros(),
/// };
/// // Facing north it drives forwards.
/// assert!((chi.rotation.inverse_rotate(&chi.velocity) - Vector3::new(5.0, 0.0, 0.0)).norm() < 1e-12);
/// // Rotation, velocity, position.
/// assert_eq!(SE23 { rotation: SO3::identity(), ..chi }.log()[4], 5.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SE23 {
    /// The rotation, body to world.
    pub rotation: SO3,
    /// The velocity in the world frame, m/s.
    pub velocity: Vector3<f64>,
    /// The position in the world frame, m.
    pub position: Vector3<f64>,
}

impl LieGroup<9> for SE23 {
    const ROTATION_DIM: usize = 3;
    const VELOCITY_DIM: usize = 3;

    fn identity() -> Self {
        Self {
            rotation: SO3::identity(),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
        }
    }

    #[inline]
    fn exp(xi: &SVector<f64, 9>) -> Self {
        let phi = sek3::part(xi, 0);
        let series = RotationSeries::at(&phi);
        Self {
            rotation: SO3::exp(&phi),
            velocity: series.gamma_times::<1>(&sek3::part(xi, 3)),
            position: series.gamma_times::<1>(&sek3::part(xi, 6)),
        }
    }

    #[inline]
    fn log(&self) -> SVector<f64, 9> {
        let phi = self.rotation.log();
        let rho = left_jacobian_inverse_times(&phi, &[self.velocity, self.position]);
        sek3::join(&phi, &rho)
    }

    #[inline]
    fn compose(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            velocity: self.velocity + self.rotation.rotate(&other.velocity),
            position: self.position + self.rotation.rotate(&other.position),
        }
    }

    #[inline]
    fn inverse(&self) -> Self {
        Self {
            rotation: self.rotation.inverse(),
            velocity: -self.rotation.inverse_rotate(&self.velocity),
            position: -self.rotation.inverse_rotate(&self.position),
        }
    }

    #[inline]
    fn between(&self, other: &Self) -> Self {
        let back = |a: &Vector3<f64>| self.rotation.inverse_rotate(a);
        Self {
            rotation: self.rotation.inverse() * other.rotation,
            velocity: back(&(other.velocity - self.velocity)),
            position: back(&(other.position - self.position)),
        }
    }

    fn adjoint(&self) -> SMatrix<f64, 9, 9> {
        sek3::adjoint(&self.rotation, &[self.velocity, self.position])
    }

    fn ad(xi: &SVector<f64, 9>) -> SMatrix<f64, 9, 9> {
        sek3::ad::<2, 9>(xi)
    }

    fn left_jacobian(xi: &SVector<f64, 9>) -> SMatrix<f64, 9, 9> {
        sek3::left_jacobian::<2, 9>(xi)
    }

    fn left_jacobian_inverse(xi: &SVector<f64, 9>) -> SMatrix<f64, 9, 9> {
        sek3::left_jacobian_inverse::<2, 9>(xi)
    }

    fn congruence(p: &mut SMatrix<f64, 9, 9>, a: &SMatrix<f64, 9, 9>) {
        sek3::congruence::<9, 9>(p, a);
    }

    #[inline]
    fn row_product<const M: usize>(
        h: &SMatrix<f64, M, 9>,
        a: &SMatrix<f64, 9, 9>,
    ) -> SMatrix<f64, M, 9> {
        sek3::row_product::<M, 9, 9>(h, a)
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.rotation.is_finite()
            && self.velocity.iter().all(|entry| entry.is_finite())
            && self.position.iter().all(|entry| entry.is_finite())
    }

    #[inline]
    fn normalized(&self) -> Self {
        Self {
            rotation: self.rotation.normalized(),
            ..*self
        }
    }
}

multiply_by_composing!(SE23);
