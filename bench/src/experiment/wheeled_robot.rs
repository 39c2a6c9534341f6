//! \[IS\] section II and figure 2: a robot drives straight on from a known place with a heading that is 135 deg wrong,
//! by odometry that is trusted. Invariant and conventional smoothing of the whole drive, Gauss-Newton step by step.
//!
//! SE(2), tangent order `(theta, x, y)`, rad and m, left-invariant. 7 m/s for 10 s in steps of 0.1 s, a fix at the end of
//! each second, prior `diag((3 pi / 4)^2, 0, 0)`. The truth is the x axis and the odometry is right; what a variant
//! changes is the noise of the fixes, and the noise that the smoothers expect of the odometry.
//!
//! Theorem 1: with Q = 0, every iterate of invariant smoothing is a drive that the odometry allows, 70 m long. The
//! conventional smoother's is not: a step along the tangent of the circle, `70 sqrt(1 + dtheta^2)` m.

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use clap::ValueEnum;
use inekf::filter::{Additive, Belief, Covariance, Left, Side};
use inekf::lie::{SE2, SO2};
use inekf::model::{OdometryStep, PlanarFix, PointFix};
use inekf::smoother::{Batch, BatchOptions, Chain, Jacobians, Motion, SmootherError};
use inekf_client::plot::palette;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use plotters::style::{Color, RGBColor};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::figures::{self, Mark, Panel, Scale, Series};
use super::section7::{normal, stream};
use super::{Options, progress, write};

/// Gauss-Newton steps that are shown.
pub const ITERATIONS: usize = 8;
/// Length of the way, m.
pub const LENGTH_M: f64 = 70.0;
const STEPS: usize = 100;
const DT_S: f64 = 0.1;
const STEPS_PER_FIX: usize = 10;
/// Heading of the prior, and its standard deviation, rad.
const WRONG_BY_RAD: f64 = 0.75 * std::f64::consts::PI;
const SIGMA_FIX_M: f64 = 1.0;
/// Variance that [`Variant::NoisyOdometry`] expects in each component of each step, rad^2 and m^2.
const ODOMETRY_VARIANCE: f64 = 1e-4;
/// Gauss-Newton as it comes.
const PLAIN: BatchOptions = BatchOptions {
    iterations: 1,
    tolerance: 0.0,
    jacobians: Jacobians::Exact,
    step_control: false,
};

/// What is noisy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Variant {
    /// The fixes: the paper's.
    NoisyFixes,
    /// Nothing.
    ExactFixes,
    /// The fixes, and the smoothers take the odometry for noisy too.
    NoisyOdometry,
}

impl Variant {
    /// All variants, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::NoisyFixes, Self::ExactFixes, Self::NoisyOdometry];

    /// Its name in CSV files and names of files.
    pub fn key(self) -> &'static str {
        match self {
            Self::NoisyFixes => "noisy_fixes",
            Self::ExactFixes => "exact_fixes",
            Self::NoisyOdometry => "noisy_odometry",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::NoisyFixes => "noisy fixes, odometry trusted",
            Self::ExactFixes => "exact fixes, odometry trusted",
            Self::NoisyOdometry => "noisy fixes, odometry not trusted",
        }
    }
}

/// The smoothers' names in tables and CSV files.
pub const SMOOTHERS: [&str; 2] = ["IS", "conventional"];

/// One iterate.
#[derive(Clone, Debug)]
pub struct Iterate {
    /// The trajectory.
    pub states: Vec<SE2>,
    /// Its length, m.
    pub length_m: f64,
    /// The first heading less the true one, rad.
    pub heading_rad: f64,
    /// The largest distance between a state and where the odometry leads from the one before, m.
    pub departure_m: f64,
}

type Drive = Chain<SE2, Left, OdometryStep<SE2>, PlanarFix, 3>;

fn drive(variant: Variant, seed: u64, index: u64) -> Drive {
    let mut rng = stream(seed, index);
    let prior = Belief::new(
        SE2 {
            rotation: SO2::from_angle(-WRONG_BY_RAD),
            position: Vector2::zeros(),
        },
        Covariance::from_variances(&Vector3::new(WRONG_BY_RAD * WRONG_BY_RAD, 0.0, 0.0)),
    );
    let step_m = LENGTH_M / STEPS as f64;
    let step = OdometryStep::new(&Vector3::new(0.0, step_m, 0.0), DT_S);
    let q = match variant {
        Variant::NoisyOdometry => Matrix3::from_diagonal_element(ODOMETRY_VARIANCE),
        Variant::NoisyFixes | Variant::ExactFixes => Matrix3::zeros(),
    };
    let mut chain = Chain::with_capacity(prior, STEPS + 1, STEPS / STEPS_PER_FIX);
    for k in 1..=STEPS {
        chain.advance(step, q);
        if k % STEPS_PER_FIX == 0 {
            let noise = SIGMA_FIX_M * normal::<2, 1>(&mut rng);
            let off = match variant {
                Variant::ExactFixes => Vector2::zeros(),
                Variant::NoisyFixes | Variant::NoisyOdometry => noise,
            };
            chain.observe(PlanarFix::new([PointFix {
                position_w: Vector2::new(k as f64 * step_m, 0.0) + off,
                covariance_w: Matrix2::identity() * (SIGMA_FIX_M * SIGMA_FIX_M),
                lever_arm_b: Vector2::zeros(),
                scale_error: 0.0,
            }]));
        }
    }
    chain
}

fn iterates<S: Side>(chain: &Drive) -> Result<Vec<Iterate>, SmootherError> {
    let mut batch = Batch::<SE2, S, 3, 2>::with_capacity(STEPS + 1, STEPS / STEPS_PER_FIX);
    batch.dead_reckon(chain);
    let mut iterates = vec![judged(chain, batch.states())];
    for _ in 0..ITERATIONS {
        batch.iterate(chain, &PLAIN)?;
        iterates.push(judged(chain, batch.states()));
    }
    Ok(iterates)
}

fn judged(chain: &Drive, states: &[SE2]) -> Iterate {
    let pairs = || states.windows(2);
    let departures = pairs().zip(chain.links()).map(|(pair, link)| {
        let expected: SE2 = Motion::apply(&link.motion, &pair[0]);
        (expected.position - pair[1].position).norm()
    });
    Iterate {
        states: states.to_vec(),
        length_m: pairs()
            .map(|pair| (pair[1].position - pair[0].position).norm())
            .sum(),
        heading_rad: states[0].rotation.angle_rad(),
        departure_m: departures.fold(0.0, f64::max),
    }
}

/// Every iterate of both [`SMOOTHERS`] on run `index` of `seed`, the first one by dead reckoning.
///
/// # Errors
/// A smoother that fails.
pub fn smooth(variant: Variant, seed: u64, index: u64) -> Result<[Vec<Iterate>; 2], SmootherError> {
    let chain = drive(variant, seed, index);
    Ok([iterates::<Left>(&chain)?, iterates::<Additive>(&chain)?])
}

/// One iteration of one smoother over all runs.
struct Row {
    variant: Variant,
    smoother: usize,
    iteration: usize,
    /// Mean, least and greatest length, m.
    length_m: [f64; 3],
    heading_rmse_rad: f64,
    /// The largest of all runs, m.
    departure_m: f64,
}

impl Row {
    fn of<'a>(
        (variant, smoother, iteration): (Variant, usize, usize),
        runs: impl Iterator<Item = &'a Iterate> + Clone,
    ) -> Self {
        let count = runs.clone().count() as f64;
        let lengths = || runs.clone().map(|iterate| iterate.length_m);
        let squares = runs.clone().map(|iterate| iterate.heading_rad.powi(2));
        Self {
            variant,
            smoother,
            iteration,
            length_m: [
                lengths().sum::<f64>() / count,
                lengths().fold(f64::INFINITY, f64::min),
                lengths().fold(0.0, f64::max),
            ],
            heading_rmse_rad: (squares.sum::<f64>() / count).sqrt(),
            departure_m: runs.fold(0.0, |most, iterate| most.max(iterate.departure_m)),
        }
    }
}

/// Runs the experiment; writes two tables and seven figures, and returns the lengths as text.
///
/// # Errors
/// A smoother that fails, with its run; a file that cannot be written.
pub fn run(options: &Options, out: &Path) -> anyhow::Result<String> {
    let mut rows = Vec::new();
    let mut states_csv = "variant,smoother,iteration,state,theta_rad,x_m,y_m\n".to_owned();
    let bar = progress("drives", 3 * options.runs);
    for variant in Variant::ALL {
        let one = |index| {
            smooth(variant, options.seed, index)
                .inspect(|_| bar.inc(1))
                .with_context(|| format!("{} in run {index}", variant.name()))
        };
        let runs: Vec<_> = (0..options.runs)
            .into_par_iter()
            .map(one)
            .collect::<anyhow::Result<_>>()?;
        for (smoother, name) in SMOOTHERS.into_iter().enumerate() {
            for iteration in 0..=ITERATIONS {
                let of_runs = runs.iter().map(|run| &run[smoother][iteration]);
                rows.push(Row::of((variant, smoother, iteration), of_runs));
                write_states(
                    &mut states_csv,
                    variant,
                    name,
                    iteration,
                    &runs[0][smoother],
                );
            }
            let file = format!("trajectories_{}_{name}.svg", variant.key());
            write(
                out,
                &file,
                &trajectories(variant, name, &runs[0][smoother])?,
            )?;
        }
    }
    bar.finish_and_clear();
    write(out, "iterations.csv", &iterations_csv(&rows))?;
    write(out, "trajectories.csv", &states_csv)?;
    write(out, "lengths.svg", &lengths(&rows)?)?;
    Ok(table(options, &rows))
}

fn write_states(
    csv: &mut String,
    variant: Variant,
    smoother: &str,
    iteration: usize,
    iterates: &[Iterate],
) {
    for (i, chi) in iterates[iteration].states.iter().enumerate() {
        let (theta, x, y) = (chi.rotation.angle_rad(), chi.position.x, chi.position.y);
        let key = variant.key();
        _ = writeln!(
            csv,
            "{key},{smoother},{iteration},{i},{theta:?},{x:?},{y:?}"
        );
    }
}

fn iterations_csv(rows: &[Row]) -> String {
    let mut csv = "variant,smoother,iteration,length_mean_m,length_least_m,length_greatest_m,\
                   heading_rmse_rad,departure_m\n"
        .to_owned();
    for row in rows {
        let [mean, least, greatest] = row.length_m;
        _ = writeln!(
            csv,
            "{},{},{},{mean:?},{least:?},{greatest:?},{:?},{:?}",
            row.variant.key(),
            SMOOTHERS[row.smoother],
            row.iteration,
            row.heading_rmse_rad,
            row.departure_m
        );
    }
    csv
}

fn table(options: &Options, rows: &[Row]) -> String {
    let mut text = format!(
        "[IS] section II: {} runs of seed {}, a way of {LENGTH_M} m\n\
         length of each Gauss-Newton iterate (mean over the runs, in brackets the least and greatest), RMSE of the \
         heading,\nand the largest distance between a state and where the odometry leads to\n",
        options.runs, options.seed
    );
    for variant in Variant::ALL {
        _ = writeln!(text, "\n{}", variant.name());
        _ = write!(text, "{:9}", "iterate");
        for name in SMOOTHERS {
            _ = write!(
                text,
                "{:>32}{:>9}{:>10}",
                format!("{name}: length (m)"),
                "deg",
                "off (m)"
            );
        }
        for iteration in 0..=ITERATIONS {
            _ = write!(text, "\n{iteration:<9}");
            let both = rows
                .iter()
                .filter(|row| row.variant == variant && row.iteration == iteration);
            for row in both {
                let [mean, least, greatest] = row.length_m;
                let length = format!("{mean:.3} [{least:.3}, {greatest:.3}]");
                let heading = row.heading_rmse_rad.to_degrees();
                _ = write!(text, "{length:>32}{heading:>9.3}{:>10.0e}", row.departure_m);
            }
        }
        text.push('\n');
    }
    text
}

/// The top of the paper's figure 2, for each variant.
fn lengths(rows: &[Row]) -> anyhow::Result<String> {
    let colours = [palette::ESTIMATE, palette::FIX];
    let panel = |variant: Variant| {
        let series = |(smoother, colour): (usize, RGBColor)| Series {
            name: format!("{}, mean length", SMOOTHERS[smoother]),
            colour: colour.to_rgba(),
            mark: Mark::Line(2),
            points: rows
                .iter()
                .filter(|row| row.variant == variant && row.smoother == smoother)
                .map(|row| (row.iteration as f64, row.length_m[0]))
                .collect(),
        };
        Panel {
            name: format!("m: {}", variant.name()),
            scale: Scale::FromZero,
            series: colours.into_iter().enumerate().map(series).collect(),
        }
    };
    figures::panels(
        "Length of each iterate",
        "Gauss-Newton iteration",
        &Variant::ALL.map(panel),
    )
}

/// The bottom of the paper's figure 2: the first iterates, and the last one, from above.
fn trajectories(variant: Variant, smoother: &str, iterates: &[Iterate]) -> anyhow::Result<String> {
    let truth = Series {
        name: "truth".to_owned(),
        colour: palette::TRUTH.to_rgba(),
        mark: Mark::Line(6),
        points: vec![(0.0, 0.0), (LENGTH_M, 0.0)],
    };
    let shown = [0, 1, 2, 3, ITERATIONS];
    let iterate = |(iteration, colour): (usize, RGBColor)| Series {
        name: match iteration {
            0 => "odometry".to_owned(),
            _ => format!("iterate {iteration}"),
        },
        colour: colour.to_rgba(),
        mark: Mark::Line(2),
        points: iterates[iteration]
            .states
            .iter()
            .map(|chi| (chi.position.x, chi.position.y))
            .collect(),
    };
    let series: Vec<Series> = std::iter::once(truth)
        .chain(shown.into_iter().zip(palette::SERIES).map(iterate))
        .collect();
    figures::from_above(&format!("{smoother}: {}", variant.name()), &series)
}
