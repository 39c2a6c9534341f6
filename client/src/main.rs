//! `inekf-client`: simulates, replays and shows what the estimation daemon makes of it.

mod commands;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use clap::{Args, Parser, Subcommand, ValueEnum};
use inekf_client::control::Controller;
use inekf_client::dataset::{Dataset, Odometry, Truth};
use inekf_client::demo::{DemoOptions, demo};
use inekf_client::live::feed_live;
use inekf_client::noise;
use inekf_client::pace::Speed;
use inekf_client::recording::replay::require_equal;
use inekf_client::recording::{Reader, RecordOptions, RerunOptions, record, rerun};
use inekf_client::replay::{ReplayOptions, replay};
use inekf_client::simulate::{Scenario, Simulation};
use inekf_shared::message::{
    ControlResponse, Counters, StateVector, model_name, reason_name, state_name, triangle_index,
};
use inekf_shared::topic::Instance;

/// Feeds, replays and measures the estimation daemon `inekf-service`.
#[derive(Parser)]
#[command(
    version,
    after_help = "\
Examples:
  inekf-client demo
  inekf-client simulate road-circuit --save circuit
  inekf-client replay circuit --config my.toml --speed max --out estimate.csv
  inekf-client simulate drone-loops --instance drone-7
  inekf-client record --instance drone-7 --out flight.rec
  inekf-client replay flight.rec --out again.csv
  inekf-client control pause --instance drone-7

Exit status: 0 done, 1 failed (one line says why), 2 wrong usage."
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Starts a daemon, simulates a drive at IMU rate, prints error and latency, writes a report.
    Demo(DemoArguments),
    /// Feeds a simulated drive or flight to a daemon in real time, or saves it as a dataset folder.
    Simulate(SimulateArguments),
    /// Feeds a dataset folder to a daemon and writes its estimates as CSV; or replays a recording, whose estimates
    /// must come again bit for bit.
    Replay(ReplayArguments),
    /// Records everything that a daemon takes, in its order, and its estimates.
    Record(RecordArguments),
    /// Asks something of a daemon.
    Control(ControlArguments),
    /// Watches a running daemon: state, rates, uncertainty, fixes, latency.
    Monitor(commands::monitor::Arguments),
    /// Writes a page about a run: trajectory, errors against the truth with their bands, NEES.
    Report(commands::report::Arguments),
    /// Writes estimates in the formats of other tools: TUM, MCAP, or a CSV for people.
    Export(commands::export::Arguments),
    /// Makes a dataset folder of an EuRoC sequence, or its truth of a TUM trajectory.
    Import(commands::import::Arguments),
    /// Prints the layout of the messages for C and C++, for Python, or as JSON.
    Layout(commands::layout::Arguments),
}

#[derive(Args)]
struct DemoArguments {
    /// What is driven: road-circuit, drone-loops or stand-then-drive.
    #[arg(long, default_value = "road-circuit")]
    scenario: Scenario,
    /// Seed of the sensors' noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// IMU rate, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 500.0)]
    rate: f64,
    /// Length of the drive, s.
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    duration: f64,
    /// Folder for the report and its plots.
    #[arg(long, value_name = "DIR", default_value = "demo-report")]
    out: PathBuf,
    /// Not used: the demo starts a daemon on an instance of its own.
    #[arg(long, value_name = "NAME", hide = true)]
    instance: Option<String>,
}

#[derive(Args)]
struct SimulateArguments {
    /// road-circuit: a car on a circuit with bends and slopes; drone-loops: a drone in figures of
    /// eight, banked; stand-then-drive: a car that stands for 15 s and drives off; planar-mismatch:
    /// odometry and two position sources in the plane, whose models are wrong.
    scenario: Simulation,
    /// The daemon to feed.
    #[arg(long, value_name = "NAME", default_value = "default")]
    instance: Instance,
    /// Seed of the sensors' noise: the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rate of IMU or odometry, Hz; by default 200, in the plane 10.
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Length, s; by default 60, in the plane 33.
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Write a dataset folder instead of feeding.
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
    /// Feed as well as save.
    #[arg(long, requires = "save")]
    feed: bool,
}

#[derive(Args)]
struct ReplayArguments {
    /// The dataset folder: imu.csv or odometry.csv, as the daemon's model needs, and position.csv,
    /// velocity.csv, heading.csv, meta.json if any. Or a recording, which brings its configuration: a daemon of its own
    /// is started with that, and the exit status is 1 if an estimate is not what it was.
    dir: PathBuf,
    /// Start a daemon with this configuration, and stop it afterwards.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Times real time, or max: as fast as the daemon takes it, losing nothing.
    #[arg(long, value_name = "X|max", default_value = "max")]
    speed: Speed,
    /// The estimate CSV to write.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Write the smoothed states as well, with the columns of the estimate CSV; for a daemon with estimator = "smoother".
    #[arg(long, value_name = "FILE.csv")]
    smoothed: Option<PathBuf>,
    /// Write the covariance as well: the upper triangle, row by row.
    #[arg(long)]
    covariance: bool,
    /// Without --config: the daemon to feed.
    #[arg(long, value_name = "NAME", default_value = "default")]
    instance: Instance,
}

#[derive(Args)]
struct RecordArguments {
    /// The daemon; it needs publish = true in its table [journal]. If it does not run yet, it is waited for.
    #[arg(long, value_name = "NAME", default_value = "default")]
    instance: Instance,
    /// The recording to write; it must not be there.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How long, s; by default until SIGINT or SIGTERM.
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
}

#[derive(Args)]
struct ControlArguments {
    /// What is asked.
    action: Action,
    /// With reload-noise: the configuration whose table [noise] is read.
    #[arg(required_if_eq("action", "reload-noise"))]
    file: Option<PathBuf>,
    /// The daemon.
    #[arg(long, value_name = "NAME", default_value = "default")]
    instance: Instance,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Action {
    /// Count samples and fixes, but take none.
    Pause,
    /// End a pause.
    Resume,
    /// Use the process noise of a configuration file from the next sample on.
    ReloadNoise,
    /// Forget the state and initialise anew.
    Reset,
    /// Print the state.
    Snapshot,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match arguments.command {
        Command::Demo(arguments) => run_demo(arguments),
        Command::Simulate(arguments) => run_simulate(arguments),
        Command::Replay(arguments) if arguments.dir.is_file() => run_rerun(arguments),
        Command::Replay(arguments) => run_replay(arguments),
        Command::Record(arguments) => run_record(arguments),
        Command::Control(arguments) => run_control(&arguments),
        Command::Monitor(arguments) => commands::monitor::run(&arguments),
        Command::Report(arguments) => commands::report::run(&arguments),
        Command::Export(arguments) => commands::export::run(&arguments),
        Command::Import(arguments) => commands::import::run(&arguments),
        Command::Layout(arguments) => commands::layout::run(&arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("inekf-client: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run_demo(arguments: DemoArguments) -> anyhow::Result<()> {
    demo(&DemoOptions {
        scenario: arguments.scenario,
        seed: arguments.seed,
        rate_hz: arguments.rate,
        duration_s: arguments.duration,
        out: arguments.out,
    })
}

fn run_simulate(arguments: SimulateArguments) -> anyhow::Result<()> {
    let instance = arguments.instance;
    let dataset = arguments
        .scenario
        .dataset(arguments.seed, arguments.rate, arguments.duration)?;
    if let Some(dir) = &arguments.save {
        dataset.save(dir)?;
        println!("saved    {}: {}", dir.display(), contents(&dataset));
        if !arguments.feed {
            return Ok(());
        }
    }
    let stop = stopped_by_signal()?;
    let summary = feed_live(&dataset, &instance, &|| stop.load(Ordering::Relaxed))?;
    println!(
        "fed      {} samples to {instance}; {} with no daemon there to hear them",
        summary.sent, summary.unheard
    );
    Ok(())
}

/// Set by SIGINT or SIGTERM.
fn stopped_by_signal() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let signalled = Arc::clone(&stop);
    ctrlc::set_handler(move || signalled.store(true, Ordering::Relaxed))
        .context("installing the handler of SIGINT and SIGTERM")?;
    Ok(stop)
}

fn contents(dataset: &Dataset) -> String {
    let truth = match &dataset.truth {
        Truth::None => 0,
        Truth::Planar(rows) => rows.len(),
        Truth::Spatial(rows) => rows.len(),
    };
    let motion = match &dataset.odometry {
        Odometry::None => format!("{} IMU samples", dataset.imu.len()),
        Odometry::Planar(rows) => format!("{} rows of odometry", rows.len()),
        Odometry::Spatial(rows) => format!("{} rows of odometry", rows.len()),
    };
    format!(
        "{motion}, {} position fixes, {truth} rows of truth",
        dataset.position.len()
    )
}

fn run_replay(arguments: ReplayArguments) -> anyhow::Result<()> {
    let options = ReplayOptions {
        dir: arguments.dir,
        config: arguments.config,
        speed: arguments.speed,
        out: arguments.out,
        smoothed: arguments.smoothed,
        covariance: arguments.covariance,
        instance: arguments.instance,
    };
    let summary = replay(&options)?;
    let seconds = summary.took.as_secs_f64();
    println!(
        "replayed {} samples in {seconds:.2} s ({:.0} per second): {} estimates in {}",
        summary.sent,
        summary.sent as f64 / seconds,
        summary.rows,
        options.out.display()
    );
    if let Some(path) = &options.smoothed {
        println!(
            "smoothed {} states in {}",
            summary.smoothed_rows,
            path.display()
        );
    }
    let Counters {
        accepted,
        gated,
        late,
        lost,
        rejected,
        unpaired,
    } = summary.last.counters;
    println!("fixes    {accepted} accepted, {gated} gated, {late} late; {lost} lost");
    if unpaired > 0 {
        println!("unpaired {unpaired}: their partner in the stack did not come in time");
    }
    if rejected > 0 {
        let reasons: Vec<String> = summary
            .last
            .rejected_by_reason
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
            .map(|(code, count)| {
                let reason = reason_name(u32::try_from(code).unwrap_or(u32::MAX));
                format!("{count} {reason}")
            })
            .collect();
        println!("rejected {rejected}: {}", reasons.join(", "));
    }
    Ok(())
}

fn run_rerun(arguments: ReplayArguments) -> anyhow::Result<()> {
    if arguments.config.is_some() || arguments.smoothed.is_some() {
        anyhow::bail!("a recording brings its configuration: leave out --config and --smoothed");
    }
    let options = RerunOptions {
        recording: arguments.dir,
        out: arguments.out,
        covariance: arguments.covariance,
    };
    let head = Reader::open(&options.recording)?.head().clone();
    let summary = rerun(&options)?;
    println!(
        "replayed {} entries of instance {}: {} rows in {}",
        summary.entries,
        head.instance,
        summary.rows,
        options.out.display()
    );
    for line in summary.lines() {
        println!("{line}");
    }
    require_equal(&summary, &head)
}

fn run_record(arguments: RecordArguments) -> anyhow::Result<()> {
    let duration = arguments.duration.map(Duration::try_from_secs_f64);
    let options = RecordOptions {
        instance: arguments.instance,
        out: arguments.out,
        duration: duration.transpose().context("--duration")?,
    };
    let stop = stopped_by_signal()?;
    let say = |line: &str| eprintln!("{line}");
    let summary = record(&options, &|| stop.load(Ordering::Relaxed), &say)?;
    println!(
        "recorded {} entries and {} estimates in {}",
        summary.entries,
        summary.estimates,
        options.out.display()
    );
    if summary.first > 0 {
        println!(
            "began    at entry {}: the daemon had run before",
            summary.first
        );
    }
    if summary.entries_missed + summary.estimates_missed > 0 {
        println!(
            "missed   {} entries, {} estimates",
            summary.entries_missed, summary.estimates_missed
        );
    }
    if summary.unwritten > 0 {
        println!(
            "lost     {} entries and estimates to a disk that had no room",
            summary.unwritten
        );
    }
    if summary.restarted {
        println!("ended    because the daemon was started anew");
    }
    Ok(())
}

fn run_control(arguments: &ControlArguments) -> anyhow::Result<()> {
    let noise = match (arguments.action, &arguments.file) {
        (Action::ReloadNoise, Some(file)) => Some(noise::load(file)?),
        (Action::ReloadNoise, None) => anyhow::bail!("reload-noise needs a configuration file"),
        (_, Some(_)) => anyhow::bail!("a file goes with reload-noise only"),
        (_, None) => None,
    };
    let mut controller = Controller::open(&arguments.instance, Duration::from_secs(5))?;
    let said = |response: ControlResponse| {
        println!("ok       the daemon is {}", state_name(response.state_code));
    };
    match (arguments.action, noise) {
        (Action::Pause, _) => said(controller.pause()?),
        (Action::Resume, _) => said(controller.unpause()?),
        (Action::Reset, _) => said(controller.reset()?),
        (Action::Snapshot, _) => print_state(&controller.snapshot()?),
        (Action::ReloadNoise, Some(noise)) => said(controller.reload_noise(noise)?),
        (Action::ReloadNoise, None) => {}
    }
    Ok(())
}

/// A state, a line for each part of it; standard deviations in the order of its error.
fn print_state(state: &StateVector) {
    let dimension = state.dimension as usize;
    let sigmas: Vec<f64> = (0..dimension)
        .filter_map(|i| triangle_index(i, i, dimension))
        .filter_map(|index| Some(state.covariance.get(index)?.sqrt()))
        .collect();
    println!("model            {}", model_name(state.model));
    println!("stamp_ns         {}", state.stamp_ns);
    println!("q_wb             {:?}", state.q_wb);
    println!("v_w_mps          {:?}", state.v_w_mps);
    println!("p_w_m            {:?}", state.p_w_m);
    println!("gyro_bias_rps    {:?}", state.gyro_bias_rps);
    println!("accel_bias_mps2  {:?}", state.accel_bias_mps2);
    println!("sigmas           {sigmas:?}");
}
