//! A group-affine motion on SE_2(3), ready to carry left-invariant errors: `F = Ad_{U^-1} M` without the matrix.
//!
//! With `U = (R, v, p)` the body part of the motion and dt its length,
//!
//! ```text
//! F (a, b, c)   = R^T (a, b - v x a, c + dt b - p x a)
//! F^T (a, b, c) = (R a + v x R b + p x R c, R b + dt R c, R c)
//! ```
//!
//! a third of the work of the product with F, which is three quarters zeros and copies.

use nalgebra::{Matrix3, SVector, Vector3};

use crate::lie::SE23;
use crate::model::{FreeMotion, GroupAffineStep};

#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    step: GroupAffineStep<SE23, FreeMotion, 9>,
    /// R.
    turn: Matrix3<f64>,
}

fn split<const D: usize>(xi: &SVector<f64, D>) -> [Vector3<f64>; 3] {
    [0, 3, 6].map(|start| Vector3::new(xi[start], xi[start + 1], xi[start + 2]))
}

fn join<const D: usize>(parts: &[Vector3<f64>; 3]) -> SVector<f64, D> {
    let mut xi = SVector::<f64, D>::zeros();
    for axis in 0..3 {
        xi[axis] = parts[0][axis];
        xi[3 + axis] = parts[1][axis];
        xi[6 + axis] = parts[2][axis];
    }
    xi
}

impl Track {
    pub fn new(step: &GroupAffineStep<SE23, FreeMotion, 9>) -> Self {
        Self {
            step: *step,
            turn: step.body.rotation.matrix(),
        }
    }

    /// Where the motion leads.
    pub fn apply(&self, pose: &SE23) -> SE23 {
        self.step.apply(pose)
    }

    /// `F xi`, D = 9.
    pub fn carry<const D: usize>(&self, xi: &SVector<f64, D>) -> SVector<f64, D> {
        let [a, b, c] = split(xi);
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        let parts = [
            a,
            b - u.velocity.cross(&a),
            c + b * dt_s - u.position.cross(&a),
        ];
        join(&parts.map(|part| self.turn.tr_mul(&part)))
    }

    /// `F^T xi`, D = 9.
    pub fn carry_back<const D: usize>(&self, xi: &SVector<f64, D>) -> SVector<f64, D> {
        let [a, b, c] = split(xi).map(|part| self.turn * part);
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        join(&[
            a + u.velocity.cross(&b) + u.position.cross(&c),
            b + c * dt_s,
            c,
        ])
    }
}
