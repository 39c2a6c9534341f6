//! `inekf-tests`: the fault table by one command, with the feeder and the reader that it kills, and long fuzzing runs.

use std::any::Any;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::ExitCode;
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};
use inekf_client::feed::Feeder;
use inekf_client::read::EstimateReader;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::topic::Instance;
use inekf_tests::faults::outcome::markdown;
use inekf_tests::faults::scene::{at_origin, rest};
use inekf_tests::faults::{self, Plan, ROWS};
use inekf_tests::fuzz::{self, TARGETS};

/// Inflicts faults on real processes, and feeds hostile bytes to everything that takes bytes.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Inflicts every fault and prints the table.
    Faults {
        /// How often each fault is inflicted; faults that take seconds each are inflicted less often.
        #[arg(long, default_value_t = 30)]
        rounds: u32,
        /// Only this one.
        #[arg(long, value_name = "NAME")]
        only: Option<String>,
        /// Writes the table here too.
        #[arg(long, value_name = "FILE")]
        markdown: Option<PathBuf>,
        /// Seed of the moments.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Gives inputs made from a seed to everything that takes bytes from outside.
    Fuzz {
        /// How many inputs each target gets.
        #[arg(long, default_value_t = 1_000_000)]
        inputs: u64,
        /// Only this target.
        #[arg(long, value_name = "NAME")]
        only: Option<String>,
        /// Seed of the inputs.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Feeds a body at rest, until it is killed.
    #[command(hide = true)]
    Feed {
        #[arg(long)]
        instance: Instance,
        #[arg(long)]
        rate: u32,
        /// Stops after so many samples.
        #[arg(long)]
        count: Option<u64>,
    },
    /// Reads estimates, until it is killed: a line for every daemon that it hears, and each time that it attached anew.
    #[command(hide = true)]
    Read {
        #[arg(long)]
        instance: Instance,
    },
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Faults {
            rounds,
            only,
            markdown,
            seed,
        } => inflict(rounds, only, markdown, seed),
        Command::Fuzz { inputs, only, seed } => fuzz(inputs, only, seed).map(|()| true),
        Command::Feed {
            instance,
            rate,
            count,
        } => feed(&instance, rate, count.unwrap_or(u64::MAX)).map(|()| true),
        Command::Read { instance } => read(&instance).map(|()| true),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("inekf-tests: {error}");
            ExitCode::FAILURE
        }
    }
}

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Runs the rows one after the other; false if one failed.
fn inflict(rounds: u32, only: Option<String>, file: Option<PathBuf>, seed: u64) -> Outcome<bool> {
    let plan = Plan {
        rounds,
        seed,
        party: std::env::current_exe()?,
    };
    let chosen: Vec<&faults::Row> = match &only {
        Some(name) => vec![faults::row(name).ok_or_else(|| {
            let names: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
            format!("there is no fault {name:?}; there are {}", names.join(", "))
        })?],
        None => ROWS.iter().collect(),
    };
    let mut rows = Vec::new();
    for row in chosen {
        let started = Instant::now();
        // A row that fails must not keep the others from being tried.
        let outcome = catch_unwind(AssertUnwindSafe(|| (row.run)(&plan))).map_err(reason);
        eprintln!(
            "{:<18} {:6.1} s  {}",
            row.name,
            started.elapsed().as_secs_f64(),
            if outcome.is_ok() { "held" } else { "FAILED" }
        );
        rows.push((row, outcome));
    }
    let table = markdown(&rows);
    print!("{table}");
    if let Some(file) = file {
        std::fs::write(&file, table)?;
    }
    Ok(rows.iter().all(|(_, outcome)| outcome.is_ok()))
}

/// Runs the targets one after the other; the first input that does not hold ends the program.
fn fuzz(inputs: u64, only: Option<String>, seed: u64) -> Outcome<()> {
    let chosen: Vec<&fuzz::Target> = match &only {
        Some(name) => vec![fuzz::target(name).ok_or_else(|| {
            let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
            format!(
                "there is no target {name:?}; there are {}",
                names.join(", ")
            )
        })?],
        None => TARGETS.iter().collect(),
    };
    for target in chosen {
        let started = Instant::now();
        fuzz::seeded(target, seed, inputs);
        println!(
            "{:<10} {inputs} inputs held in {:.0} s: {}",
            target.name,
            started.elapsed().as_secs_f64(),
            target.takes
        );
    }
    Ok(())
}

/// What a panic said.
fn reason(panic: Box<dyn Any + Send>) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "it panicked".to_owned())
}

fn feed(instance: &Instance, rate_hz: u32, count: u64) -> Outcome<()> {
    let mut feeder = Feeder::open(instance)?;
    let period = Duration::from_secs(1) / rate_hz.max(1);
    let mut due = Instant::now();
    for index in 0..count {
        let stamp_ns = monotonic_ns();
        if index % 20 == 0 {
            feeder.position(&at_origin(stamp_ns, 0))?;
        }
        feeder.imu(&rest(stamp_ns))?;
        due += period;
        sleep(due.saturating_duration_since(Instant::now()));
    }
    Ok(())
}

fn read(instance: &Instance) -> Outcome<()> {
    let mut reader: EstimateReader = EstimateReader::open(instance)?;
    let (mut last, mut attached) = (u64::MAX, 0);
    loop {
        while let Some(estimate) = reader.next_estimate()? {
            let number = estimate.head.estimate_seq;
            if number <= last || reader.reattached() > attached {
                attached = reader.reattached();
                println!("a daemon, from estimate {number}");
                std::io::stdout().flush()?;
            }
            last = number;
        }
        sleep(Duration::from_millis(1));
    }
}
