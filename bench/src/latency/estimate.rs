//! The service: an IMU sample sent to a spinning daemon, its estimate with full covariance read.

use anyhow::bail;
use inekf_client::daemon::{Daemon, private_instance};
use inekf_client::dataset::{Event, ImuRow, PositionRow};
use inekf_client::feed::Feeder;
use inekf_client::read::EstimateReader;
use inekf_client::session::Session;
use inekf_shared::clock::monotonic_ns;
use tempfile::TempDir;

use super::RoundTrip;
use crate::pin;

/// Name of the row with 9 states.
pub const NAME_9: &str = "estimate, 9 states";
/// Name of the row with 15 states.
pub const NAME_15: &str = "estimate, 15 states";

const PERIOD_NS: u64 = 1_000_000;

/// A daemon of its own, and the ports to it.
pub struct Estimate {
    name: &'static str,
    feeder: Feeder,
    reader: EstimateReader,
    stamp_ns: u64,
    _daemon: Daemon,
    _config: TempDir,
}

impl Estimate {
    /// Starts a daemon on processor `cpu`, with biases (15 states) or without (9), and initialises it.
    ///
    /// # Errors
    /// It cannot be started, or does not answer.
    pub fn start(cpu: usize, biases: bool) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        let config = folder.path().join("bench.toml");
        std::fs::write(
            &config,
            format!(
                "model = \"imu\"\nbiases = {biases}\n[noise]\ngyro_density = 1e-3\n\
                 accel_density = 1e-2\n[initial]\nlevel_window_s = 0.01\n[runtime]\nwait = \
                 \"spin\"\n"
            ),
        )?;
        let instance = private_instance("latency")?;
        let daemon = Daemon::start(&config, &instance)?;
        pin::pin(Some(daemon.id()), cpu)?;
        let mut session: Session = Session::open(&instance)?;
        let mut stamp_ns = 0;
        let fix = PositionRow {
            stamp_ns: 20 * PERIOD_NS,
            source: 0,
            dimension: 3,
            position_w_m: [0.0; 3],
            sigma_m: [1.0; 3],
        };
        session.send(&Event::Position(fix))?;
        for _ in 0..30 {
            stamp_ns += PERIOD_NS;
            session.send(&Event::Imu(at_rest(stamp_ns)))?;
        }
        session.settle(&mut |_| Ok(()))?;
        session.snapshot()?;
        drop(session);
        Ok(Self {
            name: if biases { NAME_15 } else { NAME_9 },
            feeder: Feeder::open(&instance)?,
            reader: EstimateReader::open(&instance)?,
            stamp_ns,
            _daemon: daemon,
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

impl RoundTrip for Estimate {
    fn name(&self) -> &'static str {
        self.name
    }

    fn round(&mut self) -> anyhow::Result<u64> {
        self.stamp_ns += PERIOD_NS;
        let sent_ns = monotonic_ns();
        self.feeder.imu(&at_rest(self.stamp_ns))?;
        loop {
            if let Some(estimate) = self.reader.next_estimate()?
                && estimate.head.stamp_ns == self.stamp_ns
            {
                return Ok(monotonic_ns() - sent_ns);
            }
            if monotonic_ns() - sent_ns > 5_000_000_000 {
                bail!("the daemon does not answer");
            }
            std::hint::spin_loop();
        }
    }
}
