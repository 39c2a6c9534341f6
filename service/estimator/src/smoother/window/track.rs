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

use crate::columns::{Column, combined};
use crate::filter::Covariance;
use crate::lie::{LieGroup, SE23, SO3};
use crate::model::{Automorphism, FreeMotion, GroupAffineStep, InertialState};

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
    pub fn carry_covariance<const D: usize>(
        &self,
        p: &Covariance<D>,
        q: &Covariance<D>,
        inputs: &InputJacobian,
        result: &mut Covariance<D>,
    ) {
        let (p, q) = (p.matrix(), q.matrix());
        // Of all rows of P: T A above and M^T = (T C)^T below, where P = [A C; C^T S].
        let carried = self.times_transposed::<D, D, D>(&p.data.0);
        let mut across = [[0.0; 9]; 9];
        for row in 0..9 {
            for column in 0..9 {
                across[row][column] = carried[column][row];
            }
        }
        let turned = self.times_transposed::<9, 3, 6>(&across);
        result.change_symmetrically(|result| {
            result.copy_from(q);
            for (column, (sum, turned)) in result.data.0.iter_mut().zip(&turned).enumerate() {
                for row in 0..=column {
                    sum[row] += turned[row];
                }
            }
            if D > 9 {
                add_biases(p, &carried, inputs, result);
            }
            result.fill_lower_triangle_with_upper_triangle();
        });
    }

    /// `A T^T` of the first nine columns of A: every row carried. In the first columns, those of the rotation, as many rows
    /// as FIRST says, in the velocity's SECOND; the others are without meaning.
    #[inline]
    fn times_transposed<const ROWS: usize, const FIRST: usize, const SECOND: usize>(
        &self,
        a: &[Column<ROWS>],
    ) -> [Column<ROWS>; 9] {
        let (u, dt_s) = (&self.step.body, self.step.automorphism.dt_s);
        let (v, p) = (&u.velocity, &u.position);
        let (a0, a1, a2) = (&a[0], &a[1], &a[2]);
        let velocity = |axis: usize, factors, arms| {
            combined::<SECOND, ROWS, ROWS, ROWS, 2>(&a[3 + axis], factors, arms)
        };
        let position = |axis: usize, [one, other]: [f64; 2], [left, right]: [&Column<ROWS>; 2]| {
            let columns = [&a[3 + axis], left, right];
            combined::<ROWS, ROWS, ROWS, ROWS, 3>(&a[6 + axis], [dt_s, one, other], columns)
        };
        let velocity = [
            velocity(0, [v.z, -v.y], [a1, a2]),
            velocity(1, [v.x, -v.z], [a2, a0]),
            velocity(2, [v.y, -v.x], [a0, a1]),
        ];
        let position = [
            position(0, [p.z, -p.y], [a1, a2]),
            position(1, [p.x, -p.z], [a2, a0]),
            position(2, [p.y, -p.x], [a0, a1]),
        ];
        let mut result = [[0.0; ROWS]; 9];
        for axis in 0..3 {
            let turn: [f64; 3] = core::array::from_fn(|row| self.turn[(row, axis)]);
            result[axis] = combined::<FIRST, ROWS, ROWS, ROWS, 3>(&[0.0; ROWS], turn, [a0, a1, a2]);
            result[3 + axis] =
                combined::<SECOND, ROWS, ROWS, ROWS, 3>(&[0.0; ROWS], turn, velocity.each_ref());
            result[6 + axis] =
                combined::<ROWS, ROWS, ROWS, ROWS, 3>(&[0.0; ROWS], turn, position.each_ref());
        }
        result
    }
}

/// What the biases add to the upper triangle of `F P F^T`: `-M B^T - B C'^T` above, where `C' = M - B S` is
/// what lies between, and S.
fn add_biases<const D: usize>(
    p: &SMatrix<f64, D, D>,
    carried: &[[f64; D]; 9],
    inputs: &InputJacobian,
    result: &mut SMatrix<f64, D, D>,
) {
    let b = &inputs.data.0;
    let (mut m, mut between) = ([[0.0; 9]; 6], [[0.0; 9]; 6]);
    for bias in 0..6 {
        for row in 0..9 {
            m[bias][row] = carried[row][9 + bias];
        }
        let s = core::array::from_fn(|k| -p[(9 + k, 9 + bias)]);
        between[bias] = combined::<9, 9, 9, 9, 6>(&m[bias], s, b.each_ref());
        let column = &mut result.data.0[9 + bias];
        for row in 0..9 {
            column[row] += between[bias][row];
        }
        for row in 9..D {
            column[row] += p[(row, 9 + bias)];
        }
    }
    for column in 0..9 {
        let by_b = core::array::from_fn(|k| -b[k][column]);
        let by_between = core::array::from_fn(|k| -between[k][column]);
        let sum = &mut result.data.0[column];
        let start: [f64; 9] = core::array::from_fn(|row| sum[row]);
        let half = combined::<9, 9, 9, 9, 6>(&start, by_b, m.each_ref());
        let whole = combined::<9, 9, 9, 9, 6>(&half, by_between, b.each_ref());
        sum[..9].copy_from_slice(&whole);
    }
}
