//! Event mode over many samples: does a wait ever outlast its bound?
//!
//! Samples are sent to a daemon that sleeps between them, each after a pause drawn at random, so that they meet it
//! awake, on its way to sleep, and asleep. If a wake-up is lost, the daemon looks at its queues at the end of its
//! bounded wait nonetheless, and counts it as a stall.

use std::fmt::Write;

use anyhow::{bail, ensure};
use clap::Args;
use hdrhistogram::Histogram;
use inekf_client::plot::format_ns;
use inekf_shared::clock::monotonic_ns;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::latency::estimate;
use crate::latency::mechanism::Wait;
use crate::latency::partner::RoundTrip;
use crate::latency::row::histogram;
use crate::pin;
use crate::progress::progress;

/// The daemon's bound unless its configuration says otherwise (`runtime.event_timeout_ms`), ns.
const BOUND_NS: u64 = 10_000_000;
/// Samples between two steps of the progress bar.
const STEP: u64 = 1000;

/// What to measure.
#[derive(Args, Clone, Copy, Debug)]
pub struct WakeOptions {
    /// Samples.
    #[arg(long, default_value_t = 1_000_000)]
    pub samples: u64,
    /// Longest pause between an estimate and the next sample, µs; each is drawn between none and this.
    #[arg(long, default_value_t = 40, value_name = "US")]
    pub longest_pause_us: u64,
    /// Seed of the pauses.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
}

/// What came of it.
#[derive(Debug)]
pub struct WakeReport {
    options: WakeOptions,
    /// From before a sample is sent until its estimate is read, ns.
    rounds: Histogram<u64>,
    /// Rounds that took longer than a wait may.
    beyond: u64,
    /// What the daemon counted, and the longest, ns.
    stalls: (u64, u64),
}

/// Measures.
///
/// # Errors
/// An option is out of range, the daemon cannot be started or does not answer, or there is one processor only.
pub fn measure(options: &WakeOptions) -> anyhow::Result<WakeReport> {
    ensure!(options.samples > 0, "--samples has to be 1 or more");
    ensure!(
        options.longest_pause_us <= 1_000_000,
        "--longest-pause-us has to be at most a million"
    );
    let processors = pin::processors()?;
    let [here, there, ..] = processors[..] else {
        bail!("two processors are needed: one for the daemon, one for who sends to it");
    };
    let mut daemon = estimate::imu(true, Wait::Event, there)?;
    pin::pin(None, here)?;
    let mut draws = ChaCha8Rng::seed_from_u64(options.seed);
    let mut report = WakeReport {
        options: *options,
        rounds: histogram()?,
        beyond: 0,
        stalls: (0, 0),
    };
    let bar = progress("thousands of samples", options.samples / STEP);
    for sample in 0..options.samples {
        let round_ns = daemon.round()?;
        report.rounds.saturating_record(round_ns);
        report.beyond += u64::from(round_ns > BOUND_NS);
        let until_ns = monotonic_ns() + draws.random_range(0..=1000 * options.longest_pause_us);
        while monotonic_ns() < until_ns {
            std::hint::spin_loop();
        }
        if sample % STEP == STEP - 1 {
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let health = daemon.health()?;
    report.stalls = (health.stalls, health.longest_stall_ns);
    Ok(report)
}

impl WakeReport {
    /// For people.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{} samples to a daemon that sleeps between them, pauses of 0 to {} µs\n\
             sent to read     ",
            self.rounds.len(),
            self.options.longest_pause_us
        );
        for (name, quantile) in [
            ("p50", 0.5),
            ("p99.9", 0.999),
            ("p99.999", 0.99999),
            ("max", 1.0),
        ] {
            let figure = format_ns(self.rounds.value_at_quantile(quantile) as f64);
            let _ = write!(text, "  {name} {figure}");
        }
        let _ = writeln!(
            text,
            "\nlonger than {}  {}\nstalls counted by the daemon  {} (longest {})",
            format_ns(BOUND_NS as f64),
            self.beyond,
            self.stalls.0,
            format_ns(self.stalls.1 as f64),
        );
        text
    }
}
