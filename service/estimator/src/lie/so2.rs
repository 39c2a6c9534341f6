//! SO(2): rotations in the plane.
//!
//! Stored as the unit complex number `cos + i sin`, body to world, counter-clockwise positive. Tangent:
//! the angle, radians. The group is commutative, so that Ad and all Jacobians are 1.

use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};

use super::{LieGroup, multiply_by_composing};

/// The rotation of the plane that takes body coordinates to world coordinates.
///
/// ```
/// use inekf::lie::SO2;
/// use nalgebra::Vector2;
///
/// let left = SO2::from_angle(90_f64.to_radians());
/// assert!((left.rotate(&Vector2::x()) - Vector2::y()).norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SO2 {
    cos: f64,
    sin: f64,
}

impl SO2 {
    /// The rotation by an angle in radians, counter-clockwise.
    ///
    /// ```
    /// use inekf::lie::SO2;
    ///
    /// // 350 degrees to the left are ten to the right.
    /// assert!((SO2::from_angle(350_f64.to_radians()).angle_rad().to_degrees() + 10.0).abs() < 1e-9);
    /// ```
    #[must_use]
    pub fn from_angle(theta_rad: f64) -> Self {
        let (sin, cos) = theta_rad.sin_cos();
        Self { cos, sin }
    }

    /// The angle in radians, in `[-pi, pi]`, counter-clockwise.
    ///
    /// ```
    /// use inekf::lie::SO2;
    ///
    /// // Three quarters to the left are one to the right.
    /// let turned = SO2::from_angle(270_f64.to_radians());
    /// assert!((turned.angle_rad().to_degrees() + 90.0).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn angle_rad(&self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// The rotation matrix, body to world.
    ///
    /// ```
    /// use inekf::lie::SO2;
    /// use nalgebra::Vector2;
    ///
    /// // A quarter to the left: what is ahead of the body lies north.
    /// let r_wb = SO2::from_angle(90_f64.to_radians()).matrix();
    /// assert!((r_wb * Vector2::x() - Vector2::y()).norm() < 1e-15);
    /// ```
    #[must_use]
    pub fn matrix(&self) -> Matrix2<f64> {
        Matrix2::new(self.cos, -self.sin, self.sin, self.cos)
    }

    /// Takes a vector from body to world coordinates, `R a`.
    ///
    /// ```
    /// use inekf::lie::SO2;
    /// use nalgebra::Vector2;
    ///
    /// let (r_wb, a) = (SO2::from_angle(0.3), Vector2::new(1.0, 2.0));
    /// assert!((r_wb.rotate(&a) - r_wb.matrix() * a).norm() < 1e-15);
    /// ```
    #[must_use]
    pub fn rotate(&self, a: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.cos * a.x - self.sin * a.y,
            self.sin * a.x + self.cos * a.y,
        )
    }

    /// Takes a vector from world to body coordinates, `R^T a`.
    ///
    /// ```
    /// use inekf::lie::SO2;
    /// use nalgebra::Vector2;
    ///
    /// let (r_wb, a) = (SO2::from_angle(0.3), Vector2::new(1.0, 2.0));
    /// assert!((r_wb.inverse_rotate(&r_wb.rotate(&a)) - a).norm() < 1e-15);
    /// ```
    #[must_use]
    pub fn inverse_rotate(&self, a: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.cos * a.x + self.sin * a.y,
            self.cos * a.y - self.sin * a.x,
        )
    }
}

impl LieGroup<1> for SO2 {
    const ROTATION_DIM: usize = 1;

    fn identity() -> Self {
        Self { cos: 1.0, sin: 0.0 }
    }

    fn exp(theta: &Vector1<f64>) -> Self {
        Self::from_angle(theta.x)
    }

    fn log(&self) -> Vector1<f64> {
        Vector1::new(self.angle_rad())
    }

    fn compose(&self, other: &Self) -> Self {
        let cos = self.cos * other.cos - self.sin * other.sin;
        let sin = self.sin * other.cos + self.cos * other.sin;
        // One Newton step for 1 / norm: rounding cannot build up over any number of products.
        let scale = 1.5 - 0.5 * (cos * cos + sin * sin);
        Self {
            cos: scale * cos,
            sin: scale * sin,
        }
    }

    fn inverse(&self) -> Self {
        Self {
            cos: self.cos,
            sin: -self.sin,
        }
    }

    fn adjoint(&self) -> Matrix1<f64> {
        Matrix1::identity()
    }

    fn ad(_: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::zeros()
    }

    fn left_jacobian(_: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::identity()
    }

    fn left_jacobian_inverse(_: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::identity()
    }

    fn is_finite(&self) -> bool {
        self.cos.is_finite() && self.sin.is_finite()
    }

    fn normalized(&self) -> Self {
        let scale = 1.0 / (self.cos * self.cos + self.sin * self.sin).sqrt();
        Self {
            cos: scale * self.cos,
            sin: scale * self.sin,
        }
    }
}

multiply_by_composing!(SO2);
