//! What the monitor knows of one second of a daemon. SI units inside; standard deviations in world axes.

use std::time::Duration;

use hdrhistogram::{CreationError, Histogram};
use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateHead, Health, MAX_SOURCES};

use crate::evaluate::{Deviations, Pose, deviations, estimate_pose};
use crate::model::{Estimate, Model};
use crate::rows::row;
use crate::table::EstimateState;

/// Latencies that the screen remembers, one a picture.
const REMEMBERED: usize = 120;

/// A mean of three axes and, if known, its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// The mean.
    pub mean: [f64; 3],
    /// One sigma by axis.
    pub sigma: Option<[f64; 3]>,
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Name of the daemon.
    pub instance: String,
    /// Its model.
    pub model: Model,
    /// Its last health message, if one has come.
    pub health: Option<Health>,
    /// Age of the health message, ns.
    pub health_age_ns: Option<u64>,
    /// Head of the last estimate, if one has come.
    pub head: Option<EstimateHead>,
    /// Time since the last estimate was published, ns.
    pub estimate_age_ns: Option<u64>,
    /// Estimates a second.
    pub estimate_rate_hz: f64,
    /// Estimates that came too fast to be read.
    pub missed: u64,
    /// The last pose.
    pub pose: Option<Pose>,
    /// Its standard deviations.
    pub deviations: Option<Deviations>,
    /// Gyro bias, rad/s, and accelerometer bias, m/s^2, of the model that has them.
    pub biases: Option<[[f64; 3]; 2]>,
    /// From the sending of a sample to the publication of its estimate, ns, over this picture.
    pub latency: Histogram<u64>,
    /// The 99th percentile of each of the last pictures, ns.
    pub latency_history: Vec<u64>,
    count: u64,
}

impl Picture {
    /// Nothing known yet.
    ///
    /// # Errors
    /// None: the histogram's bounds are allowed.
    pub fn new(instance: &str, model: Model) -> Result<Self, CreationError> {
        Ok(Self {
            instance: instance.to_owned(),
            model,
            health: None,
            health_age_ns: None,
            head: None,
            estimate_age_ns: None,
            estimate_rate_hz: 0.0,
            missed: 0,
            pose: None,
            deviations: None,
            biases: None,
            latency: Histogram::new_with_bounds(1, 10_000_000_000, 3)?,
            latency_history: Vec::new(),
            count: 0,
        })
    }

    /// Takes a health message.
    pub fn take_health(&mut self, health: &Health) {
        self.health = Some(*health);
    }

    /// Takes an estimate.
    pub fn take_estimate<E: Estimate>(&mut self, estimate: &E) {
        let head = estimate.head();
        self.count += 1;
        if head.flags & ESTIMATE_PROPAGATED != 0 {
            self.latency
                .saturating_record(head.published_ns.saturating_sub(head.sent_ns).max(1));
        }
        self.head = Some(*head);
        let row = row(estimate);
        self.pose = Some(estimate_pose(row.stamp_ns, &row.state));
        self.deviations = deviations(&row);
        self.biases = match row.state {
            EstimateState::Navigation {
                gyro_bias_rps,
                accel_bias_mps2,
                ..
            } if head.dimension == 15 => Some([gyro_bias_rps, accel_bias_mps2]),
            _ => None,
        };
    }

    /// Closes the picture at `now_ns` (CLOCK_MONOTONIC), after `elapsed`; `missed` counts since the monitor's start.
    pub fn finish(&mut self, now_ns: u64, elapsed: Duration, missed: u64) {
        self.estimate_rate_hz = self.count as f64 / elapsed.as_secs_f64().max(1e-9);
        self.missed = missed;
        self.health_age_ns = self.health.map(|h| now_ns.saturating_sub(h.stamp_ns));
        self.estimate_age_ns = self.head.map(|h| now_ns.saturating_sub(h.published_ns));
        if !self.latency.is_empty() {
            self.latency_history
                .push(self.latency.value_at_quantile(0.99));
        }
        let surplus = self.latency_history.len().saturating_sub(REMEMBERED);
        self.latency_history.drain(..surplus);
    }

    /// Begins the next picture: what is counted by the second starts from zero.
    pub fn begin(&mut self) {
        self.count = 0;
        self.latency.reset();
    }

    /// Position, m, world.
    #[must_use]
    pub fn position(&self) -> Option<Quantity> {
        self.pose.map(|pose| Quantity {
            mean: pose.p_w_m.into(),
            sigma: self.deviations.map(|d| d.position_m.into()),
        })
    }

    /// Last NIS of each position source that has had a fix.
    #[must_use]
    pub fn nis(&self) -> Vec<(usize, f64)> {
        let nis = self.head.map_or([f64::NAN; MAX_SOURCES], |head| head.nis);
        let known = nis.into_iter().enumerate();
        known.filter(|(_, nis)| nis.is_finite()).collect()
    }
}
