//! What a state of the window is seen by: one fix of position, velocity or heading, in body axes.
//!
//! Turned into the body, `R^T (y - h(chi)) = H xi + R^T n`, a fix has a Jacobian that does not depend on the
//! estimate, lever arm or not: `H = [-hat(b), 0, I]` for a position at the point b of the body, `[0, I, 0]` for a
//! velocity. With equal noise on all axes its covariance does not either, and then the gains are constants.
//!
//! A heading is the first of three numbers, the others seeing nothing; its Jacobian, `[row, 0, 0]`, is that of the estimate.

use nalgebra::{ArrayStorage, Matrix3, SMatrix, SVector, Vector3};

use crate::columns::combined;
use crate::filter::Covariance;
use crate::lie::hat;
use crate::model::{
    HeadingObservation, InertialState, Observation, PositionObservation, VelocityObservation,
};

/// A fix.
///
/// ```
/// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
/// # use inekf::smoother::{Preintegration, WindowError};
/// # use nalgebra::{Matrix3, Vector3};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use inekf::smoother::{Fix, Window, WindowOptions};
/// use nalgebra::SVector;
///
/// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// # let second_of_rest = {
/// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
/// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
/// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// #     let mut motion = Preintegration::new(&SE23::identity());
/// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
/// #     motion
/// # };
/// # let seen_at = |x_m: f64| PositionObservation {
/// #     position_w: Vector3::new(x_m, 0.0, 0.0),
/// #     covariance_w: Matrix3::identity() * 0.01,
/// #     lever_arm_b: Vector3::zeros(),
/// # };
/// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
/// // Whatever the sensor, one fix of a state.
/// let fixes: [Fix; 2] = [seen_at(0.3).into(), HeadingObservation { heading: 0.1, sigma: 0.1 }.into()];
/// for fix in fixes {
///     window.push(&second_of_rest);
///     window.update(fix)?;
/// }
/// assert!(window.newest().mean.rotation.heading_rad() > 0.05);
/// # Ok::<(), WindowError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fix {
    /// Of the position of a point of the body.
    Position(PositionObservation),
    /// Of the velocity.
    Velocity(VelocityObservation),
    /// Of the heading.
    Heading(HeadingObservation),
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

impl From<HeadingObservation> for Fix {
    fn from(observation: HeadingObservation) -> Self {
        Self::Heading(observation)
    }
}

/// The part of H that depends on the estimate: the derivative of a heading by the rotation; zero for other fixes.
pub(super) type HeadingRow = Vector3<f64>;

/// What a part of the tangent vector is seen through.
enum Place<'a> {
    /// Seen from there on, the rotation through a lever arm if there is one.
    Part(usize, Option<&'a Vector3<f64>>),
    /// The rotation, through a row of its own.
    Heading,
}

impl Fix {
    /// The covariance of the noise, world axes; for a heading that of three numbers.
    fn covariance_w(&self) -> Matrix3<f64> {
        match self {
            Self::Position(fix) => fix.covariance_w,
            Self::Velocity(fix) => fix.covariance_w,
            Self::Heading(fix) => {
                Matrix3::from_diagonal(&Vector3::new(fix.sigma * fix.sigma, 1.0, 1.0))
            }
        }
    }

    /// Whether nothing but the residual depends on the estimate: with noise that is the same in all directions.
    pub(super) fn is_isotropic(&self) -> bool {
        let n = match self {
            Self::Position(fix) => &fix.covariance_w,
            Self::Velocity(fix) => &fix.covariance_w,
            Self::Heading(_) => return false,
        };
        *n == Matrix3::from_diagonal_element(n[(0, 0)])
    }

    /// What depends on the estimate in H.
    pub(super) fn heading_row<G: InertialState<D>, const D: usize>(&self, chi: &G) -> HeadingRow {
        match self {
            Self::Heading(fix) => {
                let h: SMatrix<f64, 1, D> = fix.left_jacobian(chi);
                Vector3::new(h[0], h[1], h[2])
            }
            Self::Position(_) | Self::Velocity(_) => Vector3::zeros(),
        }
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
            Self::Heading(fix) => Vector3::new(fix.residual(chi).x, 0.0, 0.0),
        }
    }

    /// Covariance of the noise, body axes.
    pub(super) fn covariance_b<G: InertialState<D>, const D: usize>(
        &self,
        chi: &G,
    ) -> Matrix3<f64> {
        if self.is_isotropic() || matches!(self, Self::Heading(_)) {
            return self.covariance_w();
        }
        let r_wb = chi.pose().rotation.matrix();
        let mut turned = r_wb.transpose() * self.covariance_w() * r_wb;
        turned.fill_lower_triangle_with_upper_triangle();
        turned
    }

    /// H, 3 x D, of the left-invariant error.
    pub(super) fn jacobian<const D: usize>(&self, row: &HeadingRow) -> SMatrix<f64, 3, D> {
        let mut h = SMatrix::<f64, 3, D>::zeros();
        match self.place() {
            Place::Part(start, arm_b) => {
                for axis in 0..3 {
                    h[(axis, start + axis)] = 1.0;
                }
                if let Some(arm_b) = arm_b {
                    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&-hat(arm_b));
                }
            }
            Place::Heading => h.fixed_view_mut::<1, 3>(0, 0).copy_from(&row.transpose()),
        }
        h
    }

    /// `P H^T`, D x 3.
    pub(super) fn covariance_with<const D: usize>(
        &self,
        p: &Covariance<D>,
        row: &HeadingRow,
    ) -> SMatrix<f64, D, 3> {
        let columns = &p.matrix().data.0;
        let (c0, c1, c2) = (&columns[0], &columns[1], &columns[2]);
        let product = match self.place() {
            Place::Part(start, arm_b) => {
                let b = arm_b.copied().unwrap_or_default();
                let moved = |axis: usize, factors, turned| {
                    combined::<D, D, D, D, 2>(&columns[start + axis], factors, turned)
                };
                [
                    moved(0, [b.z, -b.y], [c1, c2]),
                    moved(1, [b.x, -b.z], [c2, c0]),
                    moved(2, [b.y, -b.x], [c0, c1]),
                ]
            }
            Place::Heading => {
                let turned = [row.x, row.y, row.z];
                let seen = combined::<D, D, D, D, 3>(&[0.0; D], turned, [c0, c1, c2]);
                [seen, [0.0; D], [0.0; D]]
            }
        };
        SMatrix::from_array_storage(ArrayStorage(product))
    }

    /// `H xi`.
    pub(super) fn seen<const D: usize>(
        &self,
        xi: &SVector<f64, D>,
        row: &HeadingRow,
    ) -> Vector3<f64> {
        let turn = Vector3::new(xi[0], xi[1], xi[2]);
        match self.place() {
            Place::Part(start, arm_b) => {
                let part = Vector3::new(xi[start], xi[start + 1], xi[start + 2]);
                arm_b.map_or(part, |arm_b| part - arm_b.cross(&turn))
            }
            Place::Heading => Vector3::new(row.dot(&turn), 0.0, 0.0),
        }
    }

    /// `adjoint + H^T weight`.
    pub(super) fn add_transposed<const D: usize>(
        &self,
        mut adjoint: SVector<f64, D>,
        weight: &Vector3<f64>,
        row: &HeadingRow,
    ) -> SVector<f64, D> {
        let turned = match self.place() {
            Place::Part(start, arm_b) => {
                for axis in 0..3 {
                    adjoint[start + axis] += weight[axis];
                }
                arm_b.map_or(Vector3::zeros(), |arm_b| arm_b.cross(weight))
            }
            Place::Heading => row * weight.x,
        };
        for axis in 0..3 {
            adjoint[axis] += turned[axis];
        }
        adjoint
    }

    fn place(&self) -> Place<'_> {
        match self {
            Self::Position(fix) => Place::Part(6, Some(&fix.lever_arm_b)),
            Self::Velocity(_) => Place::Part(3, None),
            Self::Heading(_) => Place::Heading,
        }
    }
}
