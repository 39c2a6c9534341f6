//! A new state and its fix in a full window of the smoother.

use core::hint::black_box;

use inekf::filter::Left;
use inekf::model::{Discretisation, InertialState, NavState, PositionObservation};
use inekf::smoother::{Preintegration, Window, WindowOptions};
use nalgebra::{Matrix3, Vector3};

use crate::setup::{DT_S, GRAVITY_W, NOISE, belief, fix, sample, state};
use crate::suite::Suite;

/// `update` with one fix a second: isotropic fixes keep the gains of a state without biases.
fn window<G: InertialState<D>, const D: usize>(
    suite: &mut impl Suite,
    name: &str,
    capacity: usize,
    start: G,
    covariance_w: Matrix3<f64>,
) {
    let mut window = Window::<G, Left, D>::new(&belief(start), &WindowOptions::new(capacity));
    let mut motion = Preintegration::new(&start);
    for _ in 0..200 {
        let zoh = Discretisation::ZeroOrderHold;
        motion.push(&sample(), &GRAVITY_W, DT_S, zoh, &NOISE);
    }
    let mut truth = start;
    let mut next = || {
        truth = motion.transition(&truth).0;
        let pose = truth.pose();
        let lever_arm_b = Vector3::new(1.2, -0.3, 0.8);
        let seen = PositionObservation {
            position_w: pose.position + pose.rotation.rotate(&lever_arm_b),
            covariance_w,
            ..fix(lever_arm_b)
        };
        black_box(window.push(black_box(&motion)));
        window.update(black_box(seen)).expect("a sound fix")
    };
    for _ in 0..capacity {
        next();
    }
    suite.call(&format!("smoother/{name}/{capacity}"), next);
}

/// Registers the routines.
pub fn routines(suite: &mut impl Suite) {
    let isotropic = 0.25 * Matrix3::identity();
    let anisotropic = fix(Vector3::zeros()).covariance_w;
    for capacity in [10, 50] {
        window(suite, "9_kept_gains", capacity, state().pose, isotropic);
        window(suite, "9_anew", capacity, state().pose, anisotropic);
        window::<NavState, 15>(suite, "15", capacity, state(), anisotropic);
    }
}
