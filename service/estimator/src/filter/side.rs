//! How a small error is attached to an estimate, as types: left or right invariance, and the parametrisations
//! of the smoothers that \[IS\] and \[PAR\] compare.
//!
//! | | [`Left`] | [`Right`] |
//! |---|---|---|
//! | error | `chi = chi_hat exp(xi)`, body coordinates | `chi = exp(xi) chi_hat`, world coordinates |
//! | transport after a correction | right Jacobian | left Jacobian |
//!
//! The two are one filter with two costs (\[PAR\], Propositions 1 and 2): `xi_right =
//! Ad_{chi_hat} xi_left`, and they agree as long as the covariance is carried along at updates.
//! [`Gtsam`](super::Gtsam), [`Forster`](super::Forster) and [`Additive`](super::Additive) leave the rotation
//! and the vectors uncoupled, and differ among themselves in the axes of the vectors alone.

use core::fmt::Debug;

use nalgebra::{SMatrix, SVector};

use super::late::LateSide;
use crate::lie::{LieGroup, SE23};
use crate::model::{ImuIncrement, Transition};

/// Which side of the estimate the error sits on, and in which coordinates.
pub trait Side: Copy + Clone + Debug + PartialEq {
    /// The chart in which a smoother with this parametrisation writes the residual of a motion, so that what is
    /// compared is what its users compare: the group's logarithm in body axes for both exponentials, uncoupled
    /// in body axes for [`Gtsam`](super::Gtsam) and [`Forster`](super::Forster), and in world axes for
    /// [`Additive`](super::Additive).
    type Residual: Side;

    /// The group element that lies `xi` away from `chi`.
    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G;

    /// The `xi` with `retract(chi_hat, xi) = chi`.
    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D>;

    /// J with `retract(chi, xi + d) = retract(retract(chi, xi), J d)` to first order: it carries
    /// an error written around `chi` to the point `xi` away from it.
    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// K with `difference(retract(chi, e), retract(chi, xi)) = xi - J^-1 K e` to first order in e, J the
    /// [`jacobian`](Self::jacobian): how a difference follows the point that it is taken from.
    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// A, with `xi_side = A xi_left` at `chi`, to first order.
    fn from_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D>;

    /// `A^-1`, with `xi_left = A^-1 xi_side` at `chi`, to first order.
    fn to_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D>;

    /// Whether the error is the left-invariant one already, to first order, so that changes of
    /// coordinates can be left out.
    const IS_LEFT: bool;
}

/// A side on which a belief moves with an IMU: its error has a transition in blocks.
pub trait InertialSide: LateSide {
    /// How the error of an inertial state moves with `increment`, from the pose `before` to the pose `after`.
    fn transition(increment: &ImuIncrement, before: &SE23, after: &SE23) -> Transition;
}

/// `chi = chi_hat exp(xi)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left;

/// `chi = exp(xi) chi_hat`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Right;

impl Side for Left {
    type Residual = Self;

    #[inline]
    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
        chi.compose(&G::exp(xi))
    }

    #[inline]
    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D> {
        chi_hat.between(chi).log()
    }

    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        G::right_jacobian(xi)
    }

    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        G::exp(&-xi).adjoint()
    }

    fn from_left<G: LieGroup<D>, const D: usize>(_chi: &G) -> SMatrix<f64, D, D> {
        SMatrix::identity()
    }

    fn to_left<G: LieGroup<D>, const D: usize>(_chi: &G) -> SMatrix<f64, D, D> {
        SMatrix::identity()
    }

    const IS_LEFT: bool = true;
}

impl Side for Right {
    type Residual = Left;

    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
        G::exp(xi).compose(chi)
    }

    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D> {
        chi.compose(&chi_hat.inverse()).log()
    }

    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        G::left_jacobian(xi)
    }

    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        G::exp(xi).adjoint()
    }

    fn from_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        chi.adjoint()
    }

    fn to_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D> {
        chi.inverse().adjoint()
    }

    const IS_LEFT: bool = false;
}

impl InertialSide for Left {
    #[inline(always)]
    fn transition(increment: &ImuIncrement, _before: &SE23, _after: &SE23) -> Transition {
        increment.left_transition()
    }
}

impl InertialSide for Right {
    #[inline(always)]
    fn transition(increment: &ImuIncrement, before: &SE23, after: &SE23) -> Transition {
        increment.right_transition(before, after)
    }
}
