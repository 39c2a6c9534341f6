//! The filters that are compared on [`section7`](super::section7), each as a plain loop over a run.
//!
//! Two position sources are stacked at every step. Only the constrained filters and the augmented ones know what
//! kinds of mismatch there may be (odometry scale; scale of source 1; rotation of source 0); none knows a value.

use inekf::filter::{
    Additive, Belief, Constrained, Covariance, HInfinity, HInfinityGain, Left, Right, Side,
    UpdateError, UpdateOptions, propagate_augmented, propagate_odometry, update, update_with,
};
use inekf::lie::SE2;
use inekf::model::{
    Augmented, Declared, OutputMismatch, PlanarPair, PointFix, ProcessColumns, ProcessMismatch,
    Unknowns,
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
/// Standard deviations of the augmented filter's mismatches at the start, in that order.
const SIGMAS_MISMATCH: [f64; 3] = [0.08, 0.06, 0.03];
/// \[LC\] VII.
const GAMMA: f64 = 0.02;
/// The H-infinity filter takes bounds: three times the standard deviations, nine times the covariances.
const BOUND: f64 = 9.0;
/// The random walk of the augmented filter is given for a step of this length, s.
const WALK_STEP_S: f64 = 0.1;

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
}

impl Filter {
    /// All filters, in the order of the tables.
    pub const ALL: [Self; 9] = [
        Self::InekfLeft,
        Self::InekfRight,
        Self::InekfIterated,
        Self::Ekf,
        Self::HInfinity,
        Self::LcEkf,
        Self::LcInekf,
        Self::Augmented { walk: 0.0 },
        Self::Augmented { walk: 0.03 },
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
            Self::LcInekf => constrained::<Left>(run),
            Self::LcEkf => constrained::<Additive>(run),
            Self::Augmented { walk } => augmented(run, *walk),
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

fn constrained<S: Side>(run: &Run) -> Result<Vec<SE2>, UpdateError> {
    let q = run.odometry_noise();
    let outputs = OUTPUTS.map(Declared::hard);
    let mut way =
        ProcessColumns::new(&PROCESS.map(Declared::hard)).ok_or(UpdateError::TooManyConstraints)?;
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

fn augmented(run: &Run, walk: f64) -> Result<Vec<SE2>, UpdateError> {
    let unknowns =
        Unknowns::new::<2, 3>(&PROCESS, &OUTPUTS).ok_or(UpdateError::TooManyConstraints)?;
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
        update(&mut belief, &seen, &UpdateOptions::PLAIN)?;
        Ok(belief.mean.pose)
    })
}
