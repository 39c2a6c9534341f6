//! The error of the ordinary extended Kalman filter: positions add, whatever the rotation.
//!
//! `chi = (Exp(phi) R_hat, x_hat + rho)`: every coordinate in world axes, rotation and vectors uncoupled; in
//! the plane `(theta_hat + phi, x_hat + rho)`. With it the one update core is the EKF, the baseline of \[LC\].
//! To first order `xi_additive = A xi_left`, A the adjoint without what couples the rotation to the vectors:
//! `diag(1, R)` in the plane and `diag(R, R)` in space.
//!
//! In body coordinates it is [`Gtsam`]'s parametrisation, which does the work.

use nalgebra::{SMatrix, SVector};

use super::componentwise::{Gtsam, uncoupled, with_rotation_of};
use super::side::{InertialSide, Side};
use crate::lie::{LieGroup, SE23};
use crate::model::{ImuIncrement, Transition};

/// `chi = (Exp(phi) R_hat, x_hat + rho)`.
///
/// ```
/// use inekf::filter::{Additive, Side};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// // Components are subtracted: 0.1 rad, and the position in world axes.
/// let hat = SE2::identity();
/// let chi = Additive::retract(&hat, &Vector3::new(0.1, 2.0, -1.0));
/// assert!((Additive::difference(&hat, &chi) - Vector3::new(0.1, 2.0, -1.0)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Additive;

impl Side for Additive {
    type Residual = Self;

    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
        Gtsam::retract(chi, &(Self::to_left(chi) * xi))
    }

    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D> {
        Self::from_left(chi_hat) * Gtsam::difference(chi_hat, chi)
    }

    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        with_rotation_of::<G, D>(&G::left_jacobian(xi), SMatrix::identity())
    }

    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        with_rotation_of::<G, D>(&G::exp(xi).adjoint(), SMatrix::identity())
    }

    fn from_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        uncoupled::<G, D>(chi.adjoint())
    }

    fn to_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        uncoupled::<G, D>(chi.inverse().adjoint())
    }

    const IS_LEFT: bool = false;
}

impl InertialSide for Additive {
    #[inline(always)]
    fn transition(increment: &ImuIncrement, before: &SE23, _after: &SE23) -> Transition {
        increment.additive_transition(before)
    }
}
