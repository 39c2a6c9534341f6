//! `inekf-client import`: other people's recordings as dataset folders.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use inekf_client::dataset::{Truth, save_truth};
use inekf_client::import::{euroc, tum};

/// What to import, and where to.
#[derive(Args)]
pub struct Arguments {
    /// The folder of an EuRoC sequence (that holds mav0), or the file of a TUM trajectory.
    input: PathBuf,
    /// euroc: IMU, positions, truth and noise become a dataset folder; tum: the trajectory becomes the truth.csv of the
    /// folder, whose other files stay.
    #[arg(long, value_name = "KIND")]
    from: Kind,
    /// The dataset folder to write.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Standard deviation that EuRoC's position fixes get, m per axis.
    #[arg(long, value_name = "M", default_value_t = 0.01)]
    position_sigma: f64,
    /// Not used: no daemon takes part.
    #[arg(long, value_name = "NAME", hide = true)]
    instance: Option<String>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    Tum,
    Euroc,
}

/// Imports.
///
/// # Errors
/// The input cannot be read or has a fault, or the folder cannot be written.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if !(arguments.position_sigma.is_finite() && arguments.position_sigma > 0.0) {
        anyhow::bail!(
            "--position-sigma {}: give a length above 0 m",
            arguments.position_sigma
        );
    }
    let out = &arguments.out;
    match arguments.from {
        Kind::Euroc => {
            let dataset = euroc::read(&arguments.input, arguments.position_sigma)?;
            dataset.save(out)?;
            println!(
                "imported {}: {} IMU samples, {} position fixes, {} rows of truth",
                out.display(),
                dataset.imu.len(),
                dataset.position.len(),
                rows(&dataset.truth)
            );
        }
        Kind::Tum => {
            let truth = tum::read(&arguments.input)?;
            save_truth(out, &truth)?;
            println!("imported {}: {} rows of truth", out.display(), rows(&truth));
        }
    }
    Ok(())
}

fn rows(truth: &Truth) -> usize {
    match truth {
        Truth::None => 0,
        Truth::Planar(rows) => rows.len(),
        Truth::Spatial(rows) => rows.len(),
    }
}
