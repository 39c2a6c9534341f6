//! Process noise from 1e-2 down to none: the solver stays exact, and the normal equations lose every digit.

use inekf::filter::Covariance;
use inekf::smoother::{Gaussian, LinearMeasurement, LinearMotion, Solver};
use nalgebra::{SMatrix, SVector};

use crate::common::{covariance_of_scale, noise_of_scale, normal, seeded};
use crate::reference::Problem;

const STATES: usize = 24;

/// States of which a measurement sees two components in five, under noise of the variance `q`.
fn problem(q: f64, prior: Covariance<5>) -> Problem<5, 2> {
    let mut rng = seeded(811);
    let motions = (1..STATES).map(|_| LinearMotion {
        transition: SMatrix::identity() + 0.15 * normal::<5, 5>(&mut rng),
        offset: normal(&mut rng),
        noise: noise_of_scale(&SVector::repeat(1.0), &mut rng) * q,
    });
    let motions = motions.collect();
    let measurements = (1..STATES).map(|state| {
        let measurement = LinearMeasurement {
            value: normal(&mut rng),
            jacobian: normal(&mut rng),
            noise: noise_of_scale(&SVector::repeat(3.0), &mut rng),
        };
        (state, measurement)
    });
    Problem {
        prior: Gaussian {
            mean: SVector::repeat(0.5),
            covariance: prior,
        },
        motions,
        measurements: measurements.collect(),
    }
}

/// The largest error of `solution`, relative to the largest unknown.
fn error(solution: &[SVector<f64, 5>], exact: &[SVector<f64, 5>]) -> f64 {
    let size = exact.iter().map(|xi| xi.amax()).fold(0.0, f64::max);
    let pairs = solution.iter().zip(exact);
    let worst = pairs.map(|(a, b)| (a - b).amax()).fold(0.0, |worst, x| {
        if x.is_nan() {
            f64::INFINITY
        } else {
            f64::max(worst, x)
        }
    });
    worst / size
}

#[test]
fn the_solution_stays_exact_as_noise_vanishes_and_that_of_the_normal_equations_does_not() {
    let prior = covariance_of_scale(&SVector::repeat(1.0), &mut seeded(812));
    let mut solver = Solver::with_capacity(STATES, STATES);
    for q in [
        1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 1e-16, 1e-20, 1e-40, 0.0,
    ] {
        let problem = problem(q, prior);
        let exact = problem.dense();
        let off = error(&problem.solve(&mut solver), &exact);
        assert!(off <= 1e-9, "Q = {q:e}: off by {off:e}");
    }
    let off_at = |q| {
        let problem = problem(q, prior);
        // Not even a solution is off by everything.
        let solution = problem.normal_equations();
        solution.map_or(f64::INFINITY, |solution| error(&solution, &problem.dense()))
    };
    assert!(off_at(1e-2) < 1e-9, "the two agree where noise is large");
    assert!(off_at(1e-16) > 0.5, "no digit is left: {:e}", off_at(1e-16));
}

#[test]
fn a_singular_prior_stays_exact_too() {
    let mut rng = seeded(813);
    let mut solver = Solver::with_capacity(STATES, STATES);
    for q in [1e-2, 1e-8, 1e-16, 0.0] {
        for rank in 0..5 {
            let mut root: SMatrix<f64, 5, 5> = normal(&mut rng);
            root.columns_mut(rank, 5 - rank).fill(0.0);
            let problem = problem(q, Covariance::from_upper(root * root.transpose()));
            let exact = problem.dense();
            let off = error(&problem.solve(&mut solver), &exact);
            assert!(off <= 1e-9, "Q = {q:e}, P of rank {rank}: off by {off:e}");
        }
    }
}
