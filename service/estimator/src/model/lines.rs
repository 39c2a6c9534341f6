//! The lines of a transition applied to a covariance from both sides, `F P F^T`, without F.
//!
//! F is given by what it does to an error `(phi, nu, rho, b_g, b_a)`, see [`Transition`](super::Transition):
//!
//! ```text
//! phi+ = E  phi                         - N_0 b_g
//! nu+  = E (nu  + c_1 x phi)            - N_1 b_g - A_1 b_a
//! rho+ = E (rho + c_2 x phi  + dt nu)   - N_2 b_g - A_2 b_a
//! ```
//!
//! The lines are applied to two columns of P at a time, and then, P being symmetric, to two rows of the result, as far
//! as the diagonal.

use nalgebra::Vector3;

use crate::lanes::{Block, Pair};

/// How many of the coordinates are the pose; the biases begin after them.
pub(super) const POSE: usize = 9;
/// How many inputs are noisy, and how many biases there are: three rates and three forces.
pub(super) const INPUTS: usize = 6;

/// A 3 x 3 matrix by columns, each entry twice.
type Twice = [[Pair; 3]; 3];

/// The lines of a transition, ready for two errors at a time.
pub(crate) struct Lines {
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
    /// The lines with these `c_1` and `c_2`, N and A; without `turn` E is the identity.
    #[inline(always)]
    pub fn new(
        dt_s: f64,
        turn: Option<Block>,
        couplings: &[Vector3<f64>; 2],
        by_rate: [Block; 3],
        by_force: [Block; 2],
    ) -> Self {
        let [c_1, c_2] = couplings;
        let [n_0, n_1, n_2] = by_rate;
        let [a_1, a_2] = by_force;
        Self {
            dt_s: Pair::splat(dt_s),
            turn: turn.map(twice),
            couplings: [
                [Pair::splat(c_1.x), Pair::splat(c_1.y), Pair::splat(c_1.z)],
                [Pair::splat(c_2.x), Pair::splat(c_2.y), Pair::splat(c_2.z)],
            ],
            by_rate: [twice(n_0), twice(n_1), twice(n_2)],
            by_force: [twice(a_1), twice(a_2)],
        }
    }

    /// Makes `result` `F P F^T + Q` for symmetric P and Q, exactly symmetric; D = 9 without biases and 15 with them.
    #[inline(always)]
    pub fn carry<const D: usize>(
        &self,
        p: &[[f64; D]; D],
        q: &[[f64; D]; D],
        result: &mut [[f64; D]; D],
    ) {
        const { assert!(D == POSE || D == POSE + INPUTS) };
        let t = self.times_transposed(p);
        self.put_sum(&t, q, result);
        for row in POSE..D {
            for column in 0..POSE {
                let entry = t[column][row] + q[column][row];
                result[column][row] = entry;
                result[row][column] = entry;
            }
            for column in POSE..D {
                result[column][row] = p[column][row] + q[column][row];
            }
        }
    }

    /// The columns of the pose of `P F^T`, two rows at a time: the lines applied to two columns of the symmetric P. Of the
    /// pose, what the upper triangle of the result needs.
    #[inline(always)]
    pub(super) fn times_transposed<const D: usize>(&self, p: &[[f64; D]; D]) -> [[f64; D]; POSE] {
        // In loops: unrolled, the code outgrows what the processor holds decoded. The last two of an odd number of rows
        // come first: then every pair that is read was written as one.
        let mut t = [[0.0; D]; POSE];
        if D > POSE {
            for row in [13, 0, 2, 8, 10, 12] {
                self.carry_rows::<D, 0>(p, row, &mut t);
            }
            self.carry_rows::<D, 1>(p, 4, &mut t);
            self.carry_rows::<D, 2>(p, 6, &mut t);
        } else {
            for row in [0, 2] {
                self.carry_rows::<D, 0>(p, row, &mut t);
            }
            self.carry_rows::<D, 1>(p, 4, &mut t);
            for row in [7, 6] {
                self.carry_rows::<D, 2>(p, row, &mut t);
            }
        }
        t
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
        let moved = self.moved::<D, FROM, 3>(&xi);
        for k in 3 * FROM..POSE {
            moved[k].store(&mut t[k], row);
        }
    }

    /// The pose of `F T + Q`, two columns at a time as far as the diagonal, and the same entries of two rows, in P. Of Q
    /// the lower triangle is read.
    #[inline(always)]
    pub(super) fn put_sum<const D: usize, const Q: usize>(
        &self,
        t: &[[f64; D]; POSE],
        q: &[[f64; Q]; Q],
        p: &mut [[f64; D]; D],
    ) {
        self.put_columns_of_sum::<D, Q, 1>(t, q, 0, p);
        self.put_columns_of_sum::<D, Q, 2>(t, q, 2, p);
        self.put_columns_of_sum::<D, Q, 2>(t, q, 4, p);
        self.put_columns_of_sum::<D, Q, 3>(t, q, 6, p);
        self.put_columns_of_sum::<D, Q, 3>(t, q, 7, p);
    }

    /// Two columns of it, which end in the first BLOCKS blocks.
    #[inline(always)]
    fn put_columns_of_sum<const D: usize, const Q: usize, const BLOCKS: usize>(
        &self,
        t: &[[f64; D]; POSE],
        q: &[[f64; Q]; Q],
        column: usize,
        p: &mut [[f64; D]; D],
    ) {
        let mut moved = self.moved::<D, 0, BLOCKS>(&two_columns(t, column));
        for row in 0..column + 2 {
            moved[row] = moved[row] + Pair::load(&q[row], column);
        }
        put_columns(&moved, column, p);
    }

    /// The same where the noise comes in as the biases do: `white` is its covariance with the two columns.
    #[inline(always)]
    pub(super) fn put_with_inputs<const D: usize, const BLOCKS: usize>(
        &self,
        t: &[[f64; D]; POSE],
        white: &[Pair; INPUTS],
        column: usize,
        p: &mut [[f64; D]; D],
    ) {
        let mut xi = two_columns(t, column);
        for n in 0..INPUTS {
            xi[POSE + n] = xi[POSE + n] - white[n];
        }
        put_columns(&self.moved::<D, 0, BLOCKS>(&xi), column, p);
    }

    /// `F xi` on the pose, in the blocks FROM..END; zero in the others.
    #[inline(always)]
    fn moved<const D: usize, const FROM: usize, const END: usize>(
        &self,
        xi: &[Pair; D],
    ) -> [Pair; POSE] {
        let mut moved = self.moved_freely::<D, FROM, END>(xi);
        if D > POSE {
            let mut biases = [Pair::splat(0.0); INPUTS];
            biases.copy_from_slice(&xi[POSE..]);
            self.subtract::<FROM, END>(&mut moved, &biases);
        }
        moved
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
