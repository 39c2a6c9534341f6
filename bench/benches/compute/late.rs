//! A fix that comes late: the update at its own time, and then what it changed carried to now, or the samples since
//! once more.

use core::hint::black_box;

use inekf::filter::{
    Belief, InertialSide, LateCorrection, Left, Right, UpdateOptions, propagate_in_place, update,
};
use inekf::lie::SE23;
use inekf::model::{Discretisation, Drift};
use nalgebra::Vector3;

use crate::setup::{DT_S, GRAVITY_W, NOISE, belief, fix, sample, state};
use crate::suite::Suite;

fn late<S: InertialSide>(suite: &mut impl Suite, side: &str, delay: u32) {
    let then: Belief<SE23, S, 9> = belief(state().pose);
    let seen = fix(Vector3::new(1.2, -0.3, 0.8));
    let advance = |belief: &mut Belief<SE23, S, 9>| {
        let zoh = Discretisation::ZeroOrderHold;
        for _ in 0..delay {
            propagate_in_place(belief, black_box(&sample()), &GRAVITY_W, DT_S, zoh, &NOISE);
        }
    };
    let correct = |belief: &mut Belief<SE23, S, 9>| {
        update(belief, black_box(&seen), &UpdateOptions::ITERATED).expect("a sound fix");
    };
    let mut now = then;
    advance(&mut now);
    suite.in_place(&format!("late/{side}/carried/{delay}"), now, |now| {
        let mut after = *black_box(&then);
        correct(&mut after);
        let drift = Drift::free_fall(&GRAVITY_W, DT_S * f64::from(delay));
        *now = LateCorrection::between(&then, &after)
            .carried_with_share(&drift, now)
            .0;
    });
    suite.in_place(&format!("late/{side}/replayed/{delay}"), then, |belief| {
        correct(belief);
        advance(belief);
    });
}

/// Registers the routines.
pub fn routines(suite: &mut impl Suite) {
    for delay in [1, 10, 100, 1000] {
        late::<Left>(suite, "9_left", delay);
        late::<Right>(suite, "9_right", delay);
    }
}
