//! The papers' experiments, repeated: numbers on standard output, CSV and SVG in a folder.
//!
//! [`lc_inekf`] is \[LC\] section VII; [`parametrisation`] shows Propositions 1 and 2 and Corollary 1 of \[PAR\] in
//! numbers. Both are functions of their options alone: the same seed gives the same bytes, on any number of processors.

pub mod figures;
pub mod filters;
pub mod lc_inekf;
pub mod parametrisation;
pub mod section7;

use std::path::Path;

use anyhow::{Context, ensure};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};

use section7::{DURATION_S, Setup};

/// Which experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Experiment {
    /// LC, section VII: every filter on a robot whose odometry and position sources have unknown errors.
    LcInekf,
    /// PAR, Propositions 1 and 2, Corollary 1: when the left- and right-invariant filters are one.
    Parametrisation,
}

/// What the experiments have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Monte Carlo runs.
    pub runs: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// What is simulated in the plane; `parametrisation` takes only the length of a step from it.
    pub setup: Setup,
}

/// Runs an experiment, writes its files to `out` (made if need be), and returns its tables as text.
///
/// # Errors
/// No runs, a step that is no fraction of a run, a filter that fails, or a file that cannot be written.
pub fn run(experiment: Experiment, options: &Options, out: &Path) -> anyhow::Result<String> {
    ensure!(options.runs > 0, "no runs: --runs must be at least 1");
    let dt_s = options.setup.dt_s;
    ensure!(
        (1e-3..=DURATION_S / 4.0).contains(&dt_s),
        "steps of {dt_s} s: --dt must lie between 0.001 and {} s",
        DURATION_S / 4.0
    );
    std::fs::create_dir_all(out).with_context(|| format!("making the folder {}", out.display()))?;
    match experiment {
        Experiment::LcInekf => lc_inekf::run(options, out),
        Experiment::Parametrisation => parametrisation::run(options, out),
    }
}

/// Writes `text` to the file `name` in `out`.
fn write(out: &Path, name: &str, text: &str) -> anyhow::Result<()> {
    let file = out.join(name);
    std::fs::write(&file, text).with_context(|| format!("writing {}", file.display()))
}

/// A progress bar on standard error; silent where that is not a terminal.
fn progress(what: &'static str, steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    let style = "{msg} {bar:40} {pos}/{len} runs  {elapsed} / {duration}";
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}
