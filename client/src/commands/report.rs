//! `inekf-client report`: a page about a run.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use inekf_client::dataset::{Dataset, Truth, read_truth};
use inekf_client::recording::estimates;
use inekf_client::report::{Built, Material, NisSample, build};
use inekf_client::table::{EstimateTable, read_estimates};

/// What to report on.
#[derive(Args)]
pub struct Arguments {
    /// An estimate CSV, of `replay --out FILE --covariance` for the bands and the NEES; or a recording (of `record`),
    /// which has the NIS of the fixes as well.
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
    let (table, nis) = estimate_of(&arguments.input)?;
    let dataset = truth_of(&arguments.truth)?;
    let subtitle = format!("{name} against {}", arguments.truth.display());
    let built = build(&Material {
        title: "Estimate and truth",
        subtitle: &subtitle,
        rows: &table.rows,
        truth: &dataset.truth,
        fixes: &dataset.position,
        settled_s: arguments.skip,
        nis: &nis,
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

/// The estimates with the NIS of the fixes, which only a recording has.
fn estimate_of(path: &Path) -> anyhow::Result<(EstimateTable, Vec<NisSample>)> {
    let reading = || format!("reading {}", path.display());
    if estimates::is_recording(path).with_context(reading)? {
        let recorded = estimates::read_estimates(path)?;
        return Ok((recorded.table, recorded.nis));
    }
    let file = File::open(path).with_context(reading)?;
    let table = read_estimates(&path.display().to_string(), BufReader::new(file))?;
    Ok((table, Vec::new()))
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
