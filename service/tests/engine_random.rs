//! Whatever bits a sender writes: no panic, a finite state, and the good stream goes on.
//!
//! Each message is either random in every bit, or the good one with a few fields made strange.

mod common;

use common::{
    Engine, Input, circle, feed, heading, imu, numbers, position, position_error, settings, stamp,
    state_on_circle, velocity,
};
use inekf_service::engine::Settings;
use inekf_service::engine::settings::{LevelSource, PositionSource};
use inekf_service::engine::tally::Refusal;
use inekf_shared::message::{
    EstimateSe23, Header, HeadingFix, INPUT_ODOMETRY_2D, ImuSample, PositionFix,
    REASON_WRONG_MODEL, STATE_RUNNING, StateVector, VelocityFix, WAITING_FOR_NOTHING,
};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const MESSAGES: u64 = 20_000;

/// Numbers at the edges of what a double can be and of what the engine believes.
const STRANGE: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    50.0,
    -50.0,
    499.0,
    1e5,
    -1e5,
    1e9,
    -1e9,
    1e-9,
    1e-18,
    1e18,
    1e150,
    -1e150,
    1e300,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
];

/// Writes a strange number over some of `values`.
fn spoil(values: &mut [f64], rng: &mut ChaCha8Rng) {
    for _ in 0..rng.random_range(0..3) {
        let at = rng.random_range(0..values.len());
        values[at] = if rng.random_bool(0.5) {
            *STRANGE.choose(rng).unwrap()
        } else {
            f64::from_bits(rng.random())
        };
    }
}

fn any_bits(values: &mut [f64], rng: &mut ChaCha8Rng) {
    values.fill_with(|| f64::from_bits(rng.random()));
}

fn spoil_header(header: &mut Header, rng: &mut ChaCha8Rng) {
    match rng.random_range(0..8) {
        0 => header.stamp_ns = rng.random(),
        1 => header.stamp_ns = *[0, 1, u64::MAX - 1, u64::MAX].choose(rng).unwrap(),
        2 => {
            header.stamp_ns = header
                .stamp_ns
                .wrapping_add_signed(rng.random_range(-9e9..9e9) as i64)
        }
        3 => header.seq = rng.random(),
        4 => header.epoch = rng.random(),
        5 => header.sent_ns = rng.random(),
        _ => {}
    }
}

fn any_header(rng: &mut ChaCha8Rng) -> Header {
    Header {
        stamp_ns: rng.random(),
        seq: rng.random(),
        sent_ns: rng.random(),
        epoch: rng.random(),
    }
}

/// Which kind of message is made strange.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Imu,
    Position,
    Velocity,
    Heading,
    State,
    Odometry,
}

fn strange_imu(k: u64, rng: &mut ChaCha8Rng) -> ImuSample {
    let mut sample = imu(k);
    if rng.random_bool(0.5) {
        sample.header = any_header(rng);
        any_bits(&mut sample.gyro_rps, rng);
        any_bits(&mut sample.accel_mps2, rng);
    } else {
        spoil_header(&mut sample.header, rng);
        spoil(&mut sample.gyro_rps, rng);
        spoil(&mut sample.accel_mps2, rng);
    }
    sample
}

fn strange_position(k: u64, rng: &mut ChaCha8Rng) -> PositionFix {
    let mut fix = position(stamp(k), k, rng.random_range(0..2));
    if rng.random_bool(0.3) {
        fix.header = any_header(rng);
        (fix.source, fix.dimension) = (rng.random(), rng.random());
        any_bits(&mut fix.position_w_m, rng);
        any_bits(&mut fix.covariance_w_m2, rng);
    } else {
        spoil_header(&mut fix.header, rng);
        spoil(&mut fix.position_w_m, rng);
        spoil(&mut fix.covariance_w_m2, rng);
    }
    fix
}

fn strange_velocity(k: u64, rng: &mut ChaCha8Rng) -> VelocityFix {
    let mut fix = velocity(stamp(k), k);
    if rng.random_bool(0.3) {
        fix.header = any_header(rng);
        (fix.source, fix.flags) = (rng.random(), rng.random());
        any_bits(&mut fix.velocity_w_mps, rng);
        any_bits(&mut fix.covariance_w, rng);
    } else {
        spoil_header(&mut fix.header, rng);
        spoil(&mut fix.velocity_w_mps, rng);
        spoil(&mut fix.covariance_w, rng);
    }
    fix
}

fn strange_heading(k: u64, rng: &mut ChaCha8Rng) -> HeadingFix {
    let mut fix = heading(stamp(k), k);
    let mut values = [fix.heading_rad, fix.sigma_rad];
    if rng.random_bool(0.3) {
        fix.header = any_header(rng);
        (fix.source, fix.flags) = (rng.random(), rng.random());
        any_bits(&mut values, rng);
    } else {
        spoil_header(&mut fix.header, rng);
        spoil(&mut values, rng);
    }
    [fix.heading_rad, fix.sigma_rad] = values;
    fix
}

fn strange_state(k: u64, rng: &mut ChaCha8Rng) -> StateVector {
    let mut state = state_on_circle(stamp(k), 1.0);
    if rng.random_bool(0.3) {
        (state.model, state.dimension) = (rng.random(), rng.random());
        state.stamp_ns = rng.random();
        any_bits(&mut state.q_wb, rng);
        any_bits(&mut state.covariance, rng);
        return state;
    }
    match rng.random_range(0..12) {
        0 => state.dimension = rng.random_range(0..17),
        1 => state.dimension = 9,
        2 => state.model = rng.random_range(0..6),
        3 => state.stamp_ns = rng.random(),
        4 => state.stamp_ns = 0,
        5 => spoil(&mut state.q_wb, rng),
        6 => spoil(&mut state.v_w_mps, rng),
        7 => spoil(&mut state.p_w_m, rng),
        8 => spoil(&mut state.gyro_bias_rps, rng),
        9 => spoil(&mut state.accel_bias_mps2, rng),
        _ => spoil(&mut state.covariance, rng),
    }
    state
}

fn feed_strange(engine: &mut Engine, kind: Kind, k: u64, rng: &mut ChaCha8Rng) {
    let outbox: &mut Vec<EstimateSe23> = &mut Vec::new();
    match kind {
        Kind::Imu => engine.sample(&strange_imu(k, rng), rng.random(), outbox),
        Kind::Position => engine.position(&strange_position(k, rng), outbox),
        Kind::Velocity => engine.velocity(&strange_velocity(k, rng), outbox),
        Kind::Heading => engine.heading(&strange_heading(k, rng), outbox),
        Kind::State => {
            // Refused or not, the state must be sound.
            let _ = engine.set_state(&strange_state(k, rng));
        }
        Kind::Odometry => engine.refuse(
            INPUT_ODOMETRY_2D,
            &any_header(rng),
            Refusal(REASON_WRONG_MODEL),
        ),
    }
    for estimate in outbox {
        assert_finite(&common::state_of(estimate));
    }
}

fn assert_finite(state: &StateVector) {
    assert!(numbers(state).all(f64::is_finite), "{state:?}");
}

/// Starts level, from the first fix.
fn unknown_start() -> Settings {
    let mut settings = settings();
    settings.initial.level = LevelSource::Accelerometer {
        window_ns: 200_000_000,
    };
    settings.initial.position = PositionSource::FirstFix;
    settings
}

/// Bad messages among good ones, or before any good one; then 20 s of good ones.
fn survives(settings: Settings, kind: Kind, among_good: bool, seed: u64) {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut engine = Engine::new(settings);
    let outbox = &mut Vec::new();
    for n in 0..MESSAGES {
        let k = n + 1;
        feed_strange(&mut engine, kind, k, rng);
        if among_good {
            feed(&mut engine, &Input::Imu(imu(k)), outbox);
            if k.is_multiple_of(20) {
                feed(
                    &mut engine,
                    &Input::Position(position(stamp(k), k, 0)),
                    outbox,
                );
            }
            outbox.clear();
        }
        if let Some(state) = engine.snapshot() {
            assert_finite(&state);
        }
    }
    for input in circle(220) {
        if input.header().stamp_ns > stamp(MESSAGES) {
            feed(&mut engine, &input, outbox);
        }
    }
    let state = engine.snapshot().unwrap();
    assert_finite(&state);
    assert_eq!(
        engine.state(),
        (STATE_RUNNING, WAITING_FOR_NOTHING),
        "{kind:?} {among_good} {seed}"
    );
    assert!(
        position_error(&state) < 1.0,
        "{kind:?} {among_good} {seed}: {} m off, {:?}",
        position_error(&state),
        engine.tally()
    );
}

fn survives_every_way(kind: Kind) {
    for (among_good, seed) in [(true, 1), (false, 2)] {
        survives(settings(), kind, among_good, seed);
        survives(unknown_start(), kind, among_good, seed + 10);
    }
}

#[test]
fn random_imu_samples_do_no_lasting_harm() {
    survives_every_way(Kind::Imu);
}

#[test]
fn random_positions_do_no_lasting_harm() {
    survives_every_way(Kind::Position);
}

#[test]
fn random_velocities_do_no_lasting_harm() {
    survives_every_way(Kind::Velocity);
}

#[test]
fn random_headings_do_no_lasting_harm() {
    survives_every_way(Kind::Heading);
}

#[test]
fn random_states_do_no_lasting_harm() {
    survives_every_way(Kind::State);
}

#[test]
fn random_odometry_does_no_lasting_harm() {
    survives_every_way(Kind::Odometry);
}
