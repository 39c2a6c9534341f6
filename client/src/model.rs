//! The daemon's models as a client sees them: what each is fed, and what its estimates hold.
//!
//! | model | driven by | estimate | tangent order of its covariance |
//! |---|---|---|---|
//! | [`Model::Imu`] | IMU samples | SE_2(3) with biases | rotation, velocity, position, gyro bias, accelerometer bias |
//! | [`Model::Odometry3d`] | spatial odometry | SE(3) | rotation, position |
//! | [`Model::Odometry2d`] | planar odometry | SE(2) | theta, x, y |
//!
//! World ENU, body FLU, SI units, radians; covariances of the left-invariant error in body coordinates.

use std::fmt;

use inekf_shared::message::{
    EstimateMessage, EstimateSe2, EstimateSe3, EstimateSe23, MODEL_IMU, MODEL_ODOMETRY_2D,
    MODEL_ODOMETRY_3D, model_name,
};

use crate::table::{EstimateState, Layout};

/// What a daemon estimates.
///
/// ```
/// use inekf_client::model::Model;
///
/// for model in Model::ALL {
///     assert_eq!(Model::from_code(model.code()), Some(model));
/// }
/// assert_eq!(Model::Odometry2d.to_string(), "odometry2d");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// An IMU drives SE_2(3) with biases.
    Imu,
    /// Spatial odometry drives SE(3).
    Odometry3d,
    /// Planar odometry drives SE(2).
    Odometry2d,
}

impl Model {
    /// Every model.
    pub const ALL: [Self; 3] = [Self::Imu, Self::Odometry3d, Self::Odometry2d];

    /// The model of a `MODEL_*` code; `None` for a code that is not defined.
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_shared::message::MODEL_IMU;
    ///
    /// assert_eq!(Model::from_code(MODEL_IMU), Some(Model::Imu));
    /// assert_eq!(Model::from_code(99), None);
    /// ```
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.code() == code)
    }

    /// The `MODEL_*` code.
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_shared::message::MODEL_ODOMETRY_2D;
    ///
    /// assert_eq!(Model::Odometry2d.code(), MODEL_ODOMETRY_2D);
    /// ```
    pub fn code(self) -> u32 {
        match self {
            Self::Imu => MODEL_IMU,
            Self::Odometry3d => MODEL_ODOMETRY_3D,
            Self::Odometry2d => MODEL_ODOMETRY_2D,
        }
    }

    /// The name in a configuration file.
    ///
    /// ```
    /// use inekf_client::model::Model;
    ///
    /// // As in `model = "odometry3d"`.
    /// assert_eq!(Model::Odometry3d.name(), "odometry3d");
    /// ```
    pub fn name(self) -> &'static str {
        model_name(self.code())
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An estimate of one model, as the estimate CSV shows it.
///
/// ```
/// use inekf_client::model::Estimate;
/// use inekf_client::table::EstimateState;
/// use inekf_shared::message::{EstimateMessage, EstimateSe2, Zero};
///
/// /// Whatever the model.
/// fn first_variance<E: Estimate>(estimate: &E) -> f64 {
///     estimate.covariance()[0]
/// }
///
/// let mut plane = EstimateSe2::ZERO;
/// plane.theta_rad = 0.5;
/// plane.covariance[0] = 0.04; // of theta, rad^2
/// assert_eq!(first_variance(&plane), 0.04);
/// assert_eq!(plane.mean(), EstimateState::Plane { theta_rad: 0.5, p_w_m: [0.0; 2] });
/// assert_eq!(EstimateSe2::KIND.code(), EstimateSe2::MODEL);
/// ```
pub trait Estimate: EstimateMessage {
    /// The model it is of.
    const KIND: Model;
    /// The columns of its mean.
    const LAYOUT: Layout;

    /// The mean.
    ///
    /// ```
    /// use inekf_client::model::Estimate;
    /// use inekf_client::table::EstimateState;
    /// use inekf_shared::message::{EstimateSe2, Zero};
    ///
    /// let mut estimate = EstimateSe2::ZERO;
    /// estimate.theta_rad = 0.5;
    /// assert_eq!(estimate.mean(), EstimateState::Plane { theta_rad: 0.5, p_w_m: [0.0; 2] });
    /// ```
    fn mean(&self) -> EstimateState;

    /// The whole array of the covariance: the upper triangle, row by row, then zeros if the dimension is smaller.
    ///
    /// ```
    /// use inekf_client::model::Estimate;
    /// use inekf_shared::message::{EstimateSe2, Zero};
    ///
    /// // The upper triangle of 3 x 3.
    /// assert_eq!(EstimateSe2::ZERO.covariance().len(), 6);
    /// ```
    fn covariance(&self) -> &[f64];
}

impl Estimate for EstimateSe23 {
    const KIND: Model = Model::Imu;
    const LAYOUT: Layout = Layout::Navigation;

    fn mean(&self) -> EstimateState {
        EstimateState::Navigation {
            q_wb: self.q_wb,
            v_w_mps: self.v_w_mps,
            p_w_m: self.p_w_m,
            gyro_bias_rps: self.gyro_bias_rps,
            accel_bias_mps2: self.accel_bias_mps2,
        }
    }

    fn covariance(&self) -> &[f64] {
        &self.covariance
    }
}

impl Estimate for EstimateSe3 {
    const KIND: Model = Model::Odometry3d;
    const LAYOUT: Layout = Layout::Pose;

    fn mean(&self) -> EstimateState {
        EstimateState::Pose {
            q_wb: self.q_wb,
            p_w_m: self.p_w_m,
        }
    }

    fn covariance(&self) -> &[f64] {
        &self.covariance
    }
}

impl Estimate for EstimateSe2 {
    const KIND: Model = Model::Odometry2d;
    const LAYOUT: Layout = Layout::Plane;

    fn mean(&self) -> EstimateState {
        EstimateState::Plane {
            theta_rad: self.theta_rad,
            p_w_m: self.p_w_m,
        }
    }

    fn covariance(&self) -> &[f64] {
        &self.covariance
    }
}
