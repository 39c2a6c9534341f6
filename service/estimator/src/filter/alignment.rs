//! The first belief: level from the accelerometer, heading and the rest from what is known.
//!
//! At rest the specific force is `-R^T g_w`, which gives roll and pitch; heading stays a prior,
//! as wide as it must be. Uncertainties are stated about world axes (tilt about x and y, heading
//! about z) and carried to the body axes of the left-invariant error.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::belief::Belief;
use super::covariance::Covariance;
use super::side::Side;
use crate::lie::{LieGroup, SE23, SO3, hat};
use crate::model::InertialState;

/// An attitude found by levelling.
///
/// ```
/// use inekf::filter::Levelled;
/// use nalgebra::Vector3;
///
/// // At rest, rolled: what is felt is up, wherever that is in the body.
/// let up_b = Vector3::new(0.0, 3.0, 9.3);
/// let level = Levelled::from_force(&up_b, 0.5).expect("enough force");
/// assert!((level.r_wb.rotate(&up_b).normalize() - Vector3::z()).norm() < 1e-12);
/// assert!((level.r_wb.heading_rad() - 0.5).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levelled {
    /// Body to world.
    pub r_wb: SO3,
}

impl Levelled {
    /// Roll and pitch from the mean specific force `force_b` (m/s^2, body frame), heading as given
    /// (rad, counter-clockwise from east). `None` if the force is too small to show where up is.
    ///
    /// ```
    /// use inekf::filter::Levelled;
    /// use nalgebra::Vector3;
    ///
    /// // In free fall nothing says where up is.
    /// assert!(Levelled::from_force(&Vector3::zeros(), 0.0).is_none());
    /// ```
    pub fn from_force(force_b: &Vector3<f64>, heading: f64) -> Option<Self> {
        let norm = force_b.norm();
        if !(norm.is_finite() && norm > 1.0) {
            return None;
        }
        let up_b = force_b / norm;
        let roll = up_b.y.atan2(up_b.z);
        let pitch = (-up_b.x).atan2((up_b.y * up_b.y + up_b.z * up_b.z).sqrt());
        Some(Self {
            r_wb: SO3::from_roll_pitch_heading(roll, pitch, heading),
        })
    }
}

/// Means and standard deviations of the biases.
///
/// ```
/// use inekf::filter::BiasPrior;
/// use nalgebra::Vector3;
///
/// // A MEMS sensor out of the box: 0.1 deg/s and 50 mg, on each axis.
/// let prior = BiasPrior {
///     gyro_bias: Vector3::zeros(),
///     gyro_sigma: 0.1_f64.to_radians(),
///     accel_bias: Vector3::zeros(),
///     accel_sigma: 0.05 * 9.80665,
/// };
/// assert!((prior.accel_sigma - 0.49).abs() < 1e-3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasPrior {
    /// Gyroscope bias, rad/s, body frame.
    pub gyro_bias: Vector3<f64>,
    /// Its standard deviation per axis, rad/s.
    pub gyro_sigma: f64,
    /// Accelerometer bias, m/s^2, body frame.
    pub accel_bias: Vector3<f64>,
    /// Its standard deviation per axis, m/s^2.
    pub accel_sigma: f64,
}

/// Everything the first belief is made of.
///
/// ```
/// use inekf::filter::{Alignment, Belief, BiasPrior, Left};
/// use inekf::lie::{LieGroup, SE23, SO3};
/// use nalgebra::{Matrix3, Vector3};
///
/// let alignment = Alignment {
///     r_wb: SO3::identity(),
///     tilt_sigma: 0.01,
///     heading_sigma: 1.0,
///     velocity_w: Vector3::zeros(),
///     velocity_sigma: 0.1,
///     position_w: Vector3::new(0.0, 0.0, 2.0),
///     position_covariance_w: Matrix3::identity(),
///     lever_arm_b: Vector3::new(0.0, 0.0, 2.0), // to an antenna 2 m above the IMU
///     biases: BiasPrior {
///         gyro_bias: Vector3::zeros(),
///         gyro_sigma: 0.0,
///         accel_bias: Vector3::zeros(),
///         accel_sigma: 0.0,
///     },
/// };
/// let belief: Belief<SE23, Left, 9> = alignment.belief();
/// // The antenna is where it was seen, so the IMU is below it, and leans with what is not known of the tilt.
/// assert!(belief.mean.position.norm() < 1e-12);
/// assert!(belief.covariance.matrix()[(6, 1)].abs() > 1e-5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Attitude, body to world.
    pub r_wb: SO3,
    /// Standard deviation of the tilt about each horizontal world axis, rad.
    pub tilt_sigma: f64,
    /// Standard deviation of the heading about the vertical, rad.
    pub heading_sigma: f64,
    /// Velocity, m/s, world frame.
    pub velocity_w: Vector3<f64>,
    /// Standard deviation of the velocity per axis, m/s.
    pub velocity_sigma: f64,
    /// Position of the point `lever_arm_b` away from the IMU, m, world frame.
    pub position_w: Vector3<f64>,
    /// Covariance of that position, m^2, world axes.
    pub position_covariance_w: Matrix3<f64>,
    /// From the IMU to the point whose position is known (an antenna), m, body frame.
    pub lever_arm_b: Vector3<f64>,
    /// The biases; ignored by states without them.
    pub biases: BiasPrior,
}

impl Alignment {
    /// The belief. Where the antenna is known rather than the IMU, position and attitude errors
    /// are correlated through the lever arm: `xi_p = -R^T n + [l]x xi_R`.
    ///
    /// ```
    /// # use inekf::filter::{Alignment, BiasPrior};
    /// # use inekf::lie::{LieGroup, SO3};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Left};
    /// use inekf::model::NavState;
    ///
    /// # let alignment = Alignment {
    /// #     r_wb: SO3::identity(),
    /// #     tilt_sigma: 0.01,
    /// #     heading_sigma: 0.5,
    /// #     velocity_w: Vector3::zeros(),
    /// #     velocity_sigma: 0.1,
    /// #     position_w: Vector3::zeros(),
    /// #     position_covariance_w: Matrix3::identity(),
    /// #     lever_arm_b: Vector3::zeros(),
    /// #     biases: BiasPrior {
    /// #         gyro_bias: Vector3::zeros(),
    /// #         gyro_sigma: 0.001,
    /// #         accel_bias: Vector3::zeros(),
    /// #         accel_sigma: 0.05,
    /// #     },
    /// # };
    /// // Level, the heading by 0.5 rad, the gyroscope's bias by 0.001 rad/s.
    /// let belief: Belief<NavState, Left, 15> = alignment.belief();
    /// let p = belief.covariance.matrix();
    /// assert!((p[(2, 2)].sqrt() - 0.5).abs() < 1e-12 && (p[(9, 9)].sqrt() - 0.001).abs() < 1e-12);
    /// ```
    pub fn belief<G: InertialState<D>, S: Side, const D: usize>(&self) -> Belief<G, S, D> {
        let r_wb = self.r_wb.matrix();
        let to_body = r_wb.transpose();
        let tilt = self.tilt_sigma * self.tilt_sigma;
        let attitude_w = Matrix3::from_diagonal(&Vector3::new(
            tilt,
            tilt,
            self.heading_sigma * self.heading_sigma,
        ));
        let attitude_b = to_body * attitude_w * r_wb;
        let lever = hat(&self.lever_arm_b);

        let mut variances = SVector::<f64, D>::zeros();
        variances
            .fixed_rows_mut::<3>(3)
            .fill(self.velocity_sigma * self.velocity_sigma);
        if D >= 15 {
            for axis in 0..3 {
                variances[9 + axis] = self.biases.gyro_sigma * self.biases.gyro_sigma;
                variances[12 + axis] = self.biases.accel_sigma * self.biases.accel_sigma;
            }
        }
        let mut p = SMatrix::<f64, D, D>::from_diagonal(&variances);
        p.fixed_view_mut::<3, 3>(0, 0).copy_from(&attitude_b);
        p.fixed_view_mut::<3, 3>(0, 6)
            .copy_from(&(attitude_b * lever.transpose()));
        p.fixed_view_mut::<3, 3>(6, 6).copy_from(
            &(to_body * self.position_covariance_w * r_wb + lever * attitude_b * lever.transpose()),
        );

        let pose = SE23 {
            rotation: self.r_wb.normalized(),
            velocity: self.velocity_w,
            position: self.position_w - self.r_wb.rotate(&self.lever_arm_b),
        };
        Belief::from_left_covariance(
            G::from_parts(pose, self.biases.gyro_bias, self.biases.accel_bias),
            Covariance::from_upper(p),
        )
    }
}
