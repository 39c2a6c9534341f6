//! Rows of odometry: what they say, for how long, and how far they are to be trusted.
//!
//! A row is the motion of the body since the row before, in the body frame of then. Part of the time is part of the
//! motion at a constant twist, `exp(share log kappa)`: so a fix between two rows splits the row. Where rows are known
//! to be lost, the one that comes speaks for them too, at the same twist, and is doubted.

use inekf::model::{OdometryStep, RigidPose};
use nalgebra::{SMatrix, SVector};

use super::super::resume::Doubt;
use super::super::settings::seconds;
use crate::config::OdometryNoise;

/// A checked row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<const D: usize> {
    /// `(rotation vector, translation)`, rad and m, in the body frame at the start.
    pub increment: SVector<f64, D>,
    /// The time it speaks for, nanoseconds.
    pub span_ns: u64,
    /// Whether rows before it are missing.
    pub follows_loss: bool,
}

impl<const D: usize> Row<D> {
    /// The row with `increment` that comes `interval_ns` nanoseconds after `before`, `missing` rows between them.
    ///
    /// It speaks for an even share of the interval, but for no less than half of what the row before did: a number
    /// that leaps by thousands is a fault of the sender, and would multiply the motion by thousands.
    pub fn after(
        before: &Self,
        increment: SVector<f64, D>,
        interval_ns: u64,
        missing: u64,
    ) -> Self {
        let share_ns = interval_ns / missing.saturating_add(1);
        Self {
            increment,
            span_ns: share_ns.max(before.span_ns / 2).min(interval_ns).max(1),
            follows_loss: missing > 0,
        }
    }
}

/// The motion between two rows.
#[derive(Clone, Copy, Debug)]
pub struct RowMotion<G, const D: usize> {
    /// Of the whole row.
    step: OdometryStep<G>,
    /// Its covariance, left-invariant.
    q: SMatrix<f64, D, D>,
    /// The time it speaks for, nanoseconds.
    span_ns: u64,
    /// Further covariance per second, where the row says too little.
    doubt: SMatrix<f64, D, D>,
}

/// Covariance of a row over `dt_s` seconds, D x D.
fn covariance<G: RigidPose<D, N>, const D: usize, const N: usize>(
    noise: &OdometryNoise,
    increment: &SVector<f64, D>,
    dt_s: f64,
) -> SMatrix<f64, D, D> {
    let way_m = increment.rows(G::POSITION, N).norm();
    let turn_rad = increment.rows(0, G::ROTATION_DIM).norm();
    let sigmas = noise.row_sigmas(dt_s, way_m, turn_rad);
    let square = |sigma: f64| sigma * sigma;
    diagonal::<G, D, N>(
        square(sigmas.rotation),
        square(sigmas.translation),
        square(sigmas.lateral),
    )
}

/// The covariance with these variances.
fn diagonal<G: RigidPose<D, N>, const D: usize, const N: usize>(
    rotation: f64,
    forward: f64,
    lateral: f64,
) -> SMatrix<f64, D, D> {
    SMatrix::from_diagonal(&SVector::from_fn(|i, _| {
        if i < G::ROTATION_DIM {
            rotation
        } else if i == G::POSITION {
            forward
        } else {
            lateral
        }
    }))
}

/// Doubt about the mean angular rate where rows are missing, rad/s.
const GAP_ROTATION_SIGMA: f64 = 0.2;
/// Doubt about the mean velocity where rows are missing, m/s.
const GAP_TRANSLATION_SIGMA: f64 = 1.0;

impl<G, const D: usize> RowMotion<G, D> {
    /// The motion of `row` over the `interval_ns` nanoseconds since the row before; `max_gap_ns` is the longest
    /// interval that is not doubted.
    pub fn new<const N: usize>(
        row: &Row<D>,
        interval_ns: u64,
        max_gap_ns: u64,
        noise: &OdometryNoise,
    ) -> Self
    where
        G: RigidPose<D, N>,
    {
        let dt_s = seconds(row.span_ns);
        let says_too_little =
            row.follows_loss || interval_ns > row.span_ns || interval_ns > max_gap_ns;
        let doubt = if says_too_little {
            // A rate that is wrong over the whole interval: its square grows with the interval's length.
            let square = |sigma: f64| sigma * sigma * seconds(interval_ns);
            let translation = square(GAP_TRANSLATION_SIGMA);
            diagonal::<G, D, N>(square(GAP_ROTATION_SIGMA), translation, translation)
        } else {
            SMatrix::zeros()
        };
        Self {
            step: OdometryStep::new(&row.increment, dt_s),
            q: covariance::<G, D, N>(noise, &row.increment, dt_s),
            span_ns: row.span_ns,
            doubt,
        }
    }

    /// `silence_ns` nanoseconds in which nothing was heard: the body stays, as far as anyone knows.
    pub fn of_silence<const N: usize>(
        silence_ns: u64,
        noise: &OdometryNoise,
        doubt: &Doubt,
    ) -> (OdometryStep<G>, SMatrix<f64, D, D>)
    where
        G: RigidPose<D, N>,
    {
        let dt_s = seconds(silence_ns);
        let still = SVector::zeros();
        let square = |sigma: f64| (sigma * dt_s) * (sigma * dt_s);
        let way = square(doubt.speed_sigma);
        let q = covariance::<G, D, N>(noise, &still, dt_s)
            + diagonal::<G, D, N>(square(doubt.turn_sigma), way, way);
        (OdometryStep::new(&still, dt_s), q)
    }

    /// The next `part_ns` nanoseconds of it: a step and the covariance of its noise.
    pub fn part<const N: usize>(&self, part_ns: u64) -> (OdometryStep<G>, SMatrix<f64, D, D>)
    where
        G: RigidPose<D, N>,
    {
        let dt_s = seconds(part_ns);
        let doubt = self.doubt * dt_s;
        if part_ns == self.span_ns {
            return (self.step, self.q + doubt);
        }
        let share = part_ns as f64 / self.span_ns.max(1) as f64;
        let step = OdometryStep {
            kappa: G::exp(&(self.step.kappa.log() * share)),
            dt_s,
        };
        (step, self.q * share + doubt)
    }
}
