//! A daemon and its parties: a feeder and a reader in processes of their own, and an observer in this one.
//!
//! The body rests at the origin: SI units, world ENU, body FLU; stamps are CLOCK_MONOTONIC, nanoseconds.

use std::thread::sleep;
use std::time::{Duration, Instant};

use inekf_client::dataset::{ImuRow, PositionRow};
use inekf_client::read::EstimateReader;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23};

use super::Plan;
use crate::link::instance;
use crate::memory::Memory;
use crate::process::{Daemon, PATIENCE, Running, service};
use crate::programs::programs;

/// The instance of all scenes.
pub const INSTANCE: &str = "car";

/// A configuration that starts with the first sample, at rest at the origin.
pub const CONFIG: &str = "\
model = 'imu'
[noise]
gyro_density = 2.5e-4
accel_density = 1.2e-3
gyro_bias_walk = 1e-5
accel_bias_walk = 1e-4
[initial]
level = 'given'
heading_sigma_deg = 5.0
position_m = [0.0, 0.0, 0.0]
position_sigma_m = 1.0
velocity_sigma_mps = 0.1
[update]
gate_probability = 0.9999
[health]
period_s = 0.05
";

/// Shared memory, and the configuration of the daemons in it.
#[derive(Debug)]
pub struct Scene {
    /// The shared memory.
    pub memory: Memory,
    config: String,
}

impl Scene {
    /// A scene with [`CONFIG`].
    pub fn new() -> Self {
        Self::with_config(CONFIG)
    }

    /// A scene with another configuration.
    pub fn with_config(config: &str) -> Self {
        // They may have to be built first, which no time is to contain.
        programs();
        Self {
            memory: Memory::new(),
            config: config.to_owned(),
        }
    }

    /// Starts a daemon and waits until it is ready.
    pub fn daemon(&self) -> Daemon {
        Daemon::start(&self.memory, INSTANCE, &self.config)
    }

    /// Starts `inekf-tests` as a feeder of this rate, Hz.
    pub fn feeder(&self, plan: &Plan, rate_hz: u32) -> Running {
        let mut command = self.memory.command(&plan.party);
        command.args([
            "feed",
            "--instance",
            INSTANCE,
            "--rate",
            &rate_hz.to_string(),
        ]);
        Running::start(command)
    }

    /// Starts `inekf-tests` as a reader.
    pub fn reader(&self, plan: &Plan) -> Running {
        let mut command = self.memory.command(&plan.party);
        command.args(["read", "--instance", INSTANCE]);
        Running::start(command)
    }

    /// Reads estimates in this process.
    pub fn observer(&self) -> Observer {
        Observer::new(
            EstimateReader::open_on(self.memory.node(), &instance(INSTANCE)).expect("a reader"),
        )
    }

    /// Stops the daemon and whoever else is `left`, and asserts that nothing of theirs is.
    pub fn end(&self, daemon: Daemon, left: impl Sized) -> usize {
        daemon.stop();
        drop(left);
        self.cleared()
    }

    /// Asserts that `doctor` leaves nothing, which it returns.
    pub fn cleared(&self) -> usize {
        let after = self.files_after_doctor();
        let left = || [self.memory.shared_files(), self.memory.root_files()].concat();
        assert_eq!(after, 0, "files are left: {:#?}", left());
        after
    }

    /// Files in shared memory and under the root.
    pub fn files(&self) -> usize {
        self.memory.shared_files().len() + self.memory.root_files().len()
    }

    /// Has `doctor` clean up, and says what is left. What was half made is given up after 2 s only.
    pub fn files_after_doctor(&self) -> usize {
        let clean = || service(&self.memory, ["doctor"]).succeeded();
        if self.files() > 0 {
            clean();
        }
        if self.files() > 0 {
            sleep(Duration::from_millis(2100));
            clean();
        }
        self.files()
    }
}

impl Default for Scene {
    fn default() -> Self {
        Self::new()
    }
}

/// Follows the estimates of one daemon after the other.
pub struct Observer {
    reader: EstimateReader,
    last: Option<EstimateSe23>,
    /// Estimates that answer a sample.
    pub answers: u64,
    /// `seq` of the last sample answered in each life of a feeder that has ended.
    ended: Vec<u64>,
}

impl Observer {
    fn new(reader: EstimateReader) -> Self {
        Self {
            reader,
            last: None,
            answers: 0,
            ended: Vec::new(),
        }
    }

    /// Takes what has come, and gives the newest there ever was.
    pub fn look(&mut self) -> Option<EstimateSe23> {
        let last = self.look_with_losses();
        assert_eq!(self.reader.missed(), 0);
        last
    }

    /// How often the reader attached anew.
    pub fn reattached(&self) -> u64 {
        self.reader.reattached()
    }

    /// The same where estimates may be lost.
    pub fn look_with_losses(&mut self) -> Option<EstimateSe23> {
        while let Some(estimate) = self.reader.next_estimate().expect("it can be received") {
            let finite = estimate.p_w_m.iter().chain(&estimate.q_wb);
            assert!(finite.copied().all(f64::is_finite), "{estimate:?}");
            // A number that does not go on, of another sample: another feeder.
            if let Some(last) = self.last
                && estimate.head.seq <= last.head.seq
                && estimate.head.sent_ns != last.head.sent_ns
            {
                self.ended.push(last.head.seq);
            }
            self.answers += u64::from(estimate.head.flags & ESTIMATE_PROPAGATED != 0);
            self.last = Some(estimate);
        }
        self.last
    }

    /// Samples sent by all feeders so far, if each began to count from 0 and its last sample was answered.
    pub fn sent(&self) -> u64 {
        let last = self.last.map(|last| last.head.seq);
        self.ended.iter().chain(&last).map(|seq| seq + 1).sum()
    }

    /// Looks on for so long.
    pub fn watch_for(&mut self, time: Duration) {
        let started = Instant::now();
        while started.elapsed() < time {
            self.look();
            sleep(Duration::from_micros(200));
        }
    }

    /// Waits for an estimate that was published, and whose sample was sent, after `start_ns`.
    ///
    /// # Panics
    /// If there is none for long.
    pub fn wait_since(&mut self, start_ns: u64) -> EstimateSe23 {
        let started = Instant::now();
        loop {
            if let Some(estimate) = self.look()
                && estimate.head.published_ns > start_ns
                && estimate.head.sent_ns > start_ns
            {
                return estimate;
            }
            assert!(started.elapsed() < PATIENCE, "no estimate came any more");
            sleep(Duration::from_micros(200));
        }
    }

    /// Waits until no estimate has come for a while: what was sent has been answered and has left.
    pub fn wait_for_silence(&mut self) {
        loop {
            let before = self.look().map(|last| last.head.estimate_seq);
            sleep(Duration::from_millis(50));
            if self.look().map(|last| last.head.estimate_seq) == before {
                return;
            }
        }
    }

    /// Waits for a new estimate.
    pub fn wait(&mut self) -> EstimateSe23 {
        self.wait_since(monotonic_ns())
    }

    /// Runs `start`, and says how long it took until an estimate came of it.
    pub fn back_after<T>(&mut self, start: impl FnOnce() -> T) -> (T, Duration) {
        let (started, start_ns) = (Instant::now(), monotonic_ns());
        let begun = start();
        self.wait_since(start_ns);
        (begun, started.elapsed())
    }
}

/// A sample at rest.
pub fn rest(stamp_ns: u64) -> ImuRow {
    ImuRow {
        stamp_ns,
        gyro_rps: [0.0; 3],
        accel_mps2: [0.0, 0.0, 9.80665],
    }
}

/// A fix at the origin.
pub fn at_origin(stamp_ns: u64, source: u32) -> PositionRow {
    PositionRow {
        stamp_ns,
        position_w_m: [0.0; 3],
        sigma_m: [1.0; 3],
        source,
        dimension: 3,
    }
}
