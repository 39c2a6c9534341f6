//! The groups: exponential and logarithm of each, and a covariance carried from one side to the other.

use core::hint::black_box;

use inekf::filter::{Belief, Left};
use inekf::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3, TwoFrames};
use inekf::model::NavState;
use nalgebra::SVector;

use crate::dense;
use crate::setup::{assert_same, belief, state};
use crate::suite::Suite;

/// At a small turn, as in a sample, and at a large one, where the series end.
fn maps<G: LieGroup<D>, const D: usize>(suite: &mut impl Suite, name: &str) {
    for (size, scale) in [("small", 0.02), ("large", 0.6)] {
        let xi = SVector::<f64, D>::from_fn(|i, _| scale * (1.0 + 0.3 * i as f64));
        let element = G::exp(&xi);
        suite.call(&format!("lie/{name}/exp_{size}"), || G::exp(black_box(&xi)));
        suite.call(&format!("lie/{name}/log_{size}"), || {
            black_box(&element).log()
        });
    }
}

fn sides<G: LieGroup<D>, const D: usize>(suite: &mut impl Suite, name: &str, mean: G) {
    let left: Belief<G, Left, D> = belief(mean);
    let right = left.to_right();
    let plainly = dense::transformed(&mean.adjoint(), left.covariance.matrix());
    assert_same(right.covariance.matrix(), &plainly);

    suite.in_place(&format!("coordinates/{name}/to_right"), left, |belief| {
        let right = belief.to_right();
        belief.covariance = right.covariance;
    });
    suite.in_place(&format!("coordinates/{name}/to_left"), right, |belief| {
        belief.covariance = belief.left_covariance();
    });
    let p = *left.covariance.matrix();
    suite.in_place(&format!("coordinates/{name}/dense"), p, |p| {
        *p = dense::transformed(&black_box(mean).adjoint(), p);
    });
}

/// Registers the routines.
pub fn routines(suite: &mut impl Suite) {
    maps::<SO2, 1>(suite, "so2");
    maps::<SO3, 3>(suite, "so3");
    maps::<SE2, 3>(suite, "se2");
    maps::<SE3, 6>(suite, "se3");
    maps::<SE23, 9>(suite, "se23");
    maps::<TwoFrames, 15>(suite, "two_frames");
    maps::<NavState, 15>(suite, "nav_state");
    sides::<SE23, 9>(suite, "9", state().pose);
    sides::<NavState, 15>(suite, "15", state());
}
