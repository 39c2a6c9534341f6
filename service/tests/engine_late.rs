//! Late fixes: whatever the order of arrival, the estimate is bit for bit the one on time; without biases, where they
//! are [`carried`], but for rounding.

#[path = "engine_late/carried.rs"]
mod carried;
mod common;

use common::{
    Engine, Input, PERIOD_NS, all_bits, assert_refused, belief_bits, circle, engine_at, feed,
    heading, imu, position, run, settings, stamp, state_bits, state_on_circle, velocity,
};
use inekf_service::engine::Settings;
use inekf_shared::message::{Counters, ESTIMATE_REPLAYED, ESTIMATE_UPDATED, REASON_BUFFER_FULL};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Fixes that the engine can hold at one time.
const CAPACITY: u64 = 1024;
const SECOND_NS: u64 = 1_000_000_000;

fn bits(engine: &Engine) -> Vec<u64> {
    state_bits(&engine.snapshot().unwrap())
}

/// Five seconds of every kind of fix, a few of them far off so that the gate has to work.
fn drive() -> Vec<Input> {
    let mut inputs = circle(5);
    let fixes = inputs.iter_mut().filter_map(|input| match input {
        Input::Position(fix) => Some(fix),
        _ => None,
    });
    for fix in fixes.step_by(7) {
        fix.position_w_m[1] += 80.0;
    }
    inputs
}

/// The same messages; each fix up to `early` samples before or `late` after the one it is due by.
fn shuffled(inputs: &[Input], early: i64, late: i64, seed: u64) -> Vec<Input> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut sample = 0;
    let mut keyed: Vec<((i64, u32), Input)> = inputs
        .iter()
        .map(|input| match input {
            Input::Imu(_) => {
                sample += 1;
                ((sample, 0), *input)
            }
            fix => {
                let arrival = sample + rng.random_range(-early..=late);
                // After the first sample, behind any sample of the same place, before the end.
                ((arrival.clamp(1, 500), rng.random_range(1..u32::MAX)), *fix)
            }
        })
        .collect();
    keyed.sort_by_key(|(key, _)| *key);
    keyed.into_iter().map(|(_, input)| input).collect()
}

#[test]
fn any_order_of_arrival_gives_the_same_bits() {
    let inputs = drive();
    let (on_time, _) = run(settings(), &inputs);
    assert_eq!(on_time.tally().counters.late, 0);
    assert!(on_time.tally().counters.gated > 5);
    for seed in 0..30 {
        let (early, late) = (
            [0, 0, 30][seed as usize % 3],
            [5, 90, 60][seed as usize % 3],
        );
        let arrived = shuffled(&inputs, early, late, seed);
        let (engine, estimates) = run(settings(), &arrived);
        assert_refused(engine.tally(), &[]);
        // Out of order, a number that comes late has been counted as lost; all else is the same.
        let counters = Counters {
            lost: on_time.tally().counters.lost,
            ..engine.tally().counters
        };
        assert_eq!(counters, on_time.tally().counters);
        assert!(bits(&engine) == bits(&on_time), "seed {seed}");
        if late > 0 {
            let replayed = |flags| flags & ESTIMATE_REPLAYED != 0;
            assert!(estimates.iter().any(|row| replayed(row.head.flags)));
        }
    }
}

#[test]
fn every_scheme_of_holding_samples_is_replayed_alike() {
    use inekf_service::config::Hold;
    let inputs = drive();
    for hold in [Hold::Forward, Hold::Midpoint] {
        let mut settings = settings();
        settings.imu.hold = hold;
        let (on_time, _) = run(settings, &inputs);
        let (late, _) = run(settings, &shuffled(&inputs, 10, 60, 7));
        assert!(bits(&late) == bits(&on_time));
    }
}

#[test]
fn after_a_late_fix_the_newest_estimate_is_the_one_on_time() {
    let state = state_on_circle(stamp(0), 0.7);
    let fix = position(stamp(20) - 3_000_001, 0, 1);
    let mut on_time = engine_at(settings(), &state);
    let mut late = engine_at(settings(), &state);
    let (mut expected, mut rows) = (Vec::new(), Vec::new());
    for k in 0..=50 {
        if k == 20 {
            feed(&mut on_time, &Input::Position(fix), &mut expected);
        }
        feed(&mut on_time, &Input::Imu(imu(k)), &mut expected);
        feed(&mut late, &Input::Imu(imu(k)), &mut rows);
    }
    feed(&mut late, &Input::Position(fix), &mut rows);
    let (row, expected) = (rows.last().unwrap(), expected.last().unwrap());
    assert_eq!(row.head.stamp_ns, stamp(50));
    assert_eq!(row.head.flags, ESTIMATE_UPDATED | ESTIMATE_REPLAYED);
    assert_eq!(row.head.source, 1);
    assert!(belief_bits(row) == belief_bits(expected));
    assert_eq!(
        row.head.nis.map(f64::to_bits),
        expected.head.nis.map(f64::to_bits)
    );
    assert_eq!(rows.len(), 51, "a row for each sample, one for the fix");
}

#[test]
fn a_fix_beyond_the_window_is_counted_and_changes_nothing() {
    let samples: Vec<_> = (0..300).map(|k| Input::Imu(imu(k))).collect();
    let (clean, clean_rows) = run(settings(), &samples);
    // The window is one second.
    for (lateness_ns, is_late) in [
        (SECOND_NS + 1, true),
        (SECOND_NS, false),
        (2 * SECOND_NS, true),
        (stamp(299), true),
        (stamp(299) - 1, true),
    ] {
        let fix_ns = stamp(299) - lateness_ns;
        // What is true a second before the end: good values where the stamp is good.
        let (mut place, mut speed, mut course) = (
            position(stamp(199), 0, 0),
            velocity(stamp(199), 0),
            heading(stamp(199), 0),
        );
        place.header.stamp_ns = fix_ns;
        speed.header.stamp_ns = fix_ns;
        course.header.stamp_ns = fix_ns;
        for fix in [
            Input::Position(place),
            Input::Velocity(speed),
            Input::Heading(course),
        ] {
            let mut inputs = samples.clone();
            inputs.push(fix);
            let (engine, rows) = run(settings(), &inputs);
            let counters = engine.tally().counters;
            assert_eq!(
                (counters.late, counters.accepted),
                if is_late { (1, 0) } else { (0, 1) }
            );
            assert_refused(engine.tally(), &[]);
            assert_eq!(bits(&engine) == bits(&clean), is_late);
            if is_late {
                assert!(all_bits(&rows) == all_bits(&clean_rows));
            }
        }
    }
}

#[test]
fn a_window_of_zero_takes_no_late_fix() {
    let mut settings = settings();
    settings.fusion.late_window_ns = 0;
    let mut inputs: Vec<_> = (0..10).map(|k| Input::Imu(imu(k))).collect();
    inputs.push(Input::Position(position(stamp(9) - 1, 0, 0)));
    inputs.push(Input::Position(position(stamp(9), 1, 0)));
    let (engine, _) = run(settings, &inputs);
    assert_eq!(engine.tally().counters.late, 1);
    assert_eq!(engine.tally().counters.accepted, 1);
}

#[test]
fn the_capacity_bounds_the_window_too() {
    let mut small = settings();
    small.fusion.late_capacity = 16;
    let samples: Vec<_> = (0..300).map(|k| Input::Imu(imu(k))).collect();
    // 16 samples reach back over 15 intervals.
    for (lateness_ns, is_late) in [
        (15 * PERIOD_NS - 1, false),
        (15 * PERIOD_NS, true),
        (40 * PERIOD_NS, true),
    ] {
        let mut inputs = samples.clone();
        inputs.push(Input::Position(position(stamp(299) - lateness_ns, 0, 0)));
        let (engine, _) = run(small, &inputs);
        assert_eq!(engine.tally().counters.late, u64::from(is_late));
    }
}

/// Counts that do not add up would be inputs that vanished.
fn assert_every_fix_is_accounted_for(engine: &Engine, fixes: u64, waiting: u64) {
    let counters = engine.tally().counters;
    assert_eq!(
        counters.accepted + counters.gated + counters.late + counters.rejected + waiting,
        fixes
    );
}

#[test]
fn a_full_buffer_is_counted_and_empties_again() {
    let mut engine = engine_at(settings(), &state_on_circle(stamp(0), 0.7));
    let rows = &mut Vec::new();
    feed(&mut engine, &Input::Imu(imu(0)), rows);
    // All ahead of the samples, within 20 s.
    for n in 0..CAPACITY + 100 {
        let fix_ns = stamp(1) + n * 2 * PERIOD_NS - 1;
        feed(&mut engine, &Input::Position(position(fix_ns, n, 0)), rows);
    }
    assert_refused(engine.tally(), &[(REASON_BUFFER_FULL, 100)]);
    assert!(rows.is_empty());
    for k in 1..2 * CAPACITY {
        feed(&mut engine, &Input::Imu(imu(k)), rows);
    }
    assert_eq!(engine.tally().counters.accepted, CAPACITY);
    assert_every_fix_is_accounted_for(&engine, CAPACITY + 100, 0);

    let now_ns = stamp(2 * CAPACITY - 1);
    feed(
        &mut engine,
        &Input::Position(position(now_ns, 5000, 0)),
        rows,
    );
    assert_refused(engine.tally(), &[(REASON_BUFFER_FULL, 100)]);
    assert_eq!(engine.tally().counters.accepted, CAPACITY + 1);
}

/// A window of a minute in which two fixes a sample arrive on time, for `samples`.
fn dense(samples: u64) -> (Settings, Vec<Input>) {
    let mut settings = settings();
    settings.fusion.late_window_ns = 60 * SECOND_NS;
    settings.fusion.late_capacity = 65_536;
    let mut inputs = vec![Input::Imu(imu(0))];
    for k in 1..samples {
        inputs.push(Input::Position(position(stamp(k) - 1, k, 0)));
        inputs.push(Input::Velocity(velocity(stamp(k) - 2, k)));
        inputs.push(Input::Imu(imu(k)));
    }
    (settings, inputs)
}

#[test]
fn fixes_on_time_are_never_refused_for_those_remembered() {
    let (settings, inputs) = dense(2000);
    let (engine, _) = run(settings, &inputs);
    assert_refused(engine.tally(), &[]);
    assert_eq!(engine.tally().counters.accepted, 2 * 1999);
}

#[test]
fn too_many_remembered_fixes_shorten_the_window() {
    let (settings, inputs) = dense(2000);
    // 1024 fixes reach back over 512 samples.
    for (lateness, is_late) in [(400, false), (600, true)] {
        let mut inputs = inputs.clone();
        inputs.push(Input::Heading(heading(stamp(1999 - lateness), 0)));
        let (engine, _) = run(settings, &inputs);
        assert_refused(engine.tally(), &[]);
        assert_eq!(
            engine.tally().counters.late,
            u64::from(is_late),
            "{lateness}"
        );
    }
    // What is still reached is replayed to the same bits.
    let late_by = 400;
    let fix = Input::Heading(heading(stamp(1999 - late_by), 0));
    let mut late = inputs.clone();
    late.push(fix);
    let mut on_time = inputs;
    on_time.insert(3 * (1999 - late_by as usize), fix);
    assert!(bits(&run(settings, &late).0) == bits(&run(settings, &on_time).0));
}

#[test]
fn fixes_that_wait_when_the_state_is_replaced_are_counted() {
    let mut engine = engine_at(settings(), &state_on_circle(stamp(0), 0.7));
    let rows = &mut Vec::new();
    feed(&mut engine, &Input::Imu(imu(0)), rows);
    for n in 1..=5 {
        feed(
            &mut engine,
            &Input::Position(position(stamp(n), n, 0)),
            rows,
        );
    }
    feed(&mut engine, &Input::Imu(imu(1)), rows);
    feed(&mut engine, &Input::Imu(imu(2)), rows);
    assert_every_fix_is_accounted_for(&engine, 5, 3);
    engine.set_state(&state_on_circle(stamp(2), 0.7)).unwrap();
    assert_every_fix_is_accounted_for(&engine, 5, 0);
    feed(
        &mut engine,
        &Input::Position(position(stamp(4), 6, 0)),
        rows,
    );
    engine.reset();
    assert_every_fix_is_accounted_for(&engine, 6, 0);
}
