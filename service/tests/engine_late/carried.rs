//! Late fixes of a filter without biases, carried to the newest state in constant time: what is published is what a
//! replay publishes, to 1e-12 of the scale of each number.

use inekf::filter::{Additive, InertialSide, Left, Right};
use inekf::lie::SE23;
use inekf::model::InertialState;
use inekf_service::config::LateMethod;
use inekf_service::engine::{InertialEngine, Settings};
use inekf_shared::message::{Counters, EstimateSe23, StateVector, triangle_index};

use super::common::{
    Engine, Input, PERIOD_NS, all_bits, belief_bits, engine_at, feed, lively_imu, position,
    settings, stamp, state_of, state_on_circle, variance, velocity,
};
use super::{drive, shuffled};

/// A window that holds every delay.
fn settings_of(method: LateMethod) -> Settings {
    let mut settings = settings();
    settings.initial.wait_for_request = true;
    settings.fusion.late_window_ns = 15_000_000_000;
    settings.fusion.late_method = method;
    settings
}

/// What an engine without biases makes of the inputs, from a state that is known to 0.2 m, 0.2 m/s and 0.2 rad.
fn engine_of<G: InertialState<D>, S: InertialSide, const D: usize>(
    settings: Settings,
    inputs: &[Input],
) -> (InertialEngine<G, S, D>, Vec<EstimateSe23>) {
    let mut engine = InertialEngine::<G, S, D>::new(settings);
    engine.set_state(&state_on_circle(stamp(0), 0.2)).unwrap();
    let mut rows = Vec::new();
    for input in inputs {
        feed(&mut engine, input, &mut rows);
    }
    (engine, rows)
}

/// `count` lively samples; after sample k, every `every`, a position that is `delay` samples and a third late.
fn delayed(count: u64, every: u64, delay: u64) -> Vec<Input> {
    let mut inputs = Vec::new();
    for k in 0..count {
        inputs.push(Input::Imu(lively_imu(k)));
        if k > delay && k.is_multiple_of(every) {
            let fix_ns = stamp(k - delay) - PERIOD_NS / 3;
            inputs.push(Input::Position(position(fix_ns, k, (k / every % 2) as u32)));
        }
    }
    inputs
}

/// Fails unless the numbers of two states are the same to 1e-12 of their scale.
fn assert_same_state(what: &str, actual: &StateVector, expected: &StateVector) {
    let close = |name: &str, a: &[f64], b: &[f64], scale: f64| {
        for (a, b) in a.iter().zip(b) {
            assert!(
                (a - b).abs() <= 1e-12 * scale,
                "{what}, {name}: {a:e} for {b:e}, of scale {scale:e}"
            );
        }
    };
    let size = |v: &[f64]| v.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    close("attitude", &actual.q_wb, &expected.q_wb, 1.0);
    let (v, p) = (&expected.v_w_mps, &expected.p_w_m);
    close("velocity", &actual.v_w_mps, v, size(v));
    close("position", &actual.p_w_m, p, size(p));
    let d = expected.dimension as usize;
    for i in 0..d {
        for j in i..d {
            let at = triangle_index(i, j, d).unwrap();
            let scale = (variance(expected, i) * variance(expected, j)).sqrt();
            let (a, b) = (actual.covariance[at], expected.covariance[at]);
            close("covariance", &[a], &[b], scale);
        }
    }
}

/// Fails unless all that was published is the same, to 1e-12 where it is a number.
fn assert_same_rows(what: &str, actual: &[EstimateSe23], expected: &[EstimateSe23]) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    for (a, b) in actual.iter().zip(expected) {
        assert_same_state(what, &state_of(a), &state_of(b));
        let (a, b) = (&a.head, &b.head);
        assert_eq!(
            (a.stamp_ns, a.seq, a.flags, a.source, a.state, a.counters),
            (b.stamp_ns, b.seq, b.flags, b.source, b.state, b.counters),
            "{what}"
        );
        for (a, b) in a.nis.iter().zip(&b.nis) {
            let same = (a - b).abs() <= 1e-9 * b.abs().max(1.0);
            assert!(same || (a.is_nan() && b.is_nan()), "{what}: {a} for {b}");
        }
    }
}

fn assert_carried<S: InertialSide>(side: &str, cases: &[(u64, u64)]) {
    for &(every, delay) in cases {
        let what = format!("{side}, a fix every {every}, {delay} late");
        let inputs = delayed(delay + 600, every, delay);
        let (_, carried) = engine_of::<SE23, S, 9>(settings_of(LateMethod::Carry), &inputs);
        let (_, replayed) = engine_of::<SE23, S, 9>(settings_of(LateMethod::Replay), &inputs);
        assert_same_rows(&what, &carried, &replayed);
        let bits = |rows: &[EstimateSe23]| belief_bits(rows.last().unwrap());
        assert!(bits(&carried) != bits(&replayed), "{what}: a replay");
    }
}

#[test]
fn what_is_published_is_what_a_replay_publishes() {
    let within_a_second = [(20, 10), (20, 100), (7, 100)];
    assert_carried::<Left>("left", &within_a_second);
    assert_carried::<Left>("left", &[(25, 1000)]);
    // Ten seconds on, the attitude's part of a covariance in world coordinates is so much larger than what is published
    // that a replay itself rounds by 1e-12; the library's tests compare these in their own coordinates.
    assert_carried::<Right>("right", &within_a_second);
    assert_carried::<Additive>("additive", &within_a_second);
}

/// Fixes of every kind in any order: carried, replayed behind carried ones, gated, and let in after a lock-out.
#[test]
fn carried_and_replayed_fixes_mix() {
    let inputs = drive();
    for seed in 0..30 {
        let arrived = shuffled(&inputs, [0, 30][seed as usize % 2], 90, seed);
        let (engine, carried) =
            engine_of::<SE23, Left, 9>(settings_of(LateMethod::Carry), &arrived);
        let (other, replayed) =
            engine_of::<SE23, Left, 9>(settings_of(LateMethod::Replay), &arrived);
        assert_same_rows(&format!("seed {seed}"), &carried, &replayed);
        assert_eq!(engine.tally().counters, other.tally().counters);
        assert!(engine.tally().counters.gated > 5);
    }
}

/// A source that jumps is gated, and let in again, at the same fix.
#[test]
fn a_lock_out_of_a_late_source_ends_alike() {
    let mut inputs = delayed(2000, 20, 100);
    for input in &mut inputs[800..] {
        if let Input::Position(fix) = input {
            fix.position_w_m[0] += 40.0;
        }
    }
    let of = |method| {
        let mut settings = settings_of(method);
        settings.fusion.recover_after = 5;
        engine_of::<SE23, Left, 9>(settings, &inputs)
    };
    let (carried, rows) = of(LateMethod::Carry);
    let (replayed, expected) = of(LateMethod::Replay);
    let Counters { gated, .. } = replayed.tally().counters;
    assert!(gated >= 5);
    assert_eq!(carried.tally().counters, replayed.tally().counters);
    assert_same_rows("lock-out", &rows, &expected);
}

/// With biases, with an update in between and with Euler's scheme a late fix is replayed, bit for bit.
#[test]
fn where_it_is_not_exact_nothing_is_carried() {
    let inputs = delayed(400, 20, 100);
    let biased = |method| {
        let mut engine: Engine = engine_at(settings_of(method), &state_on_circle(stamp(0), 0.5));
        let mut rows = Vec::new();
        for input in &inputs {
            feed(&mut engine, input, &mut rows);
        }
        rows
    };
    assert!(all_bits(&biased(LateMethod::Carry)) == all_bits(&biased(LateMethod::Replay)));

    let mut between = Vec::new();
    for input in &inputs {
        between.push(*input);
        if let Input::Imu(sample) = input
            && sample.header.seq % 10 == 5
        {
            between.push(Input::Velocity(velocity(
                sample.header.stamp_ns,
                sample.header.seq,
            )));
        }
    }
    let of = |method| engine_of::<SE23, Left, 9>(settings_of(method), &between).1;
    assert!(all_bits(&of(LateMethod::Carry)) == all_bits(&of(LateMethod::Replay)));

    let of = |method| {
        let mut settings = settings_of(method);
        settings.imu.discretisation = inekf::model::Discretisation::Euler;
        engine_of::<SE23, Left, 9>(settings, &inputs).1
    };
    assert!(all_bits(&of(LateMethod::Carry)) == all_bits(&of(LateMethod::Replay)));
}
