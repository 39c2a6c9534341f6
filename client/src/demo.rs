//! `inekf-client demo`: a daemon, a simulated drive at IMU rate, the error and the latency.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use hdrhistogram::Histogram;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{Counters, ESTIMATE_PROPAGATED, ESTIMATE_UPDATED, EstimateSe23};

use crate::daemon::{Daemon, private_instance};
use crate::dataset::Dataset;
use crate::evaluate::Summary;
use crate::pace::Pace;
use crate::plot::{LatencySeries, format_ns};
use crate::progress::Progress;
use crate::report::{Built, Material, NisSample, build};
use crate::rows::{RowBuilder, row};
use crate::session::Session;
use crate::simulate::{Scenario, SimulationOptions, simulate};
use crate::table::EstimateRow;

/// The daemon's configuration.
const CONFIG: &str = include_str!("../demo.toml");
/// Errors are summed up from here on: by then the unknown heading has been found.
const CONVERGED_AFTER_S: f64 = 10.0;

/// What the demo does.
///
/// ```
/// use inekf_client::demo::DemoOptions;
/// use inekf_client::simulate::Scenario;
///
/// let options = DemoOptions {
///     scenario: Scenario::DroneLoops,
///     seed: 1,
///     rate_hz: 200.0,
///     duration_s: 20.0,
///     out: "demo-report".into(),
/// };
/// // The same seed drives the same noise.
/// assert_eq!(options.clone().seed, options.seed);
/// ```
#[derive(Clone, Debug)]
pub struct DemoOptions {
    /// What is driven.
    pub scenario: Scenario,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// IMU rate, Hz.
    pub rate_hz: f64,
    /// How long, s.
    pub duration_s: f64,
    /// Folder for the report and its plots.
    pub out: PathBuf,
}

/// Two latencies of every sample.
struct Latencies {
    /// From the feeder's send to the reader's receipt: two crossings of shared memory and the
    /// filter step between them.
    round_trip: Histogram<u64>,
    /// Inside the daemon: from the receipt of the sample to the publication of its estimate.
    in_daemon: Histogram<u64>,
}

impl Latencies {
    fn new() -> anyhow::Result<Self> {
        let histogram = || Histogram::new_with_bounds(1, 10_000_000_000, 3);
        Ok(Self {
            round_trip: histogram()?,
            in_daemon: histogram()?,
        })
    }

    fn record(&mut self, estimate: &EstimateSe23, now_ns: u64) {
        let head = &estimate.head;
        if head.flags & ESTIMATE_PROPAGATED != 0 {
            self.round_trip
                .saturating_record(now_ns.saturating_sub(head.sent_ns));
            self.in_daemon
                .saturating_record(head.published_ns.saturating_sub(head.received_ns));
        }
    }

    fn series(&self) -> [LatencySeries<'_>; 2] {
        [
            LatencySeries {
                name: "sent to read",
                histogram: &self.round_trip,
            },
            LatencySeries {
                name: "in the daemon",
                histogram: &self.in_daemon,
            },
        ]
    }
}

/// Runs the demo and prints what came of it.
///
/// ```no_run
/// use inekf_client::demo::{DemoOptions, demo};
/// use inekf_client::simulate::Scenario;
///
/// demo(&DemoOptions {
///     scenario: Scenario::RoadCircuit,
///     seed: 1,
///     rate_hz: 500.0,
///     duration_s: 30.0,
///     out: "demo-report".into(),
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The daemon cannot be started, or the report not be written.
pub fn demo(options: &DemoOptions) -> anyhow::Result<()> {
    let dataset = simulate(
        options.scenario,
        &SimulationOptions {
            seed: options.seed,
            imu_rate_hz: options.rate_hz,
            duration_s: options.duration_s,
            ..SimulationOptions::default()
        },
    )?;
    fs::create_dir_all(&options.out)
        .with_context(|| format!("creating {}", options.out.display()))?;
    let config = options.out.join("demo.toml");
    fs::write(&config, CONFIG).with_context(|| format!("writing {}", config.display()))?;

    let instance = private_instance("demo")?;
    let daemon = Daemon::start(&config, &instance)?;
    println!("daemon   {}", daemon.ready_line());
    println!(
        "drive    {}: {} IMU samples at {} Hz, {} position fixes, heading unknown",
        options.scenario.name(),
        dataset.imu.len(),
        options.rate_hz,
        dataset.position.len()
    );
    let driven = drive(&dataset, &mut Session::open(&instance)?);
    let stopped = daemon.stop();
    let driven = driven?;
    stopped?;

    let subtitle = format!(
        "{}: {} s at {} Hz, seed {}; heading and speed unknown at the start",
        options.scenario.name(),
        options.duration_s,
        options.rate_hz,
        options.seed
    );
    let built = build(&Material {
        title: "inekf demo",
        subtitle: &subtitle,
        rows: &driven.rows,
        truth: &dataset.truth,
        fixes: &dataset.position,
        settled_s: CONVERGED_AFTER_S,
        nis: &driven.nis,
        latencies: &driven.latencies.series(),
        latency_note: "Both processes on this machine, spinning.",
        counters: Some(driven.counters),
    })?;
    let Some(summary) = &built.summary else {
        bail!("the drive is too short: give it more than {CONVERGED_AFTER_S} s");
    };
    print_summary(summary, &driven.latencies);
    println!("report   {}", write_report(&options.out, &built)?.display());
    Ok(())
}

/// What came of the drive.
struct Driven {
    rows: Vec<EstimateRow>,
    nis: Vec<NisSample>,
    latencies: Latencies,
    counters: Counters,
}

/// How long the answer to a sample is polled for; before the daemon has a state there is none.
const ANSWER_WITHIN: Duration = Duration::from_millis(1);

/// Feeds in real time, reads the answer to each sample as soon as it comes, and sleeps in between.
fn drive(dataset: &Dataset, session: &mut Session) -> anyhow::Result<Driven> {
    let mut latencies = Latencies::new()?;
    let mut rows = Vec::with_capacity(dataset.imu.len());
    let mut nis = Vec::with_capacity(dataset.position.len());
    let mut builder = RowBuilder::default();
    let newest_ns = Cell::new(None);
    let mut take = |estimate: EstimateSe23| {
        latencies.record(&estimate, monotonic_ns());
        newest_ns.set(Some(estimate.head.stamp_ns));
        nis.extend(nis_of(&estimate));
        rows.extend(builder.push(estimate).as_ref().map(row));
        Ok(())
    };
    let events = dataset.events();
    let progress = Progress::new("driving", events.len());
    let pace = Pace::new(0, 1.0);
    for (sent, event) in events.enumerate() {
        pace.wait(event.stamp_ns());
        session.send(&event)?;
        let sent_at = Instant::now();
        while event.is_motion()
            && newest_ns.get() != Some(event.stamp_ns())
            && sent_at.elapsed() < ANSWER_WITHIN
        {
            session.take_estimates(&mut take)?;
        }
        progress.advance(sent);
    }
    let answer = session.settle(&mut take)?;
    progress.finish();
    rows.extend(builder.finish().as_ref().map(row));
    Ok(Driven {
        rows,
        nis,
        latencies,
        counters: answer.counters,
    })
}

/// The NIS of the fix that was fused into this estimate, if one was: all fixes here are of position.
fn nis_of(estimate: &EstimateSe23) -> Option<NisSample> {
    let head = &estimate.head;
    let source = usize::try_from(head.source).ok()?;
    let nis = *head.nis.get(source)?;
    (head.flags & ESTIMATE_UPDATED != 0).then_some(NisSample {
        stamp_ns: head.stamp_ns,
        nis,
        degrees: 3,
    })
}

fn print_summary(summary: &Summary, latencies: &Latencies) {
    let position = summary.position_rmse_m;
    println!(
        "error    after {CONVERGED_AFTER_S} s, RMSE: position {:.2} m east, {:.2} m north, {:.2} m \
         up; heading {:.2} deg; attitude {:.2} deg",
        position.x,
        position.y,
        position.z,
        summary.heading_rmse_rad.to_degrees(),
        summary.attitude_rmse_rad.to_degrees()
    );
    for series in latencies.series() {
        let [p50, p99, p999, max] = quantiles(series.histogram);
        println!(
            "latency  {:<13} p50 {p50}, p99 {p99}, p99.9 {p999}, max {max}",
            series.name
        );
    }
}

/// p50, p99, p99.9 and the maximum, with units.
fn quantiles(histogram: &Histogram<u64>) -> [String; 4] {
    [
        histogram.value_at_quantile(0.5),
        histogram.value_at_quantile(0.99),
        histogram.value_at_quantile(0.999),
        histogram.max(),
    ]
    .map(|ns| format_ns(ns as f64))
}

/// Writes the page and its figures into the folder; returns the page's path.
fn write_report(out: &Path, built: &Built) -> anyhow::Result<PathBuf> {
    let write = |name: &str, text: &str| -> anyhow::Result<PathBuf> {
        let path = out.join(name);
        fs::write(&path, text).with_context(|| format!("writing {}", path.display()))?;
        Ok(path)
    };
    for (name, svg) in &built.figures {
        write(name, svg)?;
    }
    write("report.html", &built.html)
}
