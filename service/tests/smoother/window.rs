//! The window as a whole: restarts, requests, and estimators that have none.

use inekf_shared::message::{ESTIMATE_RESET, REASON_UNKNOWN_SOURCE, SMOOTHED_CUT, STATE_DEGRADED};

use crate::common::{
    Input, assert_refused, heading, imu, numbers, position, stamp, state_bits, state_of,
    state_on_circle,
};
use crate::{Fed, Full, circle, full, settings, smoothing};

fn driven() -> Full {
    let mut engine = full(smoothing("", 6, ""));
    engine.run(&circle(4));
    engine
}

fn left(engine: &mut Full) -> Vec<inekf_shared::message::SmoothedState> {
    std::iter::from_fn(|| engine.take_left()).collect()
}

#[test]
fn a_reset_and_a_requested_state_end_the_window_and_its_states_leave() {
    for by_request in [false, true] {
        let mut engine = driven();
        left(&mut engine);
        let mut outbox = Vec::new();
        if by_request {
            engine.set_state(&state_on_circle(stamp(399), 0.5)).unwrap();
        } else {
            engine.reset();
            assert_eq!(engine.snapshot(), None);
            assert!(
                engine
                    .smoothed(&mut |_| ())
                    .unwrap_err()
                    .contains("no state yet")
            );
        }
        let cut = left(&mut engine);
        assert_eq!(cut.len(), 6);
        assert!(cut.iter().all(|state| state.flags == SMOOTHED_CUT));
        for k in 400..410 {
            engine.feed(&Input::Imu(imu(k)), &mut outbox);
        }
        assert!(outbox[0].head.flags & ESTIMATE_RESET != 0);
        assert_eq!(outbox[0].head.reset_count, 1);
        assert_eq!(engine.smoothed(&mut |_| ()), Ok(1));
    }
}

#[test]
fn the_snapshot_is_the_last_estimate() {
    let mut engine = full(smoothing("", 6, ""));
    let estimates = engine.run(&circle(3));
    let snapshot = engine.snapshot().unwrap();
    assert!(state_bits(&snapshot) == state_bits(&state_of(estimates.last().unwrap())));
    assert!(numbers(&snapshot).all(f64::is_finite));
}

#[test]
fn two_runs_give_the_same_bits() {
    let bits = || {
        let estimates = full(smoothing("", 6, "")).run(&circle(4));
        crate::common::all_bits(&estimates)
    };
    assert!(bits() == bits());
}

#[test]
fn without_fixes_the_estimate_is_degraded_and_goes_on() {
    let mut engine = driven();
    let mut outbox = Vec::new();
    for k in 400..1000 {
        engine.feed(&Input::Imu(imu(k)), &mut outbox);
    }
    assert_eq!(outbox.last().unwrap().head.state, STATE_DEGRADED);
    engine.feed(&Input::Position(position(stamp(999), 1, 0)), &mut outbox);
    assert_ne!(outbox.last().unwrap().head.state, STATE_DEGRADED);
}

#[test]
fn a_filter_has_no_window() {
    let mut engine = crate::common::Engine::new(settings("", ""));
    engine.run(&circle(1));
    assert!(engine.take_left().is_none());
    assert!(
        engine
            .smoothed(&mut |_| ())
            .unwrap_err()
            .contains("no smoother")
    );
}

#[test]
fn a_heading_makes_a_state_of_the_window_and_one_of_an_unknown_source_does_not() {
    let mut engine = driven();
    let accepted = engine.tally().counters.accepted;
    left(&mut engine);
    let mut fix = heading(stamp(399), 1);
    engine.feed(&Input::Heading(fix), &mut Vec::new());
    assert_eq!(engine.tally().counters.accepted, accepted + 1);
    assert_eq!(engine.smoothed(&mut |_| ()), Ok(6));
    assert_eq!(left(&mut engine).len(), 1);
    fix.source = 2;
    engine.feed(&Input::Heading(fix), &mut Vec::new());
    assert_refused(engine.tally(), &[(REASON_UNKNOWN_SOURCE, 1)]);
}

#[test]
fn every_parametrisation_and_prior_finds_the_truth() {
    for parametrisation in ["exponential", "right", "gtsam", "forster"] {
        for prior in ["group", "linear", "recentred"] {
            let table = format!(
                "iterations = 2\nparametrisation = '{parametrisation}'\nprior = '{prior}'\njacobians = 'exact'"
            );
            let mut engine = full(smoothing("", 8, &table));
            engine.run(&circle(10));
            let error = crate::common::position_error(&engine.snapshot().unwrap());
            assert!(error < 0.1, "{parametrisation}, {prior}: {error} m");
        }
    }
}
