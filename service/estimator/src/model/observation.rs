//! What the aiding sensors observe of an inertial state.
//!
//! Every observation gives its residual `z = y - h(chi)` and `H` with
//! `h(chi exp(xi)) = h(chi) + H xi` to first order: H belongs to the left-invariant error. The
//! residual stays in the sensor's own axes, so the noise covariance needs no rotation; the gain is
//! the same as with the body-frame innovation `R^T (y - h)` of the papers.

use core::f64::consts::{PI, TAU};

use nalgebra::{Matrix1, Matrix3, SMatrix, SVector, Vector1, Vector3};

use super::inertial::InertialState;
use crate::lie::{LieGroup, hat};

pub mod points;

/// A measurement of dimension M with additive noise.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{HeadingObservation, Observation};
/// use nalgebra::SVector;
///
/// // H belongs to the left-invariant error: h(chi exp(xi)) = h(chi) + H xi, and z = y - h.
/// let fix = HeadingObservation { heading: 0.2, sigma: 0.1 };
/// let chi = SE23::exp(&SVector::repeat(0.2));
/// let xi = SVector::<f64, 9>::from_fn(|i, _| 1e-6 * (i as f64 - 4.0));
/// let change = fix.residual(&chi) - fix.residual(&chi.compose(&SE23::exp(&xi)));
/// assert!((change - fix.left_jacobian(&chi) * xi).norm() < 1e-10);
/// ```
pub trait Observation<G: LieGroup<D>, const D: usize, const M: usize> {
    /// `y - h(chi)`, M.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{HeadingObservation, Observation};
    ///
    /// // The short way round: from -3.1 to 3.1 rad it is a little to the right.
    /// let chi = SE23 { rotation: inekf::lie::SO3::exp(&nalgebra::Vector3::new(0.0, 0.0, -3.1)), ..SE23::identity() };
    /// let residual = HeadingObservation { heading: 3.1, sigma: 0.1 }.residual(&chi);
    /// assert!((residual.x - (6.2 - core::f64::consts::TAU)).abs() < 1e-12);
    /// ```
    fn residual(&self, chi: &G) -> SVector<f64, M>;
    /// H, M x D, of the left-invariant error at `chi`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23, SO3};
    /// use inekf::model::{Observation, VelocityObservation};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// // The error is in body axes and the residual in those of the world: R, in the place of the velocity.
    /// let chi = SE23 { rotation: SO3::exp(&Vector3::new(0.3, -0.5, 0.8)), ..SE23::identity() };
    /// let fix = VelocityObservation { velocity_w: Vector3::zeros(), covariance_w: Matrix3::identity() };
    /// let h = fix.left_jacobian(&chi);
    /// assert_eq!(h.fixed_view::<3, 3>(0, 3), chi.rotation.matrix());
    /// assert_eq!(h.fixed_view::<3, 3>(0, 6).norm(), 0.0);
    /// ```
    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, M, D>;
    /// Covariance of the noise, M x M, symmetric positive definite.
    ///
    /// ```
    /// use inekf::lie::SE23;
    /// use inekf::model::{HeadingObservation, Observation};
    ///
    /// // A variance, where the sensor is described by its standard deviation.
    /// let noise = Observation::<SE23, 9, 1>::noise(&HeadingObservation { heading: 0.2, sigma: 0.1 });
    /// assert!((noise.x - 0.01).abs() < 1e-15);
    /// ```
    fn noise(&self) -> SMatrix<f64, M, M>;
}

/// Position of an antenna, world frame: `y = p_w + r_wb * lever_arm_b + n`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Observation, PositionObservation};
/// use nalgebra::{Matrix3, Vector3};
///
/// // An antenna a metre above the IMU.
/// let fix = PositionObservation {
///     position_w: Vector3::new(0.0, 0.0, 1.2),
///     covariance_w: Matrix3::identity(),
///     lever_arm_b: Vector3::new(0.0, 0.0, 1.0),
/// };
/// let residual = fix.residual(&SE23::identity());
/// assert!((residual.norm() - 0.2).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionObservation {
    /// Measured position, m, world frame.
    pub position_w: Vector3<f64>,
    /// Covariance, m^2, world axes.
    pub covariance_w: Matrix3<f64>,
    /// From the IMU to the antenna, m, body frame.
    pub lever_arm_b: Vector3<f64>,
}

impl<G: InertialState<D>, const D: usize> Observation<G, D, 3> for PositionObservation {
    fn residual(&self, chi: &G) -> Vector3<f64> {
        let pose = chi.pose();
        self.position_w - pose.position - pose.rotation.rotate(&self.lever_arm_b)
    }

    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, 3, D> {
        let r_wb = chi.pose().rotation.matrix();
        let mut h = SMatrix::<f64, 3, D>::zeros();
        h.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(-r_wb * hat(&self.lever_arm_b)));
        h.fixed_view_mut::<3, 3>(0, 6).copy_from(&r_wb);
        h
    }

    fn noise(&self) -> Matrix3<f64> {
        self.covariance_w
    }
}

/// Velocity of the IMU over ground, world frame: `y = v_w + n`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Observation, VelocityObservation};
/// use nalgebra::{Matrix3, Vector3};
///
/// // In world axes: what a receiver's Doppler says, not what wheels say.
/// let fix = VelocityObservation { velocity_w: Vector3::new(3.0, 0.0, 0.0), covariance_w: Matrix3::identity() };
/// assert_eq!(fix.residual(&SE23::identity()), Vector3::new(3.0, 0.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityObservation {
    /// Measured velocity, m/s, world frame.
    pub velocity_w: Vector3<f64>,
    /// Covariance, (m/s)^2, world axes.
    pub covariance_w: Matrix3<f64>,
}

impl<G: InertialState<D>, const D: usize> Observation<G, D, 3> for VelocityObservation {
    fn residual(&self, chi: &G) -> Vector3<f64> {
        self.velocity_w - chi.pose().velocity
    }

    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, 3, D> {
        let mut h = SMatrix::<f64, 3, D>::zeros();
        h.fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&chi.pose().rotation.matrix());
        h
    }

    fn noise(&self) -> Matrix3<f64> {
        self.covariance_w
    }
}

/// Heading of the body's x axis, counter-clockwise from east: `y = atan2(R10, R00) + n`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23, SO3};
/// use inekf::model::{HeadingObservation, Observation};
///
/// // 179 degrees against -179: two degrees apart, not 358.
/// let rotation = SO3::from_roll_pitch_heading(0.0, 0.0, -179_f64.to_radians());
/// let fix = HeadingObservation { heading: 179_f64.to_radians(), sigma: 0.1 };
/// let residual = fix.residual(&SE23 { rotation, ..SE23::identity() });
/// assert!((residual.x.to_degrees() + 2.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingObservation {
    /// Measured heading, rad.
    pub heading: f64,
    /// Standard deviation, rad.
    pub sigma: f64,
}

impl<G: InertialState<D>, const D: usize> Observation<G, D, 1> for HeadingObservation {
    fn residual(&self, chi: &G) -> Vector1<f64> {
        let difference = self.heading - chi.pose().rotation.heading_rad();
        Vector1::new((difference + PI).rem_euclid(TAU) - PI)
    }

    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, 1, D> {
        let r_wb = chi.pose().rotation.matrix();
        let forward_w = r_wb.column(0);
        let horizontal = forward_w.x * forward_w.x + forward_w.y * forward_w.y;
        let mut h = SMatrix::<f64, 1, D>::zeros();
        // Pointing straight up or down there is no heading, and nothing to learn from one.
        if horizontal > 1e-12 {
            let across_w = Vector3::new(-forward_w.y, forward_w.x, 0.0) / horizontal;
            let row = -across_w.transpose() * r_wb * hat(&Vector3::x());
            h.fixed_view_mut::<1, 3>(0, 0).copy_from(&row);
        }
        h
    }

    fn noise(&self) -> Matrix1<f64> {
        Matrix1::new(self.sigma * self.sigma)
    }
}
