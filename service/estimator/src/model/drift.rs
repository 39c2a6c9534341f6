//! What a state does by itself, whatever its body feels: `chi -> W phi(chi)`, the world's share of any number of
//! group-affine steps (\[IS\] (6), where W is called Gamma).
//!
//! Steps `chi+ = W phi(chi) U` compose to one of their kind, and W and phi of the whole depend on the time that has
//! gone by alone: gravity and free motion for an IMU held constant over its samples, nothing for odometry. What the
//! body felt, U, then follows from any two states that the steps have led from one to the other:
//!
//! ```text
//! U = (W phi(chi_then))^-1 chi_now
//! ```
//!
//! so that the error's transition over a thousand samples, `F = Ad_{U^-1} M` in the left-invariant error and
//! `F = Ad_W M` in the right-invariant one, is known without a product of a thousand matrices.

use core::marker::PhantomData;

use nalgebra::{SMatrix, Vector3};

use super::group_affine::{Automorphism, FreeMotion};
use crate::lie::{LieGroup, SE23, SO3};

/// The automorphism that changes nothing.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Automorphism, Unmoved};
/// use nalgebra::Vector3;
///
/// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
/// assert_eq!(Unmoved.apply(&chi), chi);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unmoved;

impl<G: LieGroup<D>, const D: usize> Automorphism<G, D> for Unmoved {
    fn apply(&self, chi: &G) -> G {
        *chi
    }

    fn differential(&self) -> SMatrix<f64, D, D> {
        SMatrix::identity()
    }

    fn congruence(&self, _p: &mut SMatrix<f64, D, D>) {}
}

/// `chi -> W phi(chi)`.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, Drift, ImuInput, ImuStep};
/// use nalgebra::Vector3;
///
/// // Two samples, whatever they said, drift as one interval of their length.
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// let step = |rate, dt_s| {
///     let input = ImuInput { omega_b: Vector3::new(0.0, 0.0, rate), force_b: Vector3::new(1.0, 0.0, 9.8) };
///     ImuStep::new(&input, &g_w, dt_s, Discretisation::ZeroOrderHold)
/// };
/// let go = |start: &SE23| step(-0.3, 0.2).apply(&step(0.5, 0.1).apply(start));
/// let drift = Drift::free_fall(&g_w, 0.3);
/// let start = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
/// // What the body felt does not depend on where it began.
/// let felt = drift.body_between(&SE23::identity(), &go(&SE23::identity()));
/// assert!(felt.between(&drift.body_between(&start, &go(&start))).log().norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift<G, A, const D: usize> {
    /// W: acts from the world side, e.g. gravity.
    pub world: G,
    /// phi.
    pub automorphism: A,
    dimension: PhantomData<[(); D]>,
}

impl Drift<SE23, FreeMotion, 9> {
    /// `dt_s` seconds under gravity `g_w`, m/s^2: `W = (I, g dt, g dt^2 / 2)`. The drift of every IMU whose samples
    /// are held constant over their intervals
    /// ([`ZeroOrderHold`](super::Discretisation::ZeroOrderHold)), however many there were.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::Drift;
    /// use nalgebra::Vector3;
    ///
    /// // A second of free fall from rest: 9.8 m/s and half as many metres down.
    /// let fallen = Drift::free_fall(&Vector3::new(0.0, 0.0, -9.8), 1.0).apply(&SE23::identity());
    /// assert!((fallen.velocity.z + 9.8).abs() < 1e-12 && (fallen.position.z + 4.9).abs() < 1e-12);
    /// ```
    pub fn free_fall(g_w: &Vector3<f64>, dt_s: f64) -> Self {
        Self {
            world: SE23 {
                rotation: SO3::identity(),
                velocity: g_w * dt_s,
                position: g_w * (0.5 * dt_s * dt_s),
            },
            automorphism: FreeMotion { dt_s },
            dimension: PhantomData,
        }
    }
}

impl<G: LieGroup<D>, const D: usize> Drift<G, Unmoved, D> {
    /// None at all: that of odometry, whose steps are `chi+ = chi kappa`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::Drift;
    /// use nalgebra::Vector3;
    ///
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// assert_eq!(Drift::none().apply(&chi).between(&chi).log().norm(), 0.0);
    /// ```
    pub fn none() -> Self {
        Self {
            world: G::identity(),
            automorphism: Unmoved,
            dimension: PhantomData,
        }
    }
}

impl<G: LieGroup<D>, A: Automorphism<G, D>, const D: usize> Drift<G, A, D> {
    /// `W phi(chi)`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Drift, InertialState};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    ///
    /// // As long at once as in two parts.
    /// let (part, whole) = (Drift::free_fall(&g_w, 0.5), Drift::free_fall(&g_w, 1.0));
    /// assert!(part.apply(&part.apply(&pose)).between(&whole.apply(&pose)).log().norm() < 1e-12);
    /// ```
    pub fn apply(&self, chi: &G) -> G {
        self.world.compose(&self.automorphism.apply(chi))
    }

    /// U, what the body felt on its way from `then` to `now`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Drift, InertialState};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    ///
    /// // In free fall a body feels nothing.
    /// let drift = Drift::free_fall(&g_w, 2.0);
    /// assert!(drift.body_between(&pose, &drift.apply(&pose)).log().norm() < 1e-12);
    /// ```
    pub fn body_between(&self, then: &G, now: &G) -> G {
        self.apply(then).between(now)
    }
}
