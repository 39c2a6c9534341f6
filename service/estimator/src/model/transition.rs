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

/// How many of the coordinates are the pose.
const POSE: usize = 9;
/// Where the biases begin.
const BIAS: usize = POSE;

/// A column of the covariance, or of its product with `F^T`.
type Column<const R: usize> = [f64; R];

/// `base + sum_n factors_n columns_n`.
#[inline(always)]
fn combined<const R: usize, const N: usize>(
    base: &Column<R>,
    factors: [f64; N],
    columns: [&Column<R>; N],
) -> Column<R> {
    let mut sum = *base;
    for row in 0..R {
        let mut entry = sum[row];
        for n in 0..N {
            entry += factors[n] * columns[n][row];
        }
        sum[row] = entry;
    }
    sum
}

/// `matrix` times the three entries of `column` from `start` on.
#[inline(always)]
fn times<const R: usize>(matrix: &Matrix3<f64>, column: &Column<R>, start: usize) -> Vector3<f64> {
    let part = Vector3::new(column[start], column[start + 1], column[start + 2]);
    product(matrix, &part)
}

/// `matrix vector`, written out: nalgebra's general product of this size is a call.
#[inline(always)]
fn product(matrix: &Matrix3<f64>, vector: &Vector3<f64>) -> Vector3<f64> {
    let row = |i| matrix[(i, 0)] * vector.x + matrix[(i, 1)] * vector.y + matrix[(i, 2)] * vector.z;
    Vector3::new(row(0), row(1), row(2))
}

#[inline(always)]
fn part<const R: usize>(column: &Column<R>, start: usize) -> Vector3<f64> {
    Vector3::new(column[start], column[start + 1], column[start + 2])
}

impl Transition {
    /// `F P F^T + Q`, D = 9 without biases and 15 with them; of P the upper triangle counts, the result is
    /// exactly symmetric.
    #[inline(always)]
    pub(super) fn carry<const D: usize>(
        &self,
        p: &SMatrix<f64, D, D>,
        noise: &ImuNoise,
    ) -> SMatrix<f64, D, D> {
        const { assert!(D == POSE || D == POSE + 6) };
        let t = self.times_transposed(&p.data.0);
        let white = self.white(&t, noise);
        let mut carried = [[0.0; D]; D];
        for column in 0..POSE {
            let on_pose = self.row_block(&t[column], &white[column], column / 3);
            for row in 0..=column {
                carried[column][row] = on_pose[row];
                carried[row][column] = on_pose[row];
            }
        }
        for column in 0..POSE {
            for row in BIAS..D {
                carried[column][row] = t[column][row];
                carried[row][column] = t[column][row];
            }
        }
        for column in BIAS..D {
            for row in BIAS..D {
                carried[column][row] = p[(row, column)];
            }
        }
        if D > BIAS {
            for axis in 0..3 {
                carried[BIAS + axis][BIAS + axis] += noise.gyro_bias_psd * self.dt_s;
                carried[BIAS + 3 + axis][BIAS + 3 + axis] += noise.accel_bias_psd * self.dt_s;
            }
        }
        SMatrix::from_array_storage(nalgebra::ArrayStorage(carried))
    }

    /// `P F^T`, the columns of the pose.
    #[inline(always)]
    fn times_transposed<const D: usize>(&self, p: &[Column<D>; D]) -> [Column<D>; POSE] {
        let [c_1, c_2] = &self.couplings;
        let mut t = [[0.0; D]; POSE];
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            // (c x phi)_i = c_j phi_k - c_k phi_j
            if D == POSE {
                t[i] = p[i];
                t[3 + i] = combined(&p[3 + i], [c_1[j], -c_1[k]], [&p[k], &p[j]]);
                t[6 + i] = combined(
                    &p[6 + i],
                    [self.dt_s, c_2[j], -c_2[k]],
                    [&p[3 + i], &p[k], &p[j]],
                );
            } else {
                let row = |block: &Matrix3<f64>| [-block[(i, 0)], -block[(i, 1)], -block[(i, 2)]];
                let [n_0, n_1, n_2] = self.by_rate.each_ref().map(row);
                let [a_1, a_2] = self.by_force.each_ref().map(row);
                let b: [&Column<D>; 6] = core::array::from_fn(|n| &p[BIAS + n]);
                t[i] = combined(&p[i], n_0, [b[0], b[1], b[2]]);
                t[3 + i] = combined(
                    &p[3 + i],
                    [
                        c_1[j], -c_1[k], n_1[0], n_1[1], n_1[2], a_1[0], a_1[1], a_1[2],
                    ],
                    [&p[k], &p[j], b[0], b[1], b[2], b[3], b[4], b[5]],
                );
                t[6 + i] = combined(
                    &p[6 + i],
                    [
                        self.dt_s, c_2[j], -c_2[k], n_2[0], n_2[1], n_2[2], a_2[0], a_2[1], a_2[2],
                    ],
                    [&p[3 + i], &p[k], &p[j], b[0], b[1], b[2], b[3], b[4], b[5]],
                );
            }
        }
        if let Some(e) = &self.turn {
            for block in 0..3 {
                let start = 3 * block;
                let old = [t[start], t[start + 1], t[start + 2]];
                for i in 0..3 {
                    let mut sum = [0.0; D];
                    for row in 0..D {
                        sum[row] = e[(i, 0)] * old[0][row]
                            + e[(i, 1)] * old[1][row]
                            + e[(i, 2)] * old[2][row];
                    }
                    t[start + i] = sum;
                }
            }
        }
        t
    }

    /// The rows of the biases in T, less what white noise of the input adds to them: `psd / dt` times B^T.
    #[inline(always)]
    fn white<const D: usize>(&self, t: &[Column<D>; POSE], noise: &ImuNoise) -> [Column<6>; POSE] {
        let mut white = [[0.0; 6]; POSE];
        if D > BIAS {
            for column in 0..POSE {
                for row in 0..6 {
                    white[column][row] = t[column][BIAS + row];
                }
            }
        }
        // Over no time there is no noise, and no quotient.
        if self.dt_s > 0.0 {
            let (gyro, accel) = (noise.gyro_psd / self.dt_s, noise.accel_psd / self.dt_s);
            let mut less = |block: usize, start: usize, factor: f64, matrix: &Matrix3<f64>| {
                let turned = match &self.turn {
                    Some(e) => e * matrix,
                    None => *matrix,
                };
                for i in 0..3 {
                    for n in 0..3 {
                        white[3 * block + i][start + n] -= factor * turned[(i, n)];
                    }
                }
            };
            for block in 0..3 {
                less(block, 0, gyro, &self.by_rate[block]);
            }
            for block in 0..2 {
                less(block + 1, 3, accel, &self.by_force[block]);
            }
        }
        white
    }

    /// The first `3 (last + 1)` rows of `F T` in one column.
    #[inline(always)]
    fn row_block<const D: usize>(
        &self,
        t: &Column<D>,
        white: &Column<6>,
        last: usize,
    ) -> Column<POSE> {
        let turned = |a: Vector3<f64>| match &self.turn {
            Some(e) => product(e, &a),
            None => a,
        };
        let phi = part(t, 0);
        let mut rows = [0.0; POSE];
        let mut put = |start: usize, a: Vector3<f64>| {
            let a = turned(a);
            rows[start] = a.x;
            rows[start + 1] = a.y;
            rows[start + 2] = a.z;
        };
        put(0, phi - times(&self.by_rate[0], white, 0));
        if last >= 1 {
            let nu = part(t, 3);
            put(
                3,
                nu + self.couplings[0].cross(&phi)
                    - times(&self.by_rate[1], white, 0)
                    - times(&self.by_force[0], white, 3),
            );
            if last >= 2 {
                put(
                    6,
                    part(t, 6) + self.couplings[1].cross(&phi) + nu * self.dt_s
                        - times(&self.by_rate[2], white, 0)
                        - times(&self.by_force[1], white, 3),
                );
            }
        }
        rows
    }
}
