//! One IMU sample: mean and covariance, with and without biases, on either side.

use core::hint::black_box;

use criterion::Criterion;
use inekf::filter::{Belief, InertialSide, Left, Right, propagate_in_place};
use inekf::lie::SE23;
use inekf::model::{Discretisation, InertialState, NavState};

use crate::dense;
use crate::setup::{DT_S, GRAVITY_W, NOISE, assert_same, belief, in_place, sample, state};

fn step<G: InertialState<D>, S: InertialSide, const D: usize>(
    belief: &mut Belief<G, S, D>,
    discretisation: Discretisation,
) {
    let measured = black_box(sample());
    propagate_in_place(belief, &measured, &GRAVITY_W, DT_S, discretisation, &NOISE);
}

fn pair<G: InertialState<D>, S: InertialSide, const D: usize>(
    criterion: &mut Criterion,
    name: &str,
    start: Belief<G, S, D>,
) {
    let zoh = Discretisation::ZeroOrderHold;
    let (mut fast, mut plain) = (start, start);
    step(&mut fast, zoh);
    dense::propagate(&mut plain);
    assert_same(fast.covariance.matrix(), plain.covariance.matrix());

    let mut group = criterion.benchmark_group("predict");
    in_place(&mut group, name, start, |belief| step(belief, zoh));
    let euler = Discretisation::Euler;
    in_place(&mut group, &format!("{name}/euler"), start, |belief| {
        step(belief, euler)
    });
    in_place(
        &mut group,
        &format!("{name}/dense"),
        start,
        dense::propagate,
    );
    group.finish();
}

/// Registers the benchmarks.
pub fn bench(criterion: &mut Criterion) {
    let zoh = Discretisation::ZeroOrderHold;
    let mut group = criterion.benchmark_group("predict");
    in_place(&mut group, "mean", state().pose, |pose| {
        *pose = pose
            .increment(&black_box(sample()), &GRAVITY_W, DT_S, zoh)
            .apply(pose);
    });
    group.finish();
    pair::<SE23, Left, 9>(criterion, "9_left", belief(state().pose));
    pair::<SE23, Right, 9>(criterion, "9_right", belief(state().pose));
    pair::<NavState, Left, 15>(criterion, "15_left", belief(state()));
    pair::<NavState, Right, 15>(criterion, "15_right", belief(state()));
}
