//! The linear solver against 50-digit solutions, and against the dense [IS] (28).

use inekf::filter::Covariance;
use inekf::smoother::{Gaussian, LinearMeasurement, LinearMotion, SmootherError, Solver};
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::common::golden::{matrix, numbers, relative_error};
use crate::common::{covariance_of_scale, noise_of_scale, normal, seeded};
use crate::reference::Problem;

/// The problem of one golden case.
fn problem<const D: usize, const M: usize>(case: &Value) -> Problem<D, M> {
    let motions = case["F"].as_array().expect("links").iter().enumerate();
    Problem {
        prior: Gaussian {
            mean: matrix(&case["m0"]),
            covariance: Covariance::from_upper(matrix(&case["P0"])),
        },
        motions: motions
            .map(|(i, f)| LinearMotion {
                transition: matrix(f),
                offset: matrix(&case["a"][i]),
                noise: matrix(&case["Q"][i]),
            })
            .collect(),
        measurements: case["obs"]
            .as_array()
            .expect("observations")
            .iter()
            .map(|observation| {
                let measurement = LinearMeasurement {
                    value: matrix(&observation["z"]),
                    jacobian: matrix(&observation["H"]),
                    noise: matrix(&observation["N"]),
                };
                (
                    observation["k"].as_u64().expect("an index") as usize,
                    measurement,
                )
            })
            .collect(),
    }
}

fn assert_golden<const D: usize, const M: usize>(case: &Value) {
    let problem = problem::<D, M>(case);
    let mut solver = Solver::with_capacity(0, 0);
    let solution = problem.solve(&mut solver);
    let golden: Vec<SVector<f64, D>> = case["xi"]
        .as_array()
        .expect("unknowns")
        .iter()
        .map(matrix)
        .collect();
    let name = &case["name"];
    assert_eq!(solution.len(), golden.len());
    for (i, (actual, expected)) in solution.iter().zip(&golden).enumerate() {
        let off = (actual - expected).amax();
        assert!(off <= 1e-9, "{name}, unknown {i}: off by {off:e}");
    }
    // The oracle of the other tests, against the same digits; the reader of the file rounds some inputs' last one.
    for (actual, expected) in problem.dense().iter().zip(&golden) {
        let off = (actual - expected).amax();
        assert!(off <= 1e-12, "{name}, the dense oracle: off by {off:e}");
    }
    let newest = solver.newest();
    let off = relative_error(
        newest.covariance.matrix(),
        &matrix(&case["P_last_filtered"]),
    );
    assert!(off <= 1e-9, "{name}, covariance: off by {off:e}");
    let off = (newest.mean - matrix::<D, 1>(&case["m_last_filtered"])).amax();
    assert!(off <= 1e-9, "{name}, filtered mean: off by {off:e}");
}

#[test]
fn the_five_chains_are_solved_as_with_50_digits() {
    let file: Value =
        serde_json::from_str(include_str!("../data/solver_cases.json")).expect("valid JSON");
    let cases = file["cases"].as_array().expect("cases");
    assert_eq!(cases.len(), 5);
    for case in cases {
        match numbers(&case["m0"]).len() {
            5 => assert_golden::<5, 2>(case),
            9 => assert_golden::<9, 3>(case),
            other => panic!("no chain has dimension {other}"),
        }
    }
}

/// A random chain with none, one or two measurements of an unknown.
fn any_problem(rng: &mut ChaCha8Rng, states: usize) -> Problem<4, 2> {
    let mut measurements = Vec::new();
    for state in 0..states {
        for _ in 0..(state * 2 + 1) % 3 {
            measurements.push((
                state,
                LinearMeasurement {
                    value: normal(rng),
                    jacobian: normal(rng),
                    noise: noise_of_scale(&SVector::repeat(0.3), rng),
                },
            ));
        }
    }
    Problem {
        prior: Gaussian {
            mean: normal(rng),
            covariance: covariance_of_scale(&SVector::repeat(1.0), rng),
        },
        motions: (1..states)
            .map(|_| LinearMotion {
                transition: SMatrix::identity() + 0.3 * normal::<4, 4>(rng),
                offset: normal(rng),
                noise: noise_of_scale(&SVector::repeat(0.2), rng),
            })
            .collect(),
        measurements,
    }
}

#[test]
fn any_chain_is_solved_as_by_the_dense_formula() {
    let mut rng = seeded(801);
    let mut solver = Solver::with_capacity(12, 12);
    for states in [1, 2, 3, 8, 12] {
        let problem = any_problem(&mut rng, states);
        let expected = problem.dense();
        let solution = problem.solve(&mut solver);
        assert_eq!(solution.len(), states);
        for (actual, expected) in solution.iter().zip(&expected) {
            assert!((actual - expected).amax() <= 1e-12, "{states} states");
        }
        let off = solver.newest().mean - solution[states - 1];
        assert!(
            off.amax() <= 1e-12,
            "the newest is smoothed as it is filtered"
        );
    }
}

#[test]
fn a_solver_that_was_given_nothing_has_one_unknown_at_zero() {
    let mut solver = Solver::<3, 1>::with_capacity(4, 4);
    assert_eq!(solver.solve(), [SVector::<f64, 3>::zeros()]);
}

#[test]
fn a_measurement_without_a_covariance_is_refused_and_leaves_the_chain() {
    let mut rng = seeded(802);
    let problem = any_problem(&mut rng, 5);
    let mut solver = Solver::with_capacity(5, 5);
    let before = problem.solve(&mut solver);
    let broken = LinearMeasurement {
        value: SVector::zeros(),
        jacobian: SMatrix::zeros(),
        noise: -SMatrix::identity(),
    };
    assert_eq!(
        solver.measure(&broken),
        Err(SmootherError::InnovationNotPositiveDefinite { state: 4 })
    );
    assert_eq!(solver.solve(), before);
}
