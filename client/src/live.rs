//! Feeding a simulation live: `inekf-client simulate`.

use anyhow::Context;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::topic::Instance;

use crate::dataset::{Dataset, Event};
use crate::feed::Feeder;
use crate::pace::Pace;
use crate::progress::Progress;

/// What a live feed did.
///
/// ```
/// use inekf_client::live::LiveSummary;
///
/// // A feed that was heard to its end, and one that began before its daemon.
/// let whole = LiveSummary { sent: 2000, unheard: 0 };
/// let early = LiveSummary { sent: 2000, unheard: 150 };
/// assert!(whole.unheard == 0 && early.unheard < early.sent);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LiveSummary {
    /// Rows sent.
    pub sent: usize,
    /// Rows that no daemon was there to get.
    pub unheard: usize,
}

/// Feeds `dataset` to `instance` in real time, stamped with this machine's monotonic clock, until
/// it ends or `stop` says so. The daemon may come and go meanwhile.
///
/// ```no_run
/// use inekf_client::live::feed_live;
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
/// use inekf_shared::topic::Instance;
///
/// let drive = simulate(Scenario::RoadCircuit, &SimulationOptions::default())?;
/// feed_live(&drive, &Instance::new("car")?, &|| false)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A port cannot be opened or a sample not be sent.
pub fn feed_live(
    dataset: &Dataset,
    instance: &Instance,
    stop: &dyn Fn() -> bool,
) -> anyhow::Result<LiveSummary> {
    let mut feeder = Feeder::open(instance)?;
    // A sensor clock that goes on from run to run, so that a daemon takes the next feed as the
    // continuation of time that it is.
    let base_ns = monotonic_ns();
    let events = dataset.events();
    let progress = Progress::new("feeding", events.len());
    let first_ns = events
        .clone()
        .find(Event::is_motion)
        .context("the simulation has no samples")?
        .stamp_ns();
    let pace = Pace::new(first_ns, 1.0);
    let mut summary = LiveSummary {
        sent: 0,
        unheard: 0,
    };
    for mut event in events {
        if stop() {
            break;
        }
        pace.wait(event.stamp_ns());
        shift(&mut event, base_ns);
        if feeder.send(&event)? == 0 {
            summary.unheard += 1;
        }
        summary.sent += 1;
        progress.advance(summary.sent);
    }
    progress.finish();
    Ok(summary)
}

/// Moves a row in time.
fn shift(event: &mut Event, by_ns: u64) {
    let stamp_ns = match event {
        Event::Position(row) => &mut row.stamp_ns,
        Event::Velocity(row) => &mut row.stamp_ns,
        Event::Heading(row) => &mut row.stamp_ns,
        Event::Imu(row) => &mut row.stamp_ns,
        Event::Odometry2d(row) => &mut row.stamp_ns,
        Event::Odometry3d(row) => &mut row.stamp_ns,
    };
    *stamp_ns += by_ns;
}
