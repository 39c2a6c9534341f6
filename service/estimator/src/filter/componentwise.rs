//! Parametrisations that leave the rotation and the vectors uncoupled, in body coordinates: those of the smoothers
//! that \[IS\] compares with.
//!
//! | type | error | of |
//! |---|---|---|
//! | [`Gtsam`] | `(R_hat Exp(phi), v_hat + R_hat nu, x_hat + R_hat rho)` | \[IS\] (23) |
//! | [`Forster`] | `(R_hat Exp(phi), v_hat + nu, x_hat + R_hat rho)` | \[IS\] (22) |
//!
//! To first order `Gtsam` is the left-invariant error, `chi_hat exp(xi)`, whose vectors it takes literally.
//! They work on every group that is one rotation and the vectors that it turns, from the group's own maps: the
//! exponential is `exp(phi, rho) = (Exp(phi), V rho)`, with V in the lower right of the left Jacobian. Biases add.

use nalgebra::{SMatrix, SVector};

use super::side::Side;
use crate::lie::LieGroup;

/// `chi = (R_hat Exp(phi), x_hat + R_hat rho)`, every vector in body axes.
///
/// ```
/// use inekf::filter::{Gtsam, Side};
/// use inekf::lie::{LieGroup, SE3};
/// use nalgebra::Vector6;
///
/// let (chi, xi) = (SE3::exp(&Vector6::repeat(0.2)), Vector6::new(0.3, -0.1, 0.2, 1.0, 2.0, 3.0));
/// // Uncoupled, in body axes: the translation is not bent by the rotation.
/// let moved = Gtsam::retract(&chi, &xi);
/// let step = chi.rotation.inverse_rotate(&(moved.position - chi.position));
/// assert!((step - nalgebra::Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gtsam;

/// `chi = (R_hat Exp(phi), v_hat + nu, x_hat + R_hat rho)`: the velocity in world axes, all else in body axes.
///
/// ```
/// use inekf::filter::{Forster, Side};
/// use inekf::lie::{LieGroup, SE3};
/// use nalgebra::Vector6;
///
/// let (chi, xi) = (SE3::exp(&Vector6::repeat(0.2)), Vector6::new(0.3, -0.1, 0.2, 1.0, 2.0, 3.0));
/// assert!((Forster::difference(&chi, &Forster::retract(&chi, &xi)) - xi).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Forster;

/// The matrix without the block that lets the rotation act on the vectors.
pub(super) fn uncoupled<G: LieGroup<D>, const D: usize>(
    mut matrix: SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    for column in 0..G::ROTATION_DIM {
        for row in G::ROTATION_DIM..D {
            matrix[(row, column)] = 0.0;
        }
    }
    matrix
}

/// `matrix` with the block of the rotation taken from `of_rotation`.
pub(super) fn with_rotation_of<G: LieGroup<D>, const D: usize>(
    of_rotation: &SMatrix<f64, D, D>,
    mut matrix: SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    for column in 0..G::ROTATION_DIM {
        for row in 0..G::ROTATION_DIM {
            matrix[(row, column)] = of_rotation[(row, column)];
        }
    }
    matrix
}

/// The identity, with the block of the velocity taken from `of_velocity`.
fn velocity_of<G: LieGroup<D>, const D: usize>(
    of_velocity: &SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    let mut matrix = SMatrix::identity();
    let velocity = G::ROTATION_DIM..G::ROTATION_DIM + G::VELOCITY_DIM;
    for column in velocity.clone() {
        for row in velocity.clone() {
            matrix[(row, column)] = of_velocity[(row, column)];
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

impl Side for Gtsam {
    type Residual = Self;

    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
        let inverse = G::left_jacobian_inverse(xi);
        chi.compose(&G::exp(&with_vectors_times::<G, D>(&inverse, xi)))
    }

    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D> {
        let xi = chi_hat.inverse().compose(chi).log();
        with_vectors_times::<G, D>(&G::left_jacobian(&xi), &xi)
    }

    /// `diag(J_r(phi), Exp(phi)^T, ...)`.
    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let turned_back = uncoupled::<G, D>(G::exp(&-xi).adjoint());
        with_rotation_of::<G, D>(&G::right_jacobian(xi), turned_back)
    }

    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        Self::retract(&G::identity(), xi).inverse().adjoint()
    }

    fn from_left<G: LieGroup<D>, const D: usize>(_chi: &G) -> SMatrix<f64, D, D> {
        SMatrix::identity()
    }

    fn to_left<G: LieGroup<D>, const D: usize>(_chi: &G) -> SMatrix<f64, D, D> {
        SMatrix::identity()
    }

    const IS_LEFT: bool = true;
}

impl Side for Forster {
    type Residual = Gtsam;

    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
        Gtsam::retract(chi, &(Self::to_left(chi) * xi))
    }

    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D> {
        Self::from_left(chi_hat) * Gtsam::difference(chi_hat, chi)
    }

    /// `diag(J_r(phi), I, Exp(phi)^T, ...)`.
    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let mut jacobian = Gtsam::jacobian::<G, D>(xi);
        for column in G::ROTATION_DIM..G::ROTATION_DIM + G::VELOCITY_DIM {
            jacobian.column_mut(column).fill(0.0);
            jacobian[(column, column)] = 1.0;
        }
        jacobian
    }

    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let mut jacobian = Gtsam::origin_jacobian::<G, D>(xi);
        for row in G::ROTATION_DIM..G::ROTATION_DIM + G::VELOCITY_DIM {
            jacobian.row_mut(row).fill(0.0);
            jacobian[(row, row)] = 1.0;
        }
        jacobian
    }

    fn from_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        velocity_of::<G, D>(&chi.adjoint())
    }

    fn to_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        velocity_of::<G, D>(&chi.inverse().adjoint())
    }

    const IS_LEFT: bool = false;
}
