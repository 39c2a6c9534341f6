//! \[LC\] section VII by Monte Carlo: root mean square errors of every filter in position (m) and heading.
//!
//! `rmse.csv` has the RMSE over the runs at the end of each step; `summary.csv` the RMSE over the second half of the
//! runs, where the start is forgotten, and over all of them. With e_i the mean square error of run i, the RMSE is
//! `sqrt(mean e)`; its standard error is that of the mean of e, carried through the root:
//! `sd(e) / (2 sqrt(n) RMSE)`. Two filters are compared run by run, since they see the same noise. The paper's filters
//! come first; below them the same unknowns as soft constraints, considered, learned, and with the adaptive bank.

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use inekf::lie::{LieGroup, SE2};
use inekf_client::plot::palette;
use plotters::style::{Color, RGBColor};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::figures::{self, Mark, Panel, Scale, Series};
use super::filters::Filter;
use super::section7::Run;
use super::{Options, progress, write};

/// Runs that are held in memory at a time.
const CHUNK: u64 = 256;
/// A difference counts beyond this many of its standard errors.
const SIGNIFICANT: f64 = 2.0;

/// Square errors of position, m^2, and heading, rad^2.
type Squares = [f64; 2];

/// The errors of one filter over all runs.
struct Errors {
    filter: Filter,
    /// Sum over the runs, for each step.
    over_time: Vec<Squares>,
    /// Mean over the second half, and over all steps, of each run.
    of_run: Vec<[Squares; 2]>,
}

/// A mean, or a root mean square, and its standard error.
#[derive(Clone, Copy)]
struct Figure {
    value: f64,
    error: f64,
}

impl Errors {
    fn of(filter: Filter, steps: usize) -> Self {
        Self {
            filter,
            over_time: vec![[0.0; 2]; steps],
            of_run: Vec::new(),
        }
    }

    fn add(&mut self, squares: &[Squares]) {
        for (sum, square) in self.over_time.iter_mut().zip(squares) {
            *sum = [sum[0] + square[0], sum[1] + square[1]];
        }
        let second_half = &squares[squares.len() / 2..];
        self.of_run.push([mean(second_half), mean(squares)]);
    }

    /// RMSE after each step, of position (0) or heading (1).
    fn rmse(&self, quantity: usize) -> impl Iterator<Item = f64> {
        let runs = self.of_run.len() as f64;
        self.over_time
            .iter()
            .map(move |sum| (sum[quantity] / runs).sqrt())
    }

    /// RMSE over the second half (0) or all steps (1), of position (0) or heading (1).
    fn summary(&self, part: usize, quantity: usize) -> Figure {
        let squares = self.of_run.iter().map(|run| run[part][quantity]);
        let Figure { value, error } = mean_with_error(squares);
        let rmse = value.sqrt();
        Figure {
            value: rmse,
            error: error / (2.0 * rmse),
        }
    }
}

fn mean(squares: &[Squares]) -> Squares {
    let count = squares.len() as f64;
    [0, 1].map(|i| squares.iter().map(|square| square[i]).sum::<f64>() / count)
}

/// The mean of `values` and its standard error; that of one value is not a number.
fn mean_with_error(values: impl Iterator<Item = f64> + Clone) -> Figure {
    let count = values.clone().count() as f64;
    let value = values.clone().sum::<f64>() / count;
    let variance = values.map(|x| (x - value) * (x - value)).sum::<f64>() / (count - 1.0);
    Figure {
        value,
        error: (variance / count).sqrt(),
    }
}

/// Square errors after each step.
fn square_errors(run: &Run, estimates: &[SE2]) -> Vec<Squares> {
    let square = |(estimate, truth): (&SE2, &SE2)| {
        let turn = (estimate.rotation.inverse() * truth.rotation).angle_rad();
        let off_m = (estimate.position - truth.position).norm_squared();
        [off_m, turn * turn]
    };
    estimates.iter().zip(&run.truth).map(square).collect()
}

/// The `filters` on one run.
fn one_run(options: &Options, filters: &[Filter], index: u64) -> anyhow::Result<Vec<Vec<Squares>>> {
    let run = Run::draw(&options.setup, options.seed, index);
    let errors = |filter: &Filter| {
        let estimates = filter
            .estimate(&run)
            .with_context(|| format!("{} in run {index}", filter.name()))?;
        Ok(square_errors(&run, &estimates))
    };
    filters.iter().map(errors).collect()
}

/// Runs the experiment; writes two tables and three figures, and returns the summary as text.
///
/// # Errors
/// A filter that fails, with its name and run; a file that cannot be written.
pub fn run(options: &Options, out: &Path) -> anyhow::Result<String> {
    let steps = options.setup.steps();
    let filters: Vec<Filter> = Filter::ALL
        .into_iter()
        .filter(|filter| options.adaptive || *filter != Filter::Adaptive)
        .collect();
    let mut all: Vec<Errors> = filters
        .iter()
        .map(|filter| Errors::of(*filter, steps))
        .collect();
    let bar = progress("filters", options.runs);
    for first in (0..options.runs).step_by(CHUNK as usize) {
        let indices = first..options.runs.min(first + CHUNK);
        // In the order of the runs, so that sums round alike on any number of processors.
        let chunk: Vec<_> = indices
            .into_par_iter()
            .map(|index| one_run(options, &filters, index).inspect(|_| bar.inc(1)))
            .collect::<anyhow::Result<_>>()?;
        for run in chunk {
            for (errors, squares) in all.iter_mut().zip(&run) {
                errors.add(squares);
            }
        }
    }
    bar.finish_and_clear();

    write(out, "rmse.csv", &rmse_csv(options, &all))?;
    write(out, "summary.csv", &summary_csv(&all))?;
    write(out, "figure1.svg", &figure_1(options)?)?;
    write(out, "figure2.svg", &figure_2(options, &all)?)?;
    write(out, "figure3.svg", &figure_3(options, &all)?)?;
    Ok(table(options, &all))
}

/// End of step `k`, s.
fn time_s(options: &Options, k: usize) -> f64 {
    (k + 1) as f64 * options.setup.dt_s
}

fn rmse_csv(options: &Options, all: &[Errors]) -> String {
    let mut csv = "t".to_owned();
    for errors in all {
        let key = errors.filter.key();
        _ = write!(csv, ",{key}_position_m,{key}_heading_rad");
    }
    csv.push('\n');
    let columns: Vec<Vec<f64>> = all
        .iter()
        .flat_map(|errors| [0, 1].map(|quantity| errors.rmse(quantity).collect()))
        .collect();
    for k in 0..options.setup.steps() {
        _ = write!(csv, "{:?}", time_s(options, k));
        for column in &columns {
            _ = write!(csv, ",{:?}", column[k]);
        }
        csv.push('\n');
    }
    csv
}

fn summary_csv(all: &[Errors]) -> String {
    let mut csv = "filter".to_owned();
    for quantity in ["position_m", "heading_rad"] {
        for part in ["second_half", "full"] {
            _ = write!(csv, ",{part}_{quantity},{part}_{quantity}_standard_error");
        }
    }
    csv.push('\n');
    for errors in all {
        csv.push_str(&errors.filter.key());
        for quantity in [0, 1] {
            for part in [0, 1] {
                let Figure { value, error } = errors.summary(part, quantity);
                _ = write!(csv, ",{value:?},{error:?}");
            }
        }
        csv.push('\n');
    }
    csv
}

fn table(options: &Options, all: &[Errors]) -> String {
    let Options {
        runs, seed, setup, ..
    } = options;
    let mut text = format!(
        "[LC] section VII: {runs} runs of seed {seed}, steps of {} s, mismatch {:?}\n\
         RMSE and its standard error over the runs\n\n\
         {:22}{:^32}{:^32}\n{:22}{:>20}{:>12}{:>20}{:>12}\n",
        setup.dt_s,
        setup.law,
        "",
        "position (m)",
        "heading (deg)",
        "filter",
        "second half",
        "full run",
        "second half",
        "full run",
    );
    for errors in all {
        _ = write!(text, "{:22}", errors.filter.name());
        for (quantity, unit, digits) in [(0, 1.0, 3), (1, 1_f64.to_degrees(), 4)] {
            let half = errors.summary(0, quantity);
            let full = errors.summary(1, quantity);
            let (value, error) = (half.value * unit, half.error * unit);
            let half = format!("{value:.digits$} +- {error:.digits$}");
            _ = write!(text, "{half:>20}{:>12.digits$}", full.value * unit);
        }
        text.push('\n');
    }
    text.push('\n');
    for (quantity, name) in [(0, "position"), (1, "heading")] {
        text.push_str(&verdict(all, quantity, name));
    }
    text
}

/// Whether the LC-InEKF beats the LC-EKF, as the paper says: mean square errors of the second half, run by run.
fn verdict(all: &[Errors], quantity: usize, name: &str) -> String {
    let of = |filter| all.iter().find(|errors| errors.filter == filter);
    let (Some(invariant), Some(plain)) = (of(Filter::LcInekf), of(Filter::LcEkf)) else {
        return String::new();
    };
    let pairs = invariant.of_run.iter().zip(&plain.of_run);
    let difference = mean_with_error(pairs.map(|(a, b)| a[0][quantity] - b[0][quantity]));
    let times = difference.value / difference.error;
    let [a, b] = [invariant, plain].map(|errors| errors.summary(0, quantity).value);
    let finding = if !times.is_finite() {
        "cannot be told from these runs"
    } else if times < -SIGNIFICANT {
        "reproduces"
    } else if times > SIGNIFICANT {
        "does not reproduce, the LC-EKF is better"
    } else {
        "does not reproduce, the difference is within the noise"
    };
    format!(
        "\"LC-InEKF beats LC-EKF\" in {name}: {finding} (RMSE {:.2} % {}, {times:+.1} standard errors)\n",
        100.0 * (a / b - 1.0).abs(),
        if a < b { "lower" } else { "higher" },
    )
}

/// One run from above: truth, what the two sources say, and two filters.
fn figure_1(options: &Options) -> anyhow::Result<String> {
    let run = Run::draw(&options.setup, options.seed, 0);
    let point = |chi: &SE2| (chi.position.x, chi.position.y);
    let mut series = Vec::new();
    for (source, colour) in [palette::FIX, palette::SERIES[3]].into_iter().enumerate() {
        let fixes = run.pairs.iter().map(|pair| pair.fixes[source].position_w);
        series.push(Series {
            name: ["source 0 (turned)", "source 1 (scaled)"][source].to_owned(),
            colour: colour.mix(0.35),
            mark: Mark::Dots,
            points: fixes.map(|fix| (fix.x, fix.y)).collect(),
        });
    }
    series.push(Series {
        name: "truth".to_owned(),
        colour: palette::TRUTH.to_rgba(),
        mark: Mark::Line(5),
        points: run.truth.iter().map(point).collect(),
    });
    let filters = [
        (Filter::HInfinity, palette::SERIES[2]),
        (Filter::LcInekf, palette::ESTIMATE),
    ];
    for (filter, colour) in filters {
        series.push(Series {
            name: filter.name(),
            colour: colour.to_rgba(),
            mark: Mark::Line(2),
            points: filter.estimate(&run)?.iter().map(point).collect(),
        });
    }
    figures::from_above("One run: truth, sources and estimates", &series)
}

/// RMSE over time of the paper's four filters and one augmented.
fn figure_2(options: &Options, all: &[Errors]) -> anyhow::Result<String> {
    // The LC-EKF is wider, to be seen beneath the LC-InEKF.
    let shown = [
        (Filter::InekfLeft, palette::FIX, 2),
        (Filter::HInfinity, palette::SERIES[2], 2),
        (Filter::LcEkf, palette::SERIES[3], 5),
        (Filter::LcInekf, palette::ESTIMATE, 2),
        (Filter::Augmented { walk: 0.03 }, palette::SERIES[4], 2),
    ];
    rmse_figure("RMSE", options, all, &shown)
}

/// RMSE over time of what the paper does not have, beside its own filter.
fn figure_3(options: &Options, all: &[Errors]) -> anyhow::Result<String> {
    let shown = [
        (Filter::LcInekf, palette::ESTIMATE, 2),
        (Filter::Soft, palette::SERIES[2], 2),
        (Filter::Considered, palette::SERIES[3], 5),
        (Filter::Augmented { walk: 0.0 }, palette::SERIES[4], 2),
        (Filter::Adaptive, palette::FIX, 2),
    ];
    rmse_figure("Beyond the paper: RMSE", options, all, &shown)
}

/// RMSE in heading and position over time of the filters in `shown`, each with its colour and width, that were run.
fn rmse_figure(
    title: &str,
    options: &Options,
    all: &[Errors],
    shown: &[(Filter, RGBColor, u32)],
) -> anyhow::Result<String> {
    let panel = |name: &str, quantity: usize, unit: f64| {
        let one = |(filter, colour, width): &(Filter, RGBColor, u32)| {
            let errors = all.iter().find(|errors| errors.filter == *filter)?;
            let rmse = errors.rmse(quantity).enumerate();
            Some(Series {
                name: filter.name(),
                colour: colour.to_rgba(),
                mark: Mark::Line(*width),
                points: rmse
                    .map(|(k, value)| (time_s(options, k), value * unit))
                    .collect(),
            })
        };
        Panel {
            name: name.to_owned(),
            scale: Scale::FromZero,
            series: shown.iter().filter_map(one).collect(),
        }
    };
    let panels = [
        panel("Heading RMSE (deg)", 1, 1_f64.to_degrees()),
        panel("Position RMSE (m)", 0, 1.0),
    ];
    let title = format!("{title} over {} runs", options.runs);
    figures::panels(&title, "Time (s)", &panels)
}
