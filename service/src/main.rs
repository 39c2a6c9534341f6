//! `inekf-service`: the estimation daemon.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use clap::{Parser, Subcommand};
use inekf::filter::UpdateError;
use inekf_service::config::Config;
use inekf_service::daemon::{self, Ports, supervisor};
use inekf_service::engine::{self, Engine, History, Model, Use};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, inspect};

/// Invariant Kalman filtering over shared memory.
///
/// Takes IMU samples and position, velocity and heading fixes on the topics
/// `inekf/INSTANCE/{imu,position,velocity,heading}`, publishes the estimate with its covariance on
/// `inekf/INSTANCE/estimate` at IMU rate, and prints one line that starts with `ready` when its
/// ports are open. SIGINT or SIGTERM stops it.
#[derive(Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    after_help = "\
Examples:
  inekf-service --config service/config/kitti00_car_a.toml
  inekf-service --config my.toml --instance drone-7
  inekf-service check my.toml
  inekf-service doctor

Every key of the configuration is described in service/CONFIG.md.
Logging: set RUST_LOG, e.g. RUST_LOG=debug. Shared memory: INEKF_IPC_ROOT and INEKF_IPC_PREFIX
keep a set of processes apart from others."
)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// The configuration file (TOML).
    #[arg(long, value_name = "FILE", required = true)]
    config: Option<PathBuf>,
    /// Name of this daemon; clients name the same one.
    #[arg(long, value_name = "NAME", default_value = "default")]
    instance: String,
}

#[derive(Subcommand)]
enum Command {
    /// Checks a configuration file and prints every fault in it.
    Check {
        /// The configuration file (TOML).
        file: PathBuf,
    },
    /// Shows what lies in shared memory, and removes what dead processes left there.
    Doctor,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match (&arguments.command, &arguments.config) {
        (Some(Command::Check { file }), _) => check(file),
        (Some(Command::Doctor), _) => doctor(),
        (None, Some(config)) => serve(config, &arguments.instance),
        (None, None) => Err(anyhow::anyhow!("name a configuration with --config FILE")),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("inekf-service: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn check(file: &Path) -> anyhow::Result<()> {
    let config = Config::load(file)?;
    engine::build(&config, Built).map_err(|error| unsolvable(file, &error))?;
    println!(
        "{}: good: model {}, estimator {}, {} states",
        file.display(),
        config.model,
        config.estimator,
        config.error_states(),
    );
    Ok(())
}

/// Lists and cleans. What is alive is never touched.
fn doctor() -> anyhow::Result<()> {
    let config = transport::config_from_env()?;
    for node in inspect::nodes(&config)? {
        let state = if node.alive { "alive" } else { "dead" };
        println!(
            "node     {state:<6} process {:<8} {} ({})",
            node.process, node.name, node.program
        );
    }
    let (removed, kept) = inspect::remove_dead_nodes(&config)?;
    println!("removed  {removed} dead nodes; {kept} could not be removed");
    for file in inspect::half_made_services(&config)? {
        std::fs::remove_file(&file).with_context(|| format!("removing {}", file.display()))?;
        println!("removed  {}, left half made", file.display());
    }
    let files = inspect::shared_memory_files(&config)?;
    let bytes: u64 = files.iter().map(|(_, bytes)| bytes).sum();
    println!(
        "files    {} in shared memory, {:.1} MB",
        files.len(),
        bytes as f64 * 1e-6
    );
    Ok(())
}

fn serve(file: &Path, instance: &str) -> anyhow::Result<()> {
    start_logging();
    let instance = Instance::new(instance)?;
    let config = Config::load(file)?;
    let stop = Arc::new(AtomicBool::new(false));
    let signalled = Arc::clone(&stop);
    ctrlc::set_handler(move || signalled.store(true, Ordering::Relaxed))
        .context("installing the handler of SIGINT and SIGTERM")?;
    let daemon = Serve {
        config: &config,
        instance: &instance,
        stop: &stop,
    };
    engine::build(&config, daemon).map_err(|error| unsolvable(file, &error))?
}

/// Why a configuration that reads well cannot be run.
fn unsolvable(file: &Path, error: &UpdateError) -> anyhow::Error {
    anyhow::anyhow!("{}: {error}", file.display())
}

/// Runs an engine as a daemon.
struct Serve<'a> {
    config: &'a Config,
    instance: &'a Instance,
    stop: &'a AtomicBool,
}

impl Use for Serve<'_> {
    type Output = anyhow::Result<()>;

    fn with<M: Model, H: History<M>>(self, engine: Engine<M, H>) -> anyhow::Result<()> {
        run(engine, self.config, self.instance, self.stop)
    }
}

/// Nothing but the proof that there is an engine.
struct Built;

impl Use for Built {
    type Output = ();

    fn with<M: Model, H: History<M>>(self, _engine: Engine<M, H>) {}
}

fn run<M: Model, H: History<M>>(
    mut engine: Engine<M, H>,
    config: &Config,
    instance: &Instance,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    let mut ports = Ports::open(instance, config.runtime.wait, config.smoother.is_some())?;
    let mut out = std::io::stdout();
    writeln!(
        out,
        "ready: instance {instance}, process {}, model {}, wait {}",
        std::process::id(),
        config.model,
        config.runtime.wait,
    )
    .and_then(|()| out.flush())
    .context("writing the ready line")?;
    supervisor::ready();
    let outcome = daemon::run(&mut engine, &mut ports, config, stop);
    supervisor::stopping();
    outcome
}

/// Logs to standard error: information by default, iceoryx2 only when it warns. Where that is the journal, which keeps
/// the time itself, lines have none.
fn start_logging() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info,iceoryx2=error"));
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    if std::env::var_os("JOURNAL_STREAM").is_some() {
        log.without_time().init();
    } else {
        log.init();
    }
}
