//! Replaying a dataset folder through a daemon: `inekf-client replay`.
//!
//! At full speed a bounded number of samples is in flight and none is lost; the daemon's estimates
//! depend on the data and the configuration alone, so the output is the same bytes every time.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use inekf_shared::message::{ControlResponse, EstimateSe2, EstimateSe3, EstimateSe23};
use inekf_shared::topic::Instance;

use crate::daemon::{Daemon, private_instance};
use crate::dataset::{Dataset, Event};
use crate::model::{Estimate, Model};
use crate::pace::{Pace, Speed};
use crate::progress::Progress;
use crate::rows::{RowBuilder, state, triangle};
use crate::session::{Session, running_model, why_no_estimate};
use crate::smoothed::SmoothedOutput;
use crate::table::EstimateWriter;

/// What to replay, and how.
///
/// ```
/// use inekf_client::pace::Speed;
/// use inekf_client::replay::ReplayOptions;
/// use inekf_shared::topic::Instance;
///
/// let options = ReplayOptions {
///     dir: "flight".into(),
///     config: None, // a daemon that runs already is fed: that of `instance`
///     speed: Speed::Times(1.0),
///     out: "estimate.csv".into(),
///     smoothed: None,
///     covariance: false,
///     instance: Instance::new("car")?,
/// };
/// assert_eq!(options.instance.as_str(), "car");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// The dataset folder.
    pub dir: PathBuf,
    /// Configuration of a daemon of one's own; without it the daemon of `instance` is fed.
    pub config: Option<PathBuf>,
    /// How fast.
    pub speed: Speed,
    /// The estimate CSV to write.
    pub out: PathBuf,
    /// The CSV of smoothed states to write, if one is wanted; the daemon must have a smoother.
    pub smoothed: Option<PathBuf>,
    /// Whether the CSVs have the covariance.
    pub covariance: bool,
    /// The daemon to feed if none is started.
    pub instance: Instance,
}

/// What a replay did.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::replay::ReplaySummary;
/// use inekf_shared::message::{ControlResponse, Zero};
///
/// let summary = ReplaySummary {
///     sent: 12_300,
///     rows: 12_000,
///     smoothed_rows: 0,
///     took: Duration::from_millis(600),
///     last: ControlResponse::ZERO,
/// };
/// // A minute at 200 Hz in 0.6 s; a fix has no row of its own.
/// assert!(summary.rows as f64 / 200.0 / summary.took.as_secs_f64() > 99.0);
/// assert!(summary.rows < summary.sent && summary.last.counters.lost == 0);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ReplaySummary {
    /// Rows of sensors sent.
    pub sent: usize,
    /// Rows written.
    pub rows: usize,
    /// Rows of smoothed states written.
    pub smoothed_rows: usize,
    /// How long the feeding took.
    pub took: Duration,
    /// The daemon's counters at the end.
    pub last: ControlResponse,
}

/// Replays.
///
/// ```no_run
/// use std::path::Path;
///
/// use inekf_client::pace::Speed;
/// use inekf_client::replay::{ReplayOptions, replay};
/// use inekf_shared::topic::Instance;
///
/// replay(&ReplayOptions {
///     dir: "flight".into(),
///     config: Some("drone.toml".into()),
///     speed: Speed::Max,
///     out: "estimate.csv".into(),
///     smoothed: None,
///     covariance: true,
///     instance: Instance::new("default")?,
/// })?;
/// assert!(Path::new("estimate.csv").is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The data cannot be read, the daemon not be started or reached, an estimate was lost, or none
/// came; the error says which.
pub fn replay(options: &ReplayOptions) -> anyhow::Result<ReplaySummary> {
    let dataset = Dataset::load(&options.dir)?;
    let (daemon, instance) = match &options.config {
        Some(config) => {
            let instance = private_instance("replay")?;
            (Some(Daemon::start(config, &instance)?), instance)
        }
        None => (None, options.instance.clone()),
    };
    let summary = feed_any(&dataset, &instance, options);
    // Stop the daemon in either case; the first error is the one to report.
    let stopped = daemon.map_or(Ok(()), Daemon::stop);
    let summary = summary?;
    stopped?;
    Ok(summary)
}

/// Feeds the daemon with what its model takes.
fn feed_any(
    dataset: &Dataset,
    instance: &Instance,
    options: &ReplayOptions,
) -> anyhow::Result<ReplaySummary> {
    match running_model(instance)? {
        Model::Imu => feed::<EstimateSe23>(dataset, instance, options),
        Model::Odometry3d => feed::<EstimateSe3>(dataset, instance, options),
        Model::Odometry2d => feed::<EstimateSe2>(dataset, instance, options),
    }
}

fn feed<E: Estimate>(
    dataset: &Dataset,
    instance: &Instance,
    options: &ReplayOptions,
) -> anyhow::Result<ReplaySummary> {
    let events = dataset
        .events_for(E::KIND)
        .with_context(|| options.dir.display().to_string())?;
    let mut session = Session::<E>::open(instance)?;
    let mut smoothed = match &options.smoothed {
        Some(path) => Some(SmoothedOutput::new(instance, path, options.covariance)?),
        None => None,
    };
    session.set_initial(&dataset.meta)?;
    let mut output = Output::new(&options.out, options.covariance)?;
    let progress = Progress::new("replaying", events.len());
    // Time starts with the motion; fixes before it are sent at once.
    let first_ns = events
        .clone()
        .find(Event::is_motion)
        .map_or(0, |event| event.stamp_ns());
    let pace = match options.speed {
        Speed::Times(times) => Some(Pace::new(first_ns, times)),
        Speed::Max => None,
    };

    let started = Instant::now();
    let mut sent = 0;
    for event in events {
        match &pace {
            None => session.send_lossless(&event, &mut |estimate| output.take(&estimate))?,
            Some(pace) => {
                pace.wait(event.stamp_ns());
                session.send(&event)?;
                session.take_estimates(&mut |estimate| output.take(&estimate))?;
            }
        }
        if let Some(smoothed) = &mut smoothed {
            smoothed.take_left()?;
        }
        sent += 1;
        progress.advance(sent);
    }
    let last = session.settle(&mut |estimate| output.take(&estimate))?;
    let took = started.elapsed();
    let smoothed_rows = match smoothed {
        Some(smoothed) => smoothed.finish(session.controller())?,
        None => 0,
    };
    progress.finish();
    let rows = output.finish()?;
    if rows == 0 {
        bail!("no estimate came: {}", why_no_estimate(&last));
    }
    Ok(ReplaySummary {
        sent,
        rows,
        smoothed_rows,
        took,
        last,
    })
}

/// The estimate CSV under construction. Its header needs the dimension of the first estimate.
pub(crate) struct Output<E> {
    path: PathBuf,
    covariance: bool,
    builder: RowBuilder<E>,
    writer: Option<EstimateWriter<BufWriter<File>>>,
    file: Option<File>,
    rows: usize,
}

impl<E: Estimate> Output<E> {
    /// Creates the file.
    pub(crate) fn new(path: &Path, covariance: bool) -> anyhow::Result<Self> {
        let file = File::create(path).with_context(|| format!("creating {}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            covariance,
            builder: RowBuilder::default(),
            writer: None,
            file: Some(file),
            rows: 0,
        })
    }

    /// Takes the next estimate.
    pub(crate) fn take(&mut self, estimate: &E) -> anyhow::Result<()> {
        match self.builder.push(*estimate) {
            Some(complete) => self.write(&complete),
            None => Ok(()),
        }
    }

    fn write(&mut self, estimate: &E) -> anyhow::Result<()> {
        let triangle = if self.covariance {
            triangle(estimate)
        } else {
            &[]
        };
        let writing = || format!("writing {}", self.path.display());
        if let Some(file) = self.file.take() {
            let dimension = self
                .covariance
                .then_some(estimate.head().dimension as usize);
            self.writer = Some(
                EstimateWriter::new(BufWriter::new(file), E::LAYOUT, dimension)
                    .with_context(writing)?,
            );
        }
        if let Some(writer) = &mut self.writer {
            writer
                .write(estimate.head().stamp_ns, &state(estimate), triangle)
                .with_context(writing)?;
            self.rows += 1;
        }
        Ok(())
    }

    /// Writes the last row and returns how many there are.
    pub(crate) fn finish(mut self) -> anyhow::Result<usize> {
        if let Some(last) = std::mem::take(&mut self.builder).finish() {
            self.write(&last)?;
        }
        if let Some(writer) = self.writer {
            writer
                .finish()
                .with_context(|| format!("writing {}", self.path.display()))?;
        }
        Ok(self.rows)
    }
}
