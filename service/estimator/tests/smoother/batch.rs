//! Batch smoothing on every group and in every parametrisation: each iteration against a dense Gauss-Newton step in
//! the parametrisation's own coordinates with numerical Jacobians, the minimum against the gradient, and the cost
//! along the way.

use inekf::filter::{Additive, Belief, Covariance, Forster, Gtsam, Left, Right, Side};
use inekf::lie::{LieGroup, SE2, SE3, SE23};
use inekf::model::{Discretisation, Observation, PositionObservation};
use inekf::smoother::{
    Batch, BatchOptions, Chain, Jacobians, Motion, Preintegration, SmootherError,
};
use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector, Vector3};

use crate::align_straight::{first, fixes, motions};
use crate::common::{normal, seeded};
use crate::drive::{Drive, by_imu, by_odometry, fix, full, gap};

/// One Gauss-Newton step as it comes.
const PLAIN: BatchOptions = BatchOptions {
    iterations: 1,
    tolerance: 0.0,
    jacobians: Jacobians::Exact,
    step_control: false,
};

/// Every residual of the chain, each with the identity as its covariance: the cost is the squared norm. The noise of
/// the links, which lives in body axes, is turned into those of the chart as `around` says.
fn residuals<G, S, P, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, P, T, O, D>,
    states: &[G],
    around: &[G],
) -> DVector<f64>
where
    G: LieGroup<D>,
    S: Side,
    P: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    fn whitened<const R: usize>(
        residual: &SVector<f64, R>,
        covariance: &SMatrix<f64, R, R>,
    ) -> Vec<f64> {
        let root = Cholesky::new(*covariance)
            .expect("a regular covariance")
            .l();
        let white = root
            .solve_lower_triangular(residual)
            .expect("a regular root");
        white.iter().copied().collect()
    }
    let prior = chain.prior();
    let mut all = whitened(
        &P::difference(&prior.mean, &states[0]),
        prior.covariance.matrix(),
    );
    for (i, link) in chain.links().iter().enumerate() {
        let residual = S::Residual::difference(&link.motion.apply(&states[i]), &states[i + 1]);
        let to_body = S::Residual::to_left(&link.motion.apply(&around[i]));
        all.extend(whitened(&(to_body * residual), &link.noise));
    }
    for sighting in chain.sightings() {
        let residual = sighting.observation.residual(&states[sighting.state]);
        all.extend(whitened(&residual, &sighting.observation.noise()));
    }
    DVector::from_vec(all)
}

fn perturbed<G: LieGroup<D>, S: Side, const D: usize>(
    states: &[G],
    index: usize,
    step: f64,
) -> Vec<G> {
    let mut states = states.to_vec();
    let mut xi = SVector::<f64, D>::zeros();
    xi[index % D] = step;
    states[index / D] = S::retract(&states[index / D], &xi);
    states
}

/// The derivative of all residuals in the coordinates of S, by central differences of fourth order.
fn jacobian<G, S, P, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, P, T, O, D>,
    states: &[G],
) -> DMatrix<f64>
where
    G: LieGroup<D>,
    S: Side,
    P: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    const STEP: f64 = 3e-4;
    let columns: Vec<_> = (0..states.len() * D)
        .map(|index| {
            let at = |steps: f64| {
                let moved = perturbed::<G, S, D>(states, index, steps * STEP);
                residuals::<G, S, P, T, O, D, M>(chain, &moved, states)
            };
            ((at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0))) / (12.0 * STEP)
        })
        .collect();
    DMatrix::from_columns(&columns)
}

/// One Gauss-Newton step in the coordinates of S, dense.
fn dense_step<G, S, P, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, P, T, O, D>,
    states: &[G],
) -> Vec<G>
where
    G: LieGroup<D>,
    S: Side,
    P: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    let jacobian = jacobian::<G, S, P, T, O, D, M>(chain, states);
    let residuals = residuals::<G, S, P, T, O, D, M>(chain, states, states);
    let factored = jacobian.qr();
    let right = factored.q().transpose() * residuals;
    let step = factored
        .r()
        .solve_upper_triangular(&-right)
        .expect("a regular problem");
    states
        .iter()
        .enumerate()
        .map(|(i, chi)| S::retract(chi, &step.fixed_rows::<D>(i * D).into_owned()))
        .collect()
}

fn assert_parametrisation<G, S, T, O, const D: usize, const M: usize>(
    name: &str,
    chain: &Chain<G, Left, T, O, D>,
) where
    G: LieGroup<D>,
    S: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    let mut batch = Batch::<G, S, D, M>::with_capacity(chain.states(), chain.sightings().len());
    batch.dead_reckon(chain);
    for iteration in 0..4 {
        let expected = dense_step::<G, S, Left, T, O, D, M>(chain, batch.states());
        let cost = batch.cost(chain).expect("a cost");
        let plain = residuals::<G, S, Left, T, O, D, M>(chain, batch.states(), batch.states())
            .norm_squared();
        assert!((cost.square - plain).abs() <= 1e-9 * plain, "{name}: cost");
        assert!(cost.outside <= 1e-12);
        batch.iterate(chain, &PLAIN).expect("a solution");
        let off = gap(&expected, batch.states());
        assert!(off <= 1e-6, "{name}, iteration {iteration}: off by {off:e}");
    }

    // The additive chart turns the noise of the links as the trajectory says: its fixed point is no minimum of a cost.
    let options = BatchOptions {
        iterations: 100,
        step_control: false,
        ..BatchOptions::default()
    };
    let done = batch.smooth(chain, &options).expect("a solution");
    assert!(done.converged, "{name}");
    let jacobian = jacobian::<G, S, Left, T, O, D, M>(chain, batch.states());
    let residuals = residuals::<G, S, Left, T, O, D, M>(chain, batch.states(), batch.states());
    let slope = jacobian.tr_mul(&residuals).amax() / jacobian.amax();
    assert!(
        slope <= 1e-7,
        "{name}: the minimum has a slope of {slope:e}"
    );
    // Every share of the curvature is known there: the covariance of the newest state.
    let inverse = (jacobian.tr_mul(&jacobian))
        .try_inverse()
        .expect("a regular problem");
    let n = inverse.nrows();
    let expected = SMatrix::<f64, D, D>::from_fn(|i, j| inverse[(n - D + i, n - D + j)]);
    let to_left = S::to_left(&batch.states()[chain.states() - 1]);
    let expected = to_left * expected * to_left.transpose();
    let off = (batch.newest_covariance().matrix() - expected).amax() / expected.amax();
    assert!(off <= 1e-6, "{name}: covariance off by {off:e}");
}

fn assert_every_parametrisation<G, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, Left, T, O, D>,
) where
    G: LieGroup<D>,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    assert_parametrisation::<G, Left, T, O, D, M>("left", chain);
    assert_parametrisation::<G, Right, T, O, D, M>("right", chain);
    assert_parametrisation::<G, Gtsam, T, O, D, M>("GTSAM", chain);
    assert_parametrisation::<G, Forster, T, O, D, M>("Forster", chain);
    assert_parametrisation::<G, Additive, T, O, D, M>("additive", chain);
}

#[test]
fn every_iteration_is_a_dense_gauss_newton_step_in_the_coordinates_of_its_parametrisation() {
    let mut rng = seeded(851);
    let prior = Belief::new(
        SE2::exp(&normal(&mut rng)),
        Covariance::from_upper(full(0.5, &mut rng)),
    );
    let q = full(0.05, &mut rng);
    let chain = by_odometry::<SE2, 3, 2>(prior, &SVector::repeat(0.5), &q, 8, &mut rng);
    assert_every_parametrisation::<_, _, _, 3, 2>(&chain);

    let prior = Belief::new(
        SE3::exp(&normal(&mut rng)),
        Covariance::from_upper(full(0.5, &mut rng)),
    );
    let q = full(0.05, &mut rng);
    let chain = by_odometry::<SE3, 6, 3>(prior, &SVector::repeat(0.4), &q, 6, &mut rng);
    assert_every_parametrisation::<_, _, _, 6, 3>(&chain);

    let prior = Belief::new(
        SE23::exp(&normal(&mut rng)),
        Covariance::from_upper(full(0.4, &mut rng)),
    );
    let q = full(0.05, &mut rng);
    let chain = by_imu(prior, &SVector::repeat(0.3), &q, 6, &mut rng);
    assert_every_parametrisation::<_, _, _, 9, 3>(&chain);
}

#[test]
fn frozen_jacobians_differ_along_the_way_and_not_without_noise() {
    let mut rng = seeded(852);
    let frozen = BatchOptions {
        jacobians: Jacobians::Frozen,
        ..PLAIN
    };
    let run = |chain: &Drive<SE2, _, 3, 2>, options: &BatchOptions| {
        let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(9, 8);
        batch.dead_reckon(chain);
        for _ in 0..3 {
            batch.iterate(chain, options).expect("a solution");
        }
        batch.states().to_vec()
    };
    // A prior on the heading alone is the same either way, and so are links that hold exactly.
    let prior: Belief<SE2, Left, 3> = Belief::new(
        SE2::identity(),
        Covariance::from_variances(&Vector3::new(1.0, 0.0, 0.0)),
    );
    let error = Vector3::new(0.8, 0.0, 0.0);
    let none = by_odometry::<SE2, 3, 2>(prior, &error, &SMatrix::zeros(), 8, &mut rng);
    assert!(gap(&run(&none, &PLAIN), &run(&none, &frozen)) < 1e-10);
    let some = by_odometry::<SE2, 3, 2>(prior, &error, &full(0.2, &mut rng), 8, &mut rng);
    assert!(gap(&run(&some, &PLAIN), &run(&some, &frozen)) > 1e-6);
}

/// [IS] section V as one batch of 41 states: preintegrated motions of 1 s, fixes of 3 m, a known start, a heading
/// wrong by 80 degrees and nothing known of attitude and velocity.
fn alignment() -> Chain<SE23, Left, Preintegration<SE23, 9>, PositionObservation, 9> {
    let mut chain = Chain::with_capacity(first(), 41, 40);
    for (motion, fix) in motions(Discretisation::ZeroOrderHold)
        .into_iter()
        .zip(fixes())
    {
        chain.advance(motion, *motion.noise().matrix());
        chain.observe(fix);
    }
    chain
}

fn costs<S: Side>(options: &BatchOptions) -> (Vec<f64>, Vec<f64>) {
    let chain = alignment();
    let mut batch = Batch::<SE23, S, 9, 3>::with_capacity(41, 40);
    batch.dead_reckon(&chain);
    let mut costs = vec![batch.cost(&chain).expect("a cost").square];
    let mut shares = Vec::new();
    for _ in 0..12 {
        shares.push(batch.iterate(&chain, options).expect("a step").share);
        costs.push(batch.cost(&chain).expect("a cost").square);
    }
    (costs, shares)
}

fn never_rises(costs: &[f64]) -> bool {
    costs
        .windows(2)
        .all(|pair| pair[1] <= pair[0] * (1.0 + 1e-9))
}

#[test]
fn no_step_of_invariant_smoothing_raises_the_cost_of_the_alignment() {
    let controlled = BatchOptions {
        step_control: true,
        ..PLAIN
    };
    // By itself: the control never has to shorten a step.
    let (free, _) = costs::<Left>(&PLAIN);
    assert!(never_rises(&free), "{free:?}");
    assert!(free[4] < 1.01 * free[12], "four steps are enough: {free:?}");
    let (_, shares) = costs::<Left>(&controlled);
    assert!(shares.iter().all(|share| *share == 1.0), "{shares:?}");
    // The same cost in GTSAM's chart rises at the first full step, and falls under control.
    let (free, _) = costs::<Gtsam>(&PLAIN);
    assert!(free[1] > 1000.0 * free[0], "{free:?}");
    let (costs, shares) = costs::<Gtsam>(&controlled);
    assert!(never_rises(&costs), "{costs:?}");
    assert!(shares[0] < 1.0, "{shares:?}");
}

#[test]
fn what_cannot_be_smoothed_is_refused_and_changes_nothing() {
    let mut rng = seeded(853);
    let prior: Belief<SE2, Left, 3> =
        Belief::new(SE2::identity(), Covariance::from_upper(full(0.5, &mut rng)));
    let mut chain =
        by_odometry::<SE2, 3, 2>(prior, &SVector::zeros(), &full(0.1, &mut rng), 4, &mut rng);
    let options = BatchOptions::default();
    let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(5, 5);
    let wrong = Err(SmootherError::WrongLength {
        states: 0,
        expected: 5,
    });
    assert_eq!(batch.smooth(&chain, &options), wrong);

    batch.dead_reckon(&chain);
    let before = batch.states().to_vec();
    chain.observe(fix(SVector::repeat(f64::NAN), 1.0));
    assert_eq!(batch.iterate(&chain, &PLAIN), Err(SmootherError::NotFinite));
    assert!(batch.iterate(&chain, &options).is_err());
    assert_eq!(batch.states(), before);
}
