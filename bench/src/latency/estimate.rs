//! The service: a sample sent to a real daemon, its estimate with full covariance read.

use std::time::Duration;

use anyhow::Context;
use inekf_client::daemon::{Daemon, private_instance};
use inekf_client::dataset::{ImuRow, Odometry2dRow, PositionRow};
use inekf_client::feed::{Feeder, SendError};
use inekf_client::model;
use inekf_client::read::EstimateReader;
use inekf_client::session::Session;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, ESTIMATE_UPDATED, EstimateSe2, EstimateSe23, Health, StateVector,
};
use inekf_shared::transport::{self, Node, Subscriber};
use tempfile::TempDir;

use super::mechanism::Wait;
use super::partner::{RoundTrip, still_patient};
use crate::pin;

const PERIOD_NS: u64 = 1_000_000;
/// Samples sent to initialise; the first fix is due at the 20th.
const FIRST: u64 = 30;
/// Samples from one fix to the next, where there are any: 5 Hz at 1 kHz.
const FIX_EVERY: u64 = 200;
/// Turn and way of a step of odometry: a circle of 10 m radius, counter-clockwise from the origin.
const STEP_RAD: f64 = 1e-3;
const STEP_M: f64 = 1e-2;
const RADIUS_M: f64 = STEP_M / STEP_RAD;

/// Sends the sample of a stamp, and what belongs to it.
type Send = fn(&mut Feeder, u64) -> Result<usize, SendError>;

/// A daemon of its own, and the ports to it.
pub struct Estimate<E: model::Estimate> {
    feeder: Feeder,
    reader: EstimateReader<E>,
    send: Send,
    /// The flag of the estimate that ends a round.
    flag: u32,
    stamp_ns: u64,
    inside_ns: u64,
    daemon: Daemon,
    health: Subscriber<Health>,
    // After the port that was made on it, and after the daemon.
    _node: Node,
    _config: TempDir,
}

impl<E: model::Estimate> Estimate<E> {
    /// What the daemon says of itself from now on: it takes about a second.
    ///
    /// # Errors
    /// It does not say anything.
    pub fn health(&self) -> anyhow::Result<Health> {
        let asked_ns = monotonic_ns();
        loop {
            while let Some(health) = self.health.receive()? {
                if health.stamp_ns > asked_ns {
                    return Ok(*health);
                }
            }
            still_patient(asked_ns, "the daemon")?;
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// A daemon of the model `imu` on processor `cpu`, with biases (15 states) or without (9),
/// initialised.
///
/// # Errors
/// It cannot be started, or does not answer.
pub fn imu(biases: bool, wait: Wait, cpu: usize) -> anyhow::Result<Estimate<EstimateSe23>> {
    let config = inertial(&format!("biases = {biases}\n"), wait);
    let send = |feeder: &mut Feeder, stamp_ns| feeder.imu(&at_rest(stamp_ns));
    Estimate::start(&config, cpu, imu_at_first, send, ESTIMATE_PROPAGATED)
}

/// The same with biases and a position fix every 200 samples, fused by the filter or by the
/// smoother with a window of 50 states. What ends a round is the estimate of the sample itself,
/// which waits for no fix: a solve can only hold up the sample after it.
///
/// # Errors
/// It cannot be started, or does not answer.
pub fn aided(smooths: bool, wait: Wait, cpu: usize) -> anyhow::Result<Estimate<EstimateSe23>> {
    let estimator = if smooths {
        "estimator = \"smoother\"\n[smoother]\nwindow = 50\n"
    } else {
        ""
    };
    let send = |feeder: &mut Feeder, stamp_ns: u64| {
        if (stamp_ns / PERIOD_NS).is_multiple_of(FIX_EVERY) {
            feeder.position(&fix(stamp_ns, 3, [0.0; 3]))?;
        }
        feeder.imu(&at_rest(stamp_ns))
    };
    let config = inertial(estimator, wait);
    Estimate::start(&config, cpu, imu_at_first, send, ESTIMATE_PROPAGATED)
}

/// The model `imu`, with what is `special` at the top of the file.
fn inertial(special: &str, wait: Wait) -> String {
    format!(
        "model = \"imu\"\n{special}\
         [noise]\ngyro_density = 1e-3\naccel_density = 1e-2\n\
         [initial]\nlevel_window_s = 0.01\n\
         [runtime]\nwait = \"{}\"\n",
        wait.name()
    )
}

/// The first samples, and the fix to start from.
fn imu_at_first(feeder: &mut Feeder, stamp_ns: u64) -> Result<usize, SendError> {
    if stamp_ns == 20 * PERIOD_NS {
        feeder.position(&fix(stamp_ns, 3, [0.0; 3]))?;
    }
    feeder.imu(&at_rest(stamp_ns))
}

/// A daemon of the model `odometry2d` on processor `cpu` with a linearly constrained filter, blind
/// to a wrong scale of the odometry. With `fixes`, each sample has a position fix, and the estimate
/// that ends a round is the one that it was fused into, by the constrained gain.
///
/// # Errors
/// It cannot be started, or does not answer.
pub fn odometry(fixes: bool, wait: Wait, cpu: usize) -> anyhow::Result<Estimate<EstimateSe2>> {
    let config = format!(
        "model = \"odometry2d\"\nestimator = \"lc-inekf\"\nmismatch = \"hard\"\n\
         [noise]\nrotation_density = 3e-3\ntranslation_density = 1e-2\n\
         [initial]\nheading_deg = 0.0\nheading_sigma_deg = 5.0\n\
         position_m = [0.0, 0.0]\nposition_sigma_m = 1.0\n\
         [[mismatched]]\nwhat = \"odometry_scale\"\n\
         [runtime]\nwait = \"{}\"\n",
        wait.name()
    );
    let (send, flag): (Send, u32) = if fixes {
        (odometry_and_fix, ESTIMATE_UPDATED)
    } else {
        (odometry_alone, ESTIMATE_PROPAGATED)
    };
    Estimate::start(&config, cpu, odometry_and_fix, send, flag)
}

fn odometry_alone(feeder: &mut Feeder, stamp_ns: u64) -> Result<usize, SendError> {
    feeder.odometry2d(&on_circle(stamp_ns))
}

/// The fix comes first: it is then fused with the sample, not after it as a late one.
fn odometry_and_fix(feeder: &mut Feeder, stamp_ns: u64) -> Result<usize, SendError> {
    let (sin, cos) = (stamp_ns as f64 / PERIOD_NS as f64 * STEP_RAD).sin_cos();
    let position_w_m = [RADIUS_M * sin, RADIUS_M * (1.0 - cos), 0.0];
    feeder.position(&fix(stamp_ns, 2, position_w_m))?;
    odometry_alone(feeder, stamp_ns)
}

impl<E: model::Estimate> Estimate<E> {
    fn start(config: &str, cpu: usize, first: Send, send: Send, flag: u32) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("bench.toml");
        std::fs::write(&file, config)?;
        let instance = private_instance("latency")?;
        let daemon = Daemon::start(&file, &instance)?;
        pin::pin(Some(daemon.id()), cpu)?;
        let mut feeder = Feeder::open(&instance)?;
        let reader = EstimateReader::open(&instance)?;
        let node = transport::open_node("inekf-bench")?;
        let health = transport::health(&node, &instance)?.subscriber()?;
        let mut session: Session<E> = Session::open(&instance)?;
        for step in 1..=FIRST {
            first(&mut feeder, step * PERIOD_NS)?;
        }
        session.settle(&mut |_| Ok(()))?;
        let _initialised: StateVector = session.snapshot().context("initialising the daemon")?;
        Ok(Self {
            feeder,
            reader,
            send,
            flag,
            stamp_ns: FIRST * PERIOD_NS,
            inside_ns: 0,
            daemon,
            health,
            _node: node,
            _config: folder,
        })
    }
}

fn at_rest(stamp_ns: u64) -> ImuRow {
    ImuRow {
        stamp_ns,
        gyro_rps: [0.0, 0.0, 0.1],
        accel_mps2: [0.1, 0.0, 9.80665],
    }
}

fn on_circle(stamp_ns: u64) -> Odometry2dRow {
    Odometry2dRow {
        stamp_ns,
        dtheta_rad: STEP_RAD,
        translation_m: [STEP_M, 0.0],
    }
}

fn fix(stamp_ns: u64, dimension: u32, position_w_m: [f64; 3]) -> PositionRow {
    let sigma_m = if dimension == 2 {
        [0.1, 0.1, 0.0]
    } else {
        [1.0; 3]
    };
    PositionRow {
        stamp_ns,
        source: 0,
        dimension,
        position_w_m,
        sigma_m,
    }
}

impl<E: model::Estimate> RoundTrip for Estimate<E> {
    fn round(&mut self) -> anyhow::Result<u64> {
        self.stamp_ns += PERIOD_NS;
        let sent_ns = monotonic_ns();
        (self.send)(&mut self.feeder, self.stamp_ns)?;
        loop {
            if let Some(estimate) = self.reader.borrow_next()?
                && estimate.head().stamp_ns == self.stamp_ns
                && estimate.head().flags & self.flag != 0
            {
                let round_ns = monotonic_ns() - sent_ns;
                let head = estimate.head();
                self.inside_ns = head.published_ns.saturating_sub(head.received_ns);
                return Ok(round_ns);
            }
            still_patient(sent_ns, "the daemon")?;
            std::hint::spin_loop();
        }
    }

    fn inside(&self) -> Option<u64> {
        Some(self.inside_ns)
    }

    fn process(&self) -> Option<u32> {
        Some(self.daemon.id())
    }
}
