//! From a running daemon to a file: `inekf-client record`.

use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use inekf_shared::message::{EstimateSe2, EstimateSe3, EstimateSe23, JournalEntry};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Subscriber};

use super::{Head, RECORDING_VERSION, Writer};
use crate::control::{ControlError, Controller};
use crate::model::{Estimate, Model};
use crate::read::EstimateReader;

/// How long a daemon may take to say what its configuration is.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Between two looks for a daemon, or for what it says.
const POLL: Duration = Duration::from_millis(1);
/// What has been recorded reaches the system this often.
const FLUSH_EVERY: Duration = Duration::from_millis(100);
/// While the disk refuses, it is tried this often.
const RETRY_EVERY: Duration = Duration::from_millis(500);

/// What to record, and where to.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::recording::RecordOptions;
/// use inekf_shared::topic::Instance;
///
/// let options = RecordOptions {
///     instance: Instance::new("car")?,
///     out: "drive.rec".into(),
///     duration: Some(Duration::from_secs(60)),
/// };
/// // Without a duration it goes on until it is stopped.
/// assert!(RecordOptions { duration: None, ..options }.duration.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RecordOptions {
    /// The daemon.
    pub instance: Instance,
    /// The file, which must not be there.
    pub out: PathBuf,
    /// How long; until it is stopped if not given.
    pub duration: Option<Duration>,
}

/// What was recorded.
///
/// ```
/// use inekf_client::recording::RecordSummary;
///
/// // A recording that began in the middle, and of which nothing is missing since.
/// let summary = RecordSummary { entries: 1000, first: 250, estimates: 1200, ..Default::default() };
/// assert_eq!((summary.entries_missed, summary.estimates_missed, summary.unwritten), (0, 0, 0));
/// assert!(summary.first > 0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordSummary {
    /// Entries of the journal.
    pub entries: u64,
    /// Index of the first of them.
    pub first: u64,
    /// Entries between them that did not come.
    pub entries_missed: u64,
    /// Estimates.
    pub estimates: u64,
    /// Estimates that did not come.
    pub estimates_missed: u64,
    /// Entries and estimates that the disk had no room for.
    pub unwritten: u64,
    /// Whether it ended because the daemon was started anew.
    pub restarted: bool,
}

/// Records until `stop` says so, the time is up, or the daemon has been started anew. If the daemon does not run yet, it
/// is waited for. A disk that refuses while it runs ends nothing: `say` is told so once, and again when it takes what
/// was kept meanwhile.
///
/// # Errors
/// The daemon publishes no journal, or the file cannot be begun, or the disk still refuses at the end; what was recorded
/// until then is in it.
///
/// It is not run here, for it needs a daemon, another process:
///
/// ```no_run
/// use inekf_client::recording::{RecordOptions, record};
/// use inekf_shared::topic::Instance;
///
/// let options = RecordOptions {
///     instance: Instance::new("car")?,
///     out: "drive.rec".into(),
///     duration: None,
/// };
/// let summary = record(&options, &|| false, &|line| eprintln!("{line}"))?;
/// assert_eq!(summary.entries_missed, 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn record(
    options: &RecordOptions,
    stop: &dyn Fn() -> bool,
    say: &dyn Fn(&str),
) -> anyhow::Result<RecordSummary> {
    let node = transport::open_node("inekf-record")?;
    // Before the daemon is asked anything: not to miss what it takes meanwhile.
    let topic = transport::journal(&node, &options.instance)?;
    let journal = topic.subscriber()?;
    let model = loop {
        let code = transport::estimate_model(&node, &options.instance)?;
        if let Some(model) = code.and_then(Model::from_code) {
            break model;
        }
        if stop() {
            return Ok(RecordSummary::default());
        }
        std::thread::sleep(POLL);
    };
    let publishes = || topic.publisher_count() > 0;
    match model {
        Model::Imu => run::<EstimateSe23>(options, &journal, &publishes, stop, say),
        Model::Odometry3d => run::<EstimateSe3>(options, &journal, &publishes, stop, say),
        Model::Odometry2d => run::<EstimateSe2>(options, &journal, &publishes, stop, say),
    }
}

fn run<E: Estimate>(
    options: &RecordOptions,
    journal: &Subscriber<JournalEntry>,
    publishes: &dyn Fn() -> bool,
    stop: &dyn Fn() -> bool,
    say: &dyn Fn(&str),
) -> anyhow::Result<RecordSummary> {
    let mut estimates = EstimateReader::<E>::open(&options.instance)?;
    let mut controller = Controller::open(&options.instance, ANSWER_WITHIN)?;
    let config = loop {
        match controller.config() {
            Ok(config) => break config,
            Err(ControlError::Silent { .. }) if !stop() => {}
            Err(error) => return Err(error.into()),
        }
    };
    if !publishes() {
        bail!(
            "the daemon of instance {} publishes no journal: set publish = true in the table [journal] of its configuration",
            options.instance
        );
    }
    let began = SystemTime::now().duration_since(UNIX_EPOCH);
    let head = Head {
        version: RECORDING_VERSION,
        model: E::MODEL,
        instance: options.instance.to_string(),
        began_unix_s: began.unwrap_or_default().as_secs(),
        config,
    };
    let place = || options.out.display().to_string();
    let mut writer = Writer::create(&options.out, &head).with_context(place)?;
    let mut summary = RecordSummary::default();
    let mut next = None;
    let (started, mut flushed) = (Instant::now(), Instant::now());
    let mut disk = Disk::default();
    let is_up = || {
        options
            .duration
            .is_some_and(|limit| started.elapsed() >= limit)
    };
    loop {
        // Asked before the last look, so that nothing sent before the stop is left.
        let ends = stop() || is_up();
        let mut is_idle = true;
        while let Some(entry) = journal.receive().context("receiving the journal")? {
            match next {
                Some(expected) if entry.index < expected => summary.restarted = true,
                Some(expected) => summary.entries_missed += entry.index - expected,
                None => summary.first = entry.index,
            }
            if summary.restarted {
                break;
            }
            next = Some(entry.index + 1);
            summary.entries += 1;
            writer.entry(&entry).with_context(place)?;
            is_idle = false;
        }
        while let Some(estimate) = estimates.next_estimate()? {
            if !summary.restarted {
                summary.estimates += 1;
                writer.estimate(&estimate).with_context(place)?;
            }
            is_idle = false;
        }
        if flushed.elapsed() >= disk.next_try() {
            disk.took(writer.flush(), writer.given_up(), &place(), say);
            flushed = Instant::now();
        }
        if ends || summary.restarted {
            break;
        }
        if is_idle {
            std::thread::sleep(POLL);
        }
    }
    summary.estimates_missed = estimates.missed();
    summary.unwritten = writer.given_up();
    writer
        .finish()
        .with_context(|| format!("{}: the end of the recording is lost", place()))?;
    Ok(summary)
}

/// How the disk has been, so that a change is said once.
#[derive(Debug, Default)]
struct Disk {
    refuses: bool,
}

impl Disk {
    fn next_try(&self) -> Duration {
        if self.refuses {
            RETRY_EVERY
        } else {
            FLUSH_EVERY
        }
    }

    fn took(
        &mut self,
        outcome: std::io::Result<()>,
        given_up: u64,
        place: &str,
        say: &dyn Fn(&str),
    ) {
        match outcome {
            Ok(()) if core::mem::take(&mut self.refuses) => {
                say(&format!(
                    "{place}: is written again; {given_up} entries and estimates are missing in all"
                ));
            }
            Err(error) if !core::mem::replace(&mut self.refuses, true) => {
                say(&format!(
                    "{place}: cannot be written: {error}; what comes is kept in memory for some seconds, and tried again"
                ));
            }
            Ok(()) | Err(_) => {}
        }
    }
}
