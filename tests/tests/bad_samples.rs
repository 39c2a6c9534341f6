//! Whatever a sensor process writes into shared memory: a bad message is counted by its reason and changes no bit of
//! the estimates that follow.

use inekf_client::dataset::Dataset;
use inekf_client::feed::{Input, Numbering};
use inekf_service::engine::tally::Tally;
use inekf_shared::message::{
    EstimateSe23, Header, HeadingFix, INPUT_ODOMETRY_2D, ImuSample, Odometry2d, PositionFix,
    REASON_BAD_COVARIANCE, REASON_BAD_DIMENSION, REASON_BAD_FLAGS, REASON_GAP, REASON_NOT_FINITE,
    REASON_OUT_OF_RANGE, REASON_STAMP_NOT_AFTER, REASON_UNKNOWN_SOURCE, REASON_WRONG_MODEL,
    VelocityFix, Zero,
};
use inekf_tests::drive::{CONFIG, drive};
use inekf_tests::in_process;
use inekf_tests::link::{HealthReader, Link, RawFeeder};
use inekf_tests::memory::Memory;
use inekf_tests::process::Daemon;
use inekf_tests::score::{SECOND_NS, assert_same_states};

/// Feeders of every input, which send what they are given.
struct Raw {
    imu: RawFeeder<ImuSample>,
    position: RawFeeder<PositionFix>,
    velocity: RawFeeder<VelocityFix>,
    heading: RawFeeder<HeadingFix>,
    odometry2d: RawFeeder<Odometry2d>,
}

impl Raw {
    fn open(memory: &Memory) -> Self {
        Self {
            imu: RawFeeder::open(memory, "car"),
            position: RawFeeder::open(memory, "car"),
            velocity: RawFeeder::open(memory, "car"),
            heading: RawFeeder::open(memory, "car"),
            odometry2d: RawFeeder::open(memory, "car"),
        }
    }

    fn send(&self, input: Input) {
        match input {
            Input::Imu(message) => self.imu.send(message),
            Input::Position(message) => self.position.send(message),
            Input::Velocity(message) => self.velocity.send(message),
            Input::Heading(message) => self.heading.send(message),
            Input::Odometry2d(message) => self.odometry2d.send(message),
            Input::Odometry3d(_) => panic!("no test sends this"),
        }
    }
}

/// Bad messages made from good ones, and the reason for which each is refused. They repeat the good one's number, so
/// none is missing.
fn bad_messages(good: &Good) -> Vec<(Input, u32)> {
    let Good {
        imu,
        position,
        velocity,
        heading,
    } = *good;
    let imu_at = |stamp_ns| {
        Input::Imu(ImuSample {
            header: Header {
                stamp_ns,
                ..imu.header
            },
            ..imu
        })
    };
    let now_ns = imu.header.stamp_ns;
    let gyro = |gyro_rps| Input::Imu(ImuSample { gyro_rps, ..imu });
    let accel = |accel_mps2| Input::Imu(ImuSample { accel_mps2, ..imu });
    let at = |position_w_m| {
        Input::Position(PositionFix {
            position_w_m,
            ..position
        })
    };
    let variances = |x, y, z| {
        let covariance_w_m2 = [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z];
        Input::Position(PositionFix {
            covariance_w_m2,
            ..position
        })
    };
    vec![
        (gyro([0.0, f64::NAN, 0.0]), REASON_NOT_FINITE),
        (accel([f64::NEG_INFINITY, 0.0, 9.8]), REASON_NOT_FINITE),
        (gyro([51.0, 0.0, 0.0]), REASON_OUT_OF_RANGE),
        (accel([0.0, 0.0, -501.0]), REASON_OUT_OF_RANGE),
        (imu_at(now_ns), REASON_STAMP_NOT_AFTER),
        (imu_at(now_ns - 1), REASON_STAMP_NOT_AFTER),
        (imu_at(now_ns - SECOND_NS), REASON_STAMP_NOT_AFTER),
        (imu_at(0), REASON_STAMP_NOT_AFTER),
        (imu_at(now_ns + 3600 * SECOND_NS), REASON_GAP),
        (at([f64::NAN, 0.0, 0.0]), REASON_NOT_FINITE),
        (at([0.0, 1e12, 0.0]), REASON_OUT_OF_RANGE),
        (variances(1.0, -1.0, 1.0), REASON_BAD_COVARIANCE),
        (variances(1.0, 1.0, 0.0), REASON_BAD_COVARIANCE),
        (
            Input::Position(PositionFix {
                source: 5,
                ..position
            }),
            REASON_UNKNOWN_SOURCE,
        ),
        (
            Input::Position(PositionFix {
                source: u32::MAX,
                ..position
            }),
            REASON_UNKNOWN_SOURCE,
        ),
        (
            Input::Position(PositionFix {
                dimension: 4,
                ..position
            }),
            REASON_BAD_DIMENSION,
        ),
        (
            Input::Velocity(VelocityFix {
                flags: 1,
                ..velocity
            }),
            REASON_BAD_FLAGS,
        ),
        (
            Input::Velocity(VelocityFix {
                source: 1,
                ..velocity
            }),
            REASON_UNKNOWN_SOURCE,
        ),
        (
            Input::Velocity(VelocityFix {
                covariance_w: [0.0; 9],
                ..velocity
            }),
            REASON_BAD_COVARIANCE,
        ),
        (
            Input::Heading(HeadingFix {
                sigma_rad: -0.1,
                ..heading
            }),
            REASON_BAD_COVARIANCE,
        ),
        (
            Input::Heading(HeadingFix {
                heading_rad: f64::NAN,
                ..heading
            }),
            REASON_NOT_FINITE,
        ),
        (
            Input::Odometry2d(Odometry2d {
                header: Header {
                    seq: 0,
                    ..imu.header
                },
                ..Odometry2d::ZERO
            }),
            REASON_WRONG_MODEL,
        ),
    ]
}

/// The newest good message of each kind.
#[derive(Clone, Copy)]
struct Good {
    imu: ImuSample,
    position: PositionFix,
    velocity: VelocityFix,
    heading: HeadingFix,
}

impl Good {
    fn keep(&mut self, input: Input) {
        match input {
            Input::Imu(message) => self.imu = message,
            Input::Position(message) => self.position = message,
            Input::Velocity(message) => self.velocity = message,
            Input::Heading(message) => self.heading = message,
            Input::Odometry2d(_) | Input::Odometry3d(_) => {}
        }
    }
}

/// The estimates and counters of a daemon that nobody disturbs.
fn undisturbed(dataset: &Dataset) -> (Vec<EstimateSe23>, Tally) {
    let mut estimates = Vec::new();
    let tally = in_process::run(dataset, CONFIG, &mut estimates);
    (estimates, tally)
}

#[test]
fn bad_samples_are_counted_by_reason_and_change_no_bit() {
    let dataset = drive(1, 10.0);
    let memory = Memory::new();
    let config = format!("{CONFIG}\n[health]\nperiod_s = 0.2\n");
    let daemon = Daemon::start(&memory, "car", &config);
    let health = HealthReader::open(&memory, "car");
    let mut link = Link::open(&memory, "car");
    let raw = Raw::open(&memory);

    let mut numbering = Numbering::new(7);
    let mut good = Good {
        imu: ImuSample::ZERO,
        position: PositionFix::ZERO,
        velocity: VelocityFix::ZERO,
        heading: HeadingFix::ZERO,
    };
    let mut estimates = Vec::new();
    let (undisturbed, tally) = undisturbed(&dataset);
    // The fixes that come before there is a state.
    let mut expected = tally.rejected_by_reason;
    for (row, event) in dataset.events().enumerate() {
        let input = numbering.message(&event, 0);
        raw.send(input);
        good.keep(input);
        // After a second, and then every two, all bad messages come between two good ones.
        if row % 250 == 125 {
            link.settle(&mut estimates);
            for (bad, reason) in bad_messages(&good) {
                raw.send(bad);
                expected[reason as usize] += 1;
            }
        }
        if row % 100 == 99 {
            link.settle(&mut estimates);
        }
    }
    link.settle(&mut estimates);
    // Odometry is looked at when health is written.
    let all = health.wait_until("health that has counted everything", |health| {
        health.rejected_by_reason[REASON_WRONG_MODEL as usize]
            == expected[REASON_WRONG_MODEL as usize]
    });
    assert_eq!(all.rejected_by_reason, expected);
    assert_eq!(all.counters.rejected, expected.iter().sum::<u64>());
    assert_eq!(
        all.received[INPUT_ODOMETRY_2D],
        expected[REASON_WRONG_MODEL as usize]
    );
    assert_eq!((all.counters.lost, all.counters.late), (0, 0));
    assert_eq!(all.counters.accepted, tally.counters.accepted);
    assert_same_states(&estimates, &undisturbed);
    assert_eq!(estimates.last().unwrap().head.reset_count, 0);

    drop((link, raw, health));
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn nothing_but_bad_samples_leaves_a_daemon_waiting_and_answering() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let raw = Raw::open(&memory);
    let bad = ImuSample {
        gyro_rps: [f64::NAN; 3],
        ..ImuSample::ZERO
    };
    let mut estimates = Vec::new();
    // More than the daemon's buffer holds, in one go: it may lose some, and never stops.
    for seq in 0..10_000 {
        let header = Header {
            seq,
            stamp_ns: seq,
            ..Header::ZERO
        };
        raw.send(Input::Imu(ImuSample { header, ..bad }));
        if seq == 0 {
            // What is lost is counted from the first one that is heard.
            link.settle(&mut estimates);
        }
    }
    let answer = link.settle(&mut estimates);
    assert!(estimates.is_empty());
    let counters = answer.counters;
    assert_eq!(
        counters.rejected,
        answer.rejected_by_reason[REASON_NOT_FINITE as usize]
    );
    assert_eq!(counters.rejected + counters.lost, 10_000);
    // And it runs as soon as something good comes.
    assert!(!link.feed_all(&drive(2, 2.0)).is_empty());
    drop((link, raw));
    daemon.stop();
    memory.assert_nothing_left();
}
