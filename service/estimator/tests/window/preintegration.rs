//! Preintegrated motions against the samples one by one, and against numerical derivatives.

use inekf::filter::{Belief, Left, Side, propagate};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{Discretisation, InertialState, NavState};
use inekf::smoother::Preintegration;
use nalgebra::SMatrix;

use crate::common::{
    GRAVITY_W, NOISE, any_belief, any_input, any_pose, any_state, assert_close,
    assert_same_covariance, assert_same_pose, derivative_at_zero, normal, seeded,
};

const DT_S: f64 = 0.01;

/// Samples of a second.
fn inputs(seed: u64) -> Vec<inekf::model::ImuInput> {
    let mut rng = seeded(seed);
    (0..100).map(|_| any_input(&mut rng)).collect()
}

fn preintegrated<G: InertialState<D>, const D: usize>(
    reference: &G,
    seed: u64,
    discretisation: Discretisation,
) -> Preintegration<G, D> {
    let mut motion = Preintegration::new(reference);
    for input in inputs(seed) {
        motion.push(&input, &GRAVITY_W, DT_S, discretisation, &NOISE);
    }
    motion
}

/// A belief carried by the motion is the belief propagated through its samples: no approximation, wherever it begins.
fn assert_composes<G: InertialState<D>, const D: usize>(mean: G, discretisation: Discretisation) {
    let mut belief: Belief<G, Left, D> = any_belief(mean, 0.3, &mut seeded(2));
    let motion = preintegrated(&mean, 3, discretisation);
    let carried = motion.carry(&belief);
    for input in inputs(3) {
        belief = propagate(&belief, &input, &GRAVITY_W, DT_S, discretisation, &NOISE);
    }
    let (pose, expected) = (carried.mean.pose(), belief.mean.pose());
    assert_same_pose("carried", pose, expected, 1e-12);
    assert_eq!(carried.mean.gyro_bias(), belief.mean.gyro_bias());
    assert_eq!(carried.mean.accel_bias(), belief.mean.accel_bias());
    let (p, expected) = (carried.covariance.matrix(), belief.covariance.matrix());
    assert_same_covariance("carried", p, expected, 1e-11);
    assert!((motion.dt_s() - 1.0).abs() < 1e-12);
}

#[test]
fn a_motion_is_its_samples() {
    let mut rng = seeded(1);
    for discretisation in [Discretisation::ZeroOrderHold, Discretisation::Euler] {
        for _ in 0..3 {
            assert_composes::<SE23, 9>(any_pose(&mut rng), discretisation);
            assert_composes::<NavState, 15>(any_state(&mut rng), discretisation);
        }
    }
}

/// `log(f(chi)^-1 f(chi exp(xi)))`, derived at zero.
fn numerical<G: InertialState<D>, const D: usize>(
    motion: &Preintegration<G, D>,
    chi: &G,
) -> SMatrix<f64, D, D> {
    let (origin, _) = motion.transition(chi);
    derivative_at_zero(|xi| {
        let (moved, _) = motion.transition(&Left::retract(chi, xi));
        Left::difference(&origin, &moved)
    })
}

#[test]
fn the_transition_is_the_derivative_of_the_motion() {
    let mut rng = seeded(4);
    for _ in 0..3 {
        let motion = preintegrated(&SE23::identity(), 5, Discretisation::ZeroOrderHold);
        let chi = any_pose(&mut rng);
        let (_, f) = motion.transition(&chi);
        assert_close("F", &f, &numerical(&motion, &chi), 1e-8);

        // The biases of the state are not those at which the samples were integrated.
        let motion = preintegrated(&any_state(&mut rng), 6, Discretisation::ZeroOrderHold);
        let chi = any_state(&mut rng);
        let (_, f) = motion.transition(&chi);
        assert_close("F with biases", &f, &numerical(&motion, &chi), 1e-8);
    }
}

#[test]
fn other_biases_are_right_to_first_order() {
    let mut rng = seeded(7);
    let reference = any_state(&mut rng);
    let motion = preintegrated(&reference, 8, Discretisation::ZeroOrderHold);
    let (gyro, accel) = (normal::<3, 1>(&mut rng), normal::<3, 1>(&mut rng));
    let error = |size: f64| {
        let chi = NavState {
            gyro_bias: reference.gyro_bias + size * gyro,
            accel_bias: reference.accel_bias + size * accel,
            ..reference
        };
        let anew = preintegrated(&chi, 8, Discretisation::ZeroOrderHold);
        let (first_order, _) = motion.transition(&chi);
        let (exact, _) = anew.transition(&chi);
        Left::difference(&exact, &first_order).norm()
    };
    let (whole, half) = (error(1e-3), error(5e-4));
    assert!(whole > 1e-9, "there is something to see: {whole:e}");
    assert!(whole < 1e-4, "{whole:e}");
    // Of second order: half the difference makes a quarter of the error.
    assert!((whole / half - 4.0).abs() < 0.05, "{whole:e}, {half:e}");
}

#[test]
fn no_motion_is_the_identity() {
    let mut rng = seeded(9);
    let belief: Belief<NavState, Left, 15> = any_belief(any_state(&mut rng), 0.3, &mut rng);
    let carried = Preintegration::new(&belief.mean).carry(&belief);
    assert_same_pose("at rest", &carried.mean.pose, &belief.mean.pose, 1e-15);
    assert_eq!(carried.covariance, belief.covariance);
}
