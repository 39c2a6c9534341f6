//! The covariance goes where the estimate goes ([PAR] Proposition 2), and then left and right are one filter
//! ([PAR] Proposition 1).

mod common;

use common::{
    GRAVITY_W, NOISE, any_belief, any_input, any_state, assert_same_covariance, assert_within,
    derivative_at_zero, noise_of_scale, normal, seeded,
};
use inekf::filter::{Belief, Left, Right, Side, Transport, UpdateOptions, propagate, update};
use inekf::lie::SE23;
use inekf::model::{Discretisation, InertialState, NavState, PositionObservation};
use nalgebra::{SVector, Vector3};
use rand_chacha::ChaCha8Rng;

/// One pass, with transport.
const ONE_PASS: UpdateOptions = UpdateOptions {
    transport: Transport::Jacobian,
    ..UpdateOptions::PLAIN
};

/// A fix some metres away from where the belief is.
fn fix_beside(chi: &SE23, off_m: f64, rng: &mut ChaCha8Rng) -> PositionObservation {
    PositionObservation {
        position_w: chi.position + off_m * normal::<3, 1>(rng),
        covariance_w: noise_of_scale(&Vector3::repeat(0.3), rng),
        lever_arm_b: normal(rng),
    }
}

/// With transport the covariance is the one without, moved by the derivative of the error around the new
/// estimate by the error around the old one, at the correction.
fn assert_carried<G: InertialState<D>, S: Side, const D: usize>(
    what: &str,
    start: G,
    rng: &mut ChaCha8Rng,
) {
    let prior: Belief<G, S, D> = any_belief(start, 0.3, rng);
    let fix = fix_beside(start.pose(), 25.0, rng);
    for options in [ONE_PASS, UpdateOptions::ITERATED] {
        let (mut carried, mut left_behind) = (prior, prior);
        let xi = update(&mut carried, &fix, &options).expect("an update").xi;
        let without = UpdateOptions {
            transport: Transport::None,
            ..options
        };
        let same = update(&mut left_behind, &fix, &without).expect("an update");
        assert_eq!((same.xi, left_behind.mean), (xi, carried.mean));
        assert!(
            xi.rows(0, 3).norm() > 0.02,
            "{what}: a correction of consequence"
        );
        let j = derivative_at_zero(|d: &SVector<f64, D>| {
            S::difference(&carried.mean, &S::retract(&prior.mean, &(xi + d)))
        });
        let expected = j * left_behind.covariance.matrix() * j.transpose();
        assert_same_covariance(what, carried.covariance.matrix(), &expected, 1e-8);
        assert_eq!(
            carried.covariance.matrix(),
            &carried.covariance.matrix().transpose()
        );
    }
}

#[test]
fn the_covariance_is_carried_to_the_new_estimate() {
    let mut rng = seeded(101);
    for _ in 0..10 {
        let state = any_state(&mut rng);
        assert_carried::<SE23, Left, 9>("left, 9 states", state.pose, &mut rng);
        assert_carried::<SE23, Right, 9>("right, 9 states", state.pose, &mut rng);
        assert_carried::<NavState, Left, 15>("left, 15 states", state, &mut rng);
        assert_carried::<NavState, Right, 15>("right, 15 states", state, &mut rng);
    }
}

/// One belief through ten seconds of samples and fixes in both errors; returns it in left coordinates.
fn both_sides<G: InertialState<D>, const D: usize>(
    start: G,
    options: &UpdateOptions,
    seed: u64,
) -> (Belief<G, Left, D>, Belief<G, Left, D>) {
    let mut rng = seeded(seed);
    let mut left: Belief<G, Left, D> = any_belief(start, 0.2, &mut rng);
    let mut right = left.to_right();
    for _ in 0..10 {
        for _ in 0..50 {
            let mut measured = any_input(&mut rng);
            measured.force_b =
                0.1 * measured.force_b - left.mean.pose().rotation.inverse_rotate(&GRAVITY_W);
            let zoh = Discretisation::ZeroOrderHold;
            left = propagate(&left, &measured, &GRAVITY_W, 0.02, zoh, &NOISE);
            right = propagate(&right, &measured, &GRAVITY_W, 0.02, zoh, &NOISE);
        }
        let fix = fix_beside(left.mean.pose(), 2.0, &mut rng);
        update(&mut left, &fix, options).expect("an update");
        update(&mut right, &fix, options).expect("an update");
    }
    (left, right.to_left())
}

fn assert_one_filter<G: InertialState<D>, const D: usize>(what: &str, start: G, seed: u64) {
    // A fixed number of iterations: the criterion to stop is in coordinates, which differ.
    let iterated = UpdateOptions {
        iterations: 4,
        tolerance: 0.0,
        ..UpdateOptions::ITERATED
    };
    for options in [ONE_PASS, iterated] {
        let (left, right) = both_sides(start, &options, seed);
        let apart = Left::difference(&left.mean, &right.mean);
        let sigmas = left.covariance.matrix().diagonal().map(f64::sqrt);
        assert_within(
            what,
            &apart.component_div(&sigmas),
            &SVector::zeros(),
            1e-10,
        );
        assert_same_covariance(
            what,
            right.covariance.matrix(),
            left.covariance.matrix(),
            1e-10,
        );
    }
}

#[test]
fn with_transport_left_and_right_are_one_filter() {
    let mut rng = seeded(102);
    for seed in 110..115 {
        let state = any_state(&mut rng);
        assert_one_filter::<SE23, 9>("9 states", state.pose, seed);
        assert_one_filter::<NavState, 15>("15 states", state, seed);
    }
}

/// The converse, so that the test above is known to test something.
#[test]
fn without_transport_they_are_two() {
    let state = any_state(&mut seeded(103));
    let (left, right) = both_sides::<NavState, 15>(state, &UpdateOptions::PLAIN, 110);
    let apart = Left::difference(&left.mean, &right.mean);
    let sigmas = left.covariance.matrix().diagonal().map(f64::sqrt);
    assert!(apart.component_div(&sigmas).amax() > 0.1, "{apart}");
}
