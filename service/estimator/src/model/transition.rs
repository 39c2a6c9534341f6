//! One interval's effect on the error of an inertial state, by blocks of three: `P+ = F P F^T + Q` at a
//! fifth of the dense cost.
//!
//! With rotation, velocity, position and biases `(phi, nu, rho, b_g, b_a)`, both noises entering as the biases
//! do, the error moves by
//!
//! ```text
//! phi+ = E  phi                         - N_0 b_g
//! nu+  = E (nu  + c_1 x phi)            - N_1 b_g - A_1 b_a
//! rho+ = E (rho + c_2 x phi  + dt nu)   - N_2 b_g - A_2 b_a
//! ```
//!
//! on every side of the estimate ([`filter::Side`](crate::filter::Side) gives the blocks; E is the identity on
//! some). F is never formed: these lines are applied to two columns of P at a time, and then, P being symmetric, to
//! two rows of the result, as far as the diagonal. The noise, as large as a bias of covariance `psd / dt`, joins them
//! in between. [`propagate_dense`](crate::filter::propagate_dense) is the reference.

use nalgebra::{SMatrix, SVector, Vector3};

use super::imu::{ImuInput, ImuNoise};
use super::increment::Squares;
use crate::lanes::{Block, Pair};

/// F and the shape of Q of one interval, in the error of one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// Length of the interval, s.
    pub dt_s: f64,
    /// E; `None` for the identity.
    pub(crate) turn: Option<Block>,
    /// `c_1`, m/s, and `c_2`, m.
    pub couplings: [Vector3<f64>; 2],
    /// `N_0`, `N_1` and `N_2`: a change of the angular rate, rad/s.
    pub(crate) by_rate: [Block; 3],
    /// `A_1` and `A_2`: a change of the specific force, m/s^2.
    pub(crate) by_force: [Block; 2],
    /// `N_0 N_0^T` and `A_j A_i^T`.
    pub(crate) squares: Squares,
}

/// How many of the coordinates are the pose; the biases begin after them.
const POSE: usize = 9;
/// How many inputs are noisy, and how many biases there are: three rates and three forces.
const INPUTS: usize = 6;

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
        let [by_rate_0, by_rate_1, by_rate_2] = self.by_rate.map(|n| n.apply(&rate));
        let [by_force_1, by_force_2] = self.by_force.map(|a| a.apply(&force));
        let free = [
            phi,
            nu + c_1.cross(&phi),
            rho + c_2.cross(&phi) + nu * self.dt_s,
        ];
        let by_input = [by_rate_0, by_rate_1 + by_force_1, by_rate_2 + by_force_2];
        let mut moved = *xi;
        for (block, (free, by_input)) in free.into_iter().zip(by_input).enumerate() {
            let turned = self.turn.map_or(free, |e| e.apply(&free));
            moved
                .fixed_rows_mut::<3>(3 * block)
                .copy_from(&(turned + by_input));
        }
        moved
    }

    /// Makes P `F P F^T + Q`, exactly symmetric; D = 9 without biases and 15 with them.
    #[inline(always)]
    pub(super) fn carry<const D: usize>(&self, p: &mut SMatrix<f64, D, D>, noise: &ImuNoise) {
        const { assert!(D == POSE || D == POSE + INPUTS) };
        let p = &mut p.data.0;
        let lines = Lines::new(self);
        // P F^T, two rows at a time: the lines applied to two columns of the symmetric P. Of the pose, what the upper
        // triangle of the result needs. In loops: unrolled, the code outgrows what the processor holds decoded. The
        // last two of an odd number of rows come first: then every pair that is read was written as one.
        let mut t = [[0.0; D]; POSE];
        if D > POSE {
            for row in [13, 0, 2, 8, 10, 12] {
                lines.carry_rows::<D, 0>(p, row, &mut t);
            }
            lines.carry_rows::<D, 1>(p, 4, &mut t);
            lines.carry_rows::<D, 2>(p, 6, &mut t);
        } else {
            for row in [0, 2] {
                lines.carry_rows::<D, 0>(p, row, &mut t);
            }
            lines.carry_rows::<D, 1>(p, 4, &mut t);
            for row in [7, 6] {
                lines.carry_rows::<D, 2>(p, row, &mut t);
            }
        }
        // F (P F^T) + Q, two columns at a time, as far as the diagonal.
        if D > POSE {
            let white = self.white(noise);
            lines.carry_columns_with_biases::<D, 1>(&t, &white[0], 0, p);
            for (column, white) in [2, 4].into_iter().zip(&white[1..3]) {
                lines.carry_columns_with_biases::<D, 2>(&t, white, column, p);
            }
            for (column, white) in [6, 7].into_iter().zip(&white[3..5]) {
                lines.carry_columns_with_biases::<D, 3>(&t, white, column, p);
            }
        } else {
            let q = self.noise_covariance(noise);
            lines.carry_columns::<D, 1>(&t, &q, 0, p);
            lines.carry_columns::<D, 2>(&t, &q, 2, p);
            lines.carry_columns::<D, 2>(&t, &q, 4, p);
            lines.carry_columns::<D, 3>(&t, &q, 6, p);
            lines.carry_columns::<D, 3>(&t, &q, 7, p);
        }
        if D > POSE {
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

    /// The covariances of each rate and of each force over the interval, were they constant: `psd / dt`.
    #[inline(always)]
    fn densities(&self, noise: &ImuNoise) -> (f64, f64) {
        // Over no time there is no noise, and no quotient.
        let rate = if self.dt_s > 0.0 {
            1.0 / self.dt_s
        } else {
            0.0
        };
        (noise.gyro_psd * rate, noise.accel_psd * rate)
    }

    /// The covariance of the noise of each input with what it adds to the pose, `diag(psd / dt)` times the transpose
    /// of `[N_0 0; N_1 A_1; N_2 A_2]`: of the inputs in turn, in two coordinates of the pose from 0, 2, 4, 6 and 7 on.
    #[inline(always)]
    fn white(&self, noise: &ImuNoise) -> [[Pair; INPUTS]; 5] {
        let (gyro, accel) = self.densities(noise);
        let [n_0, n_1, n_2] = self.by_rate;
        let [a_1, a_2] = self.by_force;
        let [n_0, n_1, n_2] = [
            n_0.scaled(gyro).entries(),
            n_1.scaled(gyro).entries(),
            n_2.scaled(gyro).entries(),
        ];
        let [a_1, a_2] = [a_1.scaled(accel).entries(), a_2.scaled(accel).entries()];
        let mut white = [[Pair::splat(0.0); INPUTS]; 5];
        for n in 0..3 {
            white[0][n] = Pair::new(n_0[n][0], n_0[n][1]);
            white[1][n] = Pair::new(n_0[n][2], n_1[n][0]);
            white[2][n] = Pair::new(n_1[n][1], n_1[n][2]);
            white[3][n] = Pair::new(n_2[n][0], n_2[n][1]);
            white[4][n] = Pair::new(n_2[n][1], n_2[n][2]);
            white[1][3 + n] = Pair::new(0.0, a_1[n][0]);
            white[2][3 + n] = Pair::new(a_1[n][1], a_1[n][2]);
            white[3][3 + n] = Pair::new(a_2[n][0], a_2[n][1]);
            white[4][3 + n] = Pair::new(a_2[n][1], a_2[n][2]);
        }
        white
    }

    /// Q on the pose, the blocks of its lower triangle, by columns; zero above.
    #[inline(always)]
    fn noise_covariance(&self, noise: &ImuNoise) -> [Column; POSE] {
        let (gyro, accel) = self.densities(noise);
        let [n_0, n_1, n_2] = self.by_rate;
        let [s_0, s_1, s_2] = [n_0.scaled(gyro), n_1.scaled(gyro), n_2.scaled(gyro)];
        let [rate, first, both, second] = self.squares.blocks();
        let mut q = [[0.0; POSE]; POSE];
        put(&mut q, 0, 0, rate.scaled(gyro));
        put(&mut q, 3, 0, n_1.times_transposed(s_0));
        put(&mut q, 6, 0, n_2.times_transposed(s_0));
        put(
            &mut q,
            3,
            3,
            n_1.times_transposed(s_1) + first.scaled(accel),
        );
        put(&mut q, 6, 3, n_2.times_transposed(s_1) + both.scaled(accel));
        put(
            &mut q,
            6,
            6,
            n_2.times_transposed(s_2) + second.scaled(accel),
        );
        q
    }
}

/// A column of the pose.
type Column = [f64; POSE];

#[inline(always)]
fn put(matrix: &mut [Column; POSE], row: usize, column: usize, block: Block) {
    let entries = block.entries();
    for j in 0..3 {
        for i in 0..3 {
            matrix[column + j][row + i] = entries[j][i];
        }
    }
}

/// A 3 x 3 matrix by columns, each entry twice.
type Twice = [[Pair; 3]; 3];

/// The lines of a transition, ready for two errors at a time.
struct Lines {
    dt_s: Pair,
    turn: Option<Twice>,
    couplings: [[Pair; 3]; 2],
    by_rate: [Twice; 3],
    by_force: [Twice; 2],
}

#[inline(always)]
fn twice(block: Block) -> Twice {
    let entries = block.entries();
    let mut twice = [[Pair::splat(0.0); 3]; 3];
    for j in 0..3 {
        for i in 0..3 {
            twice[j][i] = Pair::splat(entries[j][i]);
        }
    }
    twice
}

/// Two columns of `(P F^T)^T`, from `column` on.
#[inline(always)]
fn two_columns<const D: usize>(t: &[[f64; D]; POSE], column: usize) -> [Pair; D] {
    let (first, second) = (&t[column], &t[column + 1]);
    let mut xi = [Pair::splat(0.0); D];
    for half in 0..D / 2 {
        let k = 2 * half;
        let [even, odd] = Pair::load(first, k).transposed(Pair::load(second, k));
        xi[k] = even;
        xi[k + 1] = odd;
    }
    xi[D - 1] = Pair::new(first[D - 1], second[D - 1]);
    xi
}

/// Puts two columns from `column` on, as far as the diagonal, into the symmetric P.
#[inline(always)]
fn put_columns<const D: usize>(columns: &[Pair; POSE], column: usize, p: &mut [[f64; D]; D]) {
    for row in 0..column + 2 {
        let [first, second] = columns[row].entries();
        if row <= column {
            p[row][column] = first;
            p[column][row] = first;
        }
        p[row][column + 1] = second;
        p[column + 1][row] = second;
    }
}

impl Lines {
    #[inline(always)]
    fn new(transition: &Transition) -> Self {
        let [c_1, c_2] = &transition.couplings;
        let [n_0, n_1, n_2] = transition.by_rate;
        let [a_1, a_2] = transition.by_force;
        Self {
            dt_s: Pair::splat(transition.dt_s),
            turn: transition.turn.map(twice),
            couplings: [
                [Pair::splat(c_1.x), Pair::splat(c_1.y), Pair::splat(c_1.z)],
                [Pair::splat(c_2.x), Pair::splat(c_2.y), Pair::splat(c_2.z)],
            ],
            by_rate: [twice(n_0), twice(n_1), twice(n_2)],
            by_force: [twice(a_1), twice(a_2)],
        }
    }

    /// Two rows of `P F^T` from the block FROM on, in T.
    #[inline(always)]
    fn carry_rows<const D: usize, const FROM: usize>(
        &self,
        p: &[[f64; D]; D],
        row: usize,
        t: &mut [[f64; D]; POSE],
    ) {
        let mut xi = [Pair::splat(0.0); D];
        for k in 0..D {
            xi[k] = Pair::load(&p[k], row);
        }
        let mut moved = self.moved_freely::<D, FROM, 3>(&xi);
        if D > POSE {
            let mut biases = [Pair::splat(0.0); INPUTS];
            biases.copy_from_slice(&xi[POSE..]);
            self.subtract::<FROM, 3>(&mut moved, &biases);
        }
        for k in 3 * FROM..POSE {
            moved[k].store(&mut t[k], row);
        }
    }

    /// Two columns of `F T + Q` as far as the diagonal, in the first BLOCKS blocks, and the same entries of two rows.
    #[inline(always)]
    fn carry_columns<const D: usize, const BLOCKS: usize>(
        &self,
        t: &[[f64; D]; POSE],
        q: &[Column; POSE],
        column: usize,
        p: &mut [[f64; D]; D],
    ) {
        let xi = two_columns(t, column);
        let mut moved = self.moved_freely::<D, 0, BLOCKS>(&xi);
        for row in 0..column + 2 {
            moved[row] = moved[row] + Pair::load(&q[row], column);
        }
        put_columns(&moved, column, p);
    }

    /// The same where there are biases, as which the noise comes in: `white` is its covariance with the two columns.
    #[inline(always)]
    fn carry_columns_with_biases<const D: usize, const BLOCKS: usize>(
        &self,
        t: &[[f64; D]; POSE],
        white: &[Pair; INPUTS],
        column: usize,
        p: &mut [[f64; D]; D],
    ) {
        let xi = two_columns(t, column);
        let mut biases = [Pair::splat(0.0); INPUTS];
        for n in 0..INPUTS {
            biases[n] = xi[POSE + n] - white[n];
        }
        let mut moved = self.moved_freely::<D, 0, BLOCKS>(&xi);
        self.subtract::<0, BLOCKS>(&mut moved, &biases);
        put_columns(&moved, column, p);
    }

    /// What the biases do to the pose, in the blocks FROM..END.
    #[inline(always)]
    fn subtract<const FROM: usize, const END: usize>(
        &self,
        pose: &mut [Pair; POSE],
        biases: &[Pair; INPUTS],
    ) {
        for block in FROM..END {
            for i in 0..3 {
                let mut entry = pose[3 * block + i];
                let [x, y, z] = &self.by_rate[block];
                entry = entry - x[i] * biases[0] - y[i] * biases[1] - z[i] * biases[2];
                if block > 0 {
                    let [x, y, z] = &self.by_force[block - 1];
                    entry = entry - x[i] * biases[3] - y[i] * biases[4] - z[i] * biases[5];
                }
                pose[3 * block + i] = entry;
            }
        }
    }

    /// The part of `F xi` that does not come from the biases, in the blocks FROM..END; zero in the others.
    #[inline(always)]
    fn moved_freely<const D: usize, const FROM: usize, const END: usize>(
        &self,
        xi: &[Pair; D],
    ) -> [Pair; POSE] {
        let mut moved = [Pair::splat(0.0); POSE];
        for block in FROM..END {
            let mut part = [xi[3 * block], xi[3 * block + 1], xi[3 * block + 2]];
            if block > 0 {
                let c = &self.couplings[block - 1];
                for i in 0..3 {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    if block > 1 {
                        part[i] = part[i] + xi[3 + i] * self.dt_s;
                    }
                    part[i] = part[i] + c[j] * xi[k] - c[k] * xi[j];
                }
            }
            for i in 0..3 {
                moved[3 * block + i] = match &self.turn {
                    Some(e) => e[0][i] * part[0] + e[1][i] * part[1] + e[2][i] * part[2],
                    None => part[i],
                };
            }
        }
        moved
    }
}
