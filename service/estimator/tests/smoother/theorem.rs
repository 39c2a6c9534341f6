//! [IS] Theorem 1 at every iteration: with group-affine motions without noise, invariant smoothing keeps (i) every
//! motion, and (ii) the states that the prior can reach, `chi_i = chi_bar_i exp(F_{i-1} .. F_0 alpha)` with one alpha
//! in the support of P0. Its rivals keep neither.

use inekf::filter::{Additive, Belief, Covariance, Forster, Gtsam, Left, Right, Side};
use inekf::lie::{LieGroup, SE2, SE3, SE23};
use inekf::model::Observation;
use inekf::smoother::{Batch, BatchOptions, Chain, Jacobians, Motion};
use nalgebra::{SMatrix, SVector, Vector3};
use std::f64::consts::PI;

use crate::common::{normal, seeded};
use crate::drive::{by_imu, by_odometry};

/// One Gauss-Newton step as it comes.
const PLAIN: BatchOptions = BatchOptions {
    iterations: 1,
    tolerance: 0.0,
    jacobians: Jacobians::Exact,
    step_control: false,
};

const TOLERANCE: f64 = 1e-10;

/// How far a trajectory is from (i), and from (ii).
struct Violation {
    motion: f64,
    reach: f64,
}

fn violation<G, T, O, const D: usize>(
    chain: &Chain<G, Left, T, O, D>,
    support: &[usize],
    states: &[G],
) -> Violation
where
    G: LieGroup<D>,
    T: Motion<G, D>,
{
    let mut mean = chain.prior().mean;
    let mut alpha = Left::difference(&mean, &states[0]);
    let beyond = (0..D)
        .filter(|i| !support.contains(i))
        .map(|i| alpha[i].abs());
    let mut violation = Violation {
        motion: 0.0,
        reach: beyond.fold(0.0, f64::max),
    };
    for (link, pair) in chain.links().iter().zip(states.windows(2)) {
        let gap = Left::difference(&link.motion.apply(&pair[0]), &pair[1]);
        violation.motion = violation.motion.max(gap.amax());
        alpha = link.motion.left_jacobian(&mean) * alpha;
        mean = link.motion.apply(&mean);
        let gap = Left::difference(&Left::retract(&mean, &alpha), &pair[1]);
        violation.reach = violation.reach.max(gap.amax());
    }
    violation
}

/// The worst of eight iterations.
fn worst<G, S, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, Left, T, O, D>,
    support: &[usize],
) -> Violation
where
    G: LieGroup<D>,
    S: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    let mut batch = Batch::<G, S, D, M>::with_capacity(chain.states(), chain.sightings().len());
    batch.dead_reckon(chain);
    let mut worst = Violation {
        motion: 0.0,
        reach: 0.0,
    };
    let mut moved = 0.0;
    for _ in 0..8 {
        moved = f64::max(
            moved,
            batch.iterate(chain, &PLAIN).expect("a solution").largest,
        );
        let now = violation(chain, support, batch.states());
        worst.motion = worst.motion.max(now.motion);
        worst.reach = worst.reach.max(now.reach);
    }
    assert!(moved > 0.1, "there was something to estimate");
    worst
}

fn assert_theorem<G, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, Left, T, O, D>,
    support: &[usize],
) where
    G: LieGroup<D>,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    for (name, kept) in [
        ("left", worst::<G, Left, T, O, D, M>(chain, support)),
        ("right", worst::<G, Right, T, O, D, M>(chain, support)),
    ] {
        let (motion, reach) = (kept.motion, kept.reach);
        assert!(
            motion <= TOLERANCE,
            "{name}, {support:?}: motions off by {motion:e}"
        );
        assert!(
            reach <= TOLERANCE,
            "{name}, {support:?}: out of reach by {reach:e}"
        );
    }
}

fn assert_violated<G, S, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, Left, T, O, D>,
    support: &[usize],
) where
    G: LieGroup<D>,
    S: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    let broken = worst::<G, S, T, O, D, M>(chain, support);
    assert!(broken.motion > 0.1 && broken.reach > 0.1);
}

/// Standard deviations of 1 rad, 3 m/s or 3 m in the directions of `support` alone, correlated among themselves.
fn prior<G: LieGroup<D>, const D: usize>(mean: G, support: &[usize]) -> Belief<G, Left, D> {
    let mut root = SMatrix::<f64, D, D>::zeros();
    for (n, i) in support.iter().enumerate() {
        root[(*i, *i)] = if *i < G::ROTATION_DIM { 1.0 } else { 3.0 };
        if n > 0 {
            root[(*i, support[n - 1])] = 0.3;
        }
    }
    Belief::new(mean, Covariance::from_upper(root * root.transpose()))
}

/// An error of some standard deviations in the directions of `support`.
fn error<G: LieGroup<D>, const D: usize>(support: &[usize]) -> SVector<f64, D> {
    let mut error = SVector::zeros();
    for i in support {
        error[*i] = if *i < G::ROTATION_DIM { 0.9 } else { 4.0 };
    }
    error
}

#[test]
fn in_the_plane_invariant_smoothing_keeps_motions_and_reach_and_the_conventional_does_not() {
    let mut rng = seeded(831);
    // The heading alone, the position alone, and a heading wrong by 135 degrees.
    for support in [&[0][..], &[1, 2]] {
        let chain = by_odometry::<SE2, 3, 2>(
            prior(SE2::exp(&Vector3::new(2.0, 10.0, -5.0)), support),
            &error::<SE2, 3>(support),
            &SMatrix::zeros(),
            30,
            &mut rng,
        );
        assert_theorem::<_, _, _, 3, 2>(&chain, support);
        if support == [0] {
            assert_violated::<_, Additive, _, _, 3, 2>(&chain, support);
        }
    }
    let wrong = Vector3::new(0.75 * PI, 0.0, 0.0);
    let chain = by_odometry::<SE2, 3, 2>(
        prior(SE2::identity(), &[0]),
        &wrong,
        &SMatrix::zeros(),
        30,
        &mut rng,
    );
    assert_theorem::<_, _, _, 3, 2>(&chain, &[0]);
    assert_violated::<_, Gtsam, _, _, 3, 2>(&chain, &[0]);
}

#[test]
fn in_space_too() {
    let mut rng = seeded(832);
    for support in [&[0, 1, 2][..], &[2], &[3, 4, 5], &[2, 3, 4]] {
        let chain = by_odometry::<SE3, 6, 3>(
            prior(SE3::exp(&normal(&mut rng)), support),
            &error::<SE3, 6>(support),
            &SMatrix::zeros(),
            15,
            &mut rng,
        );
        assert_theorem::<_, _, _, 6, 3>(&chain, support);
        if support[0] < 3 {
            assert_violated::<_, Additive, _, _, 6, 3>(&chain, support);
        }
    }
}

#[test]
fn in_inertial_navigation_with_random_motion_too() {
    let mut rng = seeded(833);
    // Attitude; attitude and velocity (an unknown start of the alignment); velocity and position; heading alone.
    for support in [
        &[0, 1, 2][..],
        &[0, 1, 2, 3, 4, 5],
        &[3, 4, 5, 6, 7, 8],
        &[2],
    ] {
        let chain = by_imu(
            prior(SE23::exp(&normal(&mut rng)), support),
            &error::<SE23, 9>(support),
            &SMatrix::zeros(),
            16,
            &mut rng,
        );
        assert_theorem::<_, _, _, 9, 3>(&chain, support);
        if support[0] < 3 {
            assert_violated::<_, Gtsam, _, _, 9, 3>(&chain, support);
            assert_violated::<_, Forster, _, _, 9, 3>(&chain, support);
            assert_violated::<_, Additive, _, _, 9, 3>(&chain, support);
        }
    }
}
