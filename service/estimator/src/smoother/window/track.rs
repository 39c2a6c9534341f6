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

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::filter::Covariance;
use crate::lie::{LieGroup, SE23, SO3};
use crate::model::{Automorphism, FreeMotion, GroupAffineStep, InertialState};

#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    step: GroupAffineStep<SE23, FreeMotion, 9>,
    /// R.
    turn: Matrix3<f64>,
    /// Whether the world part W does not turn: gravity alone does not.
    upright: bool,
}

#[inline]
fn split<const D: usize>(xi: &SVector<f64, D>) -> [Vector3<f64>; 3] {
    [
        Vector3::new(xi[0], xi[1], xi[2]),
        Vector3::new(xi[3], xi[4], xi[5]),
        Vector3::new(xi[6], xi[7], xi[8]),
    ]
}

#[inline]
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
            upright: step.world.rotation == SO3::identity(),
        }
    }

    /// Where the motion leads, D = 9.
    pub fn apply<G: InertialState<D>, const D: usize>(&self, chi: &G) -> G {
        let pose = if self.upright {
            let moved = self.step.automorphism.apply(chi.pose());
            SE23 {
                rotation: moved.rotation,
                velocity: self.step.world.velocity + moved.velocity,
                position: self.step.world.position + moved.position,
            }
            .compose(&self.step.body)
        } else {
            self.step.apply(chi.pose())
        };
        G::from_parts(pose, chi.gyro_bias(), chi.accel_bias())
    }

    /// `F xi`, D = 9.
    #[inline]
    pub fn carry<const D: usize>(&self, xi: &SVector<f64, D>) -> SVector<f64, D> {
        let [a, b, c] = split(xi);
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        let back = self.turn.transpose();
        join(&[
            back * a,
            back * (b - u.velocity.cross(&a)),
            back * (c + b * dt_s - u.position.cross(&a)),
        ])
    }

    /// `F^T xi`, D = 9.
    #[inline]
    pub fn carry_back<const D: usize>(&self, xi: &SVector<f64, D>) -> SVector<f64, D> {
        let [a, b, c] = split(xi);
        let (a, b, c) = (self.turn * a, self.turn * b, self.turn * c);
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        join(&[
            a + u.velocity.cross(&b) + u.position.cross(&c),
            b + c * dt_s,
            c,
        ])
    }

    /// F, D = 9.
    pub fn matrix<const D: usize>(&self) -> SMatrix<f64, D, D> {
        self.times_transposed(&SMatrix::<f64, D, D>::identity())
            .transpose()
    }

    /// `F P F^T + Q`, D = 9.
    pub fn carry_covariance<const D: usize>(
        &self,
        p: &Covariance<D>,
        q: &Covariance<D>,
    ) -> Covariance<D> {
        let f_p = self.times_transposed(p.matrix()).transpose();
        Covariance::from_rounded(self.times_transposed(&f_p) + q.matrix())
    }

    /// `A F^T`: every row carried. Row by row the same few products, which the compiler does for several rows at once.
    fn times_transposed<const D: usize>(&self, a: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        let r = &self.turn;
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        let (v, p) = (&u.velocity, &u.position);
        let mut result = SMatrix::<f64, D, D>::zeros();
        for row in 0..D {
            let at = |column: usize| a[(row, column)];
            let turn = [at(0), at(1), at(2)];
            let less_cross = |vector: &[f64; 3], arm: &Vector3<f64>| {
                [
                    vector[0] - (arm.y * turn[2] - arm.z * turn[1]),
                    vector[1] - (arm.z * turn[0] - arm.x * turn[2]),
                    vector[2] - (arm.x * turn[1] - arm.y * turn[0]),
                ]
            };
            let velocity = [at(3), at(4), at(5)];
            let position = [
                at(6) + dt_s * velocity[0],
                at(7) + dt_s * velocity[1],
                at(8) + dt_s * velocity[2],
            ];
            let parts = [turn, less_cross(&velocity, v), less_cross(&position, p)];
            for (block, part) in parts.iter().enumerate() {
                for axis in 0..3 {
                    result[(row, 3 * block + axis)] =
                        r[(0, axis)] * part[0] + r[(1, axis)] * part[1] + r[(2, axis)] * part[2];
                }
            }
        }
        result
    }
}
