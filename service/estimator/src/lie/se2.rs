//! SE(2): poses in the plane, the state of \[LC\] section VII.
//!
//! `(R, x)`: rotation body to world, position (m) in the world frame. Tangent: `(theta, x, y)`. Product:
//! `(R1 R2, x1 + R1 x2)`. With `J` the rotation by +90 degrees, `Exp(theta, rho) = (R(theta), V rho)` and
//! `V = S_1 I + theta S_2 J`; the functions `S_k` are those of [`super::series`].

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::series::{cos_sinc, entire};
use super::so2::SO2;
use super::{LieGroup, multiply_by_composing};

/// A pose in the plane.
///
/// ```
/// use inekf::lie::{LieGroup, SE2, SO2};
/// use nalgebra::Vector2;
///
/// let pose = SE2 { rotation: SO2::from_angle(90_f64.to_radians()), position: Vector2::new(3.0, 0.0) };
/// // Tangent order theta, x, y; a pure turn of the same angle has the same logarithm's first entry.
/// assert!((pose.log().x.to_degrees() - 90.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SE2 {
    /// The rotation, body to world.
    pub rotation: SO2,
    /// The position in the world frame, m.
    pub position: Vector2<f64>,
}

/// `J a`: `a` turned by +90 degrees.
fn turned(a: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-a.y, a.x)
}

/// `a I + b J`.
fn complex(a: f64, b: f64) -> Matrix2<f64> {
    Matrix2::new(a, -b, b, a)
}

/// `V(theta)^-1 = (theta/2) cot(theta/2) I - (theta/2) J`.
fn v_inverse(theta: f64) -> Matrix2<f64> {
    let half = 0.5 * theta;
    let (cos, sinc) = cos_sinc(half * half);
    complex(cos / sinc, -half)
}

/// The part `q` of the left Jacobian `[1 0; q V]`: `-Gamma_2 J rho = theta S_3 rho - S_2 J rho`, where
/// `Gamma_2 = S_2 I + theta S_3 J`, from the series `sum_n ad^n / (n + 1)!`.
fn q(theta: f64, rho: &Vector2<f64>, s_2: f64, s_3: f64) -> Vector2<f64> {
    theta * s_3 * rho - s_2 * turned(rho)
}

/// The matrix `[corner 0; below block]`.
fn assemble(corner: f64, below: &Vector2<f64>, block: &Matrix2<f64>) -> Matrix3<f64> {
    #[rustfmt::skip]
    let matrix = Matrix3::new(
        corner, 0.0, 0.0,
        below.x, block.m11, block.m12,
        below.y, block.m21, block.m22,
    );
    matrix
}

impl LieGroup<3> for SE2 {
    const ROTATION_DIM: usize = 1;

    fn identity() -> Self {
        Self {
            rotation: SO2::identity(),
            position: Vector2::zeros(),
        }
    }

    fn exp(xi: &Vector3<f64>) -> Self {
        let theta = xi.x;
        let s = entire(theta * theta);
        Self {
            rotation: SO2::from_angle(theta),
            position: complex(s[1], theta * s[2]) * xi.yz(),
        }
    }

    fn log(&self) -> Vector3<f64> {
        let theta = self.rotation.angle_rad();
        let rho = v_inverse(theta) * self.position;
        Vector3::new(theta, rho.x, rho.y)
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

    fn adjoint(&self) -> Matrix3<f64> {
        assemble(1.0, &-turned(&self.position), &self.rotation.matrix())
    }

    fn ad(xi: &Vector3<f64>) -> Matrix3<f64> {
        assemble(0.0, &-turned(&xi.yz()), &complex(0.0, xi.x))
    }

    fn left_jacobian(xi: &Vector3<f64>) -> Matrix3<f64> {
        let theta = xi.x;
        let s = entire(theta * theta);
        assemble(
            1.0,
            &q(theta, &xi.yz(), s[2], s[3]),
            &complex(s[1], theta * s[2]),
        )
    }

    fn left_jacobian_inverse(xi: &Vector3<f64>) -> Matrix3<f64> {
        let theta = xi.x;
        let s = entire(theta * theta);
        let inverse = v_inverse(theta);
        assemble(1.0, &-(inverse * q(theta, &xi.yz(), s[2], s[3])), &inverse)
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

multiply_by_composing!(SE2);
