//! Left and right: the Jacobians against numerical ones, the change of coordinates for errors of any size,
//! and one belief propagated in both ([PAR] Proposition 1).

mod common;

use common::{
    GRAVITY_W, NOISE, any_belief, any_input, any_pose, any_state, assert_close,
    assert_same_covariance, assert_within, derivative_at_zero, normal, seeded,
};
use inekf::filter::{Belief, InertialSide, Left, Right, Side, propagate};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{Discretisation, InertialState, NavState};
use nalgebra::SVector;
use rand_chacha::ChaCha8Rng;

/// An error far from small: rotations of up to about 2.5 rad, the rest of some units.
fn large<const D: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, D> {
    let mut xi: SVector<f64, D> = 3.0 * normal::<D, 1>(rng);
    let norm = xi.rows(0, 3).norm();
    xi.rows_mut(0, 3).scale_mut(2.5 / norm.max(2.5));
    xi
}

fn assert_side<G: LieGroup<D>, S: Side, const D: usize>(chi: &G, rng: &mut ChaCha8Rng) {
    let xi = large::<D>(rng);
    let there = S::retract(chi, &xi);
    assert_close("the way back", &S::difference(chi, &there), &xi, 1e-11);

    // The definition, about a point away from the estimate.
    let numerical = derivative_at_zero(|d: &SVector<f64, D>| {
        S::difference(&there, &S::retract(chi, &(xi + d)))
    });
    assert_close("Jacobian", &S::jacobian::<G, D>(&xi), &numerical, 1e-9);

    // Exact for an error of any size, not to first order only.
    let same = Left::retract(chi, &xi);
    let carried = S::retract(chi, &(S::from_left::<G, D>(chi) * xi));
    let gap = Left::difference(&same, &carried);
    assert_within("change of coordinates", &gap, &SVector::zeros(), 1e-11);
    let back = S::to_left::<G, D>(chi) * S::from_left::<G, D>(chi);
    assert_within("to and fro", &back, &nalgebra::SMatrix::identity(), 1e-12);
}

#[test]
fn every_side_keeps_its_definitions() {
    let mut rng = seeded(71);
    for _ in 0..30 {
        let state = any_state(&mut rng);
        assert_side::<SE23, Left, 9>(&state.pose, &mut rng);
        assert_side::<SE23, Right, 9>(&state.pose, &mut rng);
        assert_side::<NavState, Left, 15>(&state, &mut rng);
        assert_side::<NavState, Right, 15>(&state, &mut rng);
    }
}

#[test]
fn the_left_error_is_in_the_body_and_the_right_one_in_the_world() {
    let mut rng = seeded(72);
    let (chi, xi) = (any_pose(&mut rng), large::<9>(&mut rng));
    assert_eq!(Left::retract(&chi, &xi), chi * SE23::exp(&xi));
    assert_eq!(Right::retract(&chi, &xi), SE23::exp(&xi) * chi);
}

#[test]
fn a_belief_changes_sides_as_its_error_does() {
    let mut rng = seeded(73);
    for _ in 0..20 {
        let left: Belief<NavState, Left, 15> = any_belief(any_state(&mut rng), 0.3, &mut rng);
        let right = left.to_right();
        assert_eq!(right.mean, left.mean);
        let change = derivative_at_zero(|xi: &SVector<f64, 15>| {
            Right::difference(&left.mean, &Left::retract(&left.mean, xi))
        });
        let expected = change * left.covariance.matrix() * change.transpose();
        assert_same_covariance("right", right.covariance.matrix(), &expected, 1e-9);
        let back = right.to_left();
        assert_same_covariance(
            "and back",
            back.covariance.matrix(),
            left.covariance.matrix(),
            1e-11,
        );
        assert_eq!(left.left_covariance(), left.covariance);
        assert_eq!(right.left_covariance(), back.covariance);
    }
}

#[test]
fn what_is_not_finite_is_implausible() {
    let belief: Belief<NavState, Left, 15> =
        any_belief(any_state(&mut seeded(74)), 0.3, &mut seeded(75));
    assert!(belief.is_plausible());
    let mut lost = belief;
    lost.mean.accel_bias.y = f64::NAN;
    assert!(!lost.is_plausible());
    let mut infinite = belief;
    infinite.covariance = belief.covariance.scaled(f64::INFINITY);
    assert!(!infinite.is_plausible());
}

/// `P+ = F P F^T + Q` with F the numerical derivative of the error of side S.
fn assert_propagated<G: InertialState<D>, S: InertialSide, const D: usize>(
    what: &str,
    start: G,
    rng: &mut ChaCha8Rng,
) {
    let measured = any_input(rng);
    let belief: Belief<G, S, D> = any_belief(start, 0.3, rng);
    for discretisation in [Discretisation::ZeroOrderHold, Discretisation::Euler] {
        let moved = |chi: &G| {
            let step = chi.imu_step(&measured, &GRAVITY_W, 0.2, discretisation);
            chi.advance(&step, &NOISE)
        };
        let after = propagate(&belief, &measured, &GRAVITY_W, 0.2, discretisation, &NOISE);
        let (mean, _, q) = moved(&belief.mean);
        assert_eq!(after.mean, mean);
        let f = derivative_at_zero(|xi: &SVector<f64, D>| {
            S::difference(&mean, &moved(&S::retract(&belief.mean, xi)).0)
        });
        let change = derivative_at_zero(|xi: &SVector<f64, D>| {
            S::difference(&mean, &Left::retract(&mean, xi))
        });
        let expected =
            f * belief.covariance.matrix() * f.transpose() + change * q * change.transpose();
        assert_same_covariance(what, after.covariance.matrix(), &expected, 1e-8);
        assert_eq!(
            after.covariance.matrix(),
            &after.covariance.matrix().transpose()
        );
    }
}

#[test]
fn the_covariance_propagates_as_its_error_does() {
    let mut rng = seeded(76);
    for _ in 0..10 {
        let state = any_state(&mut rng);
        assert_propagated::<SE23, Left, 9>("left, 9 states", state.pose, &mut rng);
        assert_propagated::<SE23, Right, 9>("right, 9 states", state.pose, &mut rng);
        assert_propagated::<NavState, Left, 15>("left, 15 states", state, &mut rng);
        assert_propagated::<NavState, Right, 15>("right, 15 states", state, &mut rng);
    }
}

fn assert_both_sides_propagate_alike<G: InertialState<D>, const D: usize>(
    start: G,
    rng: &mut ChaCha8Rng,
) {
    let mut left: Belief<G, Left, D> = any_belief(start, 0.3, rng);
    let mut right: Belief<G, Right, D> = Belief::from_left_covariance(start, left.covariance);
    for _ in 0..200 {
        let measured = any_input(rng);
        let zoh = Discretisation::ZeroOrderHold;
        left = propagate(&left, &measured, &GRAVITY_W, 0.01, zoh, &NOISE);
        right = propagate(&right, &measured, &GRAVITY_W, 0.01, zoh, &NOISE);
    }
    assert_eq!(left.mean, right.mean);
    assert_same_covariance(
        "after 200 steps",
        right.left_covariance().matrix(),
        left.covariance.matrix(),
        1e-10,
    );
}

#[test]
fn left_and_right_propagate_one_belief() {
    let mut rng = seeded(77);
    let state = any_state(&mut rng);
    assert_both_sides_propagate_alike::<SE23, 9>(state.pose, &mut rng);
    assert_both_sides_propagate_alike::<NavState, 15>(state, &mut rng);
}
