//! `inekf-client demo`: a daemon, a simulated drive at IMU rate, the error and the latency.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use hdrhistogram::Histogram;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23};

use crate::daemon::{Daemon, private_instance};
use crate::dataset::Dataset;
use crate::evaluate::{
    DEFAULT_MAX_GAP_NS, Deviations, ErrorSample, Summary, Trajectory, deviations, errors, summarise,
};
use crate::pace::Pace;
use crate::plot::{
    LatencySeries, Report, Section, Table, TrajectoryPlot, error_bands, error_panels, format_ns,
    latency, trajectory,
};
use crate::progress::Progress;
use crate::rows::{RowBuilder, row};
use crate::session::Session;
use crate::simulate::{Scenario, SimulationOptions, simulate};
use crate::table::EstimateRow;

/// The daemon's configuration.
const CONFIG: &str = include_str!("../demo.toml");
/// Errors are summed up from here on: by then the unknown heading has been found.
const CONVERGED_AFTER_S: f64 = 10.0;

/// What the demo does.
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
    let (rows, latencies) = driven?;
    stopped?;

    let errors = errors(
        &Trajectory::from_estimates(&rows),
        &Trajectory::from_truth(&dataset.truth),
        DEFAULT_MAX_GAP_NS,
    );
    let Some(summary) = summarise(&errors, (CONVERGED_AFTER_S * 1e9) as u64) else {
        bail!("the drive is too short: give it more than {CONVERGED_AFTER_S} s");
    };
    print_summary(&summary, &latencies);
    let report = write_report(options, &dataset, &rows, &errors, &summary, &latencies)?;
    println!("report   {}", report.display());
    Ok(())
}

/// How long the answer to a sample is polled for; before the daemon has a state there is none.
const ANSWER_WITHIN: Duration = Duration::from_millis(1);

/// Feeds in real time, reads the answer to each sample as soon as it comes, and sleeps in between.
fn drive(
    dataset: &Dataset,
    session: &mut Session,
) -> anyhow::Result<(Vec<EstimateRow>, Latencies)> {
    let mut latencies = Latencies::new()?;
    let mut rows = Vec::with_capacity(dataset.imu.len());
    let mut builder = RowBuilder::default();
    let newest_ns = Cell::new(None);
    let mut take = |estimate: EstimateSe23| {
        latencies.record(&estimate, monotonic_ns());
        newest_ns.set(Some(estimate.head.stamp_ns));
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
    session.settle(&mut take)?;
    progress.finish();
    rows.extend(builder.finish().as_ref().map(row));
    Ok((rows, latencies))
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

fn write_report(
    options: &DemoOptions,
    dataset: &Dataset,
    rows: &[EstimateRow],
    errors: &[ErrorSample],
    summary: &Summary,
    latencies: &Latencies,
) -> anyhow::Result<PathBuf> {
    let top_view = |trajectory: &Trajectory| -> Vec<[f64; 2]> {
        let poses = trajectory.poses().iter();
        poses.map(|pose| [pose.p_w_m.x, pose.p_w_m.y]).collect()
    };
    let truth = top_view(&Trajectory::from_truth(&dataset.truth));
    let estimate = top_view(&Trajectory::from_estimates(rows));
    let fixes: Vec<[f64; 2]> = dataset
        .position
        .iter()
        .map(|fix| [fix.position_w_m[0], fix.position_w_m[1]])
        .collect();
    let plot = TrajectoryPlot {
        truth: &truth,
        estimate: &estimate,
        fixes: &fixes,
    };
    let trajectory = trajectory("Top view of the drive", &plot)?;
    let sigmas: Vec<Deviations> = rows.iter().filter_map(deviations).collect();
    let bands = error_bands("Error against the truth", &error_panels(errors, &sigmas, 0))?;
    let latency_plot = latency("Latency per sample", &latencies.series())?;

    let write = |name: &str, text: &str| -> anyhow::Result<PathBuf> {
        let path: PathBuf = Path::new(&options.out).join(name);
        fs::write(&path, text).with_context(|| format!("writing {}", path.display()))?;
        Ok(path)
    };
    write("trajectory.svg", &trajectory)?;
    write("error.svg", &bands)?;
    write("latency.svg", &latency_plot)?;
    let section = |heading: &str, text: String, table: Option<Table>, svg: String| Section {
        heading: heading.to_owned(),
        text,
        table,
        svg,
    };
    let report = Report {
        title: "inekf demo".to_owned(),
        subtitle: format!(
            "{}: {} s at {} Hz, seed {}; heading and speed unknown at the start",
            options.scenario.name(),
            options.duration_s,
            options.rate_hz,
            options.seed
        ),
        sections: vec![
            section("Trajectory", String::new(), None, trajectory),
            section(
                "Error",
                format!("RMSE from {CONVERGED_AFTER_S} s on."),
                Some(error_table(summary)),
                bands,
            ),
            section(
                "Latency",
                "Both processes on this machine, spinning.".to_owned(),
                Some(latency_table(latencies)),
                latency_plot,
            ),
        ],
    };
    write("report.html", &report.to_html())
}

fn error_table(summary: &Summary) -> Table {
    let position = summary.position_rmse_m;
    let cells = |name: &str, value: f64, unit: &str| {
        vec![name.to_owned(), format!("{value:.3}"), unit.to_owned()]
    };
    Table {
        header: ["quantity", "RMSE", "unit"].map(str::to_owned).to_vec(),
        rows: vec![
            cells("position east", position.x, "m"),
            cells("position north", position.y, "m"),
            cells("position up", position.z, "m"),
            cells("heading", summary.heading_rmse_rad.to_degrees(), "deg"),
            cells("attitude", summary.attitude_rmse_rad.to_degrees(), "deg"),
        ],
    }
}

fn latency_table(latencies: &Latencies) -> Table {
    let rows = latencies.series().map(|series| {
        let mut cells = vec![series.name.to_owned()];
        cells.extend(quantiles(series.histogram));
        cells
    });
    Table {
        header: ["", "p50", "p99", "p99.9", "max"]
            .map(str::to_owned)
            .to_vec(),
        rows: rows.to_vec(),
    }
}
