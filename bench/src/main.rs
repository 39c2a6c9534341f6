//! `inekf-bench`: measures the estimation service, and repeats the papers' experiments.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};
use inekf_bench::experiment::section7::{MismatchLaw, Setup};
use inekf_bench::experiment::{self, Experiment, Prior};
use inekf_bench::latency::{LatencyOptions, echo, measure, report};
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
    /// Round trips from an IMU sample to its estimate between two processes, beside a plain
    /// iceoryx2 echo and a raw cache-line ping-pong.
    Latency {
        /// Round trips per row.
        #[arg(long, default_value_t = 200_000)]
        rounds: u64,
        /// Turns that the rows take.
        #[arg(long, default_value_t = 10)]
        turns: u64,
        /// Write all rows and ratios as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
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
    /// The partner process of the plain echo.
    #[command(hide = true)]
    Echo {
        /// Instance to serve.
        instance: String,
        /// Processor to run on.
        cpu: usize,
    },
}

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
        Command::Echo { instance, cpu } => echo::serve(&Instance::new(&instance)?, cpu),
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
        Command::Latency {
            rounds,
            turns,
            json,
        } => {
            let rows = measure(&LatencyOptions {
                rounds,
                turns: turns.max(1),
            })?;
            print!("{}", report::text(&rows));
            if let Some(file) = json {
                let text = serde_json::to_string_pretty(&report::json(&rows))?;
                std::fs::write(&file, text)
                    .with_context(|| format!("writing {}", file.display()))?;
            }
            Ok(())
        }
    }
}
