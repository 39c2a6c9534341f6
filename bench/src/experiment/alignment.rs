//! \[IS\] section V and figure 3 by Monte Carlo: the heading of a vehicle that knows nothing of it, from sliding windows
//! of 10 and 50 states under three parametrisations, one Gauss-Newton iteration for each fix, with filters beside them.
//!
//! The simulation is [`take_off`](super::take_off). In a window of 50 all 41 states of the run stay, so that the form
//! of the marginalised prior matters in the window of 10 only. Errors of heading in degrees; its variance is that of the
//! vertical component of the world-frame rotation error, `(R P_rr R^T)_zz`. At each second, over the runs: RMSE, the mean
//! of 3 sigma (the paper's envelope), the share of runs within their own 3 sigma, and the mean NEES. The first error
//! is the same in all runs, so that NEES and shares mean something only from the vehicle's departure on.
//!
//! An estimator may diverge until it can no longer be computed. Such a run is lost from there on: it is counted, it is
//! not within 3 sigma, and RMSE, envelope and NEES are those of the other runs.

use std::fmt::Write;
use std::path::Path;

use inekf::filter::{Belief, Forster, Gtsam, Left, Side, UpdateOptions, update};
use inekf::lie::SE23;
use inekf::smoother::{Jacobians, PriorForm, Window, WindowOptions};
use inekf_client::plot::palette;
use plotters::style::{Color, RGBColor};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::figures::{self, Mark, Panel, Scale, Series};
use super::take_off::{FIXES, HEADING_RAD, TakeOff, first};
use super::{Options, Prior, progress, write};

/// Seconds at which the summary looks.
const INSTANTS_S: [usize; 4] = [18, 20, 30, 40];
/// The seconds after departure, when the heading can be seen.
const MOVING_S: std::ops::RangeInclusive<usize> = 17..=FIXES;
/// Iterations for each fix of [`Estimator::Iterated`].
const ITERATIONS: usize = 5;
/// What is expected of IS at 40 s, deg, for windows of 10 and 50.
const EXPECTED_DEG: [(usize, f64); 2] = [(10, 2.1), (50, 2.0)];

/// How a window moves its states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parametrisation {
    /// The exponential of the group: invariant smoothing.
    Exponential,
    /// \[IS\] (23).
    Gtsam,
    /// \[IS\] (22).
    Forster,
}

impl Parametrisation {
    const ALL: [Self; 3] = [Self::Exponential, Self::Gtsam, Self::Forster];

    fn name(self) -> &'static str {
        match self {
            Self::Exponential => "IS",
            Self::Gtsam => "GTSAM",
            Self::Forster => "Forster",
        }
    }
}

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// A sliding window with exact Jacobians.
    Window {
        /// How it moves its states.
        parametrisation: Parametrisation,
        /// The most states that it holds.
        capacity: usize,
        /// The form of the priors that marginalisation leaves.
        prior: Prior,
    },
    /// IS in a window of 10 with all covariances frozen: the library's default.
    ConstantGains,
    /// IS with several iterations for each fix.
    Iterated {
        /// The most states that the window holds.
        capacity: usize,
    },
    /// Left-invariant filter, plain.
    Filter,
    /// Left-invariant filter, iterated, with transport of the covariance.
    IteratedFilter,
}

impl Estimator {
    /// Everything that `options` ask for, in the order of the tables.
    pub fn all(options: &Options) -> Vec<Self> {
        let windows = |capacity, prior| {
            Parametrisation::ALL.map(|parametrisation| Self::Window {
                parametrisation,
                capacity,
                prior,
            })
        };
        let mut all: Vec<_> = options
            .priors()
            .flat_map(|prior| windows(10, prior))
            .collect();
        all.extend(windows(50, Prior::Group));
        all.extend([10, 50].map(|capacity| Self::Iterated { capacity }));
        all.extend([Self::ConstantGains, Self::Filter, Self::IteratedFilter]);
        all
    }

    /// Its name in tables.
    pub fn name(&self) -> String {
        match self {
            Self::Window {
                parametrisation,
                capacity: 10,
                prior,
            } => format!("{}, window 10, {}", parametrisation.name(), prior.name()),
            Self::Window {
                parametrisation,
                capacity,
                ..
            } => format!("{}, window {capacity}", parametrisation.name()),
            Self::Iterated { capacity } => {
                format!("IS, window {capacity}, {ITERATIONS} iterations")
            }
            Self::ConstantGains => "IS, window 10, constant gains".to_owned(),
            Self::Filter => "InEKF, left".to_owned(),
            Self::IteratedFilter => "InEKF, iterated, transport".to_owned(),
        }
    }

    /// Its name in CSV files: letters, digits and underscores.
    fn key(&self) -> String {
        let words = self.name().to_lowercase();
        words.replace(", ", "_").replace(' ', "_")
    }

    /// The heading after each fix of `run`, until it is lost.
    fn estimate(&self, run: &TakeOff) -> Vec<Heading> {
        let exact = |capacity, prior: Prior| WindowOptions {
            first_prior: PriorForm::Recentred,
            prior: prior.form(),
            jacobians: Jacobians::Exact,
            ..WindowOptions::new(capacity)
        };
        match *self {
            Self::Window {
                parametrisation,
                capacity,
                prior,
            } => {
                let options = exact(capacity, prior);
                match parametrisation {
                    Parametrisation::Exponential => window::<Left>(run, &options),
                    Parametrisation::Gtsam => window::<Gtsam>(run, &options),
                    Parametrisation::Forster => window::<Forster>(run, &options),
                }
            }
            Self::Iterated { capacity } => {
                let options = WindowOptions {
                    iterations: ITERATIONS,
                    ..exact(capacity, Prior::Group)
                };
                window::<Left>(run, &options)
            }
            Self::ConstantGains => window::<Left>(run, &WindowOptions::new(10)),
            Self::Filter => filter(run, &UpdateOptions::PLAIN),
            Self::IteratedFilter => filter(run, &UpdateOptions::ITERATED),
        }
    }
}

/// An estimated heading.
#[derive(Clone, Copy, Debug)]
struct Heading {
    error_deg: f64,
    sigma_deg: f64,
}

impl Heading {
    fn of(belief: &Belief<SE23, Left, 9>) -> Self {
        let turn = belief.mean.rotation.heading_rad() - HEADING_RAD;
        // The vertical in body axes: what a rotation error of the body does to the heading.
        let up_b = belief.mean.rotation.matrix().row(2).transpose();
        let of_rotation = belief.covariance.matrix().fixed_view::<3, 3>(0, 0);
        let variance = (up_b.transpose() * of_rotation * up_b)[0];
        Self {
            error_deg: turn.sin().atan2(turn.cos()).to_degrees(),
            sigma_deg: variance.sqrt().to_degrees(),
        }
    }

    fn is_within(&self) -> bool {
        self.error_deg.abs() <= 3.0 * self.sigma_deg
    }

    fn nees(&self) -> f64 {
        (self.error_deg / self.sigma_deg).powi(2)
    }
}

fn window<S: Side>(run: &TakeOff, options: &WindowOptions) -> Vec<Heading> {
    let mut window = Window::<SE23, S, 9>::new(&first(), options);
    let steps = run.motions.iter().zip(&run.fixes);
    steps
        .map_while(|(motion, fix)| {
            window.push(motion);
            window.update(*fix).ok()?;
            Some(Heading::of(&window.newest()))
        })
        .collect()
}

fn filter(run: &TakeOff, options: &UpdateOptions) -> Vec<Heading> {
    let mut belief = first();
    let steps = run.motions.iter().zip(&run.fixes);
    steps
        .map_while(|(motion, fix)| {
            belief = motion.carry(&belief);
            update(&mut belief, fix, options).ok()?;
            Some(Heading::of(&belief))
        })
        .collect()
}

/// One estimator over all runs; instants are seconds, from 1.
#[derive(Clone, Debug)]
pub struct Headings {
    /// Which one.
    pub estimator: Estimator,
    of_runs: Vec<Vec<Heading>>,
}

impl Headings {
    /// The runs that are not lost by `t_s`.
    fn at(&self, t_s: usize) -> impl Iterator<Item = Heading> + Clone {
        self.of_runs
            .iter()
            .filter_map(move |run| run.get(t_s - 1).copied())
    }

    fn mean(&self, t_s: usize, of: impl Fn(Heading) -> f64) -> f64 {
        self.at(t_s).map(of).sum::<f64>() / self.at(t_s).count() as f64
    }

    /// How many runs are lost by the end.
    pub fn lost(&self) -> usize {
        self.of_runs.len() - self.at(FIXES).count()
    }

    /// RMSE at `t_s`, deg.
    pub fn rmse_deg(&self, t_s: usize) -> f64 {
        self.mean(t_s, |heading| heading.error_deg.powi(2)).sqrt()
    }

    /// Standard error of the RMSE at `t_s`, deg: that of the mean square, carried through the root.
    pub fn rmse_error_deg(&self, t_s: usize) -> f64 {
        let square = |heading: Heading| heading.error_deg.powi(2);
        let mean = self.mean(t_s, square);
        let variance = self.mean(t_s, |heading| (square(heading) - mean).powi(2));
        let count = self.at(t_s).count() as f64;
        (variance / (count - 1.0)).sqrt() / (2.0 * mean.sqrt())
    }

    /// Mean of 3 sigma at `t_s`, deg.
    pub fn envelope_deg(&self, t_s: usize) -> f64 {
        self.mean(t_s, |heading| 3.0 * heading.sigma_deg)
    }

    /// Share of all runs that are within their own 3 sigma at `t_s`.
    pub fn within(&self, t_s: usize) -> f64 {
        let within = self.at(t_s).filter(Heading::is_within).count();
        within as f64 / self.of_runs.len() as f64
    }

    /// Mean NEES at `t_s`: 1 where the estimator is consistent.
    pub fn nees(&self, t_s: usize) -> f64 {
        self.mean(t_s, |heading| heading.nees())
    }

    /// Share within 3 sigma over all runs and the seconds in motion.
    pub fn within_in_motion(&self) -> f64 {
        let share: f64 = MOVING_S.map(|t_s| self.within(t_s)).sum();
        share / MOVING_S.count() as f64
    }

    /// Seconds in motion at which the RMSE is beyond the mean of 3 sigma.
    pub fn seconds_beyond(&self) -> usize {
        MOVING_S
            .filter(|t_s| self.rmse_deg(*t_s) > self.envelope_deg(*t_s))
            .count()
    }

    /// The largest difference to `other` over the runs at `t_s`, deg; infinite if a run is lost.
    pub fn difference_deg(&self, other: &Self, t_s: usize) -> f64 {
        let at = |run: &Vec<Heading>| run.get(t_s - 1).map(|heading| heading.error_deg);
        let pairs = self.of_runs.iter().zip(&other.of_runs);
        pairs
            .map(|(a, b)| match (at(a), at(b)) {
                (Some(a), Some(b)) => (a - b).abs(),
                _ => f64::INFINITY,
            })
            .fold(0.0, f64::max)
    }
}

/// Every estimator that `options` ask for over `options.runs` runs.
pub fn compare(options: &Options) -> Vec<Headings> {
    let estimators = Estimator::all(options);
    let bar = progress("take-offs", options.runs);
    let one = |index: u64| -> Vec<Vec<Heading>> {
        let run = TakeOff::draw(options.seed, index);
        let of_estimator = |estimator: &Estimator| estimator.estimate(&run);
        let estimates = estimators.iter().map(of_estimator).collect();
        bar.inc(1);
        estimates
    };
    let runs: Vec<_> = (0..options.runs).into_par_iter().map(one).collect();
    bar.finish_and_clear();
    let of_estimator = |(i, estimator): (usize, &Estimator)| Headings {
        estimator: *estimator,
        of_runs: runs.iter().map(|run| run[i].clone()).collect(),
    };
    estimators.iter().enumerate().map(of_estimator).collect()
}

/// Runs the experiment; writes two tables and a figure, and returns the summary as text.
///
/// # Errors
/// A file that cannot be written.
pub fn run(options: &Options, out: &Path) -> anyhow::Result<String> {
    let all = compare(options);
    write(out, "heading.csv", &heading_csv(&all))?;
    write(out, "summary.csv", &summary_csv(&all))?;
    write(out, "figure3.svg", &figure_3(options, &all)?)?;
    Ok(table(options, &all))
}

fn heading_csv(all: &[Headings]) -> String {
    let mut csv = "t".to_owned();
    for headings in all {
        let key = headings.estimator.key();
        _ = write!(
            csv,
            ",{key}_rmse_deg,{key}_envelope_deg,{key}_within,{key}_nees"
        );
    }
    csv.push('\n');
    for t_s in 1..=FIXES {
        _ = write!(csv, "{t_s}");
        for headings in all {
            let (rmse, envelope) = (headings.rmse_deg(t_s), headings.envelope_deg(t_s));
            let (within, nees) = (headings.within(t_s), headings.nees(t_s));
            _ = write!(csv, ",{rmse:?},{envelope:?},{within:?},{nees:?}");
        }
        csv.push('\n');
    }
    csv
}

fn summary_csv(all: &[Headings]) -> String {
    let mut csv = "estimator".to_owned();
    for t_s in INSTANTS_S {
        _ = write!(csv, ",rmse_{t_s}s_deg");
    }
    csv.push_str(
        ",envelope_40s_deg,nees_20s,nees_40s,within_in_motion,seconds_beyond_envelope,lost\n",
    );
    for headings in all {
        csv.push_str(&headings.estimator.key());
        for t_s in INSTANTS_S {
            _ = write!(csv, ",{:?}", headings.rmse_deg(t_s));
        }
        _ = writeln!(
            csv,
            ",{:?},{:?},{:?},{:?},{},{}",
            headings.envelope_deg(FIXES),
            headings.nees(20),
            headings.nees(FIXES),
            headings.within_in_motion(),
            headings.seconds_beyond(),
            headings.lost(),
        );
    }
    csv
}

fn table(options: &Options, all: &[Headings]) -> String {
    let mut text = format!(
        "[IS] section V: {} runs of seed {}\n\
         heading: RMSE (deg) at some seconds, mean of 3 sigma and NEES; share of runs within their 3 sigma, and \
         seconds with\nan RMSE beyond the mean of 3 sigma, both from {} s on; runs lost\n\n{:31}",
        options.runs,
        options.seed,
        MOVING_S.start(),
        "estimator"
    );
    for t_s in INSTANTS_S {
        _ = write!(text, "{:>8}", format!("{t_s} s"));
    }
    _ = writeln!(
        text,
        "{:>14}{:>12}{:>12}{:>10}{:>8}{:>6}",
        "3 sigma 40 s", "NEES 20 s", "NEES 40 s", "within", "beyond", "lost"
    );
    for headings in all {
        _ = write!(text, "{:31}", headings.estimator.name());
        for t_s in INSTANTS_S {
            _ = write!(text, "{:>8.2}", headings.rmse_deg(t_s));
        }
        _ = writeln!(
            text,
            "{:>14.2}{:>12}{:>12}{:>8.1} %{:>8}{:>6}",
            headings.envelope_deg(FIXES),
            brief(headings.nees(20)),
            brief(headings.nees(FIXES)),
            100.0 * headings.within_in_motion(),
            headings.seconds_beyond(),
            headings.lost()
        );
    }
    text.push('\n');
    text + &verdicts(all)
}

/// Two decimals, or two digits of what is large.
fn brief(value: f64) -> String {
    if value < 1e3 {
        format!("{value:.2}")
    } else {
        format!("{value:.0e}")
    }
}

/// The window of this kind, if it was run.
fn find(
    all: &[Headings],
    parametrisation: Parametrisation,
    capacity: usize,
    prior: Prior,
) -> Option<&Headings> {
    let wanted = Estimator::Window {
        parametrisation,
        capacity,
        prior,
    };
    all.iter().find(|headings| headings.estimator == wanted)
}

/// What the paper says, held against the figures.
fn verdicts(all: &[Headings]) -> String {
    use Parametrisation::{Exponential, Forster, Gtsam};
    let mut text = String::new();
    for (capacity, most) in EXPECTED_DEG {
        if let Some(headings) = find(all, Exponential, capacity, Prior::Group) {
            let (rmse, error) = (headings.rmse_deg(FIXES), headings.rmse_error_deg(FIXES));
            _ = writeln!(
                text,
                "IS, window {capacity}: RMSE {rmse:.2} +- {error:.2} deg at 40 s, its own sigma {:.2}; at most {most} \
                 expected: {}",
                headings.envelope_deg(FIXES) / 3.0,
                match (rmse <= most, rmse - 2.0 * error <= most) {
                    (true, _) => "holds",
                    (false, true) => "does not hold, within two standard errors",
                    (false, false) => "does not hold",
                }
            );
        }
    }
    let large = |parametrisation| find(all, parametrisation, 50, Prior::Group);
    if let (Some(is), Some(gtsam), Some(forster)) =
        (large(Exponential), large(Gtsam), large(Forster))
    {
        let apart = [gtsam, forster].map(|other| is.difference_deg(other, FIXES));
        let apart = apart[0].max(apart[1]);
        _ = writeln!(
            text,
            "window 50: the parametrisations agree at 40 s (largest difference {apart:.0e} deg): {}",
            if apart < 0.01 {
                "holds"
            } else {
                "does not hold"
            }
        );
    }
    for parametrisation in [Forster, Gtsam, Exponential] {
        if let Some(headings) = find(all, parametrisation, 10, Prior::Linear) {
            _ = writeln!(
                text,
                "{}, window 10, linear prior: NEES {:.2} at 40 s, {:.1} % within 3 sigma in motion, RMSE beyond it \
                 for {} s",
                parametrisation.name(),
                headings.nees(FIXES),
                100.0 * headings.within_in_motion(),
                headings.seconds_beyond()
            );
        }
    }
    text
}

/// A panel for each form of the prior in the window of 10, and one for the window of 50.
fn figure_3(options: &Options, all: &[Headings]) -> anyhow::Result<String> {
    let windows = options.priors().map(|prior| (10, prior));
    let panels: Vec<Panel> = windows
        .chain([(50, Prior::Group)])
        .map(|(capacity, prior)| {
            let name = match capacity {
                10 => format!("deg: window 10, {}", prior.name()),
                _ => format!("deg: window {capacity}"),
            };
            panel(all, name, capacity, prior)
        })
        .collect();
    let title = format!("Heading: RMSE over {} runs", options.runs);
    figures::panels(&title, "Time (s)", &panels)
}

fn panel(all: &[Headings], name: String, capacity: usize, prior: Prior) -> Panel {
    let series = |name: &str, colour: RGBColor, width: u32, of: &dyn Fn(usize) -> f64| Series {
        name: name.to_owned(),
        colour: colour.to_rgba(),
        mark: Mark::Line(width),
        points: (1..=FIXES).map(|t_s| (t_s as f64, of(t_s))).collect(),
    };
    let mut drawn = Vec::new();
    let is = find(all, Parametrisation::Exponential, capacity, prior);
    if let Some(is) = is {
        let envelope = |t_s| is.envelope_deg(t_s);
        drawn.push(series("3 sigma of IS", palette::TRUTH, 5, &envelope));
    }
    let filter = all
        .iter()
        .find(|headings| headings.estimator == Estimator::Filter);
    if let Some(filter) = filter {
        let rmse = |t_s| filter.rmse_deg(t_s);
        drawn.push(series("InEKF, left", palette::SERIES[2], 2, &rmse));
    }
    let colours = [palette::ESTIMATE, palette::FIX, palette::SERIES[3]];
    // IS last, on top where all agree.
    for (parametrisation, colour) in Parametrisation::ALL.into_iter().zip(colours).rev() {
        if let Some(headings) = find(all, parametrisation, capacity, prior) {
            let rmse = |t_s| headings.rmse_deg(t_s);
            drawn.push(series(parametrisation.name(), colour, 2, &rmse));
        }
    }
    Panel {
        name,
        scale: Scale::Logarithmic,
        series: drawn,
    }
}
