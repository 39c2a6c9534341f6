//! `inekf-bench`: measures the estimation service, and repeats the papers' experiments.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};
use inekf_bench::experiment::section7::{MismatchLaw, Setup};
use inekf_bench::experiment::{self, Experiment, Prior};
use inekf_bench::fleet::{self, FleetOptions};
use inekf_bench::late;
use inekf_bench::latency::mechanism::{self, Mechanism, Wait};
use inekf_bench::latency::neighbour::{self, Neighbour};
use inekf_bench::latency::{LatencyOptions, figure, measure};
use inekf_bench::wake::{self, WakeOptions};
use inekf_shared::topic::Instance;

/// Measures the estimation service, and repeats the papers' experiments. Build everything first: `cargo build --release`.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Round trips from a sample to its estimate with full covariance between two pinned processes,
    /// beside what else one could do: iceoryx2 echo, blackboard, sockets, a raw cache line.
    #[command(after_long_help = READING)]
    Latency {
        #[command(flatten)]
        options: LatencyOptions,
        /// Write all rows, ratios, the machine and its load as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Draw the distributions as an SVG figure.
        #[arg(long, value_name = "FILE")]
        svg: Option<PathBuf>,
    },
    /// Many vehicles in one daemon, on one processor: how many samples come late?
    Fleet {
        #[command(flatten)]
        options: FleetOptions,
    },
    /// Very many samples to a daemon that sleeps between them: does a wait ever outlast its bound?
    Wake {
        #[command(flatten)]
        options: WakeOptions,
    },
    /// A fix that comes late on SE_2(3): carried to now in constant time, against replaying the samples since. A table
    /// on standard output, late.csv and late.svg in a folder.
    Late {
        /// Folder for the results; made if need be.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// How often each way is timed; medians are reported.
        #[arg(long, default_value_t = 201)]
        turns: usize,
    },
    /// An experiment of the papers: tables on standard output, CSV files and SVG figures in a folder.
    Experiment {
        /// Which one.
        name: Experiment,
        /// Folder for the results; made if need be.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Monte Carlo runs [default: 100 for alignment, 20 for marginalisation, else 50].
        #[arg(long)]
        runs: Option<u64>,
        /// Seed of all draws.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// How the models are wrong (lc-inekf).
        #[arg(long, value_enum, default_value_t = MismatchLaw::Constant, value_name = "MODE")]
        mismatch: MismatchLaw,
        /// Length of a step in the plane, s (lc-inekf, parametrisation).
        #[arg(long, default_value_t = 0.1, value_name = "SECONDS")]
        dt: f64,
        /// Leave out the adaptive bank, which costs as much as all other filters together (lc-inekf).
        #[arg(long)]
        without_adaptive: bool,
        /// Only this form of the prior that marginalisation leaves, instead of all (alignment, marginalisation).
        #[arg(long, value_enum, value_name = "FORM")]
        prior: Option<Prior>,
    },
    /// The process that `latency --neighbour` measures beside.
    #[command(hide = true)]
    Neighbour,
    /// The partner process of a mechanism.
    #[command(hide = true)]
    Partner {
        /// What it answers over.
        mechanism: Mechanism,
        /// How it waits.
        wait: Wait,
        /// Instance to serve.
        instance: String,
        /// Processor to run on.
        cpu: usize,
    },
}

/// How to read what `latency` prints.
const READING: &str = "\
What is measured, in nanoseconds, from before the sample is sent until its answer is read:
  estimate, 15 / 9 states     IMU sample to a real daemon, estimate with full covariance back
  ..., fixes                  the same with a position fix every 200 samples, fused by the filter or by
                              the smoother, to the estimate of the sample itself
  LC-InEKF, odometry2d        planar odometry to its estimate; + fix: with a position fix beside it,
                              to the estimate that holds both
  plain iceoryx2 echo         what shared memory alone costs with the same messages
  pre-loaned iceoryx2 echo    the same with slots loaned ahead
  iceoryx2 blackboard         a newest-value slot in each direction
  Unix-domain, UDP socket     datagrams as long as those messages
  raw cache line, raw futex   the floor of what spins, and of what is woken

spin: the far side looks all the time. event: it sleeps until woken, while this side still spins for
the answer (sockets block on both sides). At saturation the next round begins at once, often before
the far side has gone to sleep: what a wake-up costs shows at fixed times. Times that pass during a
round are left out, and counted in the JSON as `missed`.

Two processors are used for as long as it runs, 40 to 60 s by default. Leave the machine alone
meanwhile: its load stands in the report. A virtual machine's processors move between the threads of
one core and two cores; a ping-pong of a cache line before and after every chunk of rounds tells
which, rows are kept apart by it, and a chunk in which it changed is left out. So compare ratios:
  / line   median by that of the ping-pongs around the same chunk
  / echo   median by that of the plain echo in the same group
A figure with ~ is dominated by noise: fewer than ten rounds beyond it, or other processes that took
a processor about as often, or chunks that disagree, or a ping-pong as disturbed.

In the JSON `ratio_p50` and `ratio_p999` on top are those of the 15-state filter by the plain echo,
both spinning at saturation.

  inekf-bench latency --json latency.json --svg latency.svg
  inekf-bench latency --neighbour --json latency.json               # idle, then beside a busy neighbour
  inekf-bench latency --rounds 1000000 --turns 20 --seconds 10     # a quarter of an hour, for the tails
";

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("inekf-bench: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Partner {
            mechanism,
            wait,
            instance,
            cpu,
        } => mechanism::serve(mechanism, wait, &Instance::new(&instance)?, cpu),
        Command::Experiment {
            name,
            out,
            runs,
            seed,
            mismatch,
            dt,
            without_adaptive,
            prior,
        } => {
            let setup = Setup {
                law: mismatch,
                dt_s: dt,
            };
            let options = experiment::Options {
                runs: runs.unwrap_or(name.usual_runs()),
                seed,
                setup,
                adaptive: !without_adaptive,
                prior,
            };
            let tables = experiment::run(name, &options, &out)?;
            let mut stdout = std::io::stdout().lock();
            stdout.write_all(tables.as_bytes())?;
            writeln!(stdout, "\nwritten to {}", out.display())?;
            Ok(())
        }
        Command::Late { out, turns } => {
            let table = late::run(turns, &out)?;
            let mut stdout = std::io::stdout().lock();
            stdout.write_all(table.as_bytes())?;
            writeln!(stdout, "\nwritten to {}", out.display())?;
            Ok(())
        }
        Command::Fleet { options } => {
            let report = fleet::measure(&options)?;
            std::io::stdout().write_all(report.text().as_bytes())?;
            Ok(())
        }
        Command::Neighbour => neighbour::live(),
        Command::Wake { options } => {
            let report = wake::measure(&options)?;
            std::io::stdout().write_all(report.text().as_bytes())?;
            Ok(())
        }
        Command::Latency { options, json, svg } => {
            let report = measure(&options)?;
            let mut all = report.json();
            std::io::stdout().write_all(report.text().as_bytes())?;
            if options.neighbour {
                let _neighbour = Neighbour::start()?;
                let beside = measure(&options)?;
                println!("\nBeside a busy neighbour:\n{}", beside.text());
                all["beside_a_busy_neighbour"] = beside.json();
            }
            if let Some(file) = json {
                write(&file, &serde_json::to_string_pretty(&all)?)?;
            }
            if let Some(file) = svg {
                write(&file, &figure::svg(&report)?)?;
            }
            Ok(())
        }
    }
}

fn write(file: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(file, text).with_context(|| format!("writing {}", file.display()))
}
