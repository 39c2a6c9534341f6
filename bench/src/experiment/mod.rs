//! The papers' experiments, repeated: numbers on standard output, CSV and SVG in a folder.
//!
//! [`lc_inekf`] is \[LC\] section VII; [`wheeled_robot`] and [`alignment`] are \[IS\] sections II and V;
//! [`mod@parametrisation`] shows Propositions 1 and 2 and Corollary 1 of \[PAR\] in numbers, [`marginalisation`] its
//! Propositions 3 and 4. All are functions of their options alone: the same seed gives the same bytes, on any number of
//! processors.

pub mod alignment;
pub mod apart;
pub mod figures;
pub mod filters;
pub mod imu_drive;
pub mod lc_inekf;
pub mod marginalisation;
pub mod parametrisation;
pub mod section7;
pub mod take_off;
pub mod wheeled_robot;

use std::path::Path;

use anyhow::{Context, ensure};
use clap::ValueEnum;
use inekf::smoother::PriorForm;

use crate::progress::progress;
use section7::{DURATION_S, Setup};

/// Which experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Experiment {
    /// LC, section VII: every filter on a robot whose odometry and position sources have unknown errors.
    LcInekf,
    /// PAR, Propositions 1 and 2, Corollary 1: when the left- and right-invariant filters are one.
    Parametrisation,
    /// IS, section II: a straight drive with a wrong heading, every iteration of two smoothers.
    WheeledRobot,
    /// IS, section V: sliding windows on an IMU whose first heading is 80 deg wrong.
    Alignment,
    /// PAR, Propositions 3 and 4, Corollary 1: when smoothers of different parametrisations are one.
    Marginalisation,
}

impl Experiment {
    /// Monte Carlo runs if the user does not say.
    pub fn usual_runs(self) -> u64 {
        match self {
            Self::LcInekf | Self::Parametrisation | Self::WheeledRobot => 50,
            Self::Alignment => 100,
            Self::Marginalisation => 20,
        }
    }
}

/// [`PriorForm`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Prior {
    /// A mean on the group, covariance frozen: the library's default.
    Group,
    /// A mean in the coordinates of the moment of marginalisation, covariance frozen: PAR (41).
    Linear,
    /// A mean on the group, covariance carried along by the exact Jacobians.
    Recentred,
}

impl Prior {
    /// All forms, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Group, Self::Linear, Self::Recentred];

    /// The library's form.
    pub fn form(self) -> PriorForm {
        match self {
            Self::Group => PriorForm::GroupMean,
            Self::Linear => PriorForm::Linear,
            Self::Recentred => PriorForm::Recentred,
        }
    }

    /// Its name in tables, legends and CSV files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Group => "group",
            Self::Linear => "linear",
            Self::Recentred => "recentred",
        }
    }
}

/// What the experiments have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Monte Carlo runs.
    pub runs: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// What `lc_inekf` simulates in the plane; `parametrisation` takes only the length of a step from it.
    pub setup: Setup,
    /// Whether the adaptive bank is among the filters of `lc_inekf`.
    pub adaptive: bool,
    /// The only form of the priors that marginalisation leaves; all if none is said.
    pub prior: Option<Prior>,
}

impl Options {
    /// Everything that an experiment has, on its own default setup.
    pub fn new(runs: u64, seed: u64) -> Self {
        Self {
            runs,
            seed,
            setup: Setup::PAPER,
            adaptive: true,
            prior: None,
        }
    }

    /// The forms of the prior that are asked for.
    fn priors(&self) -> impl Iterator<Item = Prior> {
        let only = self.prior;
        Prior::ALL
            .into_iter()
            .filter(move |prior| only.is_none_or(|only| only == *prior))
    }
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
        Experiment::WheeledRobot => wheeled_robot::run(options, out),
        Experiment::Alignment => alignment::run(options, out),
        Experiment::Marginalisation => marginalisation::run(options, out),
    }
}

/// Writes `text` to the file `name` in `out`.
fn write(out: &Path, name: &str, text: &str) -> anyhow::Result<()> {
    let file = out.join(name);
    std::fs::write(&file, text).with_context(|| format!("writing {}", file.display()))
}
