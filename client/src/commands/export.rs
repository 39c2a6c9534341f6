//! `inekf-client export`: estimates for other tools.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use inekf_client::dataset::read_truth;
use inekf_client::exchange::{flat, require_sorted, truth_table, tum};
use inekf_client::recording::estimates;
use inekf_client::table::{EstimateTable, read_estimates};

/// What to export, and how.
#[derive(Args)]
pub struct Arguments {
    /// An estimate CSV (of `replay --out`), a recording (of `record`), or a truth.csv.
    input: PathBuf,
    /// tum: a line a pose, for evo; csv: seconds, degrees and world axes, for a spreadsheet; mcap: ROS 2 messages
    /// for Foxglove and rosbag2.
    #[arg(long)]
    format: Format,
    /// The file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Not used: the input is a file.
    #[arg(long, value_name = "NAME", hide = true)]
    instance: Option<String>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Tum,
    Csv,
    Mcap,
}

/// Exports.
///
/// # Errors
/// The input cannot be read or has faults, its stamps do not increase, or the output cannot be written.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let table = read(&arguments.input)?;
    require_sorted(&table.rows).with_context(|| arguments.input.display().to_string())?;
    let path = &arguments.out;
    if same_file(&arguments.input, path) {
        bail!(
            "{} would be overwritten: name another --out",
            path.display()
        );
    }
    let file = File::create(path).with_context(|| format!("creating {}", path.display()))?;
    let mut out = BufWriter::new(file);
    let written = match arguments.format {
        Format::Tum => tum::write(&table.rows, &mut out).map_err(anyhow::Error::from),
        Format::Csv => flat::write(&table, &mut out).map_err(anyhow::Error::from),
        Format::Mcap => write_mcap(&table, &mut out),
    };
    written
        .and_then(|()| Ok(out.flush()?))
        .with_context(|| format!("writing {}", path.display()))?;
    println!("exported {} poses to {}", table.rows.len(), path.display());
    Ok(())
}

#[cfg(feature = "mcap")]
fn write_mcap(table: &EstimateTable, out: &mut BufWriter<File>) -> anyhow::Result<()> {
    Ok(inekf_client::exchange::mcap::write(&table.rows, out)?)
}

#[cfg(not(feature = "mcap"))]
fn write_mcap(_table: &EstimateTable, _out: &mut BufWriter<File>) -> anyhow::Result<()> {
    bail!("this program was built without MCAP: build it with the feature `mcap`")
}

fn same_file(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}

/// Reads an estimate CSV, a recording, or a truth, which has no biases in its header.
fn read(path: &Path) -> anyhow::Result<EstimateTable> {
    let is_recording = estimates::is_recording(path);
    if is_recording.with_context(|| format!("reading {}", path.display()))? {
        return Ok(estimates::read_estimates(path)?.table);
    }
    let text =
        std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let header = text.lines().next().unwrap_or_default();
    let has = |name: &str| header.split(',').any(|column| column.trim() == name);
    if has("vx") && !has("bgx") {
        return match truth_table(&read_truth(path)?) {
            Some(table) => Ok(table),
            None => bail!("{} has no rows", path.display()),
        };
    }
    let name = path.display().to_string();
    Ok(read_estimates(&name, text.as_bytes())?)
}
