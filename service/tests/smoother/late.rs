//! Fixes that come late: as if on time where nothing newer has been smoothed, else counted.

use inekf_shared::message::{ESTIMATE_REPLAYED, ESTIMATE_UPDATED, REASON_BUFFER_FULL};

use crate::common::{
    Input, PERIOD_NS, assert_refused, belief_bits, lively_imu, position, stamp, state_on_circle,
    velocity,
};
use crate::{Fed, Full, full, smoothing};

fn started() -> Full {
    started_with("")
}

fn started_with(top: &str) -> Full {
    let mut engine = full(smoothing(top, 5, ""));
    engine.set_state(&state_on_circle(stamp(0), 0.3)).unwrap();
    engine
}

fn snapshot(engine: &Full) -> Vec<u64> {
    crate::common::state_bits(&engine.snapshot().unwrap())
}

/// 300 samples with a fix every 50; each comes `late` samples after the one it is due by.
fn drive(engine: &mut Full, late: u64) -> Vec<inekf_shared::message::EstimateSe23> {
    let mut outbox = Vec::new();
    for k in 0..=300 {
        if k > late && (k - late).is_multiple_of(50) {
            let due = k - late;
            // Between samples, at one, and just before one.
            let stamp_ns = stamp(due) - [3_333_333, 0, 1][(due / 50 % 3) as usize];
            if due.is_multiple_of(100) {
                engine.velocity(&velocity(stamp_ns, due), &mut outbox);
            }
            engine.position(&position(stamp_ns, due, 1), &mut outbox);
            if late > 0 {
                engine.settle(&mut outbox);
            }
        }
        engine.feed(&Input::Imu(lively_imu(k)), &mut outbox);
    }
    outbox
}

#[test]
fn a_late_fix_gives_the_bits_that_it_would_have_given_on_time() {
    let mut on_time = started();
    drive(&mut on_time, 0);
    let counters = on_time.tally().counters;
    assert!(counters.accepted >= 8 && counters.late == 0, "{counters:?}");
    for (late, hold) in [
        (1, "hold = 'midpoint'"),
        (2, "hold = 'forward'"),
        (17, ""),
        (45, ""),
        (45, "hold = 'midpoint'"),
    ] {
        let mut engine = started_with(hold);
        let estimates = drive(&mut engine, late);
        // The fixes of the last samples have not come.
        let mut expected = started_with(hold);
        let mut outbox = Vec::new();
        for k in 0..=300_u64 {
            if k > 0 && k.is_multiple_of(50) && k + late <= 300 {
                let stamp_ns = stamp(k) - [3_333_333, 0, 1][(k / 50 % 3) as usize];
                if k.is_multiple_of(100) {
                    expected.velocity(&velocity(stamp_ns, k), &mut outbox);
                }
                expected.position(&position(stamp_ns, k, 1), &mut outbox);
            }
            expected.feed(&Input::Imu(lively_imu(k)), &mut outbox);
        }
        assert!(snapshot(&engine) == snapshot(&expected), "{late} late");
        assert_eq!(
            engine.tally().counters.accepted,
            expected.tally().counters.accepted
        );
        assert_eq!(engine.tally().counters.late, 0);
        let replayed = ESTIMATE_UPDATED | ESTIMATE_REPLAYED;
        assert!(estimates.iter().any(|row| row.head.flags == replayed));
    }
}

#[test]
fn a_fix_older_than_the_newest_smoothed_state_is_counted_as_late_and_changes_nothing() {
    let mut engine = started();
    let mut outbox = Vec::new();
    for k in 0..=100 {
        if k == 60 {
            engine.feed(&Input::Position(position(stamp(60), 1, 0)), &mut outbox);
        }
        engine.feed(&Input::Imu(lively_imu(k)), &mut outbox);
    }
    let (before, published) = (snapshot(&engine), outbox.len());
    engine.feed(&Input::Position(position(stamp(60) - 1, 2, 1)), &mut outbox);
    assert_eq!(engine.tally().counters.late, 1);
    assert!(snapshot(&engine) == before && outbox.len() == published);
    // At the very time of that state, and after it, fixes are taken.
    engine.feed(&Input::Position(position(stamp(60), 3, 1)), &mut outbox);
    engine.feed(&Input::Position(position(stamp(80), 4, 1)), &mut outbox);
    assert_eq!(engine.tally().counters.late, 1);
    assert_eq!(engine.tally().counters.accepted, 3);
}

#[test]
fn a_fix_beyond_the_late_window_is_counted_as_late() {
    let mut engine = started();
    let mut outbox = Vec::new();
    for k in 0..=250 {
        engine.feed(&Input::Imu(lively_imu(k)), &mut outbox);
    }
    engine.feed(
        &Input::Position(position(stamp(150) - PERIOD_NS, 1, 0)),
        &mut outbox,
    );
    assert_eq!(engine.tally().counters.late, 1);
    engine.feed(&Input::Position(position(stamp(150), 2, 0)), &mut outbox);
    assert_eq!(engine.tally().counters.accepted, 1);
}

#[test]
fn a_fix_that_comes_with_a_sample_never_goes_before_it() {
    // Given to the engine without settling, as the daemon does while samples wait.
    let mut engine = started();
    let mut outbox = Vec::new();
    for k in 0..=50 {
        engine.feed(&Input::Imu(lively_imu(k)), &mut outbox);
    }
    outbox.clear();
    engine.position(&position(stamp(40), 1, 0), &mut outbox);
    assert!(outbox.is_empty());
    engine.sample(&lively_imu(51), 0, &mut outbox);
    let stamps: Vec<u64> = outbox.iter().map(|row| row.head.stamp_ns).collect();
    assert_eq!(stamps, [stamp(51); 2]);
    let mut without = started();
    let mut rows = Vec::new();
    for k in 0..=51 {
        without.feed(&Input::Imu(lively_imu(k)), &mut rows);
    }
    assert!(belief_bits(&outbox[0]) == belief_bits(rows.last().unwrap()));
}

#[test]
fn fixes_that_never_become_due_fill_a_bounded_queue() {
    let mut engine = started();
    let mut outbox = Vec::new();
    engine.feed(&Input::Imu(lively_imu(0)), &mut outbox);
    for n in 0..1030 {
        engine.feed(&Input::Position(position(stamp(1000), n, 0)), &mut outbox);
    }
    assert_refused(engine.tally(), &[(REASON_BUFFER_FULL, 6)]);
}
