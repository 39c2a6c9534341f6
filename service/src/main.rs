//! `inekf-service`: the estimation daemon.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use clap::{Parser, Subcommand};
use inekf::filter::UpdateError;
use inekf_service::config::{self, Config};
use inekf_service::daemon::{self, Order, supervisor};
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
    /// Name of this daemon; clients name the same one. Many vehicles in one daemon: names and patterns, separated by
    /// commas, as in "lead,car-{0..99}" [default: those of the configuration's [fleet], else "default"]
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Take inputs from requests only, one by one, for the replay of a recording: nothing is read from the topics, and
    /// there are neither checkpoints nor a journal.
    #[arg(long)]
    stepped: bool,
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
        (None, Some(config)) => serve(config, arguments.instance.as_deref(), arguments.stepped),
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
    let swept = transport::sweep(&config)?;
    println!(
        "removed  {} dead nodes, {} services and {} files of theirs; {} nodes could not be removed",
        swept.nodes, swept.services, swept.files, swept.kept
    );
    transport::remove_node_counter(&config);
    let files = inspect::shared_memory_files(&config)?;
    let bytes: u64 = files.iter().map(|(_, bytes)| bytes).sum();
    println!(
        "files    {} in shared memory, {:.1} MB",
        files.len(),
        bytes as f64 * 1e-6
    );
    Ok(())
}

fn serve(file: &Path, named: Option<&str>, stepped: bool) -> anyhow::Result<()> {
    start_logging();
    let named = named.map(config::expand).transpose();
    let named = named.map_err(|problem| anyhow::anyhow!("--instance: {problem}"))?;
    let (config, config_text) = Config::load_with_text(file)?;
    let instances = match named {
        Some(named) => named,
        None if config.fleet.instances.is_empty() => vec![Instance::default()],
        None => config.fleet.instances.clone(),
    };
    engine::build(&config, Built).map_err(|error| unsolvable(file, &error))?;
    let stop = Arc::new(AtomicBool::new(false));
    let signalled = Arc::clone(&stop);
    ctrlc::set_handler(move || signalled.store(true, Ordering::Relaxed))
        .context("installing the handler of SIGINT and SIGTERM")?;
    let order = Order {
        config: &config,
        config_text: &config_text,
        instances: &instances,
        stepped,
        stop: &stop,
    };
    let outcome = daemon::serve(&order, || {
        say_ready(&config, &instances)?;
        supervisor::ready();
        Ok(())
    });
    supervisor::stopping();
    outcome
}

/// Why a configuration that reads well cannot be run.
fn unsolvable(file: &Path, error: &UpdateError) -> anyhow::Error {
    anyhow::anyhow!("{}: {error}", file.display())
}

/// Nothing but the proof that there is an engine.
struct Built;

impl Use for Built {
    type Output = ();

    fn with<M: Model + 'static, H: History<M> + 'static>(self, _engine: Engine<M, H>) {}
}

/// The line that says that the ports are open.
fn say_ready(config: &Config, instances: &[Instance]) -> anyhow::Result<()> {
    let named = match instances {
        [only] => format!("instance {only}"),
        [first, .., last] => format!("{} instances, {first} to {last}", instances.len()),
        [] => "no instance".to_owned(),
    };
    let mut out = std::io::stdout();
    writeln!(
        out,
        "ready: {named}, process {}, model {}, wait {}",
        std::process::id(),
        config.model,
        config.runtime.wait,
    )
    .and_then(|()| out.flush())
    .context("writing the ready line")
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
