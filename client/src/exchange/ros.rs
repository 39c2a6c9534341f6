//! Estimates in the conventions of ROS (REP 103 and 105, `nav_msgs/Odometry`).
//!
//! World ENU and body FLU are ROS's own. What differs is the covariance. Ours is that of the left-invariant error in
//! body coordinates, `chi = chi_hat exp(xi)`, rotation first; ROS orders position, then rotation, and means turns about
//! the fixed axes of the frame that the pose is in. To first order, with `R` the estimated attitude:
//!
//! * position `R xi_p`, rotation `R xi_R`: `P_ros = D P D^T`, `D = [0 R; R 0]` on (rotation, position);
//! * the twist is in the body: `v_b = R^T v_w`, whose error is `xi_v + [v_b]x xi_R`.
//!
//! The angular velocity is not a part of the state: it is written as zero, with the variance [`UNKNOWN`]. The same
//! stands for the velocity of a model that has none. Without a covariance in the table all entries are zero.

use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::evaluate::{Pose, estimate_pose, symmetric};
use crate::table::estimate::triangle_len;
use crate::table::{EstimateRow, EstimateState};

/// Variance of what is not estimated, in the unit of its square.
pub const UNKNOWN: f64 = 1e9;

/// What a `nav_msgs/Odometry` holds.
///
/// ```
/// use inekf_client::exchange::ros::Odometry;
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// // Ours is rotation first, in the body; ROS has x, y, z first, in the world.
/// let north = EstimateState::Pose {
///     q_wb: [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()],
///     p_w_m: [0.0; 3],
/// };
/// let mut covariance = vec![0.0; 21];
/// covariance[15] = 4.0; // (3, 3): 2 m along the body's x axis
/// let ros = Odometry::from_row(&EstimateRow { stamp_ns: 0, state: north, covariance });
/// assert!((ros.pose_covariance[(1, 1)] - 4.0).abs() < 1e-12 && ros.pose_covariance[(0, 0)] < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry {
    /// Stamp, pose in the world, velocity in the world.
    pub pose: Pose,
    /// Covariance of x, y, z and the turns about the world's axes x, y, z; m and rad.
    pub pose_covariance: Matrix6<f64>,
    /// Velocity in body axes, m/s.
    pub v_b_mps: Vector3<f64>,
    /// Covariance of the velocity and the angular velocity in body axes.
    pub twist_covariance: Matrix6<f64>,
}

impl Odometry {
    /// The row in ROS's conventions.
    ///
    /// ```
    /// use inekf_client::exchange::ros::{Odometry, UNKNOWN};
    /// use inekf_client::table::{EstimateRow, EstimateState};
    ///
    /// // Northwards at 3 m/s, facing north: 3 m/s forwards.
    /// let row = EstimateRow {
    ///     stamp_ns: 0,
    ///     state: EstimateState::Navigation {
    ///         q_wb: [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()],
    ///         v_w_mps: [0.0, 3.0, 0.0],
    ///         p_w_m: [0.0; 3],
    ///         gyro_bias_rps: [0.0; 3],
    ///         accel_bias_mps2: [0.0; 3],
    ///     },
    ///     covariance: vec![],
    /// };
    /// let ros = Odometry::from_row(&row);
    /// assert!((ros.v_b_mps.x - 3.0).abs() < 1e-12 && ros.v_b_mps.y.abs() < 1e-12);
    /// // The angular velocity is not a part of the state.
    /// assert_eq!(ros.twist_covariance[(5, 5)], UNKNOWN);
    /// ```
    #[must_use]
    pub fn from_row(row: &EstimateRow) -> Self {
        let pose = estimate_pose(row.stamp_ns, &row.state);
        let r_wb = *pose.q_wb.to_rotation_matrix().matrix();
        let v_b_mps = pose
            .v_w_mps
            .map_or_else(Vector3::zeros, |v_w| r_wb.transpose() * v_w);
        let mut twist_covariance = Matrix6::zeros();
        twist_covariance
            .fixed_view_mut::<3, 3>(3, 3)
            .fill_diagonal(UNKNOWN);
        if pose.v_w_mps.is_none() {
            twist_covariance
                .fixed_view_mut::<3, 3>(0, 0)
                .fill_diagonal(UNKNOWN);
        }
        let mut odometry = Self {
            pose,
            pose_covariance: Matrix6::zeros(),
            v_b_mps,
            twist_covariance,
        };
        if let Some(error) = Error::of(row) {
            odometry.fill(&error, &r_wb);
        }
        odometry
    }

    fn fill(&mut self, error: &Error, r_wb: &Matrix3<f64>) {
        let turned = |block: Matrix3<f64>| r_wb * block * r_wb.transpose();
        let position_rotation = turned(error.rotation_position.transpose());
        let mut pose = Matrix6::zeros();
        pose.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&turned(error.position));
        pose.fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&position_rotation);
        pose.fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&position_rotation.transpose());
        pose.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&turned(error.rotation));
        self.pose_covariance = pose;
        if let Some((velocity, rotation_velocity)) = error.velocity {
            let turn = self.v_b_mps.cross_matrix();
            let mixed = turn * rotation_velocity;
            let body =
                velocity + mixed + mixed.transpose() + turn * error.rotation * turn.transpose();
            self.twist_covariance
                .fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&body);
        }
    }
}

/// Blocks of a covariance of the left-invariant error, in space.
struct Error {
    rotation: Matrix3<f64>,
    position: Matrix3<f64>,
    rotation_position: Matrix3<f64>,
    /// Of velocity, and of rotation with velocity.
    velocity: Option<(Matrix3<f64>, Matrix3<f64>)>,
}

impl Error {
    /// `None` without a covariance, or with one whose size is not of its model.
    fn of(row: &EstimateRow) -> Option<Self> {
        let covariance = &row.covariance;
        let (dimension, velocity_at, position_at) = match row.state {
            EstimateState::Plane { .. } => return Self::of_plane(covariance),
            EstimateState::Pose { .. } => (6, None, 3),
            EstimateState::Navigation { .. } if covariance.len() == triangle_len(9) => {
                (9, Some(3), 6)
            }
            EstimateState::Navigation { .. } => (15, Some(3), 6),
        };
        let full = symmetric(covariance, dimension)?;
        let block = |row: usize, col: usize| -> Matrix3<f64> {
            full.fixed_view::<3, 3>(row, col).into_owned()
        };
        Some(Self {
            rotation: block(0, 0),
            position: block(position_at, position_at),
            rotation_position: block(0, position_at),
            velocity: velocity_at.map(|at| (block(at, at), block(0, at))),
        })
    }

    /// The plane in space: height, roll and pitch are certain.
    fn of_plane(covariance: &[f64]) -> Option<Self> {
        let full = symmetric(covariance, 3)?;
        let mut blocks = [Matrix3::zeros(); 3];
        let [rotation, position, rotation_position] = &mut blocks;
        rotation[(2, 2)] = full[(0, 0)];
        for i in 0..2 {
            rotation_position[(2, i)] = full[(0, 1 + i)];
            for j in 0..2 {
                position[(i, j)] = full[(1 + i, 1 + j)];
            }
        }
        let [rotation, position, rotation_position] = blocks;
        Some(Self {
            rotation,
            position,
            rotation_position,
            velocity: None,
        })
    }
}
