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
    pub fn apply(&self, chi: &G) -> G {
        self.world.compose(&self.automorphism.apply(chi))
    }

    /// U, what the body felt on its way from `then` to `now`.
    pub fn body_between(&self, then: &G, now: &G) -> G {
        self.apply(then).between(now)
    }
}
