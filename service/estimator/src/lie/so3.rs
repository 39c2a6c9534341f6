//! SO(3): rotations in space.
//!
//! Stored as a unit Hamilton quaternion `x, y, z, w`, body to world: `rotate` takes body coordinates to
//! world coordinates. Tangent: the rotation vector, radians. Closed forms: Sola, Deray and Atchuthan,
//! *A micro Lie theory for state estimation in robotics*, on the half angle so that neither 0 nor pi is special.

use nalgebra::{Matrix3, Matrix4, SymmetricEigen, Vector3};

use super::series::{RotationSeries, cos_sinc, inverse_jacobian_coefficient};
use super::{LieGroup, RotationError, multiply_by_composing};

/// How far a matrix may be from its nearest rotation, in its worst entry, to be taken for one.
const MATRIX_TOLERANCE: f64 = 0.1;

/// The skew matrix of a vector: `hat(a) b = a x b`.
///
/// ```
/// use inekf::lie::hat;
/// use nalgebra::Vector3;
///
/// let (a, b) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(-1.0, 0.5, 2.0));
/// assert_eq!(hat(&a) * b, a.cross(&b));
/// ```
#[must_use]
#[inline]
pub fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The rotation that takes body coordinates to world coordinates.
///
/// Two rotations are equal when their stored numbers are, up to the common sign of the quaternion.
///
/// ```
/// use inekf::lie::SO3;
///
/// // A quaternion and its negative are the same rotation.
/// let q = SO3::from_quaternion_xyzw([0.0, 0.0, 0.6, 0.8])?;
/// assert_eq!(q, SO3::from_quaternion_xyzw([0.0, 0.0, -0.6, -0.8])?);
/// # Ok::<(), inekf::lie::RotationError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct SO3 {
    /// The vector part `x, y, z`: the axis times the sine of half the angle.
    vector: Vector3<f64>,
    /// The scalar part: the cosine of half the angle.
    w: f64,
}

impl SO3 {
    /// Takes a quaternion `x, y, z, w` (Hamilton, body to world) of any norm and normalises it.
    ///
    /// ```
    /// use inekf::lie::SO3;
    ///
    /// assert!(SO3::from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0]).is_ok());
    /// assert!(SO3::from_quaternion_xyzw([0.0; 4]).is_err());
    /// ```
    ///
    /// # Errors
    /// If an entry is not finite, or the norm is zero, or its square under- or overflows.
    pub fn from_quaternion_xyzw(xyzw: [f64; 4]) -> Result<Self, RotationError> {
        let [x, y, z, w] = xyzw;
        if !xyzw.iter().all(|entry| entry.is_finite()) {
            return Err(RotationError::NotFinite);
        }
        let vector = Vector3::new(x, y, z);
        let norm_squared = vector.norm_squared() + w * w;
        if !norm_squared.is_normal() {
            return Err(RotationError::NoDirection);
        }
        Ok(Self { vector, w }.normalized())
    }

    /// The unit quaternion `x, y, z, w` (Hamilton, body to world); its sign carries no meaning.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO3};
    ///
    /// // Scalar last.
    /// assert_eq!(SO3::identity().quaternion_xyzw(), [0.0, 0.0, 0.0, 1.0]);
    /// ```
    #[must_use]
    pub fn quaternion_xyzw(&self) -> [f64; 4] {
        [self.vector.x, self.vector.y, self.vector.z, self.w]
    }

    /// The rotation nearest to a matrix (Frobenius norm), body to world: `x_w = matrix x_b`.
    ///
    /// The quaternion is the eigenvector of Davenport's matrix, as good near pi as anywhere.
    ///
    /// # Errors
    /// If an entry is not finite, or if some entry is more than 0.1 away from the nearest rotation: a
    /// reflection, a matrix with a scale, or not a rotation at all.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SO3};
    /// use nalgebra::Vector3;
    ///
    /// let r_wb = SO3::exp(&Vector3::new(0.3, -0.5, 0.8));
    /// // Three digits, as a file may have them: the nearest rotation.
    /// let rounded = r_wb.matrix().map(|entry| (entry * 1e3).round() / 1e3);
    /// let found = SO3::from_matrix(&rounded)?;
    /// assert!(r_wb.between(&found).log().norm() < 1e-3);
    /// # Ok::<(), inekf::lie::RotationError>(())
    /// ```
    pub fn from_matrix(matrix: &Matrix3<f64>) -> Result<Self, RotationError> {
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return Err(RotationError::NotFinite);
        }
        // No rotation has a larger entry than 1: refused before a product can overflow.
        if matrix.amax() > 1.0 + MATRIX_TOLERANCE {
            return Err(RotationError::NotARotation);
        }
        let m = |i, j| matrix[(i, j)];
        #[rustfmt::skip]
        let davenport = Matrix4::new(
            m(0, 0) - m(1, 1) - m(2, 2), m(0, 1) + m(1, 0), m(0, 2) + m(2, 0), m(2, 1) - m(1, 2),
            m(0, 1) + m(1, 0), m(1, 1) - m(0, 0) - m(2, 2), m(1, 2) + m(2, 1), m(0, 2) - m(2, 0),
            m(0, 2) + m(2, 0), m(1, 2) + m(2, 1), m(2, 2) - m(0, 0) - m(1, 1), m(1, 0) - m(0, 1),
            m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1), m(0, 0) + m(1, 1) + m(2, 2),
        );
        let eigen = SymmetricEigen::new(davenport);
        let q = eigen.eigenvectors.column(eigen.eigenvalues.imax());
        let rotation = Self::from_quaternion_xyzw([q[0], q[1], q[2], q[3]])?;
        if (rotation.matrix() - matrix).amax() > MATRIX_TOLERANCE {
            return Err(RotationError::NotARotation);
        }
        Ok(rotation)
    }

    /// `Rz(heading) Ry(pitch) Rx(roll)`, all in radians, with x forward, y left, z up (FLU) in the body
    /// and east, north, up (ENU) in the world.
    ///
    /// Heading counts counter-clockwise from east; a positive pitch puts the nose down and a positive roll
    /// puts the left side up.
    ///
    /// ```
    /// use inekf::lie::SO3;
    /// use nalgebra::Vector3;
    ///
    /// // Facing north: forward is north, left is west.
    /// let r_wb = SO3::from_roll_pitch_heading(0.0, 0.0, 90_f64.to_radians());
    /// assert!((r_wb.rotate(&Vector3::x()) - Vector3::y()).norm() < 1e-12);
    /// assert!((r_wb.rotate(&Vector3::y()) + Vector3::x()).norm() < 1e-12);
    /// assert!((r_wb.heading_rad().to_degrees() - 90.0).abs() < 1e-9);
    /// ```
    #[must_use]
    pub fn from_roll_pitch_heading(roll_rad: f64, pitch_rad: f64, heading_rad: f64) -> Self {
        let turn = |axis: Vector3<f64>, angle_rad: f64| {
            let (sin, cos) = (0.5 * angle_rad).sin_cos();
            Self {
                vector: axis * sin,
                w: cos,
            }
        };
        turn(Vector3::z(), heading_rad)
            * turn(Vector3::y(), pitch_rad)
            * turn(Vector3::x(), roll_rad)
    }

    /// The heading in radians, in `[-pi, pi]`: the direction of the body's x axis on the ground,
    /// counter-clockwise from the world's x axis. It is meaningless where x points straight up or down.
    ///
    /// ```
    /// use inekf::lie::SO3;
    ///
    /// // A roll and a pitch do not turn the heading.
    /// let r_wb = SO3::from_roll_pitch_heading(0.2, -0.3, 1.0);
    /// assert!((r_wb.heading_rad() - 1.0).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn heading_rad(&self) -> f64 {
        let [x, y, z, w] = self.quaternion_xyzw();
        f64::atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z)
    }

    /// The rotation matrix, body to world: its columns are the body's axes in world coordinates.
    ///
    /// ```
    /// use inekf::lie::SO3;
    /// use nalgebra::Vector3;
    ///
    /// let r_wb = SO3::from_roll_pitch_heading(0.0, 0.0, 90_f64.to_radians());
    /// // The first column is the body's x axis in the world: north.
    /// assert!((r_wb.matrix().column(0) - Vector3::y()).norm() < 1e-12);
    /// ```
    #[inline]
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        let [x, y, z, w] = self.quaternion_xyzw();
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, yy, zz) = (x * x2, y * y2, z * z2);
        let (xy, xz, yz) = (x * y2, x * z2, y * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        #[rustfmt::skip]
        let matrix = Matrix3::new(
            1.0 - (yy + zz), xy - wz, xz + wy,
            xy + wz, 1.0 - (xx + zz), yz - wx,
            xz - wy, yz + wx, 1.0 - (xx + yy),
        );
        matrix
    }

    /// Takes a vector from body to world coordinates, `R a`.
    ///
    /// ```
    /// use inekf::lie::SO3;
    /// use nalgebra::Vector3;
    ///
    /// // Nose down by a positive pitch.
    /// let r_wb = SO3::from_roll_pitch_heading(0.0, 0.1, 0.0);
    /// assert!(r_wb.rotate(&Vector3::x()).z < 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn rotate(&self, a: &Vector3<f64>) -> Vector3<f64> {
        let twice = 2.0 * self.vector.cross(a);
        a + self.w * twice + self.vector.cross(&twice)
    }

    /// Takes a vector from world to body coordinates, `R^T a`.
    ///
    /// ```
    /// use inekf::lie::SO3;
    /// use nalgebra::Vector3;
    ///
    /// // What a level accelerometer at rest feels of gravity is up; rolled to the right it is partly on its left.
    /// let r_wb = SO3::from_roll_pitch_heading(0.1, 0.0, 0.0);
    /// assert!(r_wb.inverse_rotate(&Vector3::new(0.0, 0.0, 9.80665)).y > 0.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn inverse_rotate(&self, a: &Vector3<f64>) -> Vector3<f64> {
        let twice = 2.0 * self.vector.cross(a);
        a - self.w * twice + self.vector.cross(&twice)
    }
}

/// `Jl(phi)^-1 a_i` on SO(3), without forming the matrix.
#[inline]
pub(super) fn left_jacobian_inverse_times<const K: usize>(
    phi: &Vector3<f64>,
    vectors: &[Vector3<f64>; K],
) -> [Vector3<f64>; K] {
    let c = inverse_jacobian_coefficient(phi.norm_squared());
    vectors.map(|a| {
        let phi_a = phi.cross(&a);
        a - 0.5 * phi_a + c * phi.cross(&phi_a)
    })
}

impl PartialEq for SO3 {
    fn eq(&self, other: &Self) -> bool {
        (self.vector == other.vector && self.w == other.w)
            || (self.vector == -other.vector && self.w == -other.w)
    }
}

impl LieGroup<3> for SO3 {
    const ROTATION_DIM: usize = 3;

    fn identity() -> Self {
        Self {
            vector: Vector3::zeros(),
            w: 1.0,
        }
    }

    #[inline]
    fn exp(phi: &Vector3<f64>) -> Self {
        let (cos, sinc) = cos_sinc(0.25 * phi.norm_squared());
        Self {
            vector: (0.5 * sinc) * phi,
            w: cos,
        }
    }

    #[inline]
    fn log(&self) -> Vector3<f64> {
        // Of the two quaternions, the one whose half angle is at most pi/2.
        let (vector, w) = if self.w < 0.0 {
            (-self.vector, -self.w)
        } else {
            (self.vector, self.w)
        };
        let sin_squared = vector.norm_squared();
        // For small angles atan2(s, w) by its series in (s/w)^2: no root, no arc tangent, and s^2 may underflow.
        if sin_squared < 1e-3 {
            let back = 1.0 / w;
            let t = sin_squared * (back * back);
            let series =
                t * (1.0 / 3.0 - t * (0.2 - t * (1.0 / 7.0 - t * (1.0 / 9.0 - t * (1.0 / 11.0)))));
            return (2.0 * back * (1.0 - series)) * vector;
        }
        let sin = sin_squared.sqrt();
        (2.0 * sin.atan2(w) / sin) * vector
    }

    #[inline]
    fn compose(&self, other: &Self) -> Self {
        let vector =
            self.w * other.vector + other.w * self.vector + self.vector.cross(&other.vector);
        let w = self.w * other.w - self.vector.dot(&other.vector);
        // One Newton step for 1 / norm: rounding cannot build up over any number of products.
        let scale = 1.5 - 0.5 * (vector.norm_squared() + w * w);
        Self {
            vector: scale * vector,
            w: scale * w,
        }
    }

    #[inline]
    fn inverse(&self) -> Self {
        Self {
            vector: -self.vector,
            w: self.w,
        }
    }

    fn adjoint(&self) -> Matrix3<f64> {
        self.matrix()
    }

    fn ad(phi: &Vector3<f64>) -> Matrix3<f64> {
        hat(phi)
    }

    #[inline]
    fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
        RotationSeries::at(phi).gamma::<1>()
    }

    #[inline]
    fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
        let t = phi.norm_squared();
        let c = inverse_jacobian_coefficient(t);
        let mut inverse = (c * phi) * phi.transpose() - hat(&(0.5 * phi));
        let diagonal = 1.0 - c * t;
        inverse[(0, 0)] += diagonal;
        inverse[(1, 1)] += diagonal;
        inverse[(2, 2)] += diagonal;
        inverse
    }

    fn is_finite(&self) -> bool {
        self.w.is_finite() && self.vector.iter().all(|entry| entry.is_finite())
    }

    #[inline]
    fn normalized(&self) -> Self {
        let scale = 1.0 / (self.vector.norm_squared() + self.w * self.w).sqrt();
        Self {
            vector: scale * self.vector,
            w: scale * self.w,
        }
    }
}

multiply_by_composing!(SO3);
