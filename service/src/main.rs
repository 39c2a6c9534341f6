//! `inekf-service`: the estimation daemon.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use clap::{Parser, Subcommand};
use inekf::filter::UpdateError;
use inekf_service::checkpoint::file::Identity;
use inekf_service::checkpoint::{self, Keeper};
use inekf_service::config::Config;
use inekf_service::daemon::{self, Ports, Terms};
use inekf_service::engine::resume::ResumeSettings;
use inekf_service::engine::{self, Engine, History, Model, Use};
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::EstimateMessage;
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
        (None, Some(config)) => serve(config, &arguments.instance, arguments.stepped),
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

fn serve(file: &Path, instance: &str, stepped: bool) -> anyhow::Result<()> {
    start_logging();
    let instance = Instance::new(instance)?;
    let (config, config_text) = Config::load_with_text(file)?;
    let stop = Arc::new(AtomicBool::new(false));
    let signalled = Arc::clone(&stop);
    ctrlc::set_handler(move || signalled.store(true, Ordering::Relaxed))
        .context("installing the handler of SIGINT and SIGTERM")?;
    let daemon = Serve {
        config: &config,
        config_text: &config_text,
        instance: &instance,
        stepped,
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
    config_text: &'a str,
    instance: &'a Instance,
    stepped: bool,
    stop: &'a AtomicBool,
}

impl Use for Serve<'_> {
    type Output = anyhow::Result<()>;

    fn with<M: Model, H: History<M>>(self, engine: Engine<M, H>) -> anyhow::Result<()> {
        run(engine, &self)
    }
}

/// Nothing but the proof that there is an engine.
struct Built;

impl Use for Built {
    type Output = ();

    fn with<M: Model, H: History<M>>(self, _engine: Engine<M, H>) {}
}

fn run<M: Model, H: History<M>>(mut engine: Engine<M, H>, serve: &Serve<'_>) -> anyhow::Result<()> {
    let Serve {
        config,
        config_text,
        instance,
        stepped,
        stop,
    } = *serve;
    let mut ports = Ports::open(
        instance,
        config.runtime.wait,
        config.smoother.is_some(),
        config.journal.publish && !stepped,
    )?;
    let mut terms = Terms {
        config,
        config_text,
        stepped,
        unused_checkpoint: false,
    };
    // After the ports: a second daemon of the instance must not touch the first one's file.
    let mut keeper = match &config.checkpoint.path {
        Some(path) if !stepped => {
            let identity = Identity {
                instance: instance.to_string(),
                estimator: config.estimator.to_string(),
                model: M::Estimate::MODEL,
                dimension: config.error_states() as u32,
            };
            let path = PathBuf::from(path);
            terms.unused_checkpoint = !resume(&mut engine, &mut ports, config, &path, &identity);
            let period_ns = config.checkpoint.period_ns();
            Some(Keeper::start(path, identity, period_ns, monotonic_ns())?)
        }
        _ => None,
    };
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
    let outcome = daemon::run(&mut engine, &mut ports, &terms, keeper.as_mut(), stop);
    if let Some(keeper) = keeper {
        keeper.finish(engine.snapshot());
    }
    outcome
}

/// Has the engine continue from the checkpoint, if there is one. False if it is of no use; the log then says why.
fn resume<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    config: &Config,
    path: &Path,
    identity: &Identity,
) -> bool {
    let state = match checkpoint::last_state(path, identity) {
        Ok(Some(state)) => state,
        Ok(None) => return true,
        Err(checkpoint::Unused) => return false,
    };
    match engine.resume_from(&state, ResumeSettings::new(&config.checkpoint)) {
        Ok(()) => {
            ports.journal.resumed(&state);
            true
        }
        Err(reason) => {
            tracing::warn!("checkpoint not used, starting as configured: {reason}");
            false
        }
    }
}

/// Logs to standard error: information by default, iceoryx2 only when it warns.
fn start_logging() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info,iceoryx2=error"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
}
