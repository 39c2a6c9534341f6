//! States that know where they are: what a position fix needs, in the plane (N = 2) and in space (N = 3).
//!
//! `(R, x)`: rotation body to world, position (m) in the world frame, whatever else the state carries.
//! A point fixed to the body at `b` lies at `x + R b`; in the left-invariant error its derivative is
//! `R [ (d/dphi Exp(phi) b), I ]`: `[J b, I]` in the plane and `[-hat(b), I]` in space.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

use super::nav_state::NavState;
use crate::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3, hat};

/// A Lie group of dimension D whose element places a body in N dimensions.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::Pose;
/// use nalgebra::{Vector2, Vector3};
///
/// // A point half a metre to the left of a vehicle that faces north lies to the west.
/// let north = SE2::exp(&Vector3::new(90_f64.to_radians(), 0.0, 0.0));
/// let left = north.point_w(&Vector2::new(0.0, 0.5), 1.0);
/// assert!((left - Vector2::new(-0.5, 0.0)).norm() < 1e-12);
/// ```
pub trait Pose<const D: usize, const N: usize>: LieGroup<D> {
    /// Where the position begins in the tangent vector.
    const POSITION: usize;

    /// Position, m, world frame.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Pose, RigidPose};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let north = SE2::from_increment(&Vector3::new(90_f64.to_radians(), 3.0, 1.0));
    /// assert_eq!(north.position_w(), Vector2::new(3.0, 1.0));
    /// ```
    fn position_w(&self) -> SVector<f64, N>;

    /// Rotation matrix, body to world.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Pose, RigidPose};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let north = SE2::from_increment(&Vector3::new(90_f64.to_radians(), 3.0, 1.0));
    /// // What is ahead of a vehicle that faces north lies north.
    /// assert!((north.rotation_matrix() * Vector2::x() - Vector2::y()).norm() < 1e-12);
    /// ```
    fn rotation_matrix(&self) -> SMatrix<f64, N, N>;

    /// `d Exp(phi) b / d phi` at zero, in the columns of the rotation; zero elsewhere.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::Pose;
    /// use nalgebra::Vector2;
    ///
    /// // A point ahead moves to the left when the body turns to the left, by its distance.
    /// let jacobian = <SE2 as Pose<3, 2>>::lever_jacobian(&Vector2::new(4.0, 0.0));
    /// assert_eq!(jacobian.column(0), Vector2::new(0.0, 4.0));
    /// ```
    fn lever_jacobian(lever_arm_b: &SVector<f64, N>) -> SMatrix<f64, N, D>;

    /// `scale x + R b`, m, world frame: where a sensor with this scale sees the point `b` of the body
    /// (\[LC\] (25), `scale = 1 + eps`).
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Pose, RigidPose};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let north = SE2::from_increment(&Vector3::new(90_f64.to_radians(), 3.0, 1.0));
    /// // A sensor whose scale is off by a tenth sees the position so, and not the lever.
    /// let seen = north.point_w(&Vector2::new(4.0, 0.0), 1.1);
    /// assert!((seen - (north.position_w() * 1.1 + Vector2::new(0.0, 4.0))).norm() < 1e-12);
    /// ```
    fn point_w(&self, lever_arm_b: &SVector<f64, N>, scale: f64) -> SVector<f64, N> {
        self.position_w() * scale + self.rotation_matrix() * lever_arm_b
    }

    /// The derivative of [`point_w`](Self::point_w) in the left-invariant error, N x D:
    /// `R [J b, scale I]`, or `R [-hat(b), scale I]`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Pose, RigidPose};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let north = SE2::from_increment(&Vector3::new(90_f64.to_radians(), 3.0, 1.0));
    /// let (lever_arm_b, xi) = (Vector2::new(4.0, 1.0), Vector3::new(1.0, -2.0, 0.5) * 1e-6);
    /// let moved = north * SE2::exp(&xi);
    /// let change = moved.point_w(&lever_arm_b, 1.0) - north.point_w(&lever_arm_b, 1.0);
    /// // To first order: what is left is of the second.
    /// assert!((change - north.point_jacobian(&lever_arm_b, 1.0) * xi).norm() < 1e-10);
    /// ```
    fn point_jacobian(&self, lever_arm_b: &SVector<f64, N>, scale: f64) -> SMatrix<f64, N, D> {
        let r_wb = self.rotation_matrix();
        let mut h = r_wb * Self::lever_jacobian(lever_arm_b);
        for row in 0..N {
            for column in 0..N {
                h[(row, Self::POSITION + column)] = scale * r_wb[(row, column)];
            }
        }
        h
    }
}

/// A pose that odometry drives: a rotation, a position and nothing else.
///
/// ```
/// use inekf::lie::SE2;
/// use inekf::model::{Pose, RigidPose};
/// use nalgebra::{Vector2, Vector3};
///
/// // The translation is taken literally: it is not bent by the turn, as `exp` would.
/// let kappa = SE2::from_increment(&Vector3::new(1.0, 2.0, 0.0));
/// assert_eq!(kappa.position_w(), Vector2::new(2.0, 0.0));
/// ```
pub trait RigidPose<const D: usize, const N: usize>: Pose<D, N> {
    /// `(Exp(phi), u)` of the increment `(phi, u)`: rotation vector in radians, translation in metres, in the
    /// body frame at the start of the step. The translation is taken literally, which `exp` would not.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Pose, RigidPose};
    /// use nalgebra::Vector3;
    ///
    /// let increment = Vector3::new(1.0, 2.0, 0.0);
    /// // exp goes along an arc, and arrives elsewhere with the same heading.
    /// let (literal, along_arc) = (SE2::from_increment(&increment), SE2::exp(&increment));
    /// assert_eq!(literal.rotation, along_arc.rotation);
    /// assert!((literal.position_w() - along_arc.position_w()).norm() > 0.5);
    /// ```
    fn from_increment(increment: &SVector<f64, D>) -> Self;

    /// The same rotation at another position, m, world frame.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Pose, RigidPose};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let north = SE2::from_increment(&Vector3::new(90_f64.to_radians(), 3.0, 1.0));
    /// let elsewhere = north.with_position_w(&Vector2::zeros());
    /// assert_eq!((elsewhere.rotation, elsewhere.position_w()), (north.rotation, Vector2::zeros()));
    /// ```
    fn with_position_w(&self, position_w: &SVector<f64, N>) -> Self;
}

impl Pose<3, 2> for SE2 {
    const POSITION: usize = 1;

    fn position_w(&self) -> Vector2<f64> {
        self.position
    }

    fn rotation_matrix(&self) -> Matrix2<f64> {
        self.rotation.matrix()
    }

    fn lever_jacobian(lever_arm_b: &Vector2<f64>) -> SMatrix<f64, 2, 3> {
        let mut jacobian = SMatrix::zeros();
        jacobian[(0, 0)] = -lever_arm_b.y;
        jacobian[(1, 0)] = lever_arm_b.x;
        jacobian
    }
}

impl RigidPose<3, 2> for SE2 {
    fn from_increment(increment: &Vector3<f64>) -> Self {
        Self {
            rotation: SO2::from_angle(increment.x),
            position: increment.yz(),
        }
    }

    fn with_position_w(&self, position_w: &Vector2<f64>) -> Self {
        Self {
            position: *position_w,
            ..*self
        }
    }
}

impl RigidPose<6, 3> for SE3 {
    fn from_increment(increment: &SVector<f64, 6>) -> Self {
        Self {
            rotation: SO3::exp(&increment.fixed_rows::<3>(0).into_owned()),
            position: increment.fixed_rows::<3>(3).into_owned(),
        }
    }

    fn with_position_w(&self, position_w: &Vector3<f64>) -> Self {
        Self {
            position: *position_w,
            ..*self
        }
    }
}

/// `-hat(b)` in the first three of D columns.
fn spatial_lever<const D: usize>(lever_arm_b: &Vector3<f64>) -> SMatrix<f64, 3, D> {
    let mut jacobian = SMatrix::<f64, 3, D>::zeros();
    let block = -hat(lever_arm_b);
    for row in 0..3 {
        for column in 0..3 {
            jacobian[(row, column)] = block[(row, column)];
        }
    }
    jacobian
}

/// Implements [`Pose`] in space for a state with the given tangent dimension, index and pose.
macro_rules! spatial_pose {
    ($state:ty, $dimension:literal, $position:literal, $self:ident => $pose:expr) => {
        impl Pose<$dimension, 3> for $state {
            const POSITION: usize = $position;

            fn position_w(&self) -> Vector3<f64> {
                let $self = self;
                $pose.position
            }

            fn rotation_matrix(&self) -> SMatrix<f64, 3, 3> {
                let $self = self;
                $pose.rotation.matrix()
            }

            fn lever_jacobian(lever_arm_b: &Vector3<f64>) -> SMatrix<f64, 3, $dimension> {
                spatial_lever(lever_arm_b)
            }
        }
    };
}

spatial_pose!(SE3, 6, 3, state => state);
spatial_pose!(SE23, 9, 6, state => state);
spatial_pose!(NavState, 15, 6, state => state.pose);
