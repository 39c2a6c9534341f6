//! A group-affine motion on SE_2(3), ready to carry left-invariant errors: `F = Ad_{U^-1} M` without the matrix.
//!
//! With `U = (R, v, p)` the body part of the motion and dt its length,
//!
//! ```text
//! F (a, b, c)   = R^T (a, b - v x a, c + dt b - p x a)
//! F^T (a, b, c) = (R a + v x R b + p x R c, R b + dt R c, R c)
//! ```
//!
//! a third of the work of the product with F, which is three quarters zeros and copies. With biases the motion is
//! linearised, and B, the derivative by the inputs, leads from them to the rest: `F = [T -B; 0 I]`, T as above.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::filter::Covariance;
use crate::lanes::Block;
use crate::lie::{LieGroup, SE23, SO3};
use crate::model::{Automorphism, FreeMotion, GroupAffineStep, InertialState, Lines};

/// B, 9 x 6: how the inputs, and with a minus the biases, enter a motion.
pub(super) type InputJacobian = SMatrix<f64, 9, 6>;

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

    /// Where the motion leads.
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

    /// `F xi`.
    #[inline]
    pub fn carry<const D: usize>(
        &self,
        xi: &SVector<f64, D>,
        inputs: &InputJacobian,
    ) -> SVector<f64, D> {
        let [a, b, c] = split(xi);
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        let back = self.turn.transpose();
        let mut carried = join(&[
            back * a,
            back * (b - u.velocity.cross(&a)),
            back * (c + b * dt_s - u.position.cross(&a)),
        ]);
        for bias in 9..D {
            for row in 0..9 {
                carried[row] -= inputs[(row, bias - 9)] * xi[bias];
            }
            carried[bias] = xi[bias];
        }
        carried
    }

    /// `F^T xi`.
    #[inline]
    pub fn carry_back<const D: usize>(
        &self,
        xi: &SVector<f64, D>,
        inputs: &InputJacobian,
    ) -> SVector<f64, D> {
        let [a, b, c] = split(xi);
        let (a, b, c) = (self.turn * a, self.turn * b, self.turn * c);
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        let mut carried = join(&[
            a + u.velocity.cross(&b) + u.position.cross(&c),
            b + c * dt_s,
            c,
        ]);
        for bias in 9..D {
            let entering: f64 = (0..9).map(|row| inputs[(row, bias - 9)] * xi[row]).sum();
            carried[bias] = xi[bias] - entering;
        }
        carried
    }

    /// `F P F^T + Q`, into `result`.
    #[inline]
    pub fn carry_covariance<const D: usize>(
        &self,
        p: &Covariance<D>,
        q: &Covariance<D>,
        inputs: &InputJacobian,
        result: &mut Covariance<D>,
    ) {
        let (p, q) = (&p.matrix().data.0, &q.matrix().data.0);
        let lines = self.lines(inputs);
        result.change_symmetrically(|result| lines.carry(p, q, &mut result.data.0));
    }

    /// F by its lines. A force does not turn the body: that part of B is zero.
    #[inline]
    fn lines(&self, inputs: &InputJacobian) -> Lines {
        let block = |row: usize, column: usize| {
            Block::from_columns(core::array::from_fn(|j| {
                core::array::from_fn(|i| inputs[(row + i, column + j)])
            }))
        };
        let u = &self.step.body;
        Lines::new(
            self.step.automorphism.dt_s,
            Some(Block::from_columns(self.turn.transpose().data.0)),
            &[-u.velocity, -u.position],
            [block(0, 0), block(3, 0), block(6, 0)],
            [block(3, 3), block(6, 3)],
        )
    }
}
