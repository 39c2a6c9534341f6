//! The two-frames group of inertial navigation with biases.
//!
//! `(R, v, p, b_g, b_a)`: rotation body to world; velocity (m/s) and position (m) in the world frame; gyro
//! bias (rad/s) and accelerometer bias (m/s^2) in the body frame. Tangent, of dimension 15: `(rotation,
//! velocity, position, gyro bias, accelerometer bias)`. Barrau and Bonnabel, *The geometry of navigation
//! problems*: the vectors of each frame are carried along by the rotation that concerns them,
//!
//! ```text
//! (R1, x1, b1) (R2, x2, b2) = (R1 R2, x1 + R1 x2, b2 + R2^T b1)      x = v, p      b = b_g, b_a
//! ```
//!
//! The map `b -> c = R b` turns the second law into the first, `c1 + R1 c2`, and is the identity to first
//! order at the neutral element. The group is therefore SE_4(3) in other coordinates, with the same
//! tangent space: `ad` and the Jacobians are those of SE_4(3), `Ad` has the block `hat(R b) R = R hat(b)`,
//! and the body vectors of the exponential are `R^T Jl(phi) beta = Jr(phi) beta`.

use nalgebra::{SMatrix, SVector, Vector3};

use super::series::RotationSeries;
use super::so3::{SO3, left_jacobian_inverse_times};
use super::{LieGroup, multiply_by_composing, sek3};

/// Attitude, velocity and position of a body in the world, and the biases of its inertial sensors.
///
/// ```
/// use inekf::lie::{LieGroup, TwoFrames};
/// use nalgebra::SVector;
///
/// // Biases are body vectors: composed, those of the second are turned like everything else of its body.
/// let first = TwoFrames::exp(&SVector::<f64, 15>::from_fn(|i, _| 0.05 * i as f64));
/// assert!(first.compose(&first.inverse()).log().norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoFrames {
    /// The rotation, body to world.
    pub rotation: SO3,
    /// The velocity in the world frame, m/s.
    pub velocity: Vector3<f64>,
    /// The position in the world frame, m.
    pub position: Vector3<f64>,
    /// The bias of the gyro in the body frame, rad/s.
    pub gyro_bias: Vector3<f64>,
    /// The bias of the accelerometer in the body frame, m/s^2.
    pub accel_bias: Vector3<f64>,
}

impl LieGroup<15> for TwoFrames {
    const ROTATION_DIM: usize = 3;
    const VELOCITY_DIM: usize = 3;

    fn identity() -> Self {
        Self {
            rotation: SO3::identity(),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
        }
    }

    fn exp(xi: &SVector<f64, 15>) -> Self {
        let phi = sek3::part(xi, 0);
        let left = RotationSeries::at(&phi);
        let right = RotationSeries::at(&-phi);
        Self {
            rotation: SO3::exp(&phi),
            velocity: left.gamma_times::<1>(&sek3::part(xi, 3)),
            position: left.gamma_times::<1>(&sek3::part(xi, 6)),
            gyro_bias: right.gamma_times::<1>(&sek3::part(xi, 9)),
            accel_bias: right.gamma_times::<1>(&sek3::part(xi, 12)),
        }
    }

    fn log(&self) -> SVector<f64, 15> {
        let phi = self.rotation.log();
        let [velocity, position] =
            left_jacobian_inverse_times(&phi, &[self.velocity, self.position]);
        let [gyro_bias, accel_bias] =
            left_jacobian_inverse_times(&-phi, &[self.gyro_bias, self.accel_bias]);
        sek3::join(&phi, &[velocity, position, gyro_bias, accel_bias])
    }

    fn compose(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            velocity: self.velocity + self.rotation.rotate(&other.velocity),
            position: self.position + self.rotation.rotate(&other.position),
            gyro_bias: other.gyro_bias + other.rotation.inverse_rotate(&self.gyro_bias),
            accel_bias: other.accel_bias + other.rotation.inverse_rotate(&self.accel_bias),
        }
    }

    fn inverse(&self) -> Self {
        Self {
            rotation: self.rotation.inverse(),
            velocity: -self.rotation.inverse_rotate(&self.velocity),
            position: -self.rotation.inverse_rotate(&self.position),
            gyro_bias: -self.rotation.rotate(&self.gyro_bias),
            accel_bias: -self.rotation.rotate(&self.accel_bias),
        }
    }

    fn adjoint(&self) -> SMatrix<f64, 15, 15> {
        let in_world = [
            self.velocity,
            self.position,
            self.rotation.rotate(&self.gyro_bias),
            self.rotation.rotate(&self.accel_bias),
        ];
        sek3::adjoint(&self.rotation, &in_world)
    }

    fn ad(xi: &SVector<f64, 15>) -> SMatrix<f64, 15, 15> {
        sek3::ad::<4, 15>(xi)
    }

    fn left_jacobian(xi: &SVector<f64, 15>) -> SMatrix<f64, 15, 15> {
        sek3::left_jacobian::<4, 15>(xi)
    }

    fn left_jacobian_inverse(xi: &SVector<f64, 15>) -> SMatrix<f64, 15, 15> {
        sek3::left_jacobian_inverse::<4, 15>(xi)
    }

    fn congruence(p: &mut SMatrix<f64, 15, 15>, a: &SMatrix<f64, 15, 15>) {
        sek3::congruence::<15, 15>(p, a);
    }

    #[inline]
    fn row_product<const M: usize>(
        h: &SMatrix<f64, M, 15>,
        a: &SMatrix<f64, 15, 15>,
    ) -> SMatrix<f64, M, 15> {
        sek3::row_product::<M, 15, 15>(h, a)
    }

    fn is_finite(&self) -> bool {
        let vectors = [
            self.velocity,
            self.position,
            self.gyro_bias,
            self.accel_bias,
        ];
        self.rotation.is_finite()
            && vectors
                .iter()
                .all(|vector| vector.iter().all(|entry| entry.is_finite()))
    }

    fn normalized(&self) -> Self {
        Self {
            rotation: self.rotation.normalized(),
            ..*self
        }
    }
}

multiply_by_composing!(TwoFrames);
