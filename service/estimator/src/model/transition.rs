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
//! itself, so that only the upper triangle of the pose is left to do; E comes last, block by block. The noise,
//! as large as a bias of covariance `psd / dt`, joins T in between.
//! [`propagate_dense`](crate::filter::propagate_dense) is the reference.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::imu::{ImuInput, ImuNoise};
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

/// `E (a, b, c)`.
#[inline(always)]
fn times(e: &Matrix3<f64>, a: f64, b: f64, c: f64) -> [f64; 3] {
    [
        e[(0, 0)] * a + e[(0, 1)] * b + e[(0, 2)] * c,
        e[(1, 0)] * a + e[(1, 1)] * b + e[(1, 2)] * c,
        e[(2, 0)] * a + e[(2, 1)] * b + e[(2, 2)] * c,
    ]
}

impl Transition {
    /// Where the error `xi` is after the interval, if the input was off by `disturbance` (rad/s, m/s^2): `F xi + B d`
    /// on the pose, as a bias of minus that size would move it; biases stay. D = 9 or 15.
    pub fn moved<const D: usize>(
        &self,
        xi: &SVector<f64, D>,
        disturbance: &ImuInput,
    ) -> SVector<f64, D> {
        const { assert!(D == POSE || D == POSE + INPUTS) };
        let part = |first: usize| Vector3::new(xi[first], xi[first + 1], xi[first + 2]);
        let (mut rate, mut force) = (disturbance.omega_b, disturbance.force_b);
        if D > POSE {
            rate -= part(POSE);
            force -= part(POSE + 3);
        }
        let (phi, nu, rho) = (part(0), part(3), part(6));
        let [c_1, c_2] = &self.couplings;
        let [n_0, n_1, n_2] = &self.by_rate;
        let [a_1, a_2] = &self.by_force;
        let before_turn = [
            phi + n_0 * rate,
            nu + c_1.cross(&phi) + n_1 * rate + a_1 * force,
            rho + c_2.cross(&phi) + nu * self.dt_s + n_2 * rate + a_2 * force,
        ];
        let mut moved = *xi;
        for (first, part) in (0..).step_by(3).zip(before_turn) {
            let turned = self.turn.map_or(part, |e| e * part);
            moved.fixed_rows_mut::<3>(first).copy_from(&turned);
        }
        moved
    }

    /// Makes P `F P F^T + Q`, exactly symmetric; D = 9 without biases and 15 with them.
    #[inline(always)]
    pub(super) fn carry<const D: usize>(&self, p: &mut SMatrix<f64, D, D>, noise: &ImuNoise) {
        const { assert!(D == POSE || D == POSE + INPUTS) };
        let p = &mut p.data.0;
        let inputs = self.input_columns();
        let mut t = self.times_transposed(p, &inputs);
        let densities = self.densities(noise);
        let mut pose = [[0.0; POSE]; POSE];
        for i in 0..3 {
            pose[i] = self.rows::<D, 3>(&t[i], &inputs, &densities, i);
            pose[3 + i] = self.rows::<D, 6>(&t[3 + i], &inputs, &densities, 3 + i);
            pose[6 + i] = self.rows::<D, 9>(&t[6 + i], &inputs, &densities, 6 + i);
        }
        self.turn_blocks(&pose, p);
        if D > POSE {
            self.turn_rows_of_biases(&mut t);
            for column in 0..POSE {
                for row in POSE..D {
                    p[column][row] = t[column][row];
                    p[row][column] = t[column][row];
                }
            }
            for axis in 0..3 {
                p[POSE + axis][POSE + axis] += noise.gyro_bias_psd * self.dt_s;
                p[POSE + 3 + axis][POSE + 3 + axis] += noise.accel_bias_psd * self.dt_s;
            }
        }
    }

    /// The covariance of each input over the interval, were it constant: `psd / dt`.
    #[inline(always)]
    fn densities(&self, noise: &ImuNoise) -> [f64; INPUTS] {
        // Over no time there is no noise, and no quotient.
        let rate = if self.dt_s > 0.0 {
            1.0 / self.dt_s
        } else {
            0.0
        };
        let (gyro, accel) = (noise.gyro_psd * rate, noise.accel_psd * rate);
        [gyro, gyro, gyro, accel, accel, accel]
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

    /// The columns of the pose in `P F^T`, before the turn.
    #[inline(always)]
    fn times_transposed<const D: usize>(
        &self,
        p: &[Column<D>; D],
        inputs: &[Column<POSE>; INPUTS],
    ) -> [Column<D>; POSE] {
        let [c_1, c_2] = &self.couplings;
        let mut t = [[0.0; D]; POSE];
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            // (c x phi)_i = c_j phi_k - c_k phi_j
            let (phi_j, phi_k, nu) = (&p[j], &p[k], &p[3 + i]);
            if D == POSE {
                t[i] = p[i];
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

    /// The first rows of `F T` in one column, before the turn; the ROWS of them that are not zero reach the
    /// diagonal. What the white noise of the input adds comes in as if it were a bias of covariance `psd / dt`.
    #[inline(always)]
    fn rows<const D: usize, const ROWS: usize>(
        &self,
        t: &Column<D>,
        inputs: &[Column<POSE>; INPUTS],
        densities: &[f64; INPUTS],
        column: usize,
    ) -> Column<POSE> {
        let [c_1, c_2] = &self.couplings;
        let mut rows = [0.0; POSE];
        rows[..ROWS].copy_from_slice(&t[..ROWS]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            if ROWS > 3 {
                rows[3 + i] += c_1[j] * t[k] - c_1[k] * t[j];
            }
            if ROWS > 6 {
                rows[6 + i] += c_2[j] * t[k] - c_2[k] * t[j] + self.dt_s * t[3 + i];
            }
        }
        let less = |n: usize| {
            let known = if D > POSE { t[POSE + n] } else { 0.0 };
            densities[n] * inputs[n][column] - known
        };
        let [rate_x, rate_y, rate_z, force_x, force_y, force_z] = inputs;
        // The forces do not act on the rotation.
        if ROWS > 3 {
            let factors = [less(0), less(1), less(2), less(3), less(4), less(5)];
            let columns = [rate_x, rate_y, rate_z, force_x, force_y, force_z];
            combined::<ROWS, _, _, _, _>(&rows, factors, columns)
        } else {
            let factors = [less(0), less(1), less(2)];
            combined::<ROWS, _, _, _, _>(&rows, factors, [rate_x, rate_y, rate_z])
        }
    }

    /// Puts `E X E^T` for each block X of the upper triangle of `pose` into P, and its transpose below.
    #[inline(always)]
    fn turn_blocks<const D: usize>(&self, pose: &[Column<POSE>; POSE], p: &mut [Column<D>; D]) {
        for (top, left) in [(0, 0), (0, 3), (0, 6), (3, 3), (3, 6), (6, 6)] {
            let x = |i: usize, j: usize| pose[left + j][top + i];
            let columns = match &self.turn {
                Some(e) => {
                    // The rows of X E^T, then the columns of E times that.
                    let row = |i: usize| times(e, x(i, 0), x(i, 1), x(i, 2));
                    let half = [row(0), row(1), row(2)];
                    let column = |j: usize| times(e, half[0][j], half[1][j], half[2][j]);
                    [column(0), column(1), column(2)]
                }
                None => {
                    let column = |j: usize| [x(0, j), x(1, j), x(2, j)];
                    [column(0), column(1), column(2)]
                }
            };
            for (j, column) in columns.iter().enumerate() {
                // Of a block on the diagonal the upper triangle counts.
                let rows = if top == left { j + 1 } else { 3 };
                for (i, entry) in column.iter().enumerate().take(rows) {
                    p[left + j][top + i] = *entry;
                    p[top + i][left + j] = *entry;
                }
            }
        }
    }

    /// Each block of three columns times `E^T`, in the rows of the biases.
    #[inline(always)]
    fn turn_rows_of_biases<const D: usize>(&self, t: &mut [Column<D>; POSE]) {
        let Some(e) = &self.turn else { return };
        for block in t.chunks_exact_mut(3) {
            let [x, y, z] = block else { continue };
            for row in POSE..D {
                [x[row], y[row], z[row]] = times(e, x[row], y[row], z[row]);
            }
        }
    }
}
