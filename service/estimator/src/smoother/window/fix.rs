//! What a state of the window is seen by: one fix of position or velocity, in body axes.
//!
//! Turned into the body, `R^T (y - h(chi)) = H xi + R^T n`, a fix has a Jacobian that does not depend on the
//! estimate, lever arm or not: `H = [-hat(b), 0, I]` for a position at the point b of the body, `[0, I, 0]` for a
//! velocity. With equal noise on all axes its covariance does not either, and then the gains are constants.

use nalgebra::{ArrayStorage, Matrix3, SMatrix, SVector, Vector3};

use crate::columns::combined;
use crate::filter::Covariance;
use crate::lie::hat;
use crate::model::{InertialState, PositionObservation, VelocityObservation};

/// A fix of three dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fix {
    /// Of the position of a point of the body.
    Position(PositionObservation),
    /// Of the velocity.
    Velocity(VelocityObservation),
}

impl From<PositionObservation> for Fix {
    fn from(observation: PositionObservation) -> Self {
        Self::Position(observation)
    }
}

impl From<VelocityObservation> for Fix {
    fn from(observation: VelocityObservation) -> Self {
        Self::Velocity(observation)
    }
}

impl Fix {
    fn covariance_w(&self) -> &Matrix3<f64> {
        match self {
            Self::Position(fix) => &fix.covariance_w,
            Self::Velocity(fix) => &fix.covariance_w,
        }
    }

    /// Whether the noise is the same in all directions.
    pub(super) fn is_isotropic(&self) -> bool {
        let n = self.covariance_w();
        *n == Matrix3::from_diagonal_element(n[(0, 0)])
    }

    /// The residual, body axes.
    pub(super) fn residual_b<G: InertialState<D>, const D: usize>(&self, chi: &G) -> Vector3<f64> {
        let pose = chi.pose();
        match self {
            Self::Position(fix) => {
                pose.rotation
                    .inverse_rotate(&(fix.position_w - pose.position))
                    - fix.lever_arm_b
            }
            Self::Velocity(fix) => pose
                .rotation
                .inverse_rotate(&(fix.velocity_w - pose.velocity)),
        }
    }

    /// Covariance of the noise, body axes.
    pub(super) fn covariance_b<G: InertialState<D>, const D: usize>(
        &self,
        chi: &G,
    ) -> Matrix3<f64> {
        if self.is_isotropic() {
            return *self.covariance_w();
        }
        let r_wb = chi.pose().rotation.matrix();
        let mut turned = r_wb.transpose() * self.covariance_w() * r_wb;
        turned.fill_lower_triangle_with_upper_triangle();
        turned
    }

    /// H, 3 x D, of the left-invariant error.
    pub(super) fn jacobian<const D: usize>(&self) -> SMatrix<f64, 3, D> {
        let mut h = SMatrix::<f64, 3, D>::zeros();
        let (start, arm_b) = self.place();
        for axis in 0..3 {
            h[(axis, start + axis)] = 1.0;
        }
        if let Some(arm_b) = arm_b {
            h.fixed_view_mut::<3, 3>(0, 0).copy_from(&-hat(arm_b));
        }
        h
    }

    /// `P H^T`, D x 3.
    pub(super) fn covariance_with<const D: usize>(&self, p: &Covariance<D>) -> SMatrix<f64, D, 3> {
        let columns = &p.matrix().data.0;
        let (start, arm_b) = self.place();
        let b = arm_b.copied().unwrap_or_default();
        let product = [
            combined::<D, D, D, D, 2>(&columns[start], [b.z, -b.y], [&columns[1], &columns[2]]),
            combined::<D, D, D, D, 2>(&columns[start + 1], [b.x, -b.z], [&columns[2], &columns[0]]),
            combined::<D, D, D, D, 2>(&columns[start + 2], [b.y, -b.x], [&columns[0], &columns[1]]),
        ];
        SMatrix::from_array_storage(ArrayStorage(product))
    }

    /// `H xi`.
    pub(super) fn seen<const D: usize>(&self, xi: &SVector<f64, D>) -> Vector3<f64> {
        let (start, arm_b) = self.place();
        let part = Vector3::new(xi[start], xi[start + 1], xi[start + 2]);
        match arm_b {
            Some(arm_b) => part - arm_b.cross(&Vector3::new(xi[0], xi[1], xi[2])),
            None => part,
        }
    }

    /// `adjoint + H^T weight`.
    pub(super) fn add_transposed<const D: usize>(
        &self,
        mut adjoint: SVector<f64, D>,
        weight: &Vector3<f64>,
    ) -> SVector<f64, D> {
        let (start, arm_b) = self.place();
        let turned = arm_b.map_or(Vector3::zeros(), |arm_b| arm_b.cross(weight));
        for axis in 0..3 {
            adjoint[start + axis] += weight[axis];
            adjoint[axis] += turned[axis];
        }
        adjoint
    }

    /// Where in the tangent vector the seen part begins, and the lever arm that mixes the rotation in.
    fn place(&self) -> (usize, Option<&Vector3<f64>>) {
        match self {
            Self::Position(fix) => (6, Some(&fix.lever_arm_b)),
            Self::Velocity(_) => (3, None),
        }
    }
}
