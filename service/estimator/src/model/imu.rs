//! One IMU sample as a group-affine step on SE_2(3), with its noise.
//!
//! Body frame FLU, world frame ENU. The accelerometer measures specific force: at rest it reads
//! `-R^T g_w`, +9.81 on z. Tangent order rotation, velocity, position; left-invariant noise.
//!
//! With `phi = omega dt`, `zoh` (rates constant over the interval) is exact:
//! `U = (Exp(phi), Gamma_1(phi) a dt, Gamma_2(phi) a dt^2)`, `W = (I, g dt, g dt^2 / 2)`.
//! `euler` is the scheme printed in \[IS\] (17)-(18): `U = (Exp(phi), a dt, 0)`, `W = (I, g dt, 0)`,
//! which lacks `(R a + g) dt^2 / 2` in the position.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::group_affine::{FreeMotion, GroupAffineStep};
use super::increment::{ImuIncrement, moved};
use crate::lanes::Block;
use crate::lie::{LieGroup, SE23, SO3};

/// How an interval with constant rates becomes a step.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuStep};
/// use nalgebra::Vector3;
///
/// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(1.0, 0.0, 0.0) };
/// let moved = |scheme| ImuStep::new(&push, &Vector3::zeros(), 2.0, scheme).apply(&SE23::identity());
/// // The papers' scheme lacks a dt^2 / 2 in the position.
/// assert_eq!(moved(Discretisation::Euler).position.x, 0.0);
/// assert!((moved(Discretisation::ZeroOrderHold).position.x - 2.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discretisation {
    /// Exact for angular rate and specific force constant over the interval.
    ZeroOrderHold,
    /// The scheme of \[IS\] (17)-(18), kept to reproduce the paper.
    Euler,
}

/// Angular rate and specific force of the body over one interval.
///
/// ```
/// use inekf::model::ImuInput;
/// use nalgebra::Vector3;
///
/// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
/// assert_eq!(at_rest.midpoint(&at_rest), at_rest);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuInput {
    /// Angular rate in the body frame, rad/s.
    pub omega_b: Vector3<f64>,
    /// Specific force in the body frame, m/s^2.
    pub force_b: Vector3<f64>,
}

impl ImuInput {
    /// The mean of two inputs.
    ///
    /// ```
    /// use inekf::model::ImuInput;
    /// use nalgebra::Vector3;
    ///
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.8) };
    /// assert_eq!(push.midpoint(&at_rest).omega_b, 0.5 * push.omega_b);
    /// ```
    #[inline]
    pub fn midpoint(&self, other: &Self) -> Self {
        Self {
            omega_b: 0.5 * (self.omega_b + other.omega_b),
            force_b: 0.5 * (self.force_b + other.force_b),
        }
    }
}

/// Power spectral densities of the white noises that drive the error.
///
/// A discrete standard deviation `sigma` per sample of length `dt` is the density `sigma^2 dt`.
///
/// ```
/// use inekf::model::ImuNoise;
///
/// // A data sheet's 0.01 deg/s/sqrt(Hz) and 100 ug/sqrt(Hz): densities are squared.
/// let (gyro, accel) = (0.01_f64.to_radians(), 100e-6 * 9.80665);
/// let noise = ImuNoise {
///     gyro_psd: gyro * gyro,
///     accel_psd: accel * accel,
///     gyro_bias_psd: 0.0,
///     accel_bias_psd: 0.0,
/// };
/// // 0.1 deg/s in each sample at 100 Hz.
/// assert!(((noise.gyro_psd * 100.0).sqrt().to_degrees() - 0.1).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuNoise {
    /// Gyroscope, (rad/s)^2/Hz.
    pub gyro_psd: f64,
    /// Accelerometer, (m/s^2)^2/Hz.
    pub accel_psd: f64,
    /// Gyroscope bias random walk, (rad/s^2)^2/Hz.
    pub gyro_bias_psd: f64,
    /// Accelerometer bias random walk, (m/s^3)^2/Hz.
    pub accel_bias_psd: f64,
}

/// One interval: the group-affine step, and how a disturbance of the input enters it.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuStep};
/// use nalgebra::Vector3;
///
/// // Two seconds of 1 m/s^2 forward, from rest: 2 m/s and 2 m.
/// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(1.0, 0.0, 9.80665) };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// let step = ImuStep::new(&push, &g_w, 2.0, Discretisation::ZeroOrderHold);
/// let moved = step.apply(&SE23::identity());
/// assert!((moved.velocity - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-12);
/// assert!((moved.position - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ImuStep {
    /// `chi+ = W phi(chi) U`.
    pub step: GroupAffineStep<SE23, FreeMotion, 9>,
    /// B, 9 x 6, with `U(u + d) = U(u) exp(B d)` to first order, d = (rate, force).
    pub input_jacobian: SMatrix<f64, 9, 6>,
    /// Length of the interval, s.
    pub dt_s: f64,
}

impl ImuStep {
    /// The step over `dt_s` seconds with the bias-free `input` under gravity `g_w`, m/s^2.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuStep};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// // The accelerometer at rest shows what holds it up: nothing moves.
    /// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: -g_w };
    /// let step = ImuStep::new(&at_rest, &g_w, 10.0, Discretisation::ZeroOrderHold);
    /// assert!(step.apply(&SE23::identity()).log().norm() < 1e-12);
    /// ```
    pub fn new(
        input: &ImuInput,
        g_w: &Vector3<f64>,
        dt_s: f64,
        discretisation: Discretisation,
    ) -> Self {
        Self::from(&ImuIncrement::new(input, g_w, dt_s, discretisation))
    }

    /// `W phi(pose) U`, without the products by what is known to be neutral.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuStep};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let step = ImuStep::new(&push, &g_w, 0.1, Discretisation::ZeroOrderHold);
    /// // The same as the product of the three.
    /// assert!(step.apply(&pose).between(&step.step.apply(&pose)).log().norm() < 1e-12);
    /// ```
    pub fn apply(&self, pose: &SE23) -> SE23 {
        let GroupAffineStep { world, body, .. } = &self.step;
        moved(
            pose,
            self.dt_s,
            &body.rotation,
            &[body.velocity, body.position],
            &[world.velocity, world.position],
        )
    }

    /// Covariance, 9 x 9, that the white noise of the input adds to the left-invariant error:
    /// `B diag(psd) B^T / dt`, exactly symmetric; zero for an interval of no length.
    ///
    /// ```
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise, ImuStep};
    /// use nalgebra::Vector3;
    ///
    /// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// let noise = ImuNoise { gyro_psd: 0.0, accel_psd: 0.01, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let step = ImuStep::new(&at_rest, &Vector3::zeros(), 0.5, Discretisation::ZeroOrderHold);
    /// // Velocity is a random walk: the density by the time.
    /// let q = step.noise_covariance(&noise);
    /// assert!((q[(3, 3)] - 0.01 * 0.5).abs() < 1e-15 && q == q.transpose());
    /// ```
    pub fn noise_covariance(&self, noise: &ImuNoise) -> SMatrix<f64, 9, 9> {
        if self.dt_s <= 0.0 {
            return SMatrix::zeros();
        }
        let mut scaled = self.input_jacobian;
        for column in 0..6 {
            let psd = if column < 3 {
                noise.gyro_psd
            } else {
                noise.accel_psd
            };
            scaled.column_mut(column).scale_mut(psd / self.dt_s);
        }
        let mut covariance = scaled * self.input_jacobian.transpose();
        covariance.fill_lower_triangle_with_upper_triangle();
        covariance
    }
}

impl From<&ImuIncrement> for ImuStep {
    fn from(increment: &ImuIncrement) -> Self {
        let back = Matrix3::from(increment.turn_matrix).transpose();
        let mut input_jacobian = SMatrix::<f64, 9, 6>::zeros();
        let mut place = |row, column, block: &Block| {
            input_jacobian
                .fixed_view_mut::<3, 3>(row, column)
                .copy_from(&(back * Matrix3::from(*block)));
        };
        for (row, block) in (0..).step_by(3).zip(&increment.by_rate) {
            place(row, 0, block);
        }
        for (row, block) in (3..).step_by(3).zip(&increment.by_force) {
            place(row, 3, block);
        }
        let [velocity_w, position_w] = increment.world;
        let [velocity_b, position_b] = increment.body;
        Self {
            step: GroupAffineStep::new(
                SE23 {
                    rotation: SO3::identity(),
                    velocity: velocity_w,
                    position: position_w,
                },
                FreeMotion {
                    dt_s: increment.dt_s,
                },
                SE23 {
                    rotation: increment.turn,
                    velocity: velocity_b,
                    position: position_b,
                },
            ),
            input_jacobian,
            dt_s: increment.dt_s,
        }
    }
}
