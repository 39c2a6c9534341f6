//! \[PAR\] Propositions 3 and 4 and Corollary 1 in numbers: two parametrisations of one smoother, on the same data.
//!
//! * Proposition 3: smoothing of a whole drive is not affected, iteration by iteration.
//! * Proposition 4: marginalisation sets them apart. That is so for a frozen prior; one that the exact Jacobians carry
//!   along is the same term of the cost in any coordinates.
//! * Corollary 1: an iterated filter is a window of one state, and is set apart the same way. Which filter is which
//!   window: with transport of the covariance, the one with a prior that the Jacobians carry along.
//!
//! The drive is [`imu_drive`](super::imu_drive). Compared is the newest state after each fix, as
//! [`apart`](super::apart) says; the batch begins by dead reckoning, and is compared after each iteration.
//! Left and right exponential, and GTSAM's and Forster's charts, are linked by a matrix as \[PAR\] (11) wants it;
//! the exponential and GTSAM's chart only to first order, and they measure the residual of the IMU differently: they
//! are one smoother nowhere.

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use inekf::filter::{
    Belief, Forster, Gate, Gtsam, Left, Right, Side, Transport, UpdateOptions, update_with,
};
use inekf::lie::SE23;
use inekf::model::PositionObservation;
use inekf::smoother::{
    Batch, BatchOptions, Chain, Jacobians, Preintegration, PriorForm, Window, WindowOptions,
};
use inekf_client::plot::palette;
use plotters::style::{Color, RGBColor};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::apart::Apart;
use super::figures::{self, Mark, Panel, Scale, Series};
use super::imu_drive::ImuDrive;
use super::parametrisation::WholeSteps;
use super::section7::stream;
use super::{Options, Prior, progress, write};

/// Gauss-Newton iterations: one for each fix, and so many that a window has converged.
const PASSES: [usize; 2] = [1, 8];
/// Sizes of the windows that marginalise; one state is Corollary 1.
const CAPACITIES: [usize; 2] = [10, 1];
/// More states than the drive has.
const EVERYTHING: usize = 40;

/// Two parametrisations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pair {
    /// `chi exp(xi)` and `exp(xi) chi`.
    LeftRight,
    /// \[IS\] (23) and (22).
    GtsamForster,
    /// `chi exp(xi)` and \[IS\] (23).
    LeftGtsam,
    /// The iterated left-invariant filter, with transport of the covariance, and `chi exp(xi)` in a window of one.
    FilterLeft,
}

impl Pair {
    const PARAMETRISATIONS: [Self; 3] = [Self::LeftRight, Self::GtsamForster, Self::LeftGtsam];

    fn name(self) -> &'static str {
        match self {
            Self::LeftRight => "left, right",
            Self::GtsamForster => "GTSAM, Forster",
            Self::LeftGtsam => "left, GTSAM",
            Self::FilterLeft => "iterated filter, left",
        }
    }

    fn compare(self, drive: &Recording, scheme: Scheme) -> anyhow::Result<Vec<Apart>> {
        match self {
            Self::LeftRight => compare_two::<Left, Right>(drive, scheme),
            Self::GtsamForster => compare_two::<Gtsam, Forster>(drive, scheme),
            Self::LeftGtsam => compare_two::<Left, Gtsam>(drive, scheme),
            Self::FilterLeft => {
                let newest = smoothed::<Left>(drive, scheme)?;
                Ok(apart(&filter(drive)?, &newest, drive.fixes.len()))
            }
        }
    }
}

/// What is smoothed how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// The whole drive at once.
    Batch,
    /// A window, with this many iterations for each fix.
    Window {
        /// The most states that it holds; `None` if none ever leaves.
        capacity: Option<usize>,
        /// The form of the priors that marginalisation leaves.
        prior: Prior,
        /// Gauss-Newton iterations for each fix.
        passes: usize,
    },
}

impl Scheme {
    fn all(options: &Options) -> Vec<Self> {
        let of_passes = |capacity, prior| {
            PASSES.map(|passes| Self::Window {
                capacity,
                prior,
                passes,
            })
        };
        let mut all = vec![Self::Batch];
        all.extend(of_passes(None, Prior::Group));
        for capacity in CAPACITIES {
            let of_priors = options
                .priors()
                .flat_map(|prior| of_passes(Some(capacity), prior));
            all.extend(of_priors);
        }
        all
    }

    fn name(self) -> String {
        match self {
            Self::Batch => "batch, each iteration (Prop. 3)".to_owned(),
            Self::Window {
                capacity: None,
                passes,
                ..
            } => format!("window that nothing leaves (Prop. 3), {passes} it."),
            Self::Window {
                capacity: Some(capacity),
                prior,
                passes,
            } => {
                let claim = if capacity == 1 { "Cor. 1" } else { "Prop. 4" };
                let prior = prior.name();
                format!("window {capacity} ({claim}), {prior} prior, {passes} it.")
            }
        }
    }

    /// Columns of the CSV: kind, capacity, prior, passes.
    fn columns(self) -> String {
        match self {
            Self::Batch => "batch,,,".to_owned(),
            Self::Window {
                capacity: None,
                passes,
                ..
            } => format!("window,,,{passes}"),
            Self::Window {
                capacity: Some(capacity),
                prior,
                passes,
            } => format!("window,{capacity},{},{passes}", prior.name()),
        }
    }
}

/// An estimate of the newest state.
type Newest = Belief<SE23, Left, 9>;

/// A drive with its IMU preintegrated.
struct Recording {
    first: Newest,
    motions: Vec<Preintegration<SE23, 9>>,
    fixes: Vec<PositionObservation>,
}

impl Recording {
    fn draw(seed: u64, index: u64) -> Self {
        let drive = ImuDrive::draw(&mut stream(seed, index));
        Self {
            first: drive.first(),
            motions: (0..drive.fixes.len()).map(|k| drive.motion(k)).collect(),
            fixes: drive.fixes,
        }
    }
}

fn compare_two<A: Side, B: Side>(drive: &Recording, scheme: Scheme) -> anyhow::Result<Vec<Apart>> {
    let expected = match scheme {
        Scheme::Batch => PASSES[1],
        Scheme::Window { .. } => drive.fixes.len(),
    };
    let (one, other) = (smoothed::<A>(drive, scheme)?, smoothed::<B>(drive, scheme)?);
    Ok(apart(&one, &other, expected))
}

/// Estimate by estimate; what is missing of those `expected` is lost.
fn apart(one: &[Newest], other: &[Newest], expected: usize) -> Vec<Apart> {
    let pairs = one.iter().zip(other);
    let mut apart: Vec<Apart> = pairs.map(|(a, b)| Apart::between(a, b)).collect();
    apart.resize(expected, Apart::LOST);
    apart
}

fn smoothed<S: Side>(drive: &Recording, scheme: Scheme) -> anyhow::Result<Vec<Newest>> {
    match scheme {
        Scheme::Batch => batch::<S>(drive),
        Scheme::Window {
            capacity,
            prior,
            passes,
        } => {
            let options = WindowOptions {
                iterations: passes,
                first_prior: PriorForm::Recentred,
                prior: prior.form(),
                jacobians: Jacobians::Exact,
                ..WindowOptions::new(capacity.unwrap_or(EVERYTHING))
            };
            Ok(window::<S>(drive, &options))
        }
    }
}

/// The state after each fix.
fn filter(drive: &Recording) -> anyhow::Result<Vec<Newest>> {
    let options = UpdateOptions {
        iterations: PASSES[1],
        tolerance: 0.0,
        transport: Transport::Jacobian,
        gate: Gate::OPEN,
    };
    let mut belief = drive.first;
    let steps = drive.motions.iter().zip(&drive.fixes);
    steps
        .map(|(motion, fix)| {
            belief = motion.carry(&belief);
            update_with(&mut belief, fix, &WholeSteps, &options)?;
            Ok(belief)
        })
        .collect()
}

/// The newest state after each fix, until the estimate has diverged so far that it can no longer be computed.
fn window<S: Side>(drive: &Recording, options: &WindowOptions) -> Vec<Newest> {
    let mut window = Window::<SE23, S, 9>::new(&drive.first, options);
    let steps = drive.motions.iter().zip(&drive.fixes);
    steps
        .map_while(|(motion, fix)| {
            window.push(motion);
            window.update(*fix).ok()?;
            Some(window.newest())
        })
        .collect()
}

/// The newest state after each iteration over the whole drive.
fn batch<S: Side>(drive: &Recording) -> anyhow::Result<Vec<Newest>> {
    let fixes = drive.fixes.len();
    let mut chain = Chain::with_capacity(drive.first, fixes + 1, fixes);
    for (motion, fix) in drive.motions.iter().zip(&drive.fixes) {
        chain.advance(*motion, *motion.noise().matrix());
        chain.observe(*fix);
    }
    let options = BatchOptions {
        step_control: false,
        ..BatchOptions::default()
    };
    let mut batch = Batch::<SE23, S, 9, 3>::with_capacity(fixes + 1, fixes);
    batch.dead_reckon(&chain);
    (0..PASSES[1])
        .map(|_| {
            batch.iterate(&chain, &options)?;
            let newest = batch.states()[fixes];
            Ok(Belief::new(newest, *batch.newest_covariance()))
        })
        .collect()
}

/// One comparison over all runs.
#[derive(Clone, Debug)]
pub struct Row {
    /// What is compared.
    pub pair: Pair,
    /// How both smooth.
    pub scheme: Scheme,
    /// The largest difference over the runs after each fix, or iteration.
    pub over_time: Vec<Apart>,
    /// The largest difference of all.
    pub most: Apart,
    /// The largest difference of the means in the median run.
    pub median_mean: f64,
}

impl Row {
    fn of(pair: Pair, scheme: Scheme, runs: &[Vec<Apart>]) -> Self {
        let most_of =
            |run: &Vec<Apart>| run.iter().copied().fold(Apart::default(), Apart::or_larger);
        let mut of_runs: Vec<Apart> = runs.iter().map(most_of).collect();
        of_runs.sort_by(|a, b| a.mean.total_cmp(&b.mean));
        let at = |k: usize| {
            let now = runs.iter().map(|run| run[k]);
            now.fold(Apart::default(), Apart::or_larger)
        };
        Self {
            pair,
            scheme,
            over_time: (0..runs[0].len()).map(at).collect(),
            most: of_runs
                .iter()
                .copied()
                .fold(Apart::default(), Apart::or_larger),
            median_mean: of_runs[of_runs.len() / 2].mean,
        }
    }
}

/// Every comparison over `options.runs` runs.
///
/// # Errors
/// A batch or filter that fails, with its run.
pub fn compare(options: &Options) -> anyhow::Result<Vec<Row>> {
    let schemes = Scheme::all(options);
    let mut all: Vec<(Pair, Scheme)> = Pair::PARAMETRISATIONS
        .into_iter()
        .flat_map(|pair| schemes.iter().map(move |scheme| (pair, *scheme)))
        .collect();
    all.extend(options.priors().map(|prior| {
        let scheme = Scheme::Window {
            capacity: Some(1),
            prior,
            passes: PASSES[1],
        };
        (Pair::FilterLeft, scheme)
    }));
    let bar = progress("smoothers", options.runs);
    let one = |index: u64| -> anyhow::Result<Vec<Vec<Apart>>> {
        let drive = Recording::draw(options.seed, index);
        let rows = all.iter().map(|(pair, scheme)| {
            pair.compare(&drive, *scheme)
                .with_context(|| format!("{}: {} in run {index}", pair.name(), scheme.name()))
        });
        let rows = rows.collect();
        bar.inc(1);
        rows
    };
    let runs: Vec<_> = (0..options.runs)
        .into_par_iter()
        .map(one)
        .collect::<anyhow::Result<_>>()?;
    bar.finish_and_clear();
    let row = |(i, (pair, scheme)): (usize, &(Pair, Scheme))| {
        let of_runs: Vec<_> = runs.iter().map(|run| run[i].clone()).collect();
        Row::of(*pair, *scheme, &of_runs)
    };
    Ok(all.iter().enumerate().map(row).collect())
}

/// Runs the experiment; writes two tables and a figure, and returns the first as text.
///
/// # Errors
/// A batch or filter that fails, with its run; a file that cannot be written.
pub fn run(options: &Options, out: &Path) -> anyhow::Result<String> {
    let rows = compare(options)?;
    let mut csv = "pair,kind,capacity,prior,iterations,mean_sigmas,median_mean_sigmas,\
                   covariance_relative\n"
        .to_owned();
    let mut over_time =
        "pair,kind,capacity,prior,iterations,after,mean_sigmas,covariance_relative\n".to_owned();
    let mut text = format!(
        "[PAR]: smoothers of two parametrisations side by side, {} runs of seed {}\n\
         largest difference of the newest state in standard deviations of the first smoother; \
         inf where one of the two diverges\n",
        options.runs, options.seed
    );
    for (i, row) in rows.iter().enumerate() {
        if i == 0 || rows[i - 1].pair != row.pair {
            _ = writeln!(
                text,
                "\n{:50}{:>12}{:>14}{:>14}",
                row.pair.name(),
                "means",
                "median run",
                "covariances"
            );
        }
        let (Apart { mean, covariance }, median) = (row.most, row.median_mean);
        _ = writeln!(
            text,
            "{:50}{mean:>12.1e}{median:>14.1e}{covariance:>14.1e}",
            row.scheme.name()
        );
        let pair = row.pair.name().replace(", ", "-");
        let columns = row.scheme.columns();
        _ = writeln!(csv, "{pair},{columns},{mean:?},{median:?},{covariance:?}");
        for (k, Apart { mean, covariance }) in row.over_time.iter().enumerate() {
            let after = k + 1;
            _ = writeln!(
                over_time,
                "{pair},{columns},{after},{mean:?},{covariance:?}"
            );
        }
    }
    write(out, "marginalisation.csv", &csv)?;
    write(out, "over_time.csv", &over_time)?;
    write(out, "over_time.svg", &figure(options, &rows)?)?;
    Ok(text)
}

/// Left against right over time, one panel for each size of the window.
fn figure(options: &Options, rows: &[Row]) -> anyhow::Result<String> {
    let find = |capacity: Option<usize>, prior: Prior| {
        let wanted = Scheme::Window {
            capacity,
            prior,
            passes: PASSES[1],
        };
        rows.iter()
            .find(|row| row.pair == Pair::LeftRight && row.scheme == wanted)
    };
    let series = |name: String, colour: RGBColor, row: Option<&Row>| {
        let points = row?.over_time.iter().enumerate();
        Some(Series {
            name,
            colour: colour.to_rgba(),
            mark: Mark::Line(2),
            points: points
                .map(|(k, apart)| ((k + 1) as f64, apart.mean))
                .collect(),
        })
    };
    let panel = |capacity: usize| {
        let nothing_leaves = series(
            "nothing leaves".to_owned(),
            palette::TRUTH,
            find(None, Prior::Group),
        );
        let of_priors = options
            .priors()
            .zip(palette::SERIES)
            .filter_map(|(prior, colour)| {
                let name = format!("{} prior", prior.name());
                series(name, colour, find(Some(capacity), prior))
            });
        Panel {
            name: format!("Window of {capacity} (sigmas)"),
            scale: Scale::Logarithmic,
            series: nothing_leaves.into_iter().chain(of_priors).collect(),
        }
    };
    let title = format!(
        "Left against right, largest difference of {} runs",
        options.runs
    );
    figures::panels(&title, "Time (s)", &CAPACITIES.map(panel))
}
