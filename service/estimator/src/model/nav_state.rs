//! The state of the "imperfect" InEKF: SE_2(3) x R^6, the pose with both IMU biases.
//!
//! A direct product: the biases add. Tangent order rotation, velocity, position, gyro bias,
//! accelerometer bias. With biases the dynamics are no longer group-affine; the left-invariant
//! transition keeps its state-independent block and gains the column `-B` (the bias is a
//! disturbance of the input): `F = [Ad_{U^-1} M, -B; 0, I]`.

use nalgebra::{SMatrix, SVector, Vector3};

use super::drift::{Drift, Unmoved};
use super::imu::{ImuNoise, ImuStep};
use super::inertial::InertialState;
use super::transition::Transition;
use crate::lie::{LieGroup, SE23, sek3};

/// Pose and biases.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::NavState;
/// use nalgebra::Vector3;
///
/// let state = NavState {
///     pose: SE23::identity(),
///     gyro_bias: Vector3::new(0.01, 0.0, 0.0),
///     accel_bias: Vector3::new(0.0, 0.0, 0.05),
/// };
/// // Rotation, velocity, position, gyro bias, accelerometer bias.
/// let xi = state.log();
/// assert_eq!((xi[9], xi[14]), (0.01, 0.05));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NavState {
    /// Attitude `r_wb`, velocity `v_w` and position `p_w`.
    pub pose: SE23,
    /// Gyroscope bias, rad/s, body frame.
    pub gyro_bias: Vector3<f64>,
    /// Accelerometer bias, m/s^2, body frame.
    pub accel_bias: Vector3<f64>,
}

type Vector15 = SVector<f64, 15>;
type Matrix15 = SMatrix<f64, 15, 15>;

/// `block` on the pose, identity on the biases.
fn with_identity_on_biases(block: &SMatrix<f64, 9, 9>) -> Matrix15 {
    let mut full = Matrix15::identity();
    full.fixed_view_mut::<9, 9>(0, 0).copy_from(block);
    full
}

#[inline]
fn pose_part(xi: &Vector15) -> SVector<f64, 9> {
    xi.fixed_rows::<9>(0).into_owned()
}

impl LieGroup<15> for NavState {
    const ROTATION_DIM: usize = 3;
    const VELOCITY_DIM: usize = 3;

    fn identity() -> Self {
        Self::from_parts(SE23::identity(), Vector3::zeros(), Vector3::zeros())
    }

    #[inline]
    fn exp(xi: &Vector15) -> Self {
        Self {
            pose: SE23::exp(&pose_part(xi)),
            gyro_bias: xi.fixed_rows::<3>(9).into_owned(),
            accel_bias: xi.fixed_rows::<3>(12).into_owned(),
        }
    }

    fn log(&self) -> Vector15 {
        let mut xi = Vector15::zeros();
        xi.fixed_rows_mut::<9>(0).copy_from(&self.pose.log());
        xi.fixed_rows_mut::<3>(9).copy_from(&self.gyro_bias);
        xi.fixed_rows_mut::<3>(12).copy_from(&self.accel_bias);
        xi
    }

    #[inline]
    fn compose(&self, other: &Self) -> Self {
        Self {
            pose: self.pose.compose(&other.pose),
            gyro_bias: self.gyro_bias + other.gyro_bias,
            accel_bias: self.accel_bias + other.accel_bias,
        }
    }

    fn inverse(&self) -> Self {
        Self {
            pose: self.pose.inverse(),
            gyro_bias: -self.gyro_bias,
            accel_bias: -self.accel_bias,
        }
    }

    fn adjoint(&self) -> Matrix15 {
        sek3::adjoint(
            &self.pose.rotation,
            &[self.pose.velocity, self.pose.position],
        )
    }

    fn ad(xi: &Vector15) -> Matrix15 {
        sek3::ad::<2, 15>(xi)
    }

    fn left_jacobian(xi: &Vector15) -> Matrix15 {
        sek3::left_jacobian::<2, 15>(xi)
    }

    fn left_jacobian_inverse(xi: &Vector15) -> Matrix15 {
        sek3::left_jacobian_inverse::<2, 15>(xi)
    }

    fn congruence(p: &mut Matrix15, a: &Matrix15) {
        sek3::congruence::<15, 9>(p, a);
    }

    #[inline]
    fn row_product<const M: usize>(
        h: &SMatrix<f64, M, 15>,
        a: &SMatrix<f64, 15, 15>,
    ) -> SMatrix<f64, M, 15> {
        sek3::row_product::<M, 15, 9>(h, a)
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.pose.is_finite()
            && self.gyro_bias.iter().all(|value| value.is_finite())
            && self.accel_bias.iter().all(|value| value.is_finite())
    }

    #[inline]
    fn normalized(&self) -> Self {
        Self {
            pose: self.pose.normalized(),
            ..*self
        }
    }
}

impl InertialState<15> for NavState {
    #[inline]
    fn pose(&self) -> &SE23 {
        &self.pose
    }

    #[inline]
    fn gyro_bias(&self) -> Vector3<f64> {
        self.gyro_bias
    }

    #[inline]
    fn accel_bias(&self) -> Vector3<f64> {
        self.accel_bias
    }

    #[inline]
    fn from_parts(pose: SE23, gyro_bias: Vector3<f64>, accel_bias: Vector3<f64>) -> Self {
        Self {
            pose,
            gyro_bias,
            accel_bias,
        }
    }

    #[inline(always)]
    fn carry(transition: &Transition, p: &mut Matrix15, noise: &ImuNoise) {
        transition.carry(p, noise);
    }

    const IS_GROUP_AFFINE: bool = false;

    type FreeMotion = Unmoved;

    #[inline]
    fn free_fall(_g_w: &Vector3<f64>, _dt_s: f64) -> Option<Drift<Self, Unmoved, 15>> {
        None
    }

    fn transition(&self, step: &ImuStep) -> (Self, Matrix15) {
        let (pose, pose_f) = self.pose.transition(step);
        let mut f = with_identity_on_biases(&pose_f);
        f.fixed_view_mut::<9, 6>(0, 9)
            .copy_from(&-step.input_jacobian);
        (Self { pose, ..*self }, f)
    }

    fn process_noise(step: &ImuStep, noise: &ImuNoise) -> Matrix15 {
        let mut q = Matrix15::zeros();
        q.fixed_view_mut::<9, 9>(0, 0)
            .copy_from(&step.noise_covariance(noise));
        for axis in 0..3 {
            q[(9 + axis, 9 + axis)] = noise.gyro_bias_psd * step.dt_s;
            q[(12 + axis, 12 + axis)] = noise.accel_bias_psd * step.dt_s;
        }
        q
    }
}
