//! How much of the window is worked on after each sample: counted, not timed. And that looking at it changes nothing.

use inekf_shared::message::{ESTIMATE_SMOOTHED, ESTIMATE_UPDATED, EstimateSe23};

use crate::common::{Input, belief_bits, lively_imu, position, stamp, state_on_circle, velocity};
use crate::{Fed, Full, full, smoothing};

/// Units for a state with biases, forward; no piece is larger but a push, which is three.
const STATE: i64 = 14;

fn started(window: usize, more: &str) -> Full {
    let mut engine = full(smoothing("", window, more));
    engine.set_state(&state_on_circle(stamp(0), 0.3)).unwrap();
    engine
}

/// Samples with a position every `period` of them, and with `both` a velocity of the same moment.
fn drive(samples: u64, period: u64, both: bool) -> Vec<Input> {
    let mut inputs = Vec::new();
    for k in 0..=samples {
        if k > 0 && k.is_multiple_of(period) {
            inputs.push(Input::Position(position(stamp(k), k, 0)));
            if both {
                inputs.push(Input::Velocity(velocity(stamp(k), k)));
            }
        }
        inputs.push(Input::Imu(lively_imu(k)));
    }
    inputs
}

fn flagged(estimates: &[EstimateSe23], flag: u32) -> usize {
    let flagged = |estimate: &&EstimateSe23| estimate.head.flags & flag != 0;
    estimates.iter().filter(flagged).count()
}

#[test]
fn no_sample_pays_for_more_than_a_few_states_of_the_window() {
    for (window, period, most) in [(50, 200, 32), (50, 100, 50), (20, 50, 50), (200, 200, 50)] {
        let mut engine = started(window, "");
        let (mut spent, mut outbox) = (0, Vec::new());
        for input in drive(70 * period, period, false) {
            engine.feed(&input, &mut outbox);
            if let Input::Imu(_) = input {
                spent += engine.effort().last;
            }
        }
        let effort = engine.effort();
        assert!(effort.most <= most + 3 * STATE, "{effort:?}");
        assert_eq!((effort.forced, effort.failed), (0, 0));
        // The window was worked on: forward and back for each fix.
        let states = window.min(70) as i64 * 70 / 2;
        assert!(spent > states * STATE, "{spent}");
        // All was ready for each fix, and the estimate with it is the smoothed one.
        assert_eq!(effort.early, 0);
        assert_eq!(flagged(&outbox, ESTIMATE_UPDATED), 70);
        assert_eq!(flagged(&outbox, ESTIMATE_SMOOTHED), 0);
    }
}

#[test]
fn a_second_fix_of_one_moment_waits_for_the_window_and_the_estimate_does_not() {
    let mut engine = started(20, "");
    let outbox = engine.run(&drive(2000, 100, true));
    let effort = engine.effort();
    assert_eq!((effort.early, effort.forced), (20, 0));
    assert!(effort.most <= 150 + 3 * STATE, "{effort:?}");
    assert_eq!(engine.tally().counters.accepted, 40);
    assert_eq!(flagged(&outbox, ESTIMATE_UPDATED), 40);
    // The last pair has no samples left.
    assert_eq!(flagged(&outbox, ESTIMATE_SMOOTHED), 19);
}

#[test]
fn where_fixes_come_too_fast_the_work_is_done_in_one_go_and_counted() {
    // Two fixes for each sample, and a window that each of them takes many samples for at first.
    let mut engine = started(50, "iterations = 3");
    engine.run(&drive(100, 1, true));
    let effort = engine.effort();
    assert!(effort.forced > 0, "{effort:?}");
    assert_eq!(engine.tally().counters.accepted, 200);
    let mut states = 0;
    assert_eq!(engine.smoothed(&mut |_| states += 1), Ok(50));
    assert_eq!(states, 50);
}

#[test]
fn looking_at_the_window_changes_no_estimate() {
    for more in ["", "iterations = 2"] {
        let inputs = drive(1500, 70, true);
        let unseen = started(30, more).run(&inputs);
        let mut engine = started(30, more);
        let mut seen = Vec::new();
        for (k, input) in inputs.iter().enumerate() {
            engine.feed(input, &mut seen);
            if k % 11 == 0 && engine.snapshot().is_some() {
                assert!(engine.smoothed(&mut |_| ()).is_ok());
            }
        }
        assert!(
            unseen
                .iter()
                .map(belief_bits)
                .eq(seen.iter().map(belief_bits))
        );
        let flags =
            |rows: &[EstimateSe23]| rows.iter().map(|row| row.head.flags).collect::<Vec<_>>();
        assert_eq!(flags(&unseen), flags(&seen));
    }
}

/// What is smoothed does not depend on when: the same fixes with all the samples in the world between the
/// pieces, and with none.
#[test]
fn the_smoothed_states_are_those_of_a_window_that_is_solved_at_once() {
    let states = |forced: bool| {
        let mut engine = started(10, "");
        let mut outbox = Vec::new();
        for (k, input) in drive(1200, 60, true).iter().enumerate() {
            engine.feed(input, &mut outbox);
            if forced && k > 0 {
                // To look is to have all done at once.
                engine.smoothed(&mut |_| ()).unwrap();
            }
        }
        let mut states = Vec::new();
        engine.smoothed(&mut |state| states.push(*state)).unwrap();
        let left: Vec<_> = std::iter::from_fn(|| engine.take_left()).collect();
        (states, left)
    };
    assert_eq!(states(false), states(true));
}
