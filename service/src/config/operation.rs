//! `[late]`, `[health]`, `[runtime]`: how the daemon runs, whatever it estimates.

use std::time::Duration;

use super::choice::{LateMethod, WaitMode};
use super::interval::Interval;
use super::section::Section;

/// Measurements that arrive after later samples.
///
/// ```
#[doc = include_str!("example.txt")]
/// let late = read(format!("{IMU}[late]\nwindow_s = 0.25\n"))?.late;
/// assert_eq!((late.window_s, late.method), (0.25, LateMethod::Carry));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Late {
    /// A fix this late is still fused; one that is later is counted and dropped, s.
    pub window_s: f64,
    /// How many samples the replay's ring buffer holds.
    pub capacity: usize,
    /// How.
    pub method: LateMethod,
}

/// When the estimate is called degraded or stale, and how often that is published.
///
/// ```
#[doc = include_str!("example.txt")]
/// let health = read(format!("{IMU}[health]\ndegraded_after_s = 2.0\n"))?.health;
/// assert_eq!((health.degraded_after_s, health.period_s), (2.0, 1.0));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Health {
    /// Without an accepted fix for this long the estimate is degraded, s of sensor time.
    pub degraded_after_s: f64,
    /// Without a sample of the IMU or a row of odometry for this long the estimate is stale, s of wall clock.
    pub stale_after_s: f64,
    /// Time between two health messages, s.
    pub period_s: f64,
}

/// The estimation thread.
///
/// ```
#[doc = include_str!("example.txt")]
/// let runtime = read(format!("{IMU}[runtime]\nwait = 'spin'\ncpu = 3\n"))?.runtime;
/// assert_eq!((runtime.wait, runtime.cpu, runtime.priority), (WaitMode::Spin, Some(3), None));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Runtime {
    /// How it waits for samples.
    pub wait: WaitMode,
    /// The upper bound of every wait, ms. Used with [`WaitMode::Event`]; short enough to stop in time.
    pub event_timeout_ms: u32,
    /// The processor it is pinned to; absent: any.
    pub cpu: Option<u32>,
    /// Its real-time priority (SCHED_FIFO); absent: an ordinary thread.
    pub priority: Option<i32>,
    /// Whether the daemon's memory is locked, so that none of it is ever paged out.
    pub lock_memory: bool,
}

impl Late {
    pub(super) fn read(late: &mut Section<'_, '_>) -> Self {
        Self {
            window_s: late.float("window_s", "s", Interval::closed(0.0, 60.0), 1.0),
            capacity: late.integer("capacity", Some("samples"), 1..=65_536, 2048),
            method: late.choice("method", LateMethod::Carry),
        }
    }

    /// The window in nanoseconds of sensor time.
    ///
    /// ```
    /// use inekf_service::config::Late;
    ///
    /// assert_eq!(Late { window_s: 0.25, ..Late::default() }.window_ns(), 250_000_000);
    /// ```
    pub fn window_ns(&self) -> u64 {
        nanoseconds(self.window_s)
    }
}

impl Health {
    pub(super) fn read(health: &mut Section<'_, '_>) -> Self {
        let patience = Interval::above(0.0, 3600.0);
        Self {
            degraded_after_s: health.float("degraded_after_s", "s", patience, 5.0),
            stale_after_s: health.float("stale_after_s", "s", patience, 0.5),
            period_s: health.float("period_s", "s", Interval::closed(0.01, 3600.0), 1.0),
        }
    }

    /// [`degraded_after_s`](Self::degraded_after_s) in nanoseconds of sensor time.
    pub(crate) fn degraded_after_ns(&self) -> u64 {
        nanoseconds(self.degraded_after_s)
    }

    /// [`stale_after_s`](Self::stale_after_s) in nanoseconds.
    pub(crate) fn stale_after_ns(&self) -> u64 {
        nanoseconds(self.stale_after_s)
    }

    /// [`period_s`](Self::period_s) in nanoseconds.
    pub(crate) fn period_ns(&self) -> u64 {
        nanoseconds(self.period_s)
    }
}

impl Runtime {
    pub(super) fn read(runtime: &mut Section<'_, '_>) -> Self {
        Self {
            wait: runtime.choice("wait", WaitMode::Event),
            event_timeout_ms: runtime.integer("event_timeout_ms", Some("ms"), 1..=50, 10),
            cpu: runtime.optional_integer("cpu", 0..=1023),
            priority: runtime.optional_integer("priority", 1..=99),
            lock_memory: runtime.boolean("lock_memory", false),
        }
    }

    /// The upper bound of every wait.
    pub(crate) fn event_timeout(&self) -> Duration {
        Duration::from_millis(u64::from(self.event_timeout_ms))
    }
}

/// A time in nanoseconds, to the nearest; the ranges above keep it far from overflow.
pub(super) fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

impl Default for Late {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}

impl Default for Health {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}

impl Default for Runtime {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}
