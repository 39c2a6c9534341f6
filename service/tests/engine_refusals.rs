//! Bad input: every fault is counted under exactly its reason, and changes no bit of any estimate.

mod common;

use common::{
    EPOCH, Engine, Input, all_bits, assert_refused, circle, feed, heading, imu, isotropic,
    position, run, settings, stamp, velocity,
};
use inekf_service::engine::tally::Refusal;
use inekf_shared::message::{
    Header, HeadingFix, INPUT_ODOMETRY_2D, INPUT_ODOMETRY_3D, ImuSample, PositionFix,
    REASON_BAD_COVARIANCE, REASON_BAD_DIMENSION, REASON_BAD_FLAGS, REASON_GAP, REASON_NOT_FINITE,
    REASON_NOT_READY, REASON_OUT_OF_RANGE, REASON_STAMP_NOT_AFTER, REASON_UNKNOWN_SOURCE,
    REASON_WRONG_MODEL, STATE_WAITING, VelocityFix, WAITING_FOR_IMU, Zero,
};

/// The sample before which the bad message comes.
const AT: u64 = 150;
const NOT_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
/// Farther ahead than a sample may be, or a fix.
const JUMP_NS: u64 = 61_000_000_000;

struct Case {
    name: String,
    input: Input,
    reason: u32,
}

#[derive(Default)]
struct Cases(Vec<Case>);

impl Cases {
    fn add(&mut self, name: impl Into<String>, input: Input, reason: u32) {
        self.0.push(Case {
            name: name.into(),
            input,
            reason,
        });
    }
}

fn imu_cases(cases: &mut Cases) {
    // A number that was seen before, so that nothing counts as lost.
    let good = ImuSample {
        header: Header {
            stamp_ns: stamp(AT),
            ..imu(AT - 1).header
        },
        ..imu(AT)
    };
    for axis in 0..3 {
        let mut with = |name: &str, gyro: bool, value: f64, reason| {
            let mut sample = good;
            let vector = if gyro {
                &mut sample.gyro_rps
            } else {
                &mut sample.accel_mps2
            };
            vector[axis] = value;
            let sensor = if gyro { "gyro" } else { "accel" };
            cases.add(
                format!("imu {sensor}[{axis}] {name} {value:e}"),
                Input::Imu(sample),
                reason,
            );
        };
        for value in NOT_FINITE {
            with("not finite", true, value, REASON_NOT_FINITE);
            with("not finite", false, value, REASON_NOT_FINITE);
        }
        for sign in [1.0, -1.0] {
            with("too large", true, sign * 50.001, REASON_OUT_OF_RANGE);
            with("too large", false, sign * 500.01, REASON_OUT_OF_RANGE);
            with("absurd", true, sign * f64::MAX, REASON_OUT_OF_RANGE);
            with("absurd", false, sign * f64::MAX, REASON_OUT_OF_RANGE);
        }
    }
    let stamps = [
        ("equal", stamp(AT - 1), REASON_STAMP_NOT_AFTER),
        ("one back", stamp(AT - 1) - 1, REASON_STAMP_NOT_AFTER),
        (
            "a minute back",
            stamp(AT) - 60_000_000_000,
            REASON_STAMP_NOT_AFTER,
        ),
        ("zero", 0, REASON_STAMP_NOT_AFTER),
        ("61 s ahead", stamp(AT) + JUMP_NS, REASON_GAP),
        ("the end of time", u64::MAX, REASON_GAP),
    ];
    for (name, stamp_ns, reason) in stamps {
        for epoch in [EPOCH, EPOCH + 1] {
            let mut sample = good;
            sample.header.stamp_ns = stamp_ns;
            sample.header.epoch = epoch;
            cases.add(
                format!("imu stamp {name}, epoch {epoch}"),
                Input::Imu(sample),
                reason,
            );
        }
    }
}

/// Covariances that are none, by what is wrong with them.
fn bad_covariances() -> Vec<(String, [f64; 9], u32)> {
    let good = isotropic(0.5);
    let with = |changes: &[(usize, f64)]| {
        let mut covariance = good;
        for (index, value) in changes {
            covariance[*index] = *value;
        }
        covariance
    };
    let mut bad = Vec::new();
    for entry in 0..9 {
        for value in NOT_FINITE {
            bad.push((
                format!("covariance[{entry}] {value:e}"),
                with(&[(entry, value)]),
                REASON_NOT_FINITE,
            ));
        }
    }
    for entry in [0, 4, 8] {
        for value in [0.0, -0.25, 1e-30, 1e30, f64::MAX, f64::MIN_POSITIVE] {
            bad.push((
                format!("variance[{entry}] {value:e}"),
                with(&[(entry, value)]),
                REASON_BAD_COVARIANCE,
            ));
        }
    }
    for (name, covariance) in [
        ("all zero", [0.0; 9]),
        ("one side only", with(&[(1, 0.1)])),
        ("opposite signs", with(&[(2, 0.1), (6, -0.1)])),
        ("correlation above one", with(&[(1, 0.3), (3, 0.3)])),
        ("correlation far above one", with(&[(5, 1e300), (7, 1e300)])),
        (
            "every pair possible, all three not",
            with(&[
                (1, -0.2),
                (3, -0.2),
                (2, -0.2),
                (6, -0.2),
                (5, -0.2),
                (7, -0.2),
            ]),
        ),
    ] {
        bad.push((name.to_owned(), covariance, REASON_BAD_COVARIANCE));
    }
    bad
}

fn position_cases(cases: &mut Cases) {
    let good = position(stamp(AT) - 1_000_000, 0, 0);
    let mut add = |name: String, change: &dyn Fn(&mut PositionFix), reason| {
        let mut fix = good;
        change(&mut fix);
        cases.add(format!("position {name}"), Input::Position(fix), reason);
    };
    for axis in 0..3 {
        for value in NOT_FINITE {
            add(
                format!("[{axis}] {value:e}"),
                &|fix| fix.position_w_m[axis] = value,
                REASON_NOT_FINITE,
            );
        }
        for value in [1.1e9, -1.1e9, f64::MAX] {
            add(
                format!("[{axis}] {value:e}"),
                &|fix| fix.position_w_m[axis] = value,
                REASON_OUT_OF_RANGE,
            );
        }
    }
    for (name, covariance, reason) in bad_covariances() {
        add(name, &|fix| fix.covariance_w_m2 = covariance, reason);
    }
    for source in [2, 7, 8, 9, u32::MAX] {
        add(
            format!("source {source}"),
            &|fix| fix.source = source,
            REASON_UNKNOWN_SOURCE,
        );
    }
    for dimension in [0, 1, 2, 4, 99, u32::MAX] {
        add(
            format!("dimension {dimension}"),
            &|fix| fix.dimension = dimension,
            REASON_BAD_DIMENSION,
        );
    }
    for ahead_ns in [JUMP_NS, u64::MAX - stamp(AT)] {
        add(
            format!("{ahead_ns} ns ahead"),
            &|fix| fix.header.stamp_ns = stamp(AT) + ahead_ns,
            REASON_OUT_OF_RANGE,
        );
    }
}

fn velocity_cases(cases: &mut Cases) {
    let good = velocity(stamp(AT) - 1_000_000, 0);
    let mut add = |name: String, change: &dyn Fn(&mut VelocityFix), reason| {
        let mut fix = good;
        change(&mut fix);
        cases.add(format!("velocity {name}"), Input::Velocity(fix), reason);
    };
    for axis in 0..3 {
        for value in NOT_FINITE {
            add(
                format!("[{axis}] {value:e}"),
                &|fix| fix.velocity_w_mps[axis] = value,
                REASON_NOT_FINITE,
            );
        }
        for value in [1.1e5, -1.1e5, f64::MAX] {
            add(
                format!("[{axis}] {value:e}"),
                &|fix| fix.velocity_w_mps[axis] = value,
                REASON_OUT_OF_RANGE,
            );
        }
    }
    for (name, covariance, reason) in bad_covariances() {
        add(name, &|fix| fix.covariance_w = covariance, reason);
    }
    for source in [1, 8, u32::MAX] {
        add(
            format!("source {source}"),
            &|fix| fix.source = source,
            REASON_UNKNOWN_SOURCE,
        );
    }
    for flags in [1, 1 << 31, u32::MAX] {
        add(
            format!("flags {flags}"),
            &|fix| fix.flags = flags,
            REASON_BAD_FLAGS,
        );
    }
    add(
        "61 s ahead".to_owned(),
        &|fix| fix.header.stamp_ns += JUMP_NS,
        REASON_OUT_OF_RANGE,
    );
}

fn heading_cases(cases: &mut Cases) {
    let good = heading(stamp(AT) - 1_000_000, 0);
    let mut add = |name: String, change: &dyn Fn(&mut HeadingFix), reason| {
        let mut fix = good;
        change(&mut fix);
        cases.add(format!("heading {name}"), Input::Heading(fix), reason);
    };
    for value in NOT_FINITE {
        add(
            format!("{value:e}"),
            &|fix| fix.heading_rad = value,
            REASON_NOT_FINITE,
        );
        add(
            format!("sigma {value:e}"),
            &|fix| fix.sigma_rad = value,
            REASON_NOT_FINITE,
        );
    }
    for value in [1.1e4, -1.1e4, f64::MAX] {
        add(
            format!("{value:e}"),
            &|fix| fix.heading_rad = value,
            REASON_OUT_OF_RANGE,
        );
    }
    for sigma in [0.0, -0.0, -0.1, 1e-20, 1e20, f64::MAX] {
        add(
            format!("sigma {sigma:e}"),
            &|fix| fix.sigma_rad = sigma,
            REASON_BAD_COVARIANCE,
        );
    }
    for source in [1, 8, u32::MAX] {
        add(
            format!("source {source}"),
            &|fix| fix.source = source,
            REASON_UNKNOWN_SOURCE,
        );
    }
    for flags in [1, 1 << 31, u32::MAX] {
        add(
            format!("flags {flags}"),
            &|fix| fix.flags = flags,
            REASON_BAD_FLAGS,
        );
    }
    add(
        "61 s ahead".to_owned(),
        &|fix| fix.header.stamp_ns += JUMP_NS,
        REASON_OUT_OF_RANGE,
    );
}

fn all_cases() -> Vec<Case> {
    let mut cases = Cases::default();
    imu_cases(&mut cases);
    position_cases(&mut cases);
    velocity_cases(&mut cases);
    heading_cases(&mut cases);
    cases.0
}

#[test]
fn a_bad_message_is_counted_by_its_reason_and_changes_no_bit() {
    let good = circle(3);
    let (clean_engine, clean) = run(settings(), &good);
    assert_refused(clean_engine.tally(), &[]);
    let clean = all_bits(&clean);
    let at = good
        .iter()
        .position(|input| matches!(input, Input::Imu(sample) if sample.header.seq == AT))
        .unwrap();

    for Case {
        name,
        input,
        reason,
    } in all_cases()
    {
        println!("with {name}:");
        let mut inputs = good.clone();
        inputs.insert(at, input);
        let (engine, estimates) = run(settings(), &inputs);
        assert_refused(engine.tally(), &[(reason, 1)]);
        assert_eq!(
            engine.tally().received.iter().sum::<u64>(),
            inputs.len() as u64
        );
        assert_eq!(estimates.last().unwrap().head.counters.rejected, 1);
        assert!(all_bits(&estimates) == clean, "an estimate has changed");
    }
}

#[test]
fn a_bad_fix_is_nothing_to_start_from() {
    let mut waiting = settings();
    waiting.initial.position = inekf_service::engine::settings::PositionSource::FirstFix;
    let bad_values = |reason| {
        reason != REASON_OUT_OF_RANGE && reason != REASON_STAMP_NOT_AFTER && reason != REASON_GAP
    };
    for Case {
        name,
        input,
        reason,
    } in all_cases()
    {
        println!("with {name}:");
        if matches!(input, Input::Imu(_)) || !bad_values(reason) {
            continue;
        }
        let (mut engine, mut estimates) = run(waiting, &[input]);
        assert_refused(engine.tally(), &[(reason, 1)]);
        assert_eq!(engine.state(), (STATE_WAITING, WAITING_FOR_IMU));
        for k in 0..20 {
            feed(&mut engine, &Input::Imu(imu(k)), &mut estimates);
        }
        assert!(engine.snapshot().is_none());
        assert!(estimates.is_empty());
    }
}

#[test]
fn the_largest_believable_sample_is_believed() {
    let mut sample = imu(1);
    sample.gyro_rps = [50.0, -50.0, 50.0];
    sample.accel_mps2 = [-500.0, 500.0, -500.0];
    let (engine, estimates) = run(settings(), &[Input::Imu(imu(0)), Input::Imu(sample)]);
    assert_refused(engine.tally(), &[]);
    assert_eq!(estimates.len(), 1);
}

#[test]
fn another_models_input_is_refused() {
    let (mut engine, _) = run(settings(), &circle(1));
    let before = engine.snapshot().map(|state| common::state_bits(&state));
    for input in [INPUT_ODOMETRY_2D, INPUT_ODOMETRY_3D] {
        engine.refuse(input, &Header::ZERO, Refusal(REASON_WRONG_MODEL));
        assert_eq!(engine.tally().received[input], 1);
    }
    assert_refused(engine.tally(), &[(REASON_WRONG_MODEL, 2)]);
    assert_eq!(
        engine.snapshot().map(|state| common::state_bits(&state)),
        before
    );
}

#[test]
fn fixes_that_have_nothing_to_correct_yet_are_counted_as_not_ready() {
    let (engine, estimates) = run(
        settings(),
        &[
            Input::Position(position(stamp(0), 0, 0)),
            Input::Velocity(velocity(stamp(0), 0)),
            Input::Heading(heading(stamp(0), 0)),
        ],
    );
    assert_refused(engine.tally(), &[(REASON_NOT_READY, 3)]);
    assert!(estimates.is_empty());
}

#[test]
fn what_still_waits_at_the_end_is_counted_then() {
    let mut engine = Engine::new(settings());
    let outbox = &mut Vec::new();
    for k in 0..10 {
        feed(&mut engine, &Input::Imu(imu(k)), outbox);
    }
    // Ahead of the samples: they wait.
    for (number, ahead) in [1, 1_000_000, 5_000_000_000].into_iter().enumerate() {
        let fix = position(stamp(9) + ahead, number as u64, 0);
        feed(&mut engine, &Input::Position(fix), outbox);
    }
    assert_refused(engine.tally(), &[]);
    engine.finish(outbox);
    assert_refused(engine.tally(), &[(REASON_NOT_READY, 3)]);
    assert_eq!(engine.tally().counters.accepted, 0);
}
