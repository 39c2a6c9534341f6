//! The linear problem of the smoothers solved in two other ways: by the dense [IS] (28) in 32 digits, and by the
//! normal equations, which invert P and Q.

use inekf::smoother::{Gaussian, LinearMeasurement, LinearMotion, Solver};
use nalgebra::{Cholesky, DMatrix, DVector, SVector};

use crate::extended::{Extended, Table};

/// A chain of linear Gaussian unknowns, all of it.
pub struct Problem<const D: usize, const M: usize> {
    pub prior: Gaussian<D>,
    pub motions: Vec<LinearMotion<D>>,
    /// Each with the index of its unknown, in order.
    pub measurements: Vec<(usize, LinearMeasurement<D, M>)>,
}

impl<const D: usize, const M: usize> Problem<D, M> {
    /// The solution of the code under test.
    pub fn solve(&self, solver: &mut Solver<D, M>) -> Vec<SVector<f64, D>> {
        let mut measurements = self.measurements.iter().peekable();
        solver.start(&self.prior);
        for state in 0..=self.motions.len() {
            if state > 0 {
                solver.advance(&self.motions[state - 1]);
            }
            while let Some((_, measurement)) = measurements.next_if(|(of, _)| *of == state) {
                solver
                    .measure(measurement)
                    .expect("a positive definite noise");
            }
        }
        solver.solve().to_vec()
    }

    /// `xi = A^-1 (b + K (n - L b))`, `L = H A^-1`, `K = Pi L^T (L Pi L^T + N)^-1`, in 32 digits.
    pub fn dense(&self) -> Vec<SVector<f64, D>> {
        let states = self.motions.len() + 1;
        let (rows, outputs) = (states * D, self.measurements.len() * M);
        // A^-1 has in block (i, j) the product of the transitions from j to i.
        let mut inverse = Table::zeros(rows, rows);
        let mut pi = Table::zeros(rows, rows);
        let mut b = Table::zeros(rows, 1);
        for i in 0..states {
            let (offset, noise) = match i {
                0 => (&self.prior.mean, self.prior.covariance.matrix()),
                _ => (&self.motions[i - 1].offset, &self.motions[i - 1].noise),
            };
            for row in 0..D {
                b[(i * D + row, 0)] = offset[row].into();
                inverse[(i * D + row, i * D + row)] = 1.0.into();
                for column in 0..D {
                    pi[(i * D + row, i * D + column)] = noise[(row, column)].into();
                }
            }
            if i > 0 {
                let f = &self.motions[i - 1].transition;
                for row in 0..D {
                    for column in 0..i * D {
                        let mut sum = Extended::from(0.0);
                        for k in 0..D {
                            sum = sum
                                + Extended::from(f[(row, k)]) * inverse[((i - 1) * D + k, column)];
                        }
                        inverse[(i * D + row, column)] = sum;
                    }
                }
            }
        }
        let mut h = Table::zeros(outputs, rows);
        let mut n = Table::zeros(outputs, 1);
        let mut noise = Table::zeros(outputs, outputs);
        for (k, (state, measurement)) in self.measurements.iter().enumerate() {
            for row in 0..M {
                n[(k * M + row, 0)] = measurement.value[row].into();
                for column in 0..D {
                    h[(k * M + row, state * D + column)] =
                        measurement.jacobian[(row, column)].into();
                }
                for column in 0..M {
                    noise[(k * M + row, k * M + column)] = measurement.noise[(row, column)].into();
                }
            }
        }
        let l = h.times(&inverse);
        let pi_lt = pi.times(&l.transpose());
        let innovation = l.times(&pi_lt).plus(&noise);
        let weighted = innovation.solve(&n.plus(&l.times(&b).negated()));
        let xi = inverse.times(&b.plus(&pi_lt.times(&weighted)));
        (0..states)
            .map(|i| SVector::from_fn(|row, _| xi[(i * D + row, 0)].into()))
            .collect()
    }

    /// The solution of `A^T W A xi = A^T W b` in double precision, W the inverse of all covariances; `None` where one
    /// of them or the left-hand side cannot be factored.
    pub fn normal_equations(&self) -> Option<Vec<SVector<f64, D>>> {
        let states = self.motions.len() + 1;
        let mut left = DMatrix::<f64>::zeros(states * D, states * D);
        let mut right = DVector::<f64>::zeros(states * D);
        let weight = Cholesky::new(*self.prior.covariance.matrix())?.inverse();
        add(&mut left, (0, 0), &weight);
        add_rows(&mut right, 0, &(weight * self.prior.mean));
        for (i, motion) in self.motions.iter().enumerate() {
            let weight = Cholesky::new(motion.noise)?.inverse();
            let (f, from, to) = (&motion.transition, i * D, (i + 1) * D);
            add(&mut left, (from, from), &(f.transpose() * weight * f));
            add(&mut left, (from, to), &-(f.transpose() * weight));
            add(&mut left, (to, from), &-(weight * f));
            add(&mut left, (to, to), &weight);
            add_rows(&mut right, from, &-(f.transpose() * weight * motion.offset));
            add_rows(&mut right, to, &(weight * motion.offset));
        }
        for (state, measurement) in &self.measurements {
            let weight = Cholesky::new(measurement.noise)?.inverse();
            let ht = measurement.jacobian.transpose();
            let at = state * D;
            add(&mut left, (at, at), &(ht * weight * measurement.jacobian));
            add_rows(&mut right, at, &(ht * weight * measurement.value));
        }
        let xi = Cholesky::new(left)?.solve(&right);
        Some(
            (0..states)
                .map(|i| SVector::from_fn(|row, _| xi[i * D + row]))
                .collect(),
        )
    }
}

fn add<const D: usize>(
    into: &mut DMatrix<f64>,
    (row, column): (usize, usize),
    block: &nalgebra::SMatrix<f64, D, D>,
) {
    let mut view = into.view_mut((row, column), (D, D));
    view += block;
}

fn add_rows<const D: usize>(into: &mut DVector<f64>, row: usize, block: &SVector<f64, D>) {
    let mut view = into.rows_mut(row, D);
    view += block;
}
