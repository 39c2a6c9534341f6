//! The filters that are compared on [`section7`](super::section7), each as a plain loop over a run.
//!
//! Two position sources are stacked at every step; the adaptive bank takes them one after the other. Only the
//! constrained filters and those with mismatches as states know what kinds of mismatch there may be (odometry scale;
//! scale of source 1; rotation of source 0); none knows a value.

use inekf::filter::{
    Adaptive, Additive, Belief, Consider, Constrained, Covariance, Expected, GainRule, HInfinity,
    HInfinityGain, Kalman, Left, Right, STANDARD_MODES, Side, UpdateError, UpdateOptions,
    propagate_augmented, propagate_odometry, standard_modes, update, update_with,
};
use inekf::lie::SE2;
use inekf::model::{
    Augmented, Declared, OutputMismatch, PlanarFix, PlanarPair, PointFix, ProcessColumns,
    ProcessMismatch, Unknowns,
};
use nalgebra::{SMatrix, SVector, Vector3};

use super::section7::{Run, start_variances};

const PROCESS: [ProcessMismatch; 1] = [ProcessMismatch::OdometryScale];
const OUTPUTS: [OutputMismatch; 2] = [
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    },
];
/// Standard deviations of the mismatches for the filters that are told any, in that order.
const SIGMAS_MISMATCH: [f64; 3] = [0.08, 0.06, 0.03];
/// The same in a burst, for the adaptive bank.
const SIGMAS_BURST: [f64; 3] = [0.25, 0.06, 0.03];
/// \[LC\] VII.
const GAMMA: f64 = 0.02;
/// The H-infinity filter takes bounds: three times the standard deviations, nine times the covariances.
const BOUND: f64 = 9.0;
/// The random walk of the augmented filter is given for a step of this length, s.
const WALK_STEP_S: f64 = 0.1;
/// How long a mismatch that is drawn anew each time lasts, for the adaptive bank, s.
const WHITE_INTERVAL_S: f64 = 0.1;

/// One of the filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// Left-invariant extended Kalman filter.
    InekfLeft,
    /// Right-invariant extended Kalman filter.
    InekfRight,
    /// Left-invariant, iterated to the minimum and with transport of the covariance.
    InekfIterated,
    /// Extended Kalman filter in `(theta, x, y)`.
    Ekf,
    /// Invariant extended H-infinity filter.
    HInfinity,
    /// Linearly constrained left-invariant filter, hard constraints.
    LcInekf,
    /// Linearly constrained extended Kalman filter, hard constraints.
    LcEkf,
    /// Left-invariant with the three mismatches as states.
    Augmented {
        /// Standard deviation of each mismatch's random walk over 0.1 s.
        walk: f64,
    },
    /// Linearly constrained left-invariant filter, constraints as soft as the mismatches are small.
    Soft,
    /// Left-invariant with the three mismatches considered, not estimated: Schmidt's filter.
    Considered,
    /// The bank of augmented filters for mismatches of unknown behaviour.
    Adaptive,
}

impl Filter {
    /// All filters, in the order of the tables: the paper's and their baselines, then what is beyond it.
    pub const ALL: [Self; 12] = [
        Self::InekfLeft,
        Self::InekfRight,
        Self::InekfIterated,
        Self::Ekf,
        Self::HInfinity,
        Self::LcEkf,
        Self::LcInekf,
        Self::Augmented { walk: 0.0 },
        Self::Augmented { walk: 0.03 },
        Self::Soft,
        Self::Considered,
        Self::Adaptive,
    ];

    /// Its name in tables and legends.
    pub fn name(&self) -> String {
        match self {
            Self::InekfLeft => "InEKF, left".to_owned(),
            Self::InekfRight => "InEKF, right".to_owned(),
            Self::InekfIterated => "InEKF, iterated".to_owned(),
            Self::Ekf => "EKF".to_owned(),
            Self::HInfinity => "invariant H-infinity".to_owned(),
            Self::LcInekf => "LC-InEKF".to_owned(),
            Self::LcEkf => "LC-EKF".to_owned(),
            Self::Augmented { walk } => format!("augmented, walk {walk}"),
            Self::Soft => "soft constraints".to_owned(),
            Self::Considered => "considered".to_owned(),
            Self::Adaptive => "adaptive".to_owned(),
        }
    }

    /// Its name in CSV files: letters, digits and underscores.
    pub fn key(&self) -> String {
        let letters = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let name: String = self.name().to_lowercase().chars().map(letters).collect();
        name.replace("__", "_")
    }

    /// The estimate after each step of `run`.
    ///
    /// # Errors
    /// [`UpdateError`], such as a gamma that is too large where the H-infinity filter is very unsure.
    pub fn estimate(&self, run: &Run) -> Result<Vec<SE2>, UpdateError> {
        match self {
            Self::InekfLeft => kalman::<Left>(run, &UpdateOptions::PLAIN),
            Self::InekfRight => kalman::<Right>(run, &UpdateOptions::PLAIN),
            Self::InekfIterated => kalman::<Left>(run, &UpdateOptions::ITERATED),
            Self::Ekf => kalman::<Additive>(run, &UpdateOptions::PLAIN),
            Self::HInfinity => h_infinity(run),
            Self::LcInekf => constrained::<Left>(run, [f64::INFINITY; 3]),
            Self::LcEkf => constrained::<Additive>(run, [f64::INFINITY; 3]),
            Self::Augmented { walk } => augmented(run, *walk, &Kalman),
            Self::Soft => constrained::<Left>(run, SIGMAS_MISMATCH),
            Self::Considered => augmented(run, 0.0, &Consider { first: 3 }),
            Self::Adaptive => adaptive(run),
        }
    }
}

/// The belief that all filters begin with, in the coordinates of side S.
pub(super) fn start<S: Side>(run: &Run) -> Belief<SE2, S, 3> {
    Belief::from_left_covariance(run.start, Covariance::from_variances(&start_variances()))
}

/// Runs `step` over all steps of a run.
fn over(
    run: &Run,
    mut step: impl FnMut(usize) -> Result<SE2, UpdateError>,
) -> Result<Vec<SE2>, UpdateError> {
    (0..run.steps.len()).map(&mut step).collect()
}

fn kalman<S: Side>(run: &Run, options: &UpdateOptions) -> Result<Vec<SE2>, UpdateError> {
    let q = run.odometry_noise();
    let mut belief = start::<S>(run);
    over(run, |k| {
        belief = propagate_odometry(&belief, &run.steps[k], &q);
        update(&mut belief, &run.pairs[k], options)?;
        Ok(belief.mean)
    })
}

fn h_infinity(run: &Run) -> Result<Vec<SE2>, UpdateError> {
    let rule = HInfinity {
        gamma: GAMMA,
        gain: HInfinityGain::Widened,
    };
    let q = run.odometry_noise() * BOUND;
    let mut belief = start::<Left>(run);
    over(run, |k| {
        belief = propagate_odometry(&belief, &run.steps[k], &q);
        let pair = PlanarPair::new(run.pairs[k].fixes.map(|fix| PointFix {
            covariance_w: fix.covariance_w * BOUND,
            ..fix
        }));
        update_with(&mut belief, &pair, &rule, &UpdateOptions::PLAIN)?;
        Ok(belief.mean)
    })
}

/// Constraints with mismatches of these standard deviations; infinity is the hard constraint.
fn constrained<S: Side>(run: &Run, sigmas: [f64; 3]) -> Result<Vec<SE2>, UpdateError> {
    let q = run.odometry_noise();
    let process = PROCESS.map(|mismatch| Declared::soft(mismatch, sigmas[0]));
    let outputs = [0, 1].map(|i| Declared::soft(OUTPUTS[i], sigmas[i + 1]));
    let mut way = ProcessColumns::new(&process).ok_or(UpdateError::TooManyConstraints)?;
    let mut belief = start::<S>(run);
    over(run, |k| {
        belief = propagate_odometry(&belief, &run.steps[k], &q);
        way.advance(&run.steps[k], &q);
        let rule = Constrained::new(&belief, &way, &outputs, &run.pairs[k]);
        update_with(&mut belief, &run.pairs[k], &rule, &UpdateOptions::PLAIN)?;
        way.reset();
        Ok(belief.mean)
    })
}

fn unknowns() -> Result<Unknowns, UpdateError> {
    Unknowns::new::<2, 3>(&PROCESS, &OUTPUTS).ok_or(UpdateError::TooManyConstraints)
}

/// Mismatches as states, which `rule` corrects or not.
fn augmented(
    run: &Run,
    walk: f64,
    rule: &impl GainRule<Augmented<SE2, 3, 3, 6>, 6, 4>,
) -> Result<Vec<SE2>, UpdateError> {
    let unknowns = unknowns()?;
    let of_pose = start_variances();
    let variances = SVector::<f64, 6>::from_fn(|i, _| match i {
        0..3 => of_pose[i],
        _ => SIGMAS_MISMATCH[i - 3] * SIGMAS_MISMATCH[i - 3],
    });
    let of_walk = walk * walk * run.dt_s / WALK_STEP_S;
    let mut q = SMatrix::<f64, 6, 6>::from_diagonal_element(of_walk);
    q.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&run.odometry_noise());
    let mean = Augmented::<SE2, 3, 3, 6>::new(run.start, Vector3::zeros());
    let mut belief = Belief::<_, Left, 6>::new(mean, Covariance::from_variances(&variances));
    over(run, |k| {
        belief = propagate_augmented(&belief, &unknowns, &run.steps[k], &q);
        let seen = unknowns.observe(run.pairs[k]);
        update_with(&mut belief, &seen, rule, &UpdateOptions::PLAIN)?;
        Ok(belief.mean.pose)
    })
}

fn adaptive(run: &Run) -> Result<Vec<SE2>, UpdateError> {
    let unknowns = unknowns()?;
    let expected = Expected::of(&unknowns, &SIGMAS_MISMATCH.into(), &SIGMAS_BURST.into());
    let (modes, switching) = standard_modes::<3>(&expected, WHITE_INTERVAL_S);
    let mut bank: Adaptive<SE2, 3, 3, 6, STANDARD_MODES> =
        Adaptive::new(&start(run), modes, switching, UpdateOptions::PLAIN);
    let q = run.odometry_noise();
    over(run, |k| {
        bank.advance(&unknowns, &run.steps[k], &q);
        for (source, fix) in run.pairs[k].fixes.into_iter().enumerate() {
            bank.update(&unknowns.observe_from(source, PlanarFix::new([fix])))?;
        }
        Ok(bank.estimate().mean.pose)
    })
}
