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
///
/// ```
/// use inekf_client::monitor::Quantity;
///
/// let east = Quantity { mean: [10.0, 0.0, 0.0], sigma: Some([0.5, 0.5, 1.0]) };
/// // The truth, 10.8 m, is less than two of its standard deviations away.
/// assert!(east.sigma.is_some_and(|sigma| (10.8 - east.mean[0]) / sigma[0] < 2.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// The mean.
    pub mean: [f64; 3],
    /// One sigma by axis.
    pub sigma: Option<[f64; 3]>,
}

/// A picture.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::model::Model;
/// use inekf_client::monitor::Picture;
/// use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23, Zero};
///
/// let mut picture = Picture::new("car", Model::Imu)?;
/// let mut estimate = EstimateSe23::ZERO;
/// estimate.q_wb = [0.0, 0.0, 0.0, 1.0];
/// estimate.head.flags = ESTIMATE_PROPAGATED;
/// (estimate.head.sent_ns, estimate.head.published_ns) = (1000, 2500);
/// picture.take_estimate(&estimate);
/// picture.take_estimate(&estimate);
/// picture.finish(10_000, Duration::from_millis(500), 0);
/// // Two in half a second; 1.5 us from the sample to its estimate; published 7.5 us ago.
/// assert_eq!(picture.estimate_rate_hz, 4.0);
/// assert_eq!(picture.latency.max(), 1500);
/// assert_eq!(picture.estimate_age_ns, Some(7500));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    ///
    /// let picture = Picture::new("car", Model::Imu)?;
    /// assert!(picture.head.is_none() && picture.latency.is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    /// use inekf_shared::message::{Health, Zero};
    ///
    /// let mut picture = Picture::new("car", Model::Imu)?;
    /// picture.take_health(&Health { stamp_ns: 1_000, ..Health::ZERO });
    /// picture.finish(5_000, Duration::from_secs(1), 0);
    /// assert_eq!(picture.health_age_ns, Some(4_000));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn take_health(&mut self, health: &Health) {
        self.health = Some(*health);
    }

    /// Takes an estimate.
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    ///
    /// let mut estimate = EstimateSe23::ZERO;
    /// estimate.q_wb = [0.0, 0.0, 0.0, 1.0];
    /// estimate.gyro_bias_rps = [0.01, 0.0, 0.0];
    /// let mut picture = Picture::new("car", Model::Imu)?;
    /// // Biases are shown only where they are estimated.
    /// estimate.head.dimension = 9;
    /// picture.take_estimate(&estimate);
    /// assert!(picture.biases.is_none());
    /// estimate.head.dimension = 15;
    /// picture.take_estimate(&estimate);
    /// assert_eq!(picture.biases.map(|[gyro, _]| gyro), Some([0.01, 0.0, 0.0]));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    ///
    /// // Without an estimate there is a rate, and no age.
    /// let mut picture = Picture::new("car", Model::Imu)?;
    /// picture.finish(5_000, Duration::from_secs(1), 0);
    /// assert_eq!((picture.estimate_rate_hz, picture.estimate_age_ns), (0.0, None));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    /// use inekf_shared::message::{EstimateSe2, Zero};
    ///
    /// let mut picture = Picture::new("cart", Model::Odometry2d)?;
    /// picture.take_estimate(&EstimateSe2::ZERO);
    /// picture.begin();
    /// picture.finish(0, Duration::from_secs(1), 0);
    /// // The rate is of this second; the last state stays.
    /// assert!(picture.estimate_rate_hz == 0.0 && picture.pose.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn begin(&mut self) {
        self.count = 0;
        self.latency.reset();
    }

    /// Position, m, world.
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    /// use inekf_shared::message::{EstimateSe2, Zero};
    ///
    /// let mut picture = Picture::new("cart", Model::Odometry2d)?;
    /// assert!(picture.position().is_none());
    /// let mut estimate = EstimateSe2::ZERO;
    /// (estimate.p_w_m, estimate.head.dimension) = ([3.0, 4.0], 3);
    /// estimate.covariance[3] = 0.25;
    /// picture.take_estimate(&estimate);
    /// let position = picture.position().expect("an estimate came");
    /// assert_eq!(position.mean, [3.0, 4.0, 0.0]);
    /// assert_eq!(position.sigma.map(|sigma| sigma[0]), Some(0.5));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn position(&self) -> Option<Quantity> {
        self.pose.map(|pose| Quantity {
            mean: pose.p_w_m.into(),
            sigma: self.deviations.map(|d| d.position_m.into()),
        })
    }

    /// Last NIS of each position source that has had a fix.
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_client::monitor::Picture;
    /// use inekf_shared::message::{EstimateHead, EstimateSe2, Zero};
    ///
    /// let mut picture = Picture::new("cart", Model::Odometry2d)?;
    /// let mut estimate = EstimateSe2 { head: EstimateHead::UNSTARTED, ..EstimateSe2::ZERO };
    /// estimate.head.nis[2] = 1.5;
    /// picture.take_estimate(&estimate);
    /// // A source that has had no fix has no number.
    /// assert_eq!(picture.nis(), [(2, 1.5)]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn nis(&self) -> Vec<(usize, f64)> {
        let nis = self.head.map_or([f64::NAN; MAX_SOURCES], |head| head.nis);
        let known = nis.into_iter().enumerate();
        known.filter(|(_, nis)| nis.is_finite()).collect()
    }
}
