//! The error of the ordinary extended Kalman filter: positions add, whatever the rotation.
//!
//! `chi = (Exp(phi) R_hat, x_hat + rho)`: every coordinate in world axes, rotation and vectors uncoupled; in
//! the plane `(theta_hat + phi, x_hat + rho)`. With it the one update core is the EKF, the baseline of \[LC\].
//! To first order `xi_additive = A xi_left`, A the adjoint without what couples the rotation to the vectors:
//! `diag(1, R)` in the plane and `diag(R, R)` in space.
//!
//! It works on every group that is one rotation and the vectors that it turns, from the group's own maps: the
//! exponential is `exp(phi, rho) = (Exp(phi), V rho)`, with V in the lower right of the left Jacobian.

use nalgebra::{SMatrix, SVector};

use super::side::Side;
use crate::lie::{LieGroup, SE23};
use crate::model::{ImuIncrement, Transition};

/// `chi = (Exp(phi) R_hat, x_hat + rho)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Additive;

/// The matrix without the block that lets the rotation act on the vectors.
fn uncoupled<G: LieGroup<D>, const D: usize>(mut matrix: SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    for column in 0..G::ROTATION_DIM {
        for row in G::ROTATION_DIM..D {
            matrix[(row, column)] = 0.0;
        }
    }
    matrix
}

/// `xi` with its vectors multiplied by the lower right of `matrix`; the rotation as it is.
fn with_vectors_times<G: LieGroup<D>, const D: usize>(
    matrix: &SMatrix<f64, D, D>,
    xi: &SVector<f64, D>,
) -> SVector<f64, D> {
    let mut result = uncoupled::<G, D>(*matrix) * xi;
    for row in 0..G::ROTATION_DIM {
        result[row] = xi[row];
    }
    result
}

impl Side for Additive {
    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
        let in_body = Self::to_left(chi) * xi;
        let inverse = G::left_jacobian_inverse(&in_body);
        chi.compose(&G::exp(&with_vectors_times::<G, D>(&inverse, &in_body)))
    }

    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D> {
        let xi = chi_hat.inverse().compose(chi).log();
        let in_body = with_vectors_times::<G, D>(&G::left_jacobian(&xi), &xi);
        Self::from_left(chi_hat) * in_body
    }

    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let of_rotation = G::left_jacobian(xi);
        let mut jacobian = SMatrix::<f64, D, D>::identity();
        for row in 0..G::ROTATION_DIM {
            for column in 0..G::ROTATION_DIM {
                jacobian[(row, column)] = of_rotation[(row, column)];
            }
        }
        jacobian
    }

    fn from_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        uncoupled::<G, D>(chi.adjoint())
    }

    fn to_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        uncoupled::<G, D>(chi.inverse().adjoint())
    }

    fn transition(increment: &ImuIncrement, before: &SE23, _after: &SE23) -> Transition {
        increment.additive_transition(before)
    }

    const IS_LEFT: bool = false;
}
