//! One IMU sample: mean and covariance, with and without biases, on either side.

use core::hint::black_box;

use inekf::filter::{Belief, InertialSide, Left, Right, propagate_in_place};
use inekf::lie::SE23;
use inekf::model::{Discretisation, InertialState, NavState};
use inekf_service::engine::processor::{Processor, Work};

use crate::dense;
use crate::setup::{DT_S, GRAVITY_W, NOISE, assert_same, belief, sample, state};
use crate::suite::Suite;

/// The step, for the instructions that a processor has.
struct Step<'a, G, S, const D: usize> {
    belief: &'a mut Belief<G, S, D>,
    discretisation: Discretisation,
}

impl<G: InertialState<D>, S: InertialSide, const D: usize> Work for Step<'_, G, S, D> {
    #[inline(always)]
    fn run(self) {
        propagate_in_place(
            self.belief,
            &black_box(sample()),
            &GRAVITY_W,
            DT_S,
            self.discretisation,
            &NOISE,
        );
    }
}

fn step<G: InertialState<D>, S: InertialSide, const D: usize>(
    belief: &mut Belief<G, S, D>,
    discretisation: Discretisation,
    processor: Processor,
) {
    processor.run(Step {
        belief,
        discretisation,
    });
}

fn pair<G: InertialState<D>, S: InertialSide, const D: usize>(
    suite: &mut impl Suite,
    name: &str,
    start: Belief<G, S, D>,
) {
    let zoh = Discretisation::ZeroOrderHold;
    let processor = Processor::detect();
    let (mut fast, mut plain) = (start, start);
    step(&mut fast, zoh, Processor::plain());
    step(&mut plain, zoh, processor);
    assert_eq!(fast, plain, "wider instructions give other bits");
    plain = start;
    dense::propagate(&mut plain);
    assert_same(fast.covariance.matrix(), plain.covariance.matrix());

    let euler = Discretisation::Euler;
    suite.in_place(&format!("predict/{name}"), start, |belief| {
        step(belief, zoh, processor);
    });
    suite.in_place(&format!("predict/{name}/any processor"), start, |belief| {
        step(belief, zoh, Processor::plain());
    });
    suite.in_place(&format!("predict/{name}/euler"), start, |belief| {
        step(belief, euler, processor);
    });
    suite.in_place(&format!("predict/{name}/dense"), start, dense::propagate);
}

/// Registers the routines.
pub fn routines(suite: &mut impl Suite) {
    let zoh = Discretisation::ZeroOrderHold;
    suite.in_place("predict/mean", state().pose, |pose| {
        *pose = pose
            .increment(&black_box(sample()), &GRAVITY_W, DT_S, zoh)
            .apply(pose);
    });
    pair::<SE23, Left, 9>(suite, "9_left", belief(state().pose));
    pair::<SE23, Right, 9>(suite, "9_right", belief(state().pose));
    pair::<NavState, Left, 15>(suite, "15_left", belief(state()));
    pair::<NavState, Right, 15>(suite, "15_right", belief(state()));
}
