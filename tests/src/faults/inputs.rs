//! Samples that come too fast, twice, late, or with a clock that jumps. All are counted, and the estimates go on.

use std::time::{Duration, Instant};

use inekf_client::feed::Feeder;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    ControlResponse, Header, INPUT_IMU, ImuSample, REASON_GAP, REASON_STAMP_NOT_AFTER,
    STATE_DEGRADED, STATE_RUNNING, STATE_STALE,
};
use rustix::process::{Pid, Signal, kill_process};

use super::kills::{kill, killed, unbroken};
use super::scene::{CONFIG, INSTANCE, Scene, rest};
use super::{Balance, Outcome, Plan};
use crate::link::{HealthReader, Link, RawFeeder, instance};
use crate::process::Daemon;
use crate::score::SECOND_NS;

const PERIOD_NS: u64 = 10_000_000;
/// Samples that are sent and answered at a time: fewer than any queue is long.
const AT_A_TIME: u64 = 100;

/// A daemon, samples made by hand, and what comes of them.
struct Bench {
    scene: Scene,
    daemon: Daemon,
    feeder: RawFeeder<ImuSample>,
    link: Link,
    epoch: u64,
    next_seq: u64,
    sent: u64,
}

impl Bench {
    fn new() -> Self {
        let scene = Scene::with_config(CONFIG);
        let daemon = scene.daemon();
        Self {
            feeder: RawFeeder::open(&scene.memory, INSTANCE),
            link: Link::open(&scene.memory, INSTANCE),
            scene,
            daemon,
            epoch: 1,
            next_seq: 0,
            sent: 0,
        }
    }

    /// Sends a sample of this stamp, and its number.
    fn send(&mut self, stamp_ns: u64) -> u64 {
        let seq = self.next_seq;
        self.next_seq += 1;
        self.send_numbered(stamp_ns, seq);
        seq
    }

    fn send_numbered(&mut self, stamp_ns: u64, seq: u64) {
        let row = rest(stamp_ns);
        self.feeder.send(ImuSample {
            header: Header {
                stamp_ns,
                seq,
                sent_ns: monotonic_ns(),
                epoch: self.epoch,
            },
            gyro_rps: row.gyro_rps,
            accel_mps2: row.accel_mps2,
        });
        self.sent += 1;
    }

    /// Sends `count` samples after `stamp_ns`, waits until they are processed, and gives the last stamp.
    fn run(&mut self, mut stamp_ns: u64, count: u64) -> u64 {
        for index in 0..count {
            stamp_ns += PERIOD_NS;
            self.send(stamp_ns);
            if index % AT_A_TIME == AT_A_TIME - 1 {
                self.settle();
            }
        }
        self.settle();
        stamp_ns
    }

    fn settle(&mut self) -> ControlResponse {
        self.link.settle(&mut Vec::new())
    }

    fn balance(&mut self) -> Balance {
        let answer = self.settle();
        Balance {
            sent: self.sent,
            received: answer.received[INPUT_IMU],
            lost: answer.counters.lost,
        }
        .checked()
    }

    /// Stops the daemon and says how many files there were and are.
    fn end(self) -> (usize, usize) {
        let before = self.scene.files();
        drop((self.link, self.feeder));
        self.daemon.stop();
        let after = self.scene.cleared();
        (before, after)
    }
}

/// The feeder comes back with another rate each time: from 20 Hz to 1 kHz.
pub fn another_rate(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(50);
    let mut moments = plan.moments("rate");
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut observer = scene.observer();
    let before = scene.files();
    let mut times = Vec::new();
    for _ in 0..rounds {
        let rate_hz = [20, 50, 100, 200, 500, 1000][moments.below(6) as usize];
        let (feeder, time) = observer.back_after(|| scene.feeder(plan, rate_hz));
        times.push(time);
        observer.watch_for(Duration::from_millis(100));
        killed(kill(feeder));
        observer.watch_for(Duration::from_millis(20));
    }
    let balance = unbroken(&scene, &mut observer);
    let after = scene.end(daemon, observer);
    Outcome {
        count: rounds,
        survivors: "daemon, reader",
        times,
        balance: Some(balance),
        files: Some((before, after)),
        note: "20 Hz to 1 kHz; never reset".to_owned(),
    }
}

/// The clock jumps by hours: a single wrong stamp moves nothing, and ten in a row are believed.
pub fn clock_jumps(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(300);
    let mut moments = plan.moments("clock");
    let mut bench = Bench::new();
    let mut now_ns = bench.run(1_000 * 3600 * SECOND_NS, 50);
    for round in 0..rounds {
        let by_ns = (1 + moments.below(3600)) * 3600 * SECOND_NS / 100 + 60 * SECOND_NS;
        let jumped_ns = match round % 2 {
            0 => now_ns + by_ns,
            _ => now_ns - by_ns,
        };
        // Once only: the clock stays.
        let before = bench.settle();
        bench.send(jumped_ns);
        bench.run(now_ns, 20);
        let once = bench.settle();
        assert_eq!(once.counters.rejected, before.counters.rejected + 1);
        // For good: some are refused, then the estimate begins anew.
        let mut estimates = Vec::new();
        for index in 1..=30 {
            bench.send(jumped_ns + index * PERIOD_NS);
        }
        now_ns = jumped_ns + 30 * PERIOD_NS;
        let after = bench.link.settle(&mut estimates);
        let last = estimates.last().expect("estimates come again");
        assert_eq!(last.head.stamp_ns, now_ns);
        assert_eq!(last.head.reset_count, u64::from(round) + 1);
        assert!(last.head.reset_jump_m < 1.0, "{}", last.head.reset_jump_m);
        let refused = |answer: &ControlResponse| {
            [REASON_GAP, REASON_STAMP_NOT_AFTER]
                .map(|reason| answer.rejected_by_reason[reason as usize])
                .iter()
                .sum::<u64>()
        };
        assert_eq!(refused(&after), after.counters.rejected);
        assert!(after.counters.rejected > once.counters.rejected);
    }
    let balance = bench.balance();
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        balance: Some(balance),
        files: Some(bench.end()),
        note: "a single wrong stamp is refused; a jump is believed after 10 samples, with one reset each".to_owned(),
        ..Outcome::default()
    }
}

/// Ten seconds of silence: stale, said so by health; then the estimate goes on or begins anew, as configured.
pub fn gap(_plan: &Plan) -> Outcome {
    let mut notes = Vec::new();
    let mut files = None;
    let mut balance = None;
    for (policy, resets) in [("inflate", 0), ("reinitialise", 1)] {
        let config = format!("{CONFIG}stale_after_s = 0.2\n[imu]\non_gap = '{policy}'\n");
        let scene = Scene::with_config(&config);
        let mut bench = Bench {
            daemon: scene.daemon(),
            feeder: RawFeeder::open(&scene.memory, INSTANCE),
            link: Link::open(&scene.memory, INSTANCE),
            scene,
            epoch: 1,
            next_seq: 0,
            sent: 0,
        };
        let health = HealthReader::open(&bench.scene.memory, INSTANCE);
        let now_ns = bench.run(SECOND_NS, 200);
        health.wait_until("stale", |health| health.state == STATE_STALE);
        let mut estimates = Vec::new();
        for index in 0..50 {
            bench.send(now_ns + 10 * SECOND_NS + index * PERIOD_NS);
        }
        bench.link.settle(&mut estimates);
        let last = estimates.last().expect("estimates come again");
        assert_eq!(last.head.reset_count, resets, "{policy}");
        assert!([STATE_RUNNING, STATE_DEGRADED].contains(&last.head.state));
        notes.push(format!("`{policy}`: {resets} resets"));
        balance = Some(bench.balance());
        drop(health);
        files = Some(bench.end());
    }
    Outcome {
        count: 2,
        survivors: "daemon, feeder, reader",
        balance,
        files,
        note: format!("stale meanwhile; {}", notes.join(", ")),
        ..Outcome::default()
    }
}

/// Every sample twice: the second is refused, and not one estimate differs.
pub fn duplicates(plan: &Plan) -> Outcome {
    let count = u64::from(plan.at_most(1000)) * 10;
    let mut runs = Vec::new();
    let (mut balance, mut files) = (None, None);
    for copies in [1, 2] {
        let mut bench = Bench::new();
        let mut estimates = Vec::new();
        for index in 1..=count {
            let seq = bench.send(index * PERIOD_NS);
            for _ in 1..copies {
                bench.send_numbered(index * PERIOD_NS, seq);
            }
            if index % AT_A_TIME == 0 {
                bench.link.settle(&mut estimates);
            }
        }
        let answer = bench.link.settle(&mut estimates);
        assert_eq!(answer.counters.rejected, (copies - 1) * count);
        assert_eq!(answer.counters.lost, 0);
        runs.push(estimates);
        balance = Some(bench.balance());
        files = Some(bench.end());
    }
    let [once, twice] = &runs[..] else {
        unreachable!("there were two runs");
    };
    assert_eq!(once.len(), twice.len());
    for (one, other) in once.iter().zip(twice) {
        assert_eq!(one.p_w_m.map(f64::to_bits), other.p_w_m.map(f64::to_bits));
        assert_eq!(
            one.covariance.map(f64::to_bits),
            other.covariance.map(f64::to_bits)
        );
    }
    Outcome {
        count: u32::try_from(count).unwrap_or(u32::MAX),
        survivors: "daemon, feeder, reader",
        balance,
        files,
        note: "every copy refused; estimates equal bit for bit to those without copies".to_owned(),
        ..Outcome::default()
    }
}

/// The daemon is stopped (SIGSTOP), and more is sent than its queue holds.
pub fn bursts(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(100);
    let mut moments = plan.moments("bursts");
    let scene = Scene::new();
    let daemon = scene.daemon();
    let id = i32::try_from(daemon.id()).ok().and_then(Pid::from_raw);
    let id = id.expect("a process id");
    let mut feeder = Feeder::open_on(scene.memory.node(), &instance(INSTANCE)).expect("a feeder");
    let mut link = Link::open(&scene.memory, INSTANCE);
    let (mut sent, mut longest) = (0, Duration::ZERO);
    let mut stamp_ns = SECOND_NS;
    let mut send = |feeder: &mut Feeder, count: u64| {
        for _ in 0..count {
            stamp_ns += PERIOD_NS / 10;
            let started = Instant::now();
            feeder.imu(&rest(stamp_ns)).expect("sending never fails");
            longest = longest.max(started.elapsed());
        }
        sent += count;
    };
    let mut lost = 0;
    for _ in 0..rounds {
        send(&mut feeder, 50);
        link.controller.barrier().expect("the daemon answers");
        kill_process(id, Signal::STOP).expect("it is there");
        send(&mut feeder, 4096 + 1 + moments.below(5000));
        kill_process(id, Signal::CONT).expect("it is there");
        // A loss is seen at the next number.
        send(&mut feeder, 1);
        let answer = link.controller.barrier().expect("the daemon answers");
        assert!(answer.counters.lost > lost, "the queue was overrun");
        lost = answer.counters.lost;
    }
    let answer = link.controller.barrier().expect("the daemon answers");
    let balance = Balance {
        sent,
        received: answer.received[INPUT_IMU],
        lost: answer.counters.lost,
    };
    let before = scene.files();
    drop((feeder, link));
    daemon.stop();
    let after = scene.cleared();
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        balance: Some(balance.checked()),
        files: Some((before, after)),
        note: format!(
            "longest send {:.1} ms: the feeder never waits",
            longest.as_secs_f64() * 1e3
        ),
        ..Outcome::default()
    }
}
