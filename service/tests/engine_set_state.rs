//! The set-state request: what is taken, what is refused with the state untouched, and from when.

mod common;
#[path = "engine_set_state/resume.rs"]
mod resume;

use common::{
    Direct, Engine, Input, PERIOD_NS, all_bits, assert_refused, belief_bits, circle, engine_at,
    feed, input_of, lively_imu, numbers, run, settings, stamp, state_bits, state_on_circle,
    variance,
};
use inekf::filter::{Left, Right};
use inekf::lie::SE23;
use inekf::model::NavState;
use inekf_service::config::Hold;
use inekf_service::engine::InertialEngine;
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, ESTIMATE_RESET, EstimateSe23, MODEL_ODOMETRY_2D, MODEL_ODOMETRY_3D,
    NAV_TRI, REASON_INTERNAL, REASON_STAMP_NOT_AFTER, STATE_RUNNING, STATE_WAITING, StateVector,
    WAITING_FOR_IMU, WAITING_FOR_NOTHING, WAITING_FOR_REQUEST, triangle_index,
};

const RUNNING: (u32, u32) = (STATE_RUNNING, WAITING_FOR_NOTHING);

fn waiting_engine() -> Engine {
    let mut settings = settings();
    settings.initial.wait_for_request = true;
    Engine::new(settings)
}

/// An attitude, a velocity, a position, biases and a full covariance that are all their own.
fn full_state(stamp_ns: u64) -> StateVector {
    let mut state = state_on_circle(stamp_ns, 0.5);
    state.q_wb = [0.1, -0.2, 0.3, (1.0f64 - 0.14).sqrt()];
    state.gyro_bias_rps = [0.001, -0.002, 0.003];
    state.accel_bias_mps2 = [0.01, 0.02, -0.03];
    for row in 0..15 {
        for column in row + 1..15 {
            let scale = (variance(&state, row) * variance(&state, column)).sqrt();
            let correlation = 0.3 * ((row * 7 + column * 3) as f64).sin() / 4.0;
            state.covariance[triangle_index(row, column, 15).unwrap()] = correlation * scale;
        }
    }
    state
}

fn close(a: &StateVector, b: &StateVector) -> bool {
    numbers(a)
        .zip(numbers(b))
        .all(|(a, b)| (a - b).abs() < 1e-12)
}

#[test]
fn a_snapshot_gives_the_state_that_was_set() {
    let mut engine = waiting_engine();
    let state = full_state(stamp(0));
    engine.set_state(&state).unwrap();
    assert_eq!(engine.state(), RUNNING);
    let snapshot = engine.snapshot().unwrap();
    assert!(close(&snapshot, &state));
    // And the snapshot of that, to the bit.
    let mut again = waiting_engine();
    again.set_state(&snapshot).unwrap();
    assert!(state_bits(&again.snapshot().unwrap()) == state_bits(&snapshot));
}

#[test]
fn a_state_of_nine_dimensions_takes_the_configured_biases() {
    let mut biased = settings();
    biased.initial.wait_for_request = true;
    biased.initial.biases.gyro_bias.x = 0.02;
    biased.initial.biases.accel_bias.z = 0.2;
    let mut engine = Engine::new(biased);
    let full = full_state(stamp(0));
    let mut nine = full;
    nine.dimension = 9;
    // What lies in the bias fields and behind the 45 entries of the triangle is not meant.
    nine.gyro_bias_rps = [9.0; 3];
    nine.covariance = [123.0; NAV_TRI];
    for row in 0..9 {
        for column in row..9 {
            nine.covariance[triangle_index(row, column, 9).unwrap()] =
                full.covariance[triangle_index(row, column, 15).unwrap()];
        }
    }
    engine.set_state(&nine).unwrap();
    let state = engine.snapshot().unwrap();
    assert_eq!(state.dimension, 15);
    assert_eq!(state.gyro_bias_rps, [0.02, 0.0, 0.0]);
    assert_eq!(state.accel_bias_mps2, [0.0, 0.0, 0.2]);
    for row in 0..15 {
        for column in row..15 {
            let entry = state.covariance[triangle_index(row, column, 15).unwrap()];
            let expected = match (row, column) {
                (_, 0..9) => full.covariance[triangle_index(row, column, 15).unwrap()],
                (9..12, _) if row == column => 0.01 * 0.01,
                (12..15, _) if row == column => 0.1 * 0.1,
                _ => 0.0,
            };
            assert!((entry - expected).abs() < 1e-15, "({row}, {column})");
        }
    }
}

#[test]
fn a_state_without_covariance_is_believed_as_the_configured_start() {
    let mut configured = settings();
    configured.initial.wait_for_request = true;
    configured.initial.velocity_sigma = 3.0;
    configured.initial.level_sigma = 0.1;
    configured.initial.heading_sigma = 0.1;
    let mut engine = Engine::new(configured);
    let full = full_state(stamp(0));
    let mut bare = full;
    bare.dimension = 0;
    bare.covariance = [0.0; NAV_TRI];
    engine.set_state(&bare).unwrap();
    let state = engine.snapshot().unwrap();
    let mut expected = full;
    expected.gyro_bias_rps = configured.initial.biases.gyro_bias.into();
    expected.accel_bias_mps2 = configured.initial.biases.accel_bias.into();
    assert_eq!(
        (state.p_w_m, state.v_w_mps),
        (expected.p_w_m, expected.v_w_mps)
    );
    assert_eq!(state.gyro_bias_rps, expected.gyro_bias_rps);
    // Equal deviations about every axis are the same in body axes as in world axes.
    let variance = |i: usize| state.covariance[triangle_index(i, i, 15).unwrap()];
    for axis in 0..3 {
        assert!((variance(axis) - 0.01).abs() < 1e-12);
        assert!((variance(3 + axis) - 9.0).abs() < 1e-9);
        assert!(variance(6 + axis) > 0.0);
    }
}

#[test]
fn a_filter_without_biases_takes_both_and_publishes_nine() {
    let mut requested = settings();
    requested.initial.wait_for_request = true;
    let full = full_state(stamp(0));
    let mut engine = InertialEngine::<SE23, Left, 9>::new(requested);
    engine.set_state(&full).unwrap();
    let nine = engine.snapshot().unwrap();
    assert_eq!(nine.dimension, 9);
    assert_eq!(nine.gyro_bias_rps, [0.0; 3]);
    for row in 0..9 {
        for column in row..9 {
            let entry = nine.covariance[triangle_index(row, column, 9).unwrap()];
            let expected = full.covariance[triangle_index(row, column, 15).unwrap()];
            assert_eq!(entry, expected, "({row}, {column})");
        }
    }
    assert!(nine.covariance[45..].iter().all(|entry| *entry == 0.0));
    engine.set_state(&nine).unwrap();
    assert!(state_bits(&engine.snapshot().unwrap()) == state_bits(&nine));

    let mut rows: Vec<EstimateSe23> = Vec::new();
    for k in 0..3 {
        engine.sample(&lively_imu(k), 0, &mut rows);
    }
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[1].head.dimension, 9);
    assert!(rows[1].covariance[45..].iter().all(|entry| *entry == 0.0));
    assert!(rows[1].covariance[44] > nine.covariance[44]);
}

#[test]
fn a_right_invariant_filter_speaks_of_the_left_invariant_error() {
    let mut requested = settings();
    requested.initial.wait_for_request = true;
    let state = full_state(stamp(0));
    let mut left = Engine::new(requested);
    let mut right = InertialEngine::<NavState, Right, 15>::new(requested);
    left.set_state(&state).unwrap();
    right.set_state(&state).unwrap();
    assert!(close(&right.snapshot().unwrap(), &state));
    let (mut left_rows, mut right_rows): (Vec<EstimateSe23>, Vec<_>) = (Vec::new(), Vec::new());
    for k in 0..50 {
        left.sample(&lively_imu(k), 0, &mut left_rows);
        right.sample(&lively_imu(k), 0, &mut right_rows);
    }
    // Propagation is one and the same map in two coordinates.
    let (left, right) = (left.snapshot().unwrap(), right.snapshot().unwrap());
    for (left, right) in numbers(&left).zip(numbers(&right)) {
        assert!((left - right).abs() < 1e-9 * left.abs().max(1.0));
    }
}

/// States that are none, by what is wrong with them.
fn bad_states(stamp_ns: u64) -> Vec<(String, StateVector)> {
    let good = full_state(stamp_ns);
    let mut bad = Vec::new();
    let mut add = |name: String, change: &dyn Fn(&mut StateVector)| {
        let mut state = good;
        change(&mut state);
        bad.push((name, state));
    };
    for model in [0, MODEL_ODOMETRY_2D, MODEL_ODOMETRY_3D, 99, u32::MAX] {
        add(format!("model {model}"), &|state| state.model = model);
    }
    for dimension in [3, 6, 8, 10, 14, 16, 120, u32::MAX] {
        add(format!("dimension {dimension}"), &|state| {
            state.dimension = dimension
        });
    }
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
        add(format!("q {value:e}"), &|state| state.q_wb[1] = value);
        add(format!("v {value:e}"), &|state| state.v_w_mps[2] = value);
        add(format!("p {value:e}"), &|state| state.p_w_m[0] = value);
        add(format!("gyro bias {value:e}"), &|state| {
            state.gyro_bias_rps[1] = value
        });
        add(format!("accel bias {value:e}"), &|state| {
            state.accel_bias_mps2[0] = value
        });
        add(format!("variance {value:e}"), &|state| {
            state.covariance[0] = value
        });
        add(format!("covariance {value:e}"), &|state| {
            state.covariance[17] = value
        });
        add(format!("last variance {value:e}"), &|state| {
            state.covariance[119] = value
        });
    }
    for q_wb in [
        [0.0; 4],
        [1e-200, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 2.0],
        [0.5, 0.5, 0.5, 0.4],
    ] {
        add(format!("q {q_wb:?}"), &|state| state.q_wb = q_wb);
    }
    for i in 0..15 {
        let at = triangle_index(i, i, 15).unwrap();
        add(format!("variance {i} negative"), &|state| {
            state.covariance[at] = -1e-6
        });
        add(format!("variance {i} zero beside correlations"), &|state| {
            state.covariance[at] = 0.0;
        });
    }
    for (row, column) in [(0, 1), (2, 11), (13, 14)] {
        add(
            format!("correlation of {row} and {column} above one"),
            &|state| {
                let scale = (variance(state, row) * variance(state, column)).sqrt();
                state.covariance[triangle_index(row, column, 15).unwrap()] = 1.01 * scale;
            },
        );
    }
    add("three correlations that cannot be".to_owned(), &|state| {
        for (row, column) in [(0, 1), (1, 2), (0, 2)] {
            state.covariance[triangle_index(row, column, 15).unwrap()] = -0.6 * 0.25;
        }
    });
    add("older than the last sample".to_owned(), &|state| {
        state.stamp_ns -= 1
    });
    add("stamp 1".to_owned(), &|state| state.stamp_ns = 1);
    add("an hour ahead".to_owned(), &|state| {
        state.stamp_ns += 3_600_000_000_000
    });
    add("the end of time".to_owned(), &|state| {
        state.stamp_ns = u64::MAX
    });
    bad
}

#[test]
fn a_bad_state_is_refused_with_a_reason_and_changes_no_bit() {
    let inputs = circle(2);
    let (_, clean) = run(settings(), &inputs);
    let at = 100;
    let last = inputs[..at]
        .iter()
        .map(|input| input.header().stamp_ns)
        .max();
    for (name, state) in bad_states(last.unwrap()) {
        let mut engine = Engine::new(settings());
        let mut rows = Vec::new();
        for (n, input) in inputs.iter().enumerate() {
            if n == at {
                let reason = engine.set_state(&state).unwrap_err();
                assert!(reason.len() > 20 && reason.len() <= 256, "{name}: {reason}");
                assert!(reason.starts_with("the "), "{name}: {reason}");
            }
            feed(&mut engine, input, &mut rows);
        }
        assert!(all_bits(&rows) == all_bits(&clean), "{name}");
        assert_refused(engine.tally(), &[]);
    }
}

#[test]
fn a_bad_state_starts_nothing() {
    for (name, mut state) in bad_states(stamp(0)) {
        if state.stamp_ns != stamp(0) {
            continue;
        }
        for stamp_ns in [stamp(0), 0] {
            state.stamp_ns = stamp_ns;
            let mut engine = waiting_engine();
            engine.set_state(&state).unwrap_err();
            assert_eq!(
                engine.state(),
                (STATE_WAITING, WAITING_FOR_REQUEST),
                "{name}"
            );
        }
    }
}

#[test]
fn a_singular_covariance_is_a_covariance() {
    let mut engine = waiting_engine();
    let mut state = state_on_circle(stamp(0), 0.0);
    engine.set_state(&state).unwrap();
    // Fully correlated: rank one in three components.
    for (row, column) in [(3, 3), (4, 4), (5, 5), (3, 4), (4, 5), (3, 5)] {
        state.covariance[triangle_index(row, column, 15).unwrap()] = 4.0;
    }
    engine.set_state(&state).unwrap();
    assert!(close(&engine.snapshot().unwrap(), &state));
}

#[test]
fn a_quaternion_written_with_two_decimals_is_one() {
    let mut engine = waiting_engine();
    let mut state = state_on_circle(stamp(0), 0.5);
    state.q_wb = [0.0, 0.0, 0.71, 0.71];
    engine.set_state(&state).unwrap();
    let norm: f64 = engine.snapshot().unwrap().q_wb.iter().map(|x| x * x).sum();
    assert!((norm - 1.0).abs() < 1e-15);
}

/// Samples `from..=to` to `engine`; what it published.
fn drive(engine: &mut Engine, samples: core::ops::RangeInclusive<u64>) -> Vec<EstimateSe23> {
    let mut rows = Vec::new();
    for k in samples {
        feed(engine, &Input::Imu(lively_imu(k)), &mut rows);
    }
    rows
}

#[test]
fn a_stamp_of_zero_means_now() {
    // Under every hold: the last sample is still the one that the next interval begins with.
    for hold in [Hold::Backward, Hold::Forward, Hold::Midpoint] {
        let mut held = settings();
        held.imu.hold = hold;
        held.initial.wait_for_request = true;
        let mut engine = Engine::new(held);
        assert!(drive(&mut engine, 0..=10).is_empty());
        engine.set_state(&full_state(0)).unwrap();
        assert_eq!(engine.snapshot().unwrap().stamp_ns, stamp(10));
        // That sample once more is not a new one.
        drive(&mut engine, 10..=10);
        assert_refused(engine.tally(), &[(REASON_STAMP_NOT_AFTER, 1)]);

        let rows = drive(&mut engine, 11..=11);
        let (before, after) = (input_of(&lively_imu(10)), input_of(&lively_imu(11)));
        let mut direct = Direct::new(&full_state(0));
        direct.propagate(
            &match hold {
                Hold::Backward => after,
                Hold::Forward => before,
                Hold::Midpoint => before.midpoint(&after),
            },
            PERIOD_NS,
        );
        assert_eq!(rows.len(), 1);
        assert!(belief_bits(&rows[0]) == direct.bits());
    }
}

#[test]
fn before_the_first_sample_a_stamp_of_zero_means_that_sample() {
    for mut engine in [waiting_engine(), Engine::new(settings())] {
        engine.set_state(&full_state(0)).unwrap();
        assert_eq!(engine.state(), (STATE_WAITING, WAITING_FOR_IMU));
        assert!(engine.snapshot().is_none());
        assert!(drive(&mut engine, 5..=5).is_empty());
        assert_eq!(engine.state(), RUNNING);
        let expected = StateVector {
            stamp_ns: stamp(5),
            ..full_state(0)
        };
        assert!(close(&engine.snapshot().unwrap(), &expected));
        let rows = drive(&mut engine, 6..=6);
        assert_eq!(rows[0].head.flags, ESTIMATE_PROPAGATED);
        assert_refused(engine.tally(), &[]);
    }
}

#[test]
fn the_last_of_several_requests_counts_and_a_reset_drops_it() {
    let mut engine = waiting_engine();
    engine.set_state(&full_state(0)).unwrap();
    engine.set_state(&state_on_circle(0, 0.1)).unwrap();
    drive(&mut engine, 0..=0);
    let expected = StateVector {
        stamp_ns: stamp(0),
        ..state_on_circle(0, 0.1)
    };
    assert!(close(&engine.snapshot().unwrap(), &expected));

    let mut engine = waiting_engine();
    engine.set_state(&full_state(0)).unwrap();
    engine.reset();
    assert_eq!(engine.state(), (STATE_WAITING, WAITING_FOR_REQUEST));
    drive(&mut engine, 0..=5);
    assert!(engine.snapshot().is_none());

    let mut engine = waiting_engine();
    engine.set_state(&full_state(0)).unwrap();
    engine.set_state(&state_on_circle(stamp(2), 0.1)).unwrap();
    drive(&mut engine, 2..=3);
    assert_eq!(engine.snapshot().unwrap().stamp_ns, stamp(3));
}

#[test]
fn at_the_stamp_of_the_next_sample_that_sample_moves_nothing() {
    for first in [0, 10] {
        let mut engine = waiting_engine();
        if first > 0 {
            drive(&mut engine, 0..=first - 1);
        }
        engine.set_state(&full_state(stamp(first))).unwrap();
        assert!(drive(&mut engine, first..=first).is_empty());
        assert!(close(
            &engine.snapshot().unwrap(),
            &full_state(stamp(first))
        ));
        // It is taken once.
        drive(&mut engine, first..=first);
        assert_refused(engine.tally(), &[(REASON_STAMP_NOT_AFTER, 1)]);
        let rows = drive(&mut engine, first + 1..=first + 1);
        let mut direct = Direct::new(&full_state(stamp(first)));
        direct.propagate(&input_of(&lively_imu(first + 1)), PERIOD_NS);
        assert!(belief_bits(&rows[0]) == direct.bits());
    }
}

#[test]
fn ahead_of_the_samples_they_are_refused_until_they_get_there() {
    let mut engine = waiting_engine();
    drive(&mut engine, 0..=10);
    engine.set_state(&full_state(stamp(40) - 1)).unwrap();
    let rows = drive(&mut engine, 11..=60);
    assert_refused(engine.tally(), &[(REASON_STAMP_NOT_AFTER, 29)]);
    assert_eq!(rows.len(), 21);
    assert_eq!(rows[0].head.stamp_ns, stamp(40));
    assert!(rows.iter().all(|row| row.head.reset_count == 0));
}

#[test]
fn a_wrong_stamp_before_the_first_sample_does_not_lock_it_out() {
    for stamp_ns in [5, u64::MAX] {
        let mut engine = Engine::new(settings());
        engine.set_state(&full_state(stamp_ns)).unwrap();
        let rows = drive(&mut engine, 0..=50);
        assert_eq!(engine.state(), RUNNING);
        assert_eq!(rows.last().unwrap().head.stamp_ns, stamp(50));
    }
}

#[test]
fn a_jump_is_counted_measured_and_announced_once() {
    let mut engine = engine_at(settings(), &state_on_circle(stamp(0), 0.5));
    let rows = drive(&mut engine, 0..=10);
    assert!(rows.iter().all(|row| row.head.reset_count == 0));
    assert!(rows.iter().all(|row| row.head.flags & ESTIMATE_RESET == 0));

    let mut state = full_state(0);
    for (n, offset) in [(1u64, 12.0), (2, -34.0)] {
        let before = engine.snapshot().unwrap();
        state.p_w_m = before.p_w_m;
        state.p_w_m[1] += offset;
        engine.set_state(&state).unwrap();
        let rows = drive(&mut engine, 10 * n + 1..=10 * n + 10);
        for (k, row) in rows.iter().enumerate() {
            assert_eq!(row.head.flags & ESTIMATE_RESET != 0, k == 0);
            assert_eq!(row.head.reset_count, n);
            assert!((row.head.reset_jump_m - f64::abs(offset)).abs() < 1e-12);
        }
    }
}

#[test]
fn a_filter_that_runs_away_starts_anew_and_says_so() {
    // Each is finite, and was let in; no vehicle and no sensor is like that.
    let runaways: [fn(&mut StateVector); 4] = [
        |state| state.v_w_mps[1] = -1.1e6,
        |state| (state.p_w_m[0], state.v_w_mps[0]) = (1e9, 9.9e5),
        |state| state.gyro_bias_rps[2] = 50.1,
        |state| state.accel_bias_mps2[0] = -500.1,
    ];
    for (n, runaway) in runaways.iter().enumerate() {
        let mut engine = Engine::new(settings());
        drive(&mut engine, 0..=10);
        let mut state = full_state(stamp(10));
        runaway(&mut state);
        engine.set_state(&state).unwrap();
        let rows = drive(&mut engine, 11..=20);
        if n == 1 {
            // Far and fast, but still of this world.
            assert_refused(engine.tally(), &[]);
            assert_eq!(rows.len(), 10);
            continue;
        }
        // The first sample finds it broken, the second starts, the third is propagated to.
        assert_refused(engine.tally(), &[(REASON_INTERNAL, 1)]);
        assert_eq!(rows.len(), 8);
        assert_eq!(rows[0].head.stamp_ns, stamp(13));
        assert_eq!(rows[0].head.flags & ESTIMATE_RESET, ESTIMATE_RESET);
        assert_eq!(rows[0].head.reset_count, 2);
        assert!(rows[0].p_w_m.iter().all(|p| p.abs() < 1.0));
    }
}
