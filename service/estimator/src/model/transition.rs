//! One interval's effect on the error of an inertial state, by blocks of three: `P+ = F P F^T + Q` at a
//! quarter of the dense cost.
//!
//! With rotation, velocity, position and biases `(phi, nu, rho, b_g, b_a)`, both noises entering as the biases
//! do, the error moves by
//!
//! ```text
//! phi+ = E (phi                          - N_0 b_g)
//! nu+  = E (nu  + c_1 x phi              - N_1 b_g - A_1 b_a)
//! rho+ = E (rho + c_2 x phi  + dt nu     - N_2 b_g - A_2 b_a)
//! ```
//!
//! on every side of the estimate ([`filter::Side`](crate::filter::Side) gives the blocks; E is the identity on
//! some). F is never formed: `T = P F^T` combines whole columns of P, and of `F T` the part on the biases is T
//! itself, so that only the upper triangle of the pose is left to do. The noise, as large as a bias of
//! covariance `psd / dt`, joins T in between. [`propagate_dense`](crate::filter::propagate_dense) is the
//! reference.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::imu::ImuNoise;
use crate::columns::{Column, combined};

/// F and the shape of Q of one interval, in the error of one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// Length of the interval, s.
    pub dt_s: f64,
    /// E; `None` for the identity.
    pub turn: Option<Matrix3<f64>>,
    /// `c_1`, m/s, and `c_2`, m.
    pub couplings: [Vector3<f64>; 2],
    /// `N_0`, `N_1` and `N_2`: a change of the angular rate, rad/s.
    pub by_rate: [Matrix3<f64>; 3],
    /// `A_1` and `A_2`: a change of the specific force, m/s^2.
    pub by_force: [Matrix3<f64>; 2],
}

/// How many of the coordinates are the pose; the biases begin after them.
const POSE: usize = 9;
/// How many inputs are noisy, and how many biases there are: three rates and three forces.
const INPUTS: usize = 6;

impl Transition {
    /// Makes P `F P F^T + Q`, exactly symmetric; D = 9 without biases and 15 with them, and R is at least `D + 6`.
    #[inline(always)]
    pub(super) fn carry<const D: usize, const R: usize>(
        &self,
        p: &mut SMatrix<f64, D, D>,
        noise: &ImuNoise,
    ) {
        const { assert!(D == POSE || D == POSE + INPUTS) };
        const { assert!(R >= D + INPUTS) };
        let p = &mut p.data.0;
        let inputs = self.input_columns();
        let mut t: [Column<R>; POSE] = self.times_transposed(p, &inputs);
        self.append_noise::<D, R>(&mut t, &inputs, noise);
        self.turn_columns(&mut t);
        for i in 0..3 {
            self.finish::<D, R, 3>(p, &t[i], &inputs, i);
            self.finish::<D, R, 6>(p, &t[3 + i], &inputs, 3 + i);
            self.finish::<D, R, 9>(p, &t[6 + i], &inputs, 6 + i);
        }
        for column in 0..POSE {
            for row in POSE..D {
                p[column][row] = t[column][row];
                p[row][column] = t[column][row];
            }
        }
        if D > POSE {
            for axis in 0..3 {
                p[POSE + axis][POSE + axis] += noise.gyro_bias_psd * self.dt_s;
                p[POSE + 3 + axis][POSE + 3 + axis] += noise.accel_bias_psd * self.dt_s;
            }
        }
    }

    /// What each input adds to the pose, before the turn: the columns of `[N_0 0; N_1 A_1; N_2 A_2]`.
    #[inline(always)]
    fn input_columns(&self) -> [Column<POSE>; INPUTS] {
        let mut columns = [[0.0; POSE]; INPUTS];
        for n in 0..3 {
            for i in 0..3 {
                columns[n][i] = self.by_rate[0][(i, n)];
                columns[n][3 + i] = self.by_rate[1][(i, n)];
                columns[n][6 + i] = self.by_rate[2][(i, n)];
                columns[3 + n][3 + i] = self.by_force[0][(i, n)];
                columns[3 + n][6 + i] = self.by_force[1][(i, n)];
            }
        }
        columns
    }

    /// The columns of the pose in `P F^T`, before the turn; the rows from D on are zero.
    #[inline(always)]
    fn times_transposed<const D: usize, const R: usize>(
        &self,
        p: &[Column<D>; D],
        inputs: &[Column<POSE>; INPUTS],
    ) -> [Column<R>; POSE] {
        let [c_1, c_2] = &self.couplings;
        let mut t = [[0.0; R]; POSE];
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            // (c x phi)_i = c_j phi_k - c_k phi_j
            let (phi_j, phi_k, nu) = (&p[j], &p[k], &p[3 + i]);
            if D == POSE {
                t[i] = combined::<D, D, D, R, 0>(&p[i], [], []);
                t[3 + i] = combined::<D, _, _, _, _>(nu, [c_1[j], -c_1[k]], [phi_k, phi_j]);
                let factors = [self.dt_s, c_2[j], -c_2[k]];
                t[6 + i] = combined::<D, _, _, _, _>(&p[6 + i], factors, [nu, phi_k, phi_j]);
            } else {
                let b = |n: usize| &p[POSE + n];
                let f = |n: usize, row: usize| -inputs[n][row];
                t[i] = combined::<D, _, _, _, _>(
                    &p[i],
                    [f(0, i), f(1, i), f(2, i)],
                    [b(0), b(1), b(2)],
                );
                let r = 3 + i;
                t[r] = combined::<D, _, _, _, _>(
                    nu,
                    [
                        c_1[j],
                        -c_1[k],
                        f(0, r),
                        f(1, r),
                        f(2, r),
                        f(3, r),
                        f(4, r),
                        f(5, r),
                    ],
                    [phi_k, phi_j, b(0), b(1), b(2), b(3), b(4), b(5)],
                );
                let r = 6 + i;
                t[r] = combined::<D, _, _, _, _>(
                    &p[r],
                    [
                        self.dt_s,
                        c_2[j],
                        -c_2[k],
                        f(0, r),
                        f(1, r),
                        f(2, r),
                        f(3, r),
                        f(4, r),
                        f(5, r),
                    ],
                    [nu, phi_k, phi_j, b(0), b(1), b(2), b(3), b(4), b(5)],
                );
            }
        }
        t
    }

    /// The rows of the biases in T again, from row D on, less what the white noise of the input adds there:
    /// `psd / dt` times the transpose of `inputs`.
    #[inline(always)]
    fn append_noise<const D: usize, const R: usize>(
        &self,
        t: &mut [Column<R>; POSE],
        inputs: &[Column<POSE>; INPUTS],
        noise: &ImuNoise,
    ) {
        // Over no time there is no noise, and no quotient.
        let rate = if self.dt_s > 0.0 {
            1.0 / self.dt_s
        } else {
            0.0
        };
        let (gyro, accel) = (noise.gyro_psd * rate, noise.accel_psd * rate);
        for column in 0..POSE {
            for n in 0..INPUTS {
                let known = if D > POSE { t[column][POSE + n] } else { 0.0 };
                let psd = if n < 3 { gyro } else { accel };
                t[column][D + n] = known - psd * inputs[n][column];
            }
        }
    }

    /// Each block of three columns times `E^T`.
    #[inline(always)]
    fn turn_columns<const R: usize>(&self, t: &mut [Column<R>; POSE]) {
        let Some(e) = &self.turn else { return };
        for block in t.chunks_exact_mut(3) {
            let [x, y, z] = block else { continue };
            for row in 0..R {
                let (a, b, c) = (x[row], y[row], z[row]);
                x[row] = e[(0, 0)] * a + e[(0, 1)] * b + e[(0, 2)] * c;
                y[row] = e[(1, 0)] * a + e[(1, 1)] * b + e[(1, 2)] * c;
                z[row] = e[(2, 0)] * a + e[(2, 1)] * b + e[(2, 2)] * c;
            }
        }
    }

    /// Puts the first rows of `F T` into one column of P, and into its row: ROWS of them are computed, which
    /// reach the diagonal.
    #[inline(always)]
    fn finish<const D: usize, const R: usize, const ROWS: usize>(
        &self,
        p: &mut [Column<D>; D],
        t: &Column<R>,
        inputs: &[Column<POSE>; INPUTS],
        column: usize,
    ) {
        let mut rows = [0.0; ROWS];
        rows.copy_from_slice(&t[..ROWS]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let [c_1, c_2] = &self.couplings;
            if ROWS > 3 {
                rows[3 + i] += c_1[j] * t[k] - c_1[k] * t[j];
            }
            if ROWS > 6 {
                rows[6 + i] += c_2[j] * t[k] - c_2[k] * t[j] + self.dt_s * t[3 + i];
            }
        }
        let less = |n: usize| -t[D + n];
        // The forces do not act on the rotation.
        let mut rows: Column<ROWS> = if ROWS > 3 {
            let factors = [less(0), less(1), less(2), less(3), less(4), less(5)];
            let [a, b, c, d, e, f] = inputs;
            combined::<ROWS, _, _, _, _>(&rows, factors, [a, b, c, d, e, f])
        } else {
            let factors = [less(0), less(1), less(2)];
            combined::<ROWS, _, _, _, _>(&rows, factors, [&inputs[0], &inputs[1], &inputs[2]])
        };
        if let Some(e) = &self.turn {
            for block in rows.chunks_exact_mut(3) {
                let [x, y, z] = block else { continue };
                let (a, b, c) = (*x, *y, *z);
                *x = e[(0, 0)] * a + e[(0, 1)] * b + e[(0, 2)] * c;
                *y = e[(1, 0)] * a + e[(1, 1)] * b + e[(1, 2)] * c;
                *z = e[(2, 0)] * a + e[(2, 1)] * b + e[(2, 2)] * c;
            }
        }
        for row in 0..=column {
            p[column][row] = rows[row];
            p[row][column] = rows[row];
        }
    }
}
