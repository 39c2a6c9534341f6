//! Odometry as a group-affine step, in the plane and in space: `chi+ = chi kappa exp(w)`, \[LC\] (23).
//!
//! `kappa = (Omega, u)`: the rotation and the translation (m) of the body over the step, in its own frame at
//! the start of the step. The automorphism is the identity, so that `F = Ad_{kappa^-1}` in the left-invariant
//! error, whatever the state. w is white, with covariance Q in the tangent of the group.

use nalgebra::{SMatrix, SVector};

use super::pose::RigidPose;
use crate::lie::LieGroup;

/// One step of odometry on the group G.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use nalgebra::Vector3;
///
/// // Two rows of a quarter turn to the left after a metre forward.
/// let row = OdometryStep::<SE2>::new(&Vector3::new(90_f64.to_radians(), 1.0, 0.0), 0.1);
/// let moved = row.apply(&row.apply(&SE2::identity()));
/// assert!((moved.position - nalgebra::Vector2::new(1.0, 1.0)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryStep<G> {
    /// `kappa = (Omega, u)`.
    pub kappa: G,
    /// Length of the step, s.
    pub dt_s: f64,
}

impl<G> OdometryStep<G> {
    /// The step over `dt_s` seconds with the increment `(rotation vector, translation)`, rad and m, in the
    /// body frame at its start: `(theta, x, y)` in the plane.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// // The translation is in the frame of the start: the turn does not bend it.
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(1.0, 2.0, 0.0), 0.1);
    /// assert_eq!(step.apply(&SE2::identity()).position, Vector2::new(2.0, 0.0));
    /// ```
    pub fn new<const D: usize, const N: usize>(increment: &SVector<f64, D>, dt_s: f64) -> Self
    where
        G: RigidPose<D, N>,
    {
        Self {
            kappa: G::from_increment(increment),
            dt_s,
        }
    }

    /// `chi kappa`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// // In the body's frame: facing north, forwards is north.
    /// let north = SE2::exp(&Vector3::new(90_f64.to_radians(), 0.0, 0.0));
    /// let ahead = OdometryStep::new(&Vector3::new(0.0, 2.0, 0.0), 0.1);
    /// assert!((ahead.apply(&north).position - Vector2::new(0.0, 2.0)).norm() < 1e-12);
    /// ```
    pub fn apply<const D: usize>(&self, chi: &G) -> G
    where
        G: LieGroup<D>,
    {
        chi.compose(&self.kappa)
    }

    /// F, D x D, of the left-invariant error: `Ad_{kappa^-1}`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use nalgebra::Vector3;
    ///
    /// // Ten metres ahead a heading that is off by 0.01 rad is 0.1 m to the side.
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
    /// let error = ahead.left_jacobian() * Vector3::new(0.01, 0.0, 0.0);
    /// assert!((error - Vector3::new(0.01, 0.0, 0.1)).norm() < 1e-12);
    /// ```
    pub fn left_jacobian<const D: usize>(&self) -> SMatrix<f64, D, D>
    where
        G: LieGroup<D>,
    {
        self.kappa.inverse().adjoint()
    }

    /// `(0, Omega^T u)`, D: how the left-invariant error grows with a relative error of the translation, m
    /// (\[LC\] (29)).
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::OdometryStep;
    /// use nalgebra::Vector3;
    ///
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
    /// assert_eq!(ahead.scale_direction(), Vector3::new(0.0, 10.0, 0.0));
    /// ```
    pub fn scale_direction<const D: usize, const N: usize>(&self) -> SVector<f64, D>
    where
        G: RigidPose<D, N>,
    {
        let turned = self.kappa.rotation_matrix().transpose() * self.kappa.position_w();
        let mut direction = SVector::<f64, D>::zeros();
        for axis in 0..N {
            direction[G::POSITION + axis] = turned[axis];
        }
        direction
    }

    /// `(log Omega, 0)`, D: how the left-invariant error grows with a relative error of the rotation, rad.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::OdometryStep;
    /// use nalgebra::Vector3;
    ///
    /// let turn = OdometryStep::<SE2>::new(&Vector3::new(0.3, 10.0, 0.0), 1.0);
    /// assert!((turn.turn_direction() - Vector3::new(0.3, 0.0, 0.0)).norm() < 1e-15);
    /// ```
    pub fn turn_direction<const D: usize, const N: usize>(&self) -> SVector<f64, D>
    where
        G: RigidPose<D, N>,
    {
        let kappa = self.kappa.log();
        SVector::from_fn(|row, _| {
            if row < G::ROTATION_DIM {
                kappa[row]
            } else {
                0.0
            }
        })
    }
}
