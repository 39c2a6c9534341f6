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
//! some). F is never formed: `Lines` applies these lines to P from both sides. The noise, as large as a bias of
//! covariance `psd / dt`, joins them in between. [`propagate_dense`](crate::filter::propagate_dense) is the reference.

use nalgebra::{SMatrix, SVector, Vector3};

use super::imu::{ImuInput, ImuNoise};
use super::increment::Squares;
use super::lines::{INPUTS, Lines, POSE};
use crate::lanes::{Block, Pair};

/// F and the shape of Q of one interval, in the error of one side.
///
/// ```
/// use inekf::model::{Discretisation, ImuIncrement, ImuInput};
/// use nalgebra::Vector3;
///
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// // At rest and level, seen from the body: the force that holds it up goes the wrong way with a wrong tilt.
/// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: -g_w };
/// let transition = ImuIncrement::new(&at_rest, &g_w, 0.5, Discretisation::ZeroOrderHold).left_transition();
/// let [c_1, c_2] = transition.couplings;
/// assert!((c_1 - g_w * 0.5).norm() < 1e-12 && (c_2 - g_w * 0.125).norm() < 1e-12);
/// ```
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

impl Transition {
    /// Where the error `xi` is after the interval, if the input was off by `disturbance` (rad/s, m/s^2): `F xi + B d`
    /// on the pose, as a bias of minus that size would move it; biases stay. D = 9 or 15.
    ///
    /// ```
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let increment = ImuIncrement::new(&push, &g_w, 0.1, Discretisation::ZeroOrderHold);
    /// // A bias of the state is an input that was off by as much the other way.
    /// let mut biased = SVector::<f64, 15>::zeros();
    /// biased[9] = 0.01;
    /// let none = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::zeros() };
    /// let off = ImuInput { omega_b: Vector3::new(-0.01, 0.0, 0.0), ..none };
    /// let by_bias = increment.left_transition().moved(&biased, &none);
    /// let by_input = increment.left_transition().moved(&SVector::<f64, 9>::zeros(), &off);
    /// assert!((by_bias.fixed_rows::<9>(0) - by_input).norm() < 1e-15);
    /// ```
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
        let lines = Lines::new(
            self.dt_s,
            self.turn,
            &self.couplings,
            self.by_rate,
            self.by_force,
        );
        let t = lines.times_transposed(p);
        if D > POSE {
            let white = self.white(noise);
            lines.put_with_inputs::<D, 1>(&t, &white[0], 0, p);
            for (column, white) in [2, 4].into_iter().zip(&white[1..3]) {
                lines.put_with_inputs::<D, 2>(&t, white, column, p);
            }
            for (column, white) in [6, 7].into_iter().zip(&white[3..5]) {
                lines.put_with_inputs::<D, 3>(&t, white, column, p);
            }
        } else {
            lines.put_sum(&t, &self.noise_covariance(noise), p);
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
