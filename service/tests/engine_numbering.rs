//! Losses are counted from the numbering of each topic and sender; nothing else is a loss.

mod common;

use common::{Engine, Input, feed, heading, imu, position, run, settings, stamp, velocity};
use inekf_shared::message::{INPUT_HEADING, INPUT_IMU, INPUT_POSITION, INPUT_VELOCITY};

/// Epoch and number of a message.
type Sent = (u64, u64);

/// Sends such messages on one topic; the number counted as lost.
fn lost(topic: usize, messages: &[Sent]) -> u64 {
    let mut engine = Engine::new(settings());
    for (k, (epoch, seq)) in (0..).zip(messages) {
        let mut input = match topic {
            INPUT_IMU => Input::Imu(imu(k)),
            INPUT_POSITION => Input::Position(position(stamp(k), 0, 0)),
            INPUT_VELOCITY => Input::Velocity(velocity(stamp(k), 0)),
            _ => Input::Heading(heading(stamp(k), 0)),
        };
        let header = match &mut input {
            Input::Imu(message) => &mut message.header,
            Input::Position(message) => &mut message.header,
            Input::Velocity(message) => &mut message.header,
            Input::Heading(message) => &mut message.header,
        };
        (header.epoch, header.seq) = (*epoch, *seq);
        feed(&mut engine, &input, &mut Vec::new());
    }
    assert_eq!(engine.tally().received[topic], messages.len() as u64);
    engine.tally().counters.lost
}

#[test]
fn a_gap_in_the_numbers_is_a_loss_and_nothing_else_is() {
    let cases: [(&str, &[Sent], u64); 12] = [
        ("in order", &[(1, 0), (1, 1), (1, 2)], 0),
        (
            "the first number is any",
            &[(1, 1_000_000), (1, 1_000_001)],
            0,
        ),
        ("one missing", &[(1, 0), (1, 2)], 1),
        ("several gaps", &[(1, 3), (1, 7), (1, 8), (1, 18)], 3 + 9),
        ("duplicate", &[(1, 0), (1, 1), (1, 1), (1, 2)], 0),
        ("out of order", &[(1, 0), (1, 2), (1, 1), (1, 3)], 1),
        (
            "a duplicate does not reset the count",
            &[(1, 0), (1, 5), (1, 5), (1, 0), (1, 6)],
            4,
        ),
        (
            "a new sender numbers anew",
            &[(1, 0), (1, 1), (2, 0), (2, 1)],
            0,
        ),
        (
            "a new sender starts anywhere",
            &[(1, 0), (2, 500), (2, 502)],
            1,
        ),
        (
            "two senders side by side",
            &[(1, 0), (2, 9), (1, 1), (2, 10), (1, 3), (2, 14)],
            1 + 3,
        ),
        (
            "the last number",
            &[(1, u64::MAX - 1), (1, u64::MAX), (1, 0), (1, 1)],
            0,
        ),
        (
            "everything missing",
            &[(1, 0), (1, u64::MAX), (2, 0), (2, u64::MAX)],
            u64::MAX,
        ),
    ];
    for topic in [INPUT_IMU, INPUT_POSITION, INPUT_VELOCITY, INPUT_HEADING] {
        for (name, messages, expected) in cases {
            assert_eq!(lost(topic, messages), expected, "{name}, topic {topic}");
        }
    }
}

#[test]
fn more_senders_than_are_followed_are_never_counted_as_losses() {
    let many: Vec<Sent> = (0..2000).map(|n| (n % 50, 10 * n)).collect();
    assert_eq!(lost(INPUT_POSITION, &many), 0);
}

#[test]
fn topics_are_numbered_apart() {
    let inputs = [
        Input::Imu(imu(0)),
        Input::Position(position(stamp(0), 40, 0)),
        Input::Velocity(velocity(stamp(0), 7)),
        Input::Heading(heading(stamp(0), 3)),
        Input::Imu(imu(1)),
        Input::Position(position(stamp(1), 41, 0)),
        Input::Velocity(velocity(stamp(1), 9)),
        Input::Heading(heading(stamp(1), 4)),
        Input::Imu(imu(4)),
    ];
    let (engine, estimates) = run(settings(), &inputs);
    assert_eq!(engine.tally().counters.lost, 1 + 2);
    assert_eq!(estimates.last().unwrap().head.counters.lost, 3);
}

#[test]
fn a_refused_message_is_not_a_lost_one() {
    let mut bad = imu(1);
    bad.gyro_rps[0] = f64::NAN;
    let (engine, _) = run(
        settings(),
        &[Input::Imu(imu(0)), Input::Imu(bad), Input::Imu(imu(2))],
    );
    assert_eq!(engine.tally().counters.lost, 0);
    assert_eq!(engine.tally().counters.rejected, 1);
}
