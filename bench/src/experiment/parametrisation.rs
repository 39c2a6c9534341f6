//! \[PAR\] in numbers: the left- and the right-invariant filter side by side, on the same data.
//!
//! * Proposition 1: prediction is the same filter in other coordinates, `P_right = Ad P_left Ad^T`.
//! * Proposition 2: an update is not, unless the covariance is carried to the new estimate. The new means still
//!   agree; the covariances do not, and from the next update on neither do the means.
//! * Corollary 1: nor does iterating the update help; what it needs is the same transport.
//!
//! How far apart ([`apart`](super::apart)): in standard deviations of the left filter, the largest over steps and
//! runs. Groups: SE(2) with odometry and two position sources ([`section7`](super::section7) without mismatch), SE_2(3)
//! with an IMU and position fixes on a lever arm ([`imu_drive`](super::imu_drive)).

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use inekf::filter::{
    Belief, Covariance, GainRule, Gate, InertialSide, Kalman, Left, Linearised, Transport,
    UpdateError, UpdateOptions, propagate, propagate_odometry, update_with,
};
use inekf::lie::{LieGroup, SE2, SE23};
use inekf::model::Discretisation;
use nalgebra::SMatrix;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::apart::Apart;
use super::filters::start;
use super::imu_drive::{GRAVITY_W, IMU_DT_S, ImuDrive, NOISE};
use super::section7::{MismatchLaw, Run, Setup, stream};
use super::{Options, progress, write};

/// Passes of the iterated update: a fixed number, since the criterion to stop depends on coordinates.
const PASSES: usize = 4;

/// The Kalman gain, every Gauss-Newton step taken whole, as in the paper.
///
/// The library's own iterated update shortens steps that raise the cost. Where the cost is flat to rounding that is
/// an accident, which left and right do not share: it would leave them 1e-7 standard deviations apart.
pub(super) struct WholeSteps;

impl<G: LieGroup<D>, const D: usize, const M: usize> GainRule<G, D, M> for WholeSteps {
    fn gain(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        Kalman.gain(prior, linearised)
    }
}

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Predictions alone, over the whole run: Proposition 1.
    Prediction,
    /// After the first update: Proposition 2 for one pass, Corollary 1 for several.
    FirstUpdate,
    /// After every update of the run.
    AllUpdates,
}

/// One line of the result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// The group.
    pub group: &'static str,
    /// What is compared.
    pub stage: Stage,
    /// Passes of each update; 0 without any.
    pub passes: usize,
    /// Whether the covariance is carried to the new estimate.
    pub transport: bool,
    /// The largest difference.
    pub apart: Apart,
}

/// What a comparison is, but for the group.
const COMPARISONS: [(Stage, usize, bool); 9] = [
    (Stage::Prediction, 0, false),
    (Stage::FirstUpdate, 1, true),
    (Stage::FirstUpdate, 1, false),
    (Stage::FirstUpdate, PASSES, true),
    (Stage::FirstUpdate, PASSES, false),
    (Stage::AllUpdates, 1, true),
    (Stage::AllUpdates, 1, false),
    (Stage::AllUpdates, PASSES, true),
    (Stage::AllUpdates, PASSES, false),
];

/// Data that a filter of either side can be run on.
trait Drive<G: LieGroup<D>, const D: usize> {
    /// How many updates there are.
    fn updates(&self) -> usize;

    fn start<S: InertialSide>(&self) -> Belief<G, S, D>;

    /// Everything that precedes update `k`.
    fn predict<S: InertialSide>(&self, k: usize, belief: &mut Belief<G, S, D>);

    fn correct<S: InertialSide>(
        &self,
        k: usize,
        belief: &mut Belief<G, S, D>,
        options: &UpdateOptions,
    ) -> Result<(), UpdateError>;
}

/// Both filters over `drive`.
fn side_by_side<G: LieGroup<D>, const D: usize>(
    drive: &impl Drive<G, D>,
    (stage, passes, transport): (Stage, usize, bool),
) -> Result<Apart, UpdateError> {
    let options = UpdateOptions {
        iterations: passes,
        tolerance: 0.0,
        transport: if transport {
            Transport::Jacobian
        } else {
            Transport::None
        },
        gate: Gate::OPEN,
    };
    let mut left = drive.start::<Left>();
    let mut right = left.to_right();
    let updates = match stage {
        Stage::FirstUpdate => 1,
        Stage::Prediction | Stage::AllUpdates => drive.updates(),
    };
    let mut most = Apart::default();
    for k in 0..updates {
        drive.predict(k, &mut left);
        drive.predict(k, &mut right);
        if stage != Stage::Prediction {
            drive.correct(k, &mut left, &options)?;
            drive.correct(k, &mut right, &options)?;
        }
        most = most.or_larger(Apart::between(&left, &right.to_left()));
    }
    Ok(most)
}

impl Drive<SE2, 3> for Run {
    fn updates(&self) -> usize {
        self.steps.len()
    }

    fn start<S: InertialSide>(&self) -> Belief<SE2, S, 3> {
        start(self)
    }

    fn predict<S: InertialSide>(&self, k: usize, belief: &mut Belief<SE2, S, 3>) {
        *belief = propagate_odometry(belief, &self.steps[k], &self.odometry_noise());
    }

    fn correct<S: InertialSide>(
        &self,
        k: usize,
        belief: &mut Belief<SE2, S, 3>,
        options: &UpdateOptions,
    ) -> Result<(), UpdateError> {
        update_with(belief, &self.pairs[k], &WholeSteps, options).map(|_| ())
    }
}

impl Drive<SE23, 9> for ImuDrive {
    fn updates(&self) -> usize {
        self.fixes.len()
    }

    fn start<S: InertialSide>(&self) -> Belief<SE23, S, 9> {
        let first = self.first();
        Belief::from_left_covariance(first.mean, first.covariance)
    }

    fn predict<S: InertialSide>(&self, k: usize, belief: &mut Belief<SE23, S, 9>) {
        for sample in self.samples(k) {
            let zoh = Discretisation::ZeroOrderHold;
            *belief = propagate(belief, sample, &GRAVITY_W, IMU_DT_S, zoh, &NOISE);
        }
    }

    fn correct<S: InertialSide>(
        &self,
        k: usize,
        belief: &mut Belief<SE23, S, 9>,
        options: &UpdateOptions,
    ) -> Result<(), UpdateError> {
        update_with(belief, &self.fixes[k], &WholeSteps, options).map(|_| ())
    }
}

/// Both groups, every comparison, the largest difference over `options.runs` runs.
///
/// # Errors
/// A filter that fails, with its run.
pub fn compare(options: &Options) -> anyhow::Result<Vec<Row>> {
    let bar = progress("left and right", options.runs);
    let setup = Setup {
        law: MismatchLaw::None,
        ..options.setup
    };
    let one = |index: u64| -> anyhow::Result<[Vec<Apart>; 2]> {
        let planar = Run::draw(&setup, options.seed, index);
        let spatial = ImuDrive::draw(&mut stream(options.seed, index));
        let in_plane = COMPARISONS.iter().map(|what| side_by_side(&planar, *what));
        let in_space = COMPARISONS.iter().map(|what| side_by_side(&spatial, *what));
        let context = || format!("run {index}");
        let both = [
            in_plane.collect::<Result<_, _>>().with_context(context)?,
            in_space.collect::<Result<_, _>>().with_context(context)?,
        ];
        bar.inc(1);
        Ok(both)
    };
    let runs: Vec<_> = (0..options.runs)
        .into_par_iter()
        .map(one)
        .collect::<anyhow::Result<_>>()?;
    bar.finish_and_clear();
    let mut rows = Vec::new();
    for (g, group) in ["SE(2)", "SE_2(3)"].into_iter().enumerate() {
        for (c, (stage, passes, transport)) in COMPARISONS.into_iter().enumerate() {
            let of_runs = runs.iter().map(|run| run[g][c]);
            rows.push(Row {
                group,
                stage,
                passes,
                transport,
                apart: of_runs.fold(Apart::default(), Apart::or_larger),
            });
        }
    }
    Ok(rows)
}

/// Runs the experiment; writes `parametrisation.csv` and returns the same as text.
///
/// # Errors
/// A filter that fails, with its run; a file that cannot be written.
pub fn run(options: &Options, out: &Path) -> anyhow::Result<String> {
    let rows = compare(options)?;
    let mut csv = "group,stage,passes,transport,mean_sigmas,covariance_relative\n".to_owned();
    let mut text = format!(
        "[PAR]: left- and right-invariant filter side by side, {} runs of seed {}\n\
         largest difference in standard deviations of the left filter\n\n\
         {:9}{:48}{:>12}{:>12}\n",
        options.runs, options.seed, "group", "after", "means", "covariances"
    );
    for row in &rows {
        let Row {
            group,
            stage,
            passes,
            transport,
            apart: Apart { mean, covariance },
        } = row;
        _ = writeln!(
            csv,
            "{group},{stage:?},{passes},{transport},{mean:?},{covariance:?}"
        );
        let stage = match stage {
            Stage::Prediction => "prediction alone (Prop. 1)".to_owned(),
            Stage::FirstUpdate => format!("first update, {}", manner(*passes, *transport)),
            Stage::AllUpdates => format!("all updates, {}", manner(*passes, *transport)),
        };
        _ = writeln!(text, "{group:9}{stage:48}{mean:>12.1e}{covariance:>12.1e}");
    }
    write(out, "parametrisation.csv", &csv)?;
    Ok(text)
}

/// How an update is done.
fn manner(passes: usize, transport: bool) -> String {
    let passes = match passes {
        1 => "one pass (Prop. 2)".to_owned(),
        more => format!("{more} passes (Cor. 1)"),
    };
    let transport = if transport {
        "transport"
    } else {
        "no transport"
    };
    format!("{passes}, {transport}")
}
