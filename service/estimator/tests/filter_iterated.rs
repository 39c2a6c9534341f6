//! The iterated update is a minimiser: of `xi^T P^-1 xi + z^T N^-1 z`, from any start, without ever going up.
//! Oracles: the gradient by numerical differentiation, and a Levenberg-Marquardt on the normal equations with
//! numerical Jacobians.

mod common;

use common::drive::Drive;
use common::{
    any_belief, any_state, assert_within, covariance_of_scale, derivative_at_zero, noise_of_scale,
    normal, seeded, sigmas,
};
use inekf::filter::{Belief, Left, Side, UpdateOptions, update};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{HeadingObservation, NavState, Observation, PositionObservation};
use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

/// Iterates until nothing moves.
const TO_THE_END: UpdateOptions = UpdateOptions {
    iterations: 500,
    tolerance: 1e-12,
    ..UpdateOptions::ITERATED
};

/// The cost as a sum of squares: `r(xi) = (A xi, B z)` with `A^T A = P^-1`, `B^T B = N^-1`.
struct Problem<'a, G, S, O, const D: usize, const M: usize> {
    prior: &'a Belief<G, S, D>,
    observation: &'a O,
    prior_root: SMatrix<f64, D, D>,
    noise_root: SMatrix<f64, M, M>,
}

/// The inverse of the lower Cholesky factor.
fn inverse_root<const N: usize>(p: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let lower = Cholesky::new(*p).expect("positive definite").l();
    lower
        .solve_lower_triangular(&SMatrix::identity())
        .expect("regular")
}

impl<'a, G: LieGroup<D>, S: Side, O: Observation<G, D, M>, const D: usize, const M: usize>
    Problem<'a, G, S, O, D, M>
{
    fn new(prior: &'a Belief<G, S, D>, observation: &'a O) -> Self {
        Self {
            prior,
            observation,
            prior_root: inverse_root(prior.covariance.matrix()),
            noise_root: inverse_root(&observation.noise()),
        }
    }

    fn scaled_residual(&self, xi: &SVector<f64, D>) -> SVector<f64, M> {
        self.noise_root * self.observation.residual(&S::retract(&self.prior.mean, xi))
    }

    fn cost(&self, xi: &SVector<f64, D>) -> f64 {
        (self.prior_root * xi).norm_squared() + self.scaled_residual(xi).norm_squared()
    }

    /// The gradient at `xi`, per prior standard deviation of each component.
    fn scaled_gradient(&self, xi: &SVector<f64, D>) -> SVector<f64, D> {
        let sigmas = self.prior.covariance.matrix().diagonal().map(f64::sqrt);
        let along = |d: &SVector<f64, D>| {
            SVector::<f64, 1>::new(self.cost(&(xi + d.component_mul(&sigmas))))
        };
        derivative_at_zero(along).transpose()
    }

    /// Levenberg-Marquardt from the prior's mean, textbook.
    fn levenberg_marquardt(&self) -> SVector<f64, D> {
        let mut xi = SVector::zeros();
        let mut damping = 1e-3;
        for _ in 0..300 {
            let slope = derivative_at_zero(|d: &SVector<f64, D>| self.scaled_residual(&(xi + d)));
            let normal = self.prior_root.transpose() * self.prior_root + slope.transpose() * slope;
            let downhill = -(self.prior_root.transpose() * self.prior_root * xi
                + slope.transpose() * self.scaled_residual(&xi));
            let damped = normal + SMatrix::from_diagonal(&normal.diagonal()) * damping;
            let damped = DMatrix::from_column_slice(D, D, damped.as_slice());
            let step = damped
                .lu()
                .solve(&DVector::from_column_slice(downhill.as_slice()))
                .expect("regular");
            let next = xi + SVector::<f64, D>::from_column_slice(step.as_slice());
            if self.cost(&next) <= self.cost(&xi) {
                (xi, damping) = (next, damping / 5.0);
            } else {
                damping *= 4.0;
            }
        }
        xi
    }
}

/// A fix `off_m` away from where the belief is.
fn fix_beside(chi: &SE23, off_m: f64, sigma_m: f64, rng: &mut ChaCha8Rng) -> PositionObservation {
    PositionObservation {
        position_w: chi.position + off_m * normal::<3, 1>(rng),
        covariance_w: noise_of_scale(&Vector3::repeat(sigma_m), rng),
        lever_arm_b: normal(rng),
    }
}

/// What is asked of the second minimiser, which starts where the filter does.
#[derive(Clone, Copy)]
enum Second {
    Agrees,
    /// Where the cost has several minima it may end in a worse one.
    FindsNothingLower,
    NotAsked,
}

fn assert_minimum<G, S, O, const D: usize, const M: usize>(
    what: &str,
    prior: &Belief<G, S, D>,
    observation: &O,
    second: Second,
) where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
{
    let problem = Problem::new(prior, observation);
    let mut posterior = *prior;
    let correction = update(&mut posterior, observation, &TO_THE_END).expect("an update");
    let xi = correction.xi;
    let gradient = problem.scaled_gradient(&xi).amax();
    let before = problem.scaled_gradient(&SVector::zeros()).amax();
    assert!(
        gradient <= 1e-7 * before,
        "{what}: gradient {gradient:e} of {before:e}"
    );
    assert!(
        problem.cost(&xi) < problem.cost(&SVector::zeros()),
        "{what}: a minimum"
    );
    let gap = S::difference(&S::retract(&prior.mean, &xi), &posterior.mean);
    assert_within(what, &gap, &SVector::zeros(), 1e-11);

    let oracle = problem.levenberg_marquardt();
    match second {
        Second::Agrees => {
            let sigmas = prior.covariance.matrix().diagonal().map(f64::sqrt);
            let gap = (xi - oracle).component_div(&sigmas);
            assert_within(what, &gap, &SVector::zeros(), 1e-6);
        }
        Second::FindsNothingLower => {
            let (cost, other) = (problem.cost(&xi), problem.cost(&oracle));
            assert!(
                cost <= other * (1.0 + 1e-9),
                "{what}: {cost}, the oracle {other}"
            );
        }
        Second::NotAsked => {}
    }
}

/// Beside a belief whose attitude has this deviation (rad), in both groups, on both sides.
fn assert_minima(attitude: f64, second: Second, rng: &mut ChaCha8Rng) {
    for sigma_m in [0.02, 1.0] {
        for _ in 0..5 {
            let state = any_state(rng);
            let fix = fix_beside(&state.pose, 8.0, sigma_m, rng);
            let left: Belief<SE23, Left, 9> = any_belief(state.pose, attitude, rng);
            assert_minimum("position, left, 9", &left, &fix, second);
            assert_minimum("position, right, 9", &left.to_right(), &fix, second);
            let left: Belief<NavState, Left, 15> = any_belief(state, attitude, rng);
            assert_minimum("position, left, 15", &left, &fix, second);
            assert_minimum("position, right, 15", &left.to_right(), &fix, second);
            let heading = HeadingObservation {
                heading: state.pose.rotation.heading_rad() + 0.5,
                sigma: 0.02,
            };
            assert_minimum("heading, left, 15", &left, &heading, second);
        }
    }
}

#[test]
fn the_fixed_point_is_the_minimum() {
    assert_minima(0.05, Second::Agrees, &mut seeded(91));
}

#[test]
fn far_from_linear_it_is_a_minimum_still() {
    assert_minima(0.4, Second::FindsNothingLower, &mut seeded(92));
}

/// How wrong the heading is, and its standard deviation, degrees.
const WRONG: [(f64, f64); 4] = [(80.0, 50.0), (80.0, 90.0), (170.0, 90.0), (-170.0, 180.0)];

#[test]
fn a_precise_fix_on_a_wrong_heading_is_minimised_too() {
    for (wrong_deg, sigma_deg) in WRONG {
        for fix_sigma_m in [0.01, 0.1, 3.0] {
            let mut drive = Drive::start(93);
            let mut beliefs = [drive.belief::<Left>(wrong_deg, sigma_deg, fix_sigma_m)];
            let fix = drive.second(&mut beliefs, fix_sigma_m);
            let what = format!("{wrong_deg} deg wrong, {fix_sigma_m} m");
            assert_minimum(&what, &beliefs[0], &fix, Second::NotAsked);
        }
    }
}

/// The cost after every number of iterations.
fn assert_descent<S: Side>(prior: &Belief<SE23, S, 9>, fix: &PositionObservation) {
    let problem = Problem::new(prior, fix);
    let mut before = problem.cost(&SVector::zeros());
    for iterations in 2..=40 {
        let options = UpdateOptions {
            iterations,
            tolerance: 0.0,
            ..UpdateOptions::ITERATED
        };
        let mut posterior = *prior;
        let xi = update(&mut posterior, fix, &options).expect("an update").xi;
        let cost = problem.cost(&xi);
        assert!(
            cost <= before * (1.0 + 1e-9),
            "{iterations} iterations: {before} rose to {cost}"
        );
        before = cost;
    }
}

#[test]
fn no_iteration_raises_the_cost() {
    for (wrong_deg, sigma_deg) in WRONG {
        for fix_sigma_m in [0.01, 0.1, 3.0] {
            let mut drive = Drive::start(93);
            let mut left = [drive.belief::<Left>(wrong_deg, sigma_deg, fix_sigma_m)];
            let fix = drive.second(&mut left, fix_sigma_m);
            assert_descent(&left[0], &fix);
            assert_descent(&left[0].to_right(), &fix);
        }
    }
    // Far more curved than any vehicle: half a turn of deviation on an arm of 20 m.
    let mut rng = seeded(94);
    for _ in 0..30 {
        let chi = any_state(&mut rng).pose;
        let belief: Belief<SE23, Left, 9> =
            Belief::new(chi, covariance_of_scale(&sigmas(2.0), &mut rng));
        let mut fix = fix_beside(&chi, 15.0, 0.05, &mut rng);
        fix.lever_arm_b *= 20.0;
        assert_descent(&belief, &fix);
    }
}
