//! The state of an earlier life: what is continued, how it is doubted, and what is not; and pauses, and other noise.
//! Of the doubt the oracle is the motion of a body whose rates are constant and unknown, written out by hand.

use inekf::filter::{Left, Right};
use inekf::lie::SE23;
use inekf::model::NavState;
use inekf_service::config::{Config, WhiteNoise};
use inekf_service::engine::resume::{Doubt, ResumeSettings, Resumption};
use inekf_service::engine::smoothing::SmoothingEngine;
use inekf_service::engine::{Engine as AnyEngine, History, InertialEngine, Model, Settings};
use inekf_shared::message::{
    ESTIMATE_RESUMED, EstimateSe23, ImuSample, NOISE_DENSITY, ProcessNoise, REASON_NOT_READY,
    STATE_PAUSED, STATE_RUNNING, STATE_WAITING, StateVector, WAITING_FOR_IMU, WAITING_FOR_NOTHING,
    triangle_index,
};

use super::common::{
    Engine, GRAVITY, Input, all_bits, assert_refused, belief_bits, circle, engine_at, feed, imu,
    lively_imu, position, settings, stamp, state_bits, state_on_circle, variance,
};

const SECOND_NS: u64 = 1_000_000_000;

const RESUME: ResumeSettings = ResumeSettings {
    max_age_ns: 10 * SECOND_NS,
    doubt: Doubt {
        turn_sigma: 0.2,
        accel_sigma: 2.0,
        speed_sigma: 1.0,
    },
};

/// Level, heading 0, 5 m/s east, with these standard deviations of rotation, velocity and position.
fn level_state(stamp_ns: u64, sigmas: [f64; 3]) -> StateVector {
    let mut state = state_on_circle(stamp_ns, 0.0);
    state.q_wb = [0.0, 0.0, 0.0, 1.0];
    (state.v_w_mps, state.p_w_m) = ([5.0, 0.0, 0.0], [7.0, -2.0, 1.0]);
    for i in 0..9 {
        state.covariance[triangle_index(i, i, 15).unwrap()] = sigmas[i / 3] * sigmas[i / 3];
    }
    state
}

/// The state after `seconds` of silence, at the first sample.
fn after(mut settings: Settings, state: &StateVector, doubt: Doubt, seconds: u64) -> StateVector {
    settings.initial.biases.gyro_sigma = 0.0;
    let mut engine = Engine::new(settings);
    let resume = ResumeSettings { doubt, ..RESUME };
    engine.resume_from(state, resume).unwrap();
    assert_eq!(engine.resumption(), Resumption::Waiting);
    assert_eq!(engine.state(), (STATE_WAITING, WAITING_FOR_IMU));
    let mut first = imu(0);
    first.header.stamp_ns = state.stamp_ns + seconds * SECOND_NS;
    feed(&mut engine, &Input::Imu(first), &mut Vec::new());
    let age_ns = seconds * SECOND_NS;
    assert_eq!(engine.resumption(), Resumption::Resumed { age_ns });
    engine.snapshot().unwrap()
}

/// Without noise of the sensors and without biases, unless a test adds them.
fn quiet() -> Settings {
    let mut settings = settings();
    settings.imu.white = WhiteNoise::Density {
        gyro: 0.0,
        accel: 0.0,
    };
    (settings.imu.gyro_bias_walk, settings.imu.accel_bias_walk) = (0.0, 0.0);
    settings
}

/// A state whose biases are known.
fn without_biases(mut state: StateVector) -> StateVector {
    for i in 9..15 {
        state.covariance[triangle_index(i, i, 15).unwrap()] = 0.0;
    }
    state
}

fn assert_close(name: &str, found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1.0),
        "{name}: {found}, expected {expected}"
    );
}

#[test]
fn a_body_that_nobody_heard_of_has_coasted_with_an_acceleration_that_nobody_knows() {
    let (t, accel) = (3.0, 0.7);
    let doubt = Doubt {
        turn_sigma: 0.0,
        accel_sigma: 2.0,
        speed_sigma: f64::NAN,
    };
    let mut settings = quiet();
    settings.imu.white = WhiteNoise::Density { gyro: 0.0, accel };
    let state = without_biases(level_state(stamp(0), [0.0, 0.3, 0.5]));
    let found = after(settings, &state, doubt, 3);
    assert_eq!(found.stamp_ns, stamp(0) + 3 * SECOND_NS);
    for i in 0..4 {
        assert_close("attitude", found.q_wb[i], state.q_wb[i]);
    }
    for i in 0..3 {
        assert_close("velocity", found.v_w_mps[i], state.v_w_mps[i]);
        assert_close(
            "position",
            found.p_w_m[i],
            state.p_w_m[i] + t * state.v_w_mps[i],
        );
        // A constant unknown acceleration, of white noise too: its mean over t has the density by t.
        let unknown = 4.0 + accel * accel / t;
        assert_close(
            "velocity's variance",
            variance(&found, 3 + i),
            0.09 + unknown * t * t,
        );
        let expected = 0.25 + 0.09 * t * t + unknown * t.powi(4) / 4.0;
        assert_close("position's variance", variance(&found, 6 + i), expected);
        let both = found.covariance[triangle_index(3 + i, 6 + i, 15).unwrap()];
        assert_close("both", both, 0.09 * t + unknown * t.powi(3) / 2.0);
    }
}

#[test]
fn it_may_have_turned_and_a_tilt_makes_gravity_an_acceleration() {
    let (t, gyro, walk) = (2.0, 0.05, 1e-3);
    let doubt = Doubt {
        turn_sigma: 0.2,
        accel_sigma: 0.0,
        speed_sigma: f64::NAN,
    };
    let mut settings = quiet();
    settings.imu.white = WhiteNoise::Density { gyro, accel: 0.0 };
    settings.imu.accel_bias_walk = walk;
    let state = without_biases(level_state(stamp(0), [0.1, 0.0, 0.0]));
    let found = after(settings, &state, doubt, 2);
    // A rate of turn that is constant and unknown.
    let rate = 0.04 + gyro * gyro / t;
    for axis in 0..3 {
        assert_close(
            "rotation's variance",
            variance(&found, axis),
            0.01 + rate * t * t,
        );
        assert_close("bias", variance(&found, 12 + axis), walk * walk * t);
    }
    // Coasting, the accelerometer was taken to read gravity upwards. Rolled by a, it would have pushed by g a for as
    // long as it was rolled: from the start by what was unknown then, and by what the turning adds.
    let (at_start, by_rate) = (GRAVITY * t, GRAVITY * t * t / 2.0);
    let expected = 0.01 * at_start * at_start + rate * by_rate * by_rate;
    for axis in 0..2 {
        assert_close("velocity's variance", variance(&found, 3 + axis), expected);
    }
    assert_close("upwards", variance(&found, 5), 0.0);
}

/// Resumes, feeds two samples, and gives the state at the first and what was published.
fn resumed<M, H>(
    mut engine: AnyEngine<M, H>,
    state: &StateVector,
) -> (StateVector, Vec<EstimateSe23>)
where
    M: Model<Sample = ImuSample, Estimate = EstimateSe23>,
    H: History<M>,
{
    let mut outbox = Vec::new();
    engine.resume_from(state, RESUME).unwrap();
    engine.sample(&imu(200), 0, &mut outbox);
    let first = engine.snapshot().unwrap();
    engine.sample(&imu(201), 0, &mut outbox);
    engine.sample(&imu(202), 0, &mut outbox);
    (first, outbox)
}

#[test]
fn every_filter_and_the_smoother_continue_with_the_same_state_and_say_so_once() {
    let mut state = state_on_circle(stamp(0), 0.2);
    state.covariance[triangle_index(2, 6, 15).unwrap()] = 0.01;
    let settings = settings();
    let smoother = Config::from_toml_str(
        "model = 'imu'\nestimator = 'smoother'\n[noise]\ngyro_density = 1e-3\naccel_density = 1e-3\n",
        "a smoother",
    );
    let smoother = Settings::new(&smoother.unwrap()).smoother.unwrap();
    let (left, published) = resumed(InertialEngine::<NavState, Left, 15>::new(settings), &state);
    let others = [
        resumed(InertialEngine::<NavState, Right, 15>::new(settings), &state),
        resumed(
            SmoothingEngine::<NavState, 15>::smoothing(settings, &smoother),
            &state,
        ),
    ];
    let flags = |estimates: &[EstimateSe23]| -> Vec<bool> {
        let flags = estimates.iter().map(|estimate| estimate.head.flags);
        flags.map(|flags| flags & ESTIMATE_RESUMED != 0).collect()
    };
    assert_eq!(flags(&published), [true, false]);
    assert_eq!(published[0].head.reset_count, 0);
    for (other, published) in others {
        assert_eq!(flags(&published), [true, false]);
        assert_eq!(other.stamp_ns, left.stamp_ns);
        for (a, b) in other.covariance.iter().zip(&left.covariance) {
            assert!((a - b).abs() <= 1e-9 * (1.0 + b.abs()), "{a} {b}");
        }
        for (a, b) in other.p_w_m.iter().zip(&left.p_w_m) {
            assert!((a - b).abs() < 1e-9);
        }
    }
    // Nine states.
    let mut nine = state;
    nine.dimension = 9;
    nine.covariance = [0.0; inekf_shared::message::NAV_TRI];
    for i in 0..9 {
        nine.covariance[triangle_index(i, i, 9).unwrap()] = 0.04;
    }
    let (_, published) = resumed(InertialEngine::<SE23, Left, 9>::new(settings), &nine);
    assert_eq!(flags(&published), [true, false]);
}

#[test]
fn a_state_too_old_or_of_the_future_is_as_if_there_were_none() {
    let inputs = circle(3);
    let (_, plain) = super::common::run(settings(), &inputs);
    let too_old = stamp(0) - 10 * SECOND_NS - 1;
    let future = stamp(0) + 1;
    for (stamp_ns, expected) in [
        (
            too_old,
            Resumption::TooOld {
                age_ns: 10 * SECOND_NS + 1,
            },
        ),
        (future, Resumption::FromFuture { ahead_ns: 1 }),
    ] {
        let mut engine = Engine::new(settings());
        let mut outbox = Vec::new();
        engine
            .resume_from(&state_on_circle(stamp_ns, 0.1), RESUME)
            .unwrap();
        for input in &inputs {
            feed(&mut engine, input, &mut outbox);
        }
        assert_eq!(engine.resumption(), expected);
        assert!(all_bits(&outbox) == all_bits(&plain));
    }
    // Just young enough, and at the very stamp.
    for age_ns in [10 * SECOND_NS, 0] {
        let mut engine = Engine::new(settings());
        engine
            .resume_from(&state_on_circle(stamp(0) - age_ns, 0.1), RESUME)
            .unwrap();
        feed(&mut engine, &Input::Imu(imu(0)), &mut Vec::new());
        assert_eq!(engine.resumption(), Resumption::Resumed { age_ns });
    }
}

#[test]
fn a_fix_that_came_before_the_first_sample_finds_the_start_that_is_made() {
    use inekf_service::engine::settings::PositionSource;
    let mut settings = settings();
    settings.initial.position = PositionSource::FirstFix;
    let start = |state: Option<StateVector>| {
        let mut engine = Engine::new(settings);
        let mut outbox = Vec::new();
        if let Some(state) = state {
            engine.resume_from(&state, RESUME).unwrap();
        }
        feed(
            &mut engine,
            &Input::Position(position(stamp(0), 1, 0)),
            &mut outbox,
        );
        for k in 0..5 {
            feed(&mut engine, &Input::Imu(imu(k)), &mut outbox);
        }
        (engine, outbox)
    };
    let (_, plain) = start(None);
    let (engine, useless) = start(Some(state_on_circle(stamp(1_000_000), 0.1)));
    assert_eq!(engine.tally().counters.accepted, 1);
    assert!(all_bits(&useless) == all_bits(&plain));
    // Continued, it is a fix like any other.
    let (engine, _) = start(Some(state_on_circle(stamp(0) - SECOND_NS, 0.1)));
    assert_eq!(engine.tally().counters.accepted, 1);
    assert_eq!(engine.tally().counters.rejected, 0);
}

#[test]
fn a_request_before_the_first_sample_is_preferred() {
    let earlier = state_on_circle(stamp(0), 0.1);
    let requested = level_state(0, [0.1, 0.1, 0.1]);
    let mut engine = Engine::new(settings());
    engine.resume_from(&earlier, RESUME).unwrap();
    engine.set_state(&requested).unwrap();
    assert_eq!(engine.resumption(), Resumption::None);
    feed(&mut engine, &Input::Imu(imu(1)), &mut Vec::new());
    assert_eq!(engine.snapshot().unwrap().p_w_m, requested.p_w_m);

    let mut engine = Engine::new(settings());
    engine.resume_from(&earlier, RESUME).unwrap();
    engine.reset();
    assert_eq!(engine.resumption(), Resumption::None);
    let mut waits = settings();
    waits.initial.wait_for_request = true;
    let mut engine = Engine::new(waits);
    engine.resume_from(&earlier, RESUME).unwrap();
    feed(&mut engine, &Input::Imu(imu(1)), &mut Vec::new());
    assert_eq!(engine.state(), (STATE_RUNNING, WAITING_FOR_NOTHING));
}

#[test]
fn numbers_that_are_no_state_are_refused_and_those_that_become_none_are_not_used() {
    let mut engine = Engine::new(settings());
    let mut bad = state_on_circle(stamp(0), 0.1);
    bad.q_wb = [0.0; 4];
    assert!(engine.resume_from(&bad, RESUME).is_err());
    assert_eq!(engine.resumption(), Resumption::None);

    let mut fast = state_on_circle(stamp(0), 0.1);
    fast.v_w_mps = [9e8, 0.0, 0.0];
    engine.resume_from(&fast, RESUME).unwrap();
    feed(&mut engine, &Input::Imu(imu(100)), &mut Vec::new());
    assert_eq!(engine.resumption(), Resumption::Unsound);
    assert!(engine.snapshot().unwrap().v_w_mps[0] < 10.0);
}

#[test]
fn what_comes_in_a_pause_is_counted_and_otherwise_as_if_it_had_not_come() {
    let mut paused = engine_at(settings(), &state_on_circle(stamp(0), 0.3));
    let mut deaf = engine_at(settings(), &state_on_circle(stamp(0), 0.3));
    let (mut of_paused, mut of_deaf) = (Vec::new(), Vec::new());
    for k in 0..100 {
        let inputs = [
            Input::Imu(imu(k)),
            Input::Position(position(stamp(k), k, 0)),
        ];
        match k {
            30 => paused.pause(),
            60 => paused.unpause(),
            _ => {}
        }
        let in_pause = (30..60).contains(&k);
        let expected = if in_pause {
            STATE_PAUSED
        } else {
            STATE_RUNNING
        };
        assert_eq!(paused.state(), (expected, WAITING_FOR_NOTHING));
        for input in &inputs {
            feed(&mut paused, input, &mut of_paused);
            if !in_pause {
                feed(&mut deaf, input, &mut of_deaf);
            }
        }
    }
    assert_refused(paused.tally(), &[(REASON_NOT_READY, 60)]);
    assert_eq!(of_paused.len(), of_deaf.len());
    for (a, b) in of_paused.iter().zip(&of_deaf) {
        assert!(belief_bits(a) == belief_bits(b));
    }
}

#[test]
fn other_noise_holds_from_the_next_sample_on_and_bad_noise_changes_nothing() {
    let numbers = ProcessNoise {
        form: NOISE_DENSITY,
        rotation: 5e-2,
        translation: 0.4,
        gyro_bias_walk: 1e-3,
        ..ProcessNoise::UNGIVEN
    };
    let mut other = settings();
    other.imu.white = WhiteNoise::Density {
        gyro: 5e-2,
        accel: 0.4,
    };
    (other.imu.gyro_bias_walk, other.imu.accel_bias_walk) = (1e-3, 0.0);
    let at = |settings| engine_at(settings, &state_on_circle(stamp(0), 0.3));
    let (mut reloaded, mut as_before, mut as_after) = (at(settings()), at(settings()), at(other));
    let bad = ProcessNoise {
        rotation: -1.0,
        ..numbers
    };
    assert!(
        reloaded
            .reload_noise(&bad)
            .unwrap_err()
            .contains("gyroscope")
    );
    let step = |engine: &mut Engine, k| {
        feed(engine, &Input::Imu(lively_imu(k)), &mut Vec::new());
        state_bits(&engine.snapshot().unwrap())
    };
    assert!(step(&mut reloaded, 1) == step(&mut as_before, 1));
    reloaded.reload_noise(&numbers).unwrap();
    as_after.set_state(&reloaded.snapshot().unwrap()).unwrap();
    step(&mut as_before, 2);
    assert!(step(&mut reloaded, 2) == step(&mut as_after, 2));
    assert!(step(&mut reloaded, 3) == step(&mut as_after, 3));
    assert!(step(&mut as_before, 3) != step(&mut reloaded, 4));
}
