//! `inekf-client report`: a page about a run.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use inekf_client::dataset::{Dataset, Truth, read_truth};
use inekf_client::report::{Built, Material, build};
use inekf_client::table::read_estimates;

/// What to report on.
#[derive(Args)]
pub struct Arguments {
    /// An estimate CSV, of `replay --out FILE --covariance` for the bands and the NEES.
    input: PathBuf,
    /// A dataset folder with truth.csv, whose fixes are drawn too, or the file of a truth.
    #[arg(long, value_name = "DIR|FILE")]
    truth: PathBuf,
    /// The page to write: one HTML file that needs nothing else.
    #[arg(long, value_name = "FILE.html", default_value = "report.html")]
    out: PathBuf,
    /// Errors are summed up from so long after the first estimate on, s.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    skip: f64,
    /// Not used: the input is a file.
    #[arg(long, value_name = "NAME", hide = true)]
    instance: Option<String>,
}

/// Writes the page, and prints the errors.
///
/// # Errors
/// A file cannot be read or written, has faults, or truth and estimate have no time in common.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let name = arguments.input.display().to_string();
    let file = File::open(&arguments.input).with_context(|| format!("reading {name}"))?;
    let table = read_estimates(&name, BufReader::new(file))?;
    let dataset = truth_of(&arguments.truth)?;
    let subtitle = format!("{name} against {}", arguments.truth.display());
    let built = build(&Material {
        title: "Estimate and truth",
        subtitle: &subtitle,
        rows: &table.rows,
        truth: &dataset.truth,
        fixes: &dataset.position,
        settled_s: arguments.skip,
        nis: &[],
        latencies: &[],
        latency_note: "",
        counters: None,
    })?;
    let Some(summary) = &built.summary else {
        bail!(
            "{name} and {} have no time in common after {} s",
            arguments.truth.display(),
            arguments.skip
        );
    };
    let position = summary.position_rmse_m;
    println!(
        "error    RMSE: position {:.3} m east, {:.3} m north, {:.3} m up; heading {:.3} deg",
        position.x,
        position.y,
        position.z,
        summary.heading_rmse_rad.to_degrees()
    );
    write(&arguments.out, &built)?;
    println!("report   {}", arguments.out.display());
    Ok(())
}

fn truth_of(path: &Path) -> anyhow::Result<Dataset> {
    let dataset = if path.is_dir() {
        Dataset::load(path)?
    } else {
        Dataset {
            truth: read_truth(path)?,
            ..Dataset::default()
        }
    };
    if dataset.truth == Truth::None {
        bail!("{} holds no truth.csv", path.display());
    }
    Ok(dataset)
}

fn write(path: &Path, built: &Built) -> anyhow::Result<()> {
    fs::write(path, &built.html).with_context(|| format!("writing {}", path.display()))
}
