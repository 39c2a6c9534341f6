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
///
/// ```
/// use inekf::filter::{Left, Right, Side};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// let (chi, xi) = (SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), Vector3::new(0.1, 0.2, -0.3));
/// assert_eq!(Left::retract(&chi, &xi), chi * SE2::exp(&xi));
/// assert_eq!(Right::retract(&chi, &xi), SE2::exp(&xi) * chi);
/// // On either side the difference undoes it.
/// assert!((Left::difference(&chi, &Left::retract(&chi, &xi)) - xi).norm() < 1e-12);
/// assert!((Right::difference(&chi, &Right::retract(&chi, &xi)) - xi).norm() < 1e-12);
/// ```
pub trait Side: Copy + Clone + Debug + PartialEq {
    /// The chart in which a smoother with this parametrisation writes the residual of a motion, so that what is
    /// compared is what its users compare: the group's logarithm in body axes for both exponentials, uncoupled
    /// in body axes for [`Gtsam`](super::Gtsam) and [`Forster`](super::Forster), and in world axes for
    /// [`Additive`](super::Additive).
    type Residual: Side;

    /// The group element that lies `xi` away from `chi`.
    ///
    /// ```
    /// use inekf::filter::{Additive, Side};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// // The plain EKF's: the position is added to in world axes, whatever the heading.
    /// let here = SE2::exp(&Vector3::new(1.0, 0.0, 0.0));
    /// let there = Additive::retract(&here, &Vector3::new(0.0, 2.0, 0.0));
    /// assert!((there.position - here.position - Vector2::new(2.0, 0.0)).norm() < 1e-12);
    /// ```
    fn retract<G: LieGroup<D>, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G;

    /// The `xi` with `retract(chi_hat, xi) = chi`.
    ///
    /// ```
    /// use inekf::filter::{Left, Side};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let (hat, chi) = (SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), SE2::exp(&Vector3::new(0.6, 3.0, 1.2)));
    /// // Both ways they are opposite.
    /// assert!((Left::difference(&hat, &chi) + Left::difference(&chi, &hat)).norm() < 1e-12);
    /// ```
    fn difference<G: LieGroup<D>, const D: usize>(chi_hat: &G, chi: &G) -> SVector<f64, D>;

    /// J with `retract(chi, xi + d) = retract(retract(chi, xi), J d)` to first order: it carries
    /// an error written around `chi` to the point `xi` away from it.
    ///
    /// ```
    /// use inekf::filter::{Left, Side};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// // On the left it is the right Jacobian of the group.
    /// let xi = Vector3::new(0.5, 3.0, 1.0);
    /// assert_eq!(Left::jacobian::<SE2, 3>(&xi), SE2::right_jacobian(&xi));
    /// ```
    fn jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// K with `difference(retract(chi, e), retract(chi, xi)) = xi - J^-1 K e` to first order in e, J the
    /// [`jacobian`](Self::jacobian): how a difference follows the point that it is taken from.
    ///
    /// ```
    /// use inekf::filter::{Left, Side};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let (chi, xi) = (SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), Vector3::new(0.3, 0.2, -0.4));
    /// let e = Vector3::new(1.0, -2.0, 0.5) * 1e-6;
    /// let j = Left::jacobian::<SE2, 3>(&xi);
    /// let back = j.try_inverse().expect("below a full turn") * Left::origin_jacobian::<SE2, 3>(&xi);
    /// // The start moves by e, and the difference by as much the other way, seen from its end.
    /// let moved = Left::difference(&Left::retract(&chi, &e), &Left::retract(&chi, &xi));
    /// assert!((moved - (xi - back * e)).norm() < 1e-10);
    /// ```
    fn origin_jacobian<G: LieGroup<D>, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D>;

    /// A, with `xi_side = A xi_left` at `chi`, to first order.
    ///
    /// ```
    /// use inekf::filter::{Right, Side};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// assert_eq!(Right::from_left(&chi), chi.adjoint());
    /// ```
    fn from_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D>;

    /// `A^-1`, with `xi_left = A^-1 xi_side` at `chi`, to first order.
    ///
    /// ```
    /// use inekf::filter::{Additive, Side};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// let there_and_back = Additive::to_left(&chi) * Additive::from_left(&chi);
    /// assert!((there_and_back - Matrix3::identity()).norm() < 1e-12);
    /// ```
    fn to_left<G: LieGroup<D>, const D: usize>(chi: &G) -> SMatrix<f64, D, D>;

    /// Whether the error is the left-invariant one already, to first order, so that changes of
    /// coordinates can be left out.
    const IS_LEFT: bool;
}

/// A side on which a belief moves with an IMU: its error has a transition in blocks.
///
/// ```
/// use inekf::filter::{Belief, Covariance, InertialSide, Left, Right, propagate};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuNoise};
/// use nalgebra::{SVector, Vector3};
///
/// fn moved<S: InertialSide>() -> SE23 {
///     let p = Covariance::from_variances(&SVector::repeat(0.1));
///     let push = ImuInput { omega_b: Vector3::new(0.0, 0.0, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
///     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
///     let belief = Belief::<SE23, S, 9>::new(SE23::identity(), p);
///     let g_w = Vector3::new(0.0, 0.0, -9.80665);
///     propagate(&belief, &push, &g_w, 0.1, Discretisation::ZeroOrderHold, &noise).mean
/// }
/// // The side is one of the error, not of the estimate.
/// assert_eq!(moved::<Left>(), moved::<Right>());
/// ```
pub trait InertialSide: LateSide {
    /// How the error of an inertial state moves with `increment`, from the pose `before` to the pose `after`.
    ///
    /// ```
    /// use inekf::filter::{InertialSide, Left, Right};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput};
    /// use nalgebra::Vector3;
    ///
    /// let push = ImuInput { omega_b: Vector3::new(0.0, 0.0, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let increment = ImuIncrement::new(&push, &g_w, 0.1, Discretisation::ZeroOrderHold);
    /// let (before, after) = (SE23::identity(), increment.apply(&SE23::identity()));
    /// // A wrong attitude turns what the body felt; seen from the world, what gravity did.
    /// let of_left = Left::transition(&increment, &before, &after);
    /// let of_right = Right::transition(&increment, &before, &after);
    /// assert_eq!(of_left.couplings, increment.body.map(|part| -part));
    /// assert_eq!(of_right.couplings, increment.world);
    /// ```
    fn transition(increment: &ImuIncrement, before: &SE23, after: &SE23) -> Transition;
}

/// `chi = chi_hat exp(xi)`.
///
/// ```
/// use inekf::filter::{Left, Side};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// // The error is seen from the body: it does not change if both are moved from the world's side.
/// let (hat, chi) = (SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), SE2::exp(&Vector3::new(0.6, 3.0, 1.2)));
/// let moved = SE2::exp(&Vector3::new(2.0, -7.0, 5.0));
/// assert!((Left::difference(&(moved * hat), &(moved * chi)) - Left::difference(&hat, &chi)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left;

/// `chi = exp(xi) chi_hat`.
///
/// ```
/// use inekf::filter::{Right, Side};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// // And this one does not if both are moved from the body's.
/// let (hat, chi) = (SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), SE2::exp(&Vector3::new(0.6, 3.0, 1.2)));
/// let moved = SE2::exp(&Vector3::new(2.0, -7.0, 5.0));
/// assert!((Right::difference(&(hat * moved), &(chi * moved)) - Right::difference(&hat, &chi)).norm() < 1e-12);
/// ```
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
