//! The groups: exponential and logarithm of each, and a covariance carried from one side to the other.

use core::hint::black_box;

use criterion::Criterion;
use inekf::filter::{Belief, Left};
use inekf::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3, TwoFrames};
use inekf::model::NavState;
use nalgebra::SVector;

use crate::dense;
use crate::setup::{assert_same, belief, in_place, state};

/// At a small turn, as in a sample, and at a large one, where the series end.
fn maps<G: LieGroup<D>, const D: usize>(criterion: &mut Criterion, name: &str) {
    let mut group = criterion.benchmark_group("lie");
    for (size, scale) in [("small", 0.02), ("large", 0.6)] {
        let xi = SVector::<f64, D>::from_fn(|i, _| scale * (1.0 + 0.3 * i as f64));
        let element = G::exp(&xi);
        group.bench_function(format!("{name}/exp_{size}"), |bencher| {
            bencher.iter(|| G::exp(black_box(&xi)));
        });
        group.bench_function(format!("{name}/log_{size}"), |bencher| {
            bencher.iter(|| black_box(&element).log());
        });
    }
    group.finish();
}

fn sides<G: LieGroup<D>, const D: usize>(criterion: &mut Criterion, name: &str, mean: G) {
    let left: Belief<G, Left, D> = belief(mean);
    let right = left.to_right();
    let plainly = dense::transformed(&mean.adjoint(), left.covariance.matrix());
    assert_same(right.covariance.matrix(), &plainly);

    let mut group = criterion.benchmark_group("coordinates");
    in_place(&mut group, &format!("{name}/to_right"), left, |belief| {
        let right = belief.to_right();
        belief.covariance = right.covariance;
    });
    in_place(&mut group, &format!("{name}/to_left"), right, |belief| {
        belief.covariance = belief.left_covariance();
    });
    let p = *left.covariance.matrix();
    in_place(&mut group, &format!("{name}/dense"), p, |p| {
        *p = dense::transformed(&black_box(mean).adjoint(), p);
    });
    group.finish();
}

/// Registers the benchmarks.
pub fn bench(criterion: &mut Criterion) {
    maps::<SO2, 1>(criterion, "so2");
    maps::<SO3, 3>(criterion, "so3");
    maps::<SE2, 3>(criterion, "se2");
    maps::<SE3, 6>(criterion, "se3");
    maps::<SE23, 9>(criterion, "se23");
    maps::<TwoFrames, 15>(criterion, "two_frames");
    maps::<NavState, 15>(criterion, "nav_state");
    sides::<SE23, 9>(criterion, "9", state().pose);
    sides::<NavState, 15>(criterion, "15", state());
}
