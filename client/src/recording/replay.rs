//! From a recording through a daemon of its own: every estimate must come again, bit for bit.
//!
//! The daemon is started with the recorded configuration, and given the entries in their order (`inekf-service
//! --stepped`): inputs as a journal, some hundred at a time, of which the daemon has taken each when it answers a request;
//! requests as what they are. Nothing depends on when a message comes. Only the latency stamps `received_ns` and
//! `published_ns` are not compared.
//!
//! A recording from the daemon's first entry on determines everything. One that begins later, or has a gap, determines
//! the estimates again from the next entry on that fixes the state: a reset, or a state that is set after two samples
//! (what the engine keeps of the samples before is then known as well). From there on all is compared but what counts
//! from the daemon's start: numbers, counters, the last NIS, and the first announcement of the reset.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, bail};
use inekf_shared::message::{
    CONTROL_RESET, CONTROL_SET_STATE, CONTROL_TAKE, ControlRequest, Counters, ESTIMATE_RESET,
    ESTIMATE_RESUMED, EstimateSe2, EstimateSe3, EstimateSe23, JOURNAL_CONTROL, JOURNAL_IMU,
    JOURNAL_ODOMETRY_2D, JOURNAL_ODOMETRY_3D, JOURNAL_RESUME, JournalEntry, MAX_SOURCES, Message,
    StateVector, Zero,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Outlet};

use super::read::{Damage, Item, Reader};
use super::{Entry, Head};
use crate::control::{ControlError, Controller};
use crate::daemon::{Daemon, private_instance};
use crate::model::{Estimate, Model};
use crate::read::EstimateReader;
use crate::replay::Output;

/// How long the daemon may take for the entries of one time.
const ANSWER_WITHIN: Duration = Duration::from_secs(30);
/// Inputs that are given to the daemon at a time. Each may give a few estimates, and the reader's buffer holds 1024.
const AT_A_TIME: usize = 256;
/// Samples after which what the engine keeps of them does not depend on those before: the time that a row of odometry
/// speaks for is bounded by that of the row before.
const SAMPLES_KEPT: u64 = 2;

/// What to replay.
///
/// ```
/// use inekf_client::recording::RerunOptions;
///
/// let options = RerunOptions {
///     recording: "drive.rec".into(),
///     out: "again.csv".into(),
///     covariance: true,
/// };
/// assert_ne!(options.recording, options.out);
/// ```
#[derive(Clone, Debug)]
pub struct RerunOptions {
    /// The recording.
    pub recording: PathBuf,
    /// The estimate CSV to write.
    pub out: PathBuf,
    /// Whether it has the covariance.
    pub covariance: bool,
}

/// What came of it.
///
/// ```
/// use inekf_client::recording::RerunSummary;
///
/// let summary = RerunSummary { equal: 1200, gaps: vec![(41, 3)], ..RerunSummary::default() };
/// assert_eq!(
///     summary.lines(),
///     ["1200 estimates, bit for bit equal", "missing  3 entries after entry 41"]
/// );
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RerunSummary {
    /// Entries given to the daemon.
    pub entries: u64,
    /// Estimates that were compared and found equal.
    pub equal: u64,
    /// Estimates of the replay that the recording does not have.
    pub unrecorded: u64,
    /// Entries given while nothing fixed the state: no estimate of theirs was compared.
    pub skipped: u64,
    /// Entries that are missing: index of the one before, and how many.
    pub gaps: Vec<(u64, u64)>,
    /// Bytes that could not be read.
    pub damage: Damage,
    /// Whether all was compared from the daemon's first entry on.
    pub whole: bool,
    /// Rows written.
    pub rows: usize,
    /// The first estimate that was not equal, or came too many or too few.
    pub difference: Option<String>,
}

/// Replays.
///
/// # Errors
/// The recording cannot be read, or the daemon not be started; a difference is no error here.
///
/// It is not run here, for it starts a daemon, the program `inekf-service`:
///
/// ```no_run
/// use inekf_client::recording::replay::require_equal;
/// use inekf_client::recording::{Reader, RerunOptions, rerun};
///
/// let options = RerunOptions {
///     recording: "drive.rec".into(),
///     out: "again.csv".into(),
///     covariance: true,
/// };
/// let summary = rerun(&options)?;
/// require_equal(&summary, Reader::open(&options.recording)?.head())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rerun(options: &RerunOptions) -> anyhow::Result<RerunSummary> {
    let head = Reader::open(&options.recording)?.head().clone();
    let model = Model::from_code(head.model).context("the recording is of an unknown model")?;
    let folder = tempfile::tempdir().context("making a folder for the configuration")?;
    let config = folder.path().join("recorded.toml");
    fs::write(&config, &head.config).context("writing the recorded configuration")?;
    let instance = private_instance("rerun")?;
    let daemon = Daemon::start_stepped(&config, &instance)?;
    let summary = match model {
        Model::Imu => run::<EstimateSe23>(options, &instance),
        Model::Odometry3d => run::<EstimateSe3>(options, &instance),
        Model::Odometry2d => run::<EstimateSe2>(options, &instance),
    };
    let stopped = daemon.stop();
    let summary = summary?;
    stopped?;
    Ok(summary)
}

fn run<E: Estimate>(options: &RerunOptions, instance: &Instance) -> anyhow::Result<RerunSummary> {
    let mut rerun = Rerun::<E> {
        daemon: Stepped::open(instance)?,
        recorded: Recorded::open(options)?,
        output: Output::new(&options.out, options.covariance)?,
        summary: RerunSummary::default(),
        trust: Trust::Nothing { samples: 0 },
    };
    let mut entries = Reader::open(&options.recording)?;
    let mut waiting = Vec::with_capacity(AT_A_TIME);
    let mut next = None;
    while let Some(item) = entries.next_item::<E>().context("reading the recording")? {
        let Item::Entry(entry) = item else { continue };
        match next {
            None if entry.index == 0 => {
                rerun.trust = Trust::Everything;
                rerun.summary.whole = true;
            }
            None => {}
            Some(expected) if entry.index == expected => {}
            Some(expected) if entry.index > expected => {
                rerun.take(&mut waiting)?;
                let gap = (expected - 1, entry.index - expected);
                rerun.summary.gaps.push(gap);
                rerun.trust = Trust::Nothing { samples: 0 };
            }
            Some(_) => bail!("the recording is of more than one life of a daemon"),
        }
        next = Some(entry.index + 1);
        if is_alone(&entry) {
            rerun.take(&mut waiting)?;
            waiting.push(entry);
            rerun.take(&mut waiting)?;
        } else {
            waiting.push(entry);
            if waiting.len() == AT_A_TIME {
                rerun.take(&mut waiting)?;
            }
        }
        if rerun.summary.difference.is_some() {
            break;
        }
    }
    rerun.take(&mut waiting)?;
    let mut summary = rerun.summary;
    summary.damage = entries.damage();
    summary.rows = rerun.output.finish()?;
    Ok(summary)
}

/// Whether an entry is given to the daemon by a request of its own, because the answer counts.
fn is_alone(entry: &Entry) -> bool {
    matches!(entry.kind, JOURNAL_CONTROL | JOURNAL_RESUME)
}

/// A replay under way.
struct Rerun<E: Estimate> {
    daemon: Stepped<E>,
    recorded: Recorded<E>,
    output: Output<E>,
    summary: RerunSummary,
    trust: Trust,
}

impl<E: Estimate> Rerun<E> {
    /// Gives the daemon the entries, which are inputs or one that is alone, and compares what comes of them. Does nothing
    /// once a difference has been found.
    fn take(&mut self, entries: &mut Vec<Entry>) -> anyhow::Result<()> {
        let taken = core::mem::take(entries);
        let Some(last) = taken.last().filter(|_| self.summary.difference.is_none()) else {
            return Ok(());
        };
        self.summary.entries += taken.len() as u64;
        let (estimates, done) = self.daemon.take(&taken)?;
        let was = self.trust;
        for entry in &taken {
            self.trust = self.trust.after(entry, done, self.daemon.published);
        }
        if !was.compares() {
            self.summary.skipped += taken.len() as u64;
            return Ok(());
        }
        for estimate in &estimates {
            self.output.take(estimate)?;
            self.summary.difference = self.compare(estimate, &taken)?;
            if self.summary.difference.is_some() {
                return Ok(());
            }
        }
        let published = self.trust.recorded_seq(self.daemon.published);
        if published != last.estimates {
            self.summary.difference = Some(format!(
                "after entry {} there were {} estimates, now there are {published}",
                last.index, last.estimates,
            ));
        }
        Ok(())
    }

    /// What is different about an estimate that came of some of these entries.
    fn compare(&mut self, estimate: &E, entries: &[Entry]) -> anyhow::Result<Option<String>> {
        let trust = self.trust;
        let seq = trust.recorded_seq(estimate.head().estimate_seq);
        let Some(theirs) = self.recorded.find(seq)? else {
            self.summary.unrecorded += 1;
            return Ok(None);
        };
        let (was, is) = (trust.comparable(&theirs), trust.comparable(estimate));
        if was == is {
            self.summary.equal += 1;
            return Ok(None);
        }
        // Entries say how many estimates there had been when they were done with.
        let of = entries.iter().find(|entry| entry.estimates >= seq);
        Ok(Some(format!(
            "the estimate {seq} differs, at {} ns, after entry {}: {}",
            theirs.head().stamp_ns,
            of.or(entries.last()).map_or(0, |entry| entry.index),
            where_apart(&was, &is),
        )))
    }
}

/// How far what is known determines the estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trust {
    /// Nothing has fixed the state since the beginning or the last gap, and so many samples have come.
    Nothing { samples: u64 },
    /// The state and all that follows; the recorded number of an estimate is its own plus `ahead`.
    State { ahead: i128 },
    /// Every byte.
    Everything,
}

impl Trust {
    fn compares(self) -> bool {
        !matches!(self, Self::Nothing { .. })
    }

    /// What is known after an entry, which was `done` or refused; `published` estimates have come of all so far.
    fn after(self, entry: &Entry, done: bool, published: u64) -> Self {
        let Self::Nothing { samples } = self else {
            return self;
        };
        let fixed = Self::State {
            ahead: i128::from(entry.estimates) - i128::from(published),
        };
        let samples = match entry.kind {
            JOURNAL_IMU | JOURNAL_ODOMETRY_2D | JOURNAL_ODOMETRY_3D => samples + 1,
            _ => samples,
        };
        match request_of(entry).map(|request| request.kind) {
            Some(CONTROL_RESET) => fixed,
            Some(CONTROL_SET_STATE) if done && samples >= SAMPLES_KEPT => fixed,
            _ => Self::Nothing { samples },
        }
    }

    /// The number of an estimate in the recording.
    fn recorded_seq(self, seq: u64) -> u64 {
        match self {
            Self::State { ahead } => u64::try_from(i128::from(seq) + ahead).unwrap_or(u64::MAX),
            Self::Nothing { .. } | Self::Everything => seq,
        }
    }

    /// The bytes of an estimate that are determined.
    fn comparable<E: Estimate>(self, estimate: &E) -> Vec<u8> {
        let mut known = *estimate;
        let head = known.head_mut();
        (head.received_ns, head.published_ns) = (0, 0);
        if let Self::State { .. } = self {
            (head.estimate_seq, head.reset_count, head.reset_jump_m) = (0, 0, 0.0);
            head.flags &= !(ESTIMATE_RESET | ESTIMATE_RESUMED);
            head.counters = Counters::ZERO;
            head.nis = [0.0; MAX_SOURCES];
        }
        known.as_bytes().to_vec()
    }
}

/// The request that an entry is.
fn request_of(entry: &Entry) -> Option<ControlRequest> {
    (entry.kind == JOURNAL_CONTROL)
        .then(|| ControlRequest::from_bytes(&entry.message))
        .flatten()
}

/// Where two estimates begin to differ.
fn where_apart(recorded: &[u8], now: &[u8]) -> String {
    let at = recorded
        .iter()
        .zip(now)
        .position(|(one, other)| one != other);
    let at = at.unwrap_or_default() / 8 * 8;
    let word = |bytes: &[u8]| -> u64 {
        let bytes = bytes
            .get(at..at + 8)
            .and_then(|bytes| bytes.try_into().ok());
        bytes.map_or(0, u64::from_le_bytes)
    };
    format!(
        "at byte {at} there was {:016x}, now there is {:016x}",
        word(recorded),
        word(now)
    )
}

/// A daemon that is fed entry by entry.
struct Stepped<E: Estimate> {
    controller: Controller,
    reader: EstimateReader<E>,
    entries: Outlet<JournalEntry>,
    /// The number of its last estimate.
    published: u64,
    _node: Node,
}

impl<E: Estimate> Stepped<E> {
    fn open(instance: &Instance) -> anyhow::Result<Self> {
        let reader = EstimateReader::open(instance)?;
        let mut controller = Controller::open(instance, ANSWER_WITHIN)?;
        let node = transport::open_node("inekf-rerun")?;
        let entries = Outlet::new(transport::journal(&node, instance)?.publisher()?, 1);
        controller.barrier()?;
        Ok(Self {
            controller,
            reader,
            entries,
            published: 0,
            _node: node,
        })
    }

    /// Gives the daemon inputs, or one entry that is alone. What came of them, and whether it was not refused.
    fn take(&mut self, entries: &[Entry]) -> anyhow::Result<(Vec<E>, bool)> {
        let done = match entries {
            [alone] if is_alone(alone) => self.ask(alone)?,
            inputs => self.give(inputs).map(|()| true)?,
        };
        let mut estimates = Vec::new();
        while let Some(estimate) = self.reader.next_estimate()? {
            self.published = estimate.head().estimate_seq;
            estimates.push(estimate);
        }
        if self.reader.missed() > 0 {
            bail!("estimates were lost: this process was held up for too long");
        }
        Ok((estimates, done))
    }

    /// Sends inputs one after the other, and waits until all have been taken.
    fn give(&mut self, inputs: &[Entry]) -> anyhow::Result<()> {
        for entry in inputs {
            let message = JournalEntry::new(entry.index, 0, entry.kind, &entry.message);
            if self.entries.send(&message)? == 0 {
                bail!("the daemon has gone: it no longer listens");
            }
            self.entries.restock();
        }
        let first = inputs.first().map_or(0, |entry| entry.index);
        self.controller
            .barrier()
            .with_context(|| format!("replaying {} entries from {first} on", inputs.len()))?;
        Ok(())
    }

    /// Hands over a request, or the state of a checkpoint, and says whether it was not refused.
    fn ask(&mut self, entry: &Entry) -> anyhow::Result<bool> {
        let answer = match request_of(entry) {
            // It was refused then.
            Some(request) if request.kind == CONTROL_TAKE => return Ok(false),
            Some(request) => self.controller.send(request),
            None => self.controller.send(as_request(entry)?),
        };
        match answer {
            Ok(_) => Ok(true),
            Err(ControlError::Refused { .. }) if entry.kind == JOURNAL_CONTROL => Ok(false),
            Err(error) => Err(error).context(format!("replaying entry {}", entry.index)),
        }
    }
}

/// The request that has the daemon begin with the state of a checkpoint.
fn as_request(entry: &Entry) -> anyhow::Result<ControlRequest> {
    let state = StateVector::from_bytes(&entry.message);
    Ok(ControlRequest {
        kind: CONTROL_TAKE,
        argument: entry.kind,
        state: state.with_context(|| format!("entry {} is no state", entry.index))?,
        ..ControlRequest::ZERO
    })
}

/// The recorded estimates, in their order.
struct Recorded<E> {
    reader: Reader,
    next: Option<E>,
}

impl<E: Estimate> Recorded<E> {
    fn open(options: &RerunOptions) -> anyhow::Result<Self> {
        Ok(Self {
            reader: Reader::open(&options.recording)?,
            next: None,
        })
    }

    /// The estimate of this number, if it is there; numbers must grow.
    fn find(&mut self, seq: u64) -> anyhow::Result<Option<E>> {
        loop {
            if let Some(next) = &self.next {
                match next.head().estimate_seq {
                    number if number == seq => return Ok(self.next.take()),
                    number if number > seq => return Ok(None),
                    _ => {}
                }
            }
            let item = self
                .reader
                .next_item::<E>()
                .context("reading the recording")?;
            match item {
                Some(Item::Estimate(estimate)) => self.next = Some(estimate),
                Some(Item::Entry(_)) => {}
                None => {
                    self.next = None;
                    return Ok(None);
                }
            }
        }
    }
}

impl RerunSummary {
    /// What there is to say about it, a line each.
    ///
    /// ```
    /// use inekf_client::recording::RerunSummary;
    ///
    /// let summary = RerunSummary {
    ///     equal: 10,
    ///     difference: Some("estimate 11 has another position".to_owned()),
    ///     ..RerunSummary::default()
    /// };
    /// assert_eq!(
    ///     summary.lines(),
    ///     ["10 estimates, bit for bit equal, then estimate 11 has another position"]
    /// );
    /// ```
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let equal = match &self.difference {
            None => format!("{} estimates, bit for bit equal", self.equal),
            Some(difference) => format!(
                "{} estimates, bit for bit equal, then {difference}",
                self.equal
            ),
        };
        lines.push(equal);
        if self.skipped > 0 {
            lines.push(format!(
                "skipped  {} entries up to one that fixes the state; since then all is compared but numbers and counters",
                self.skipped
            ));
        }
        for (after, count) in &self.gaps {
            lines.push(format!("missing  {count} entries after entry {after}"));
        }
        if self.unrecorded > 0 {
            let count = self.unrecorded;
            lines.push(format!("missing  {count} estimates in the recording"));
        }
        let Damage {
            places,
            bytes,
            torn,
        } = self.damage;
        if places > 0 {
            lines.push(format!("damaged  {bytes} bytes in {places} places"));
        }
        if torn > 0 {
            lines.push(format!("torn     {torn} bytes at the end"));
        }
        lines
    }
}

/// Whether the recording could be compared at all, and was equal.
///
/// # Errors
/// One line that says why not.
///
/// ```
/// use inekf_client::recording::replay::require_equal;
/// use inekf_client::recording::{Head, RECORDING_VERSION, RerunSummary};
/// # use inekf_shared::message::MODEL_IMU;
///
/// # let head = Head {
/// #     version: RECORDING_VERSION,
/// #     model: MODEL_IMU,
/// #     instance: "car".to_owned(),
/// #     began_unix_s: 0,
/// #     config: String::new(),
/// # };
/// assert!(require_equal(&RerunSummary { equal: 5, ..RerunSummary::default() }, &head).is_ok());
/// // A comparison of nothing proves nothing.
/// let error = require_equal(&RerunSummary::default(), &head).expect_err("none was compared");
/// assert!(error.to_string().starts_with("nothing could be compared"));
/// ```
pub fn require_equal(summary: &RerunSummary, head: &Head) -> anyhow::Result<()> {
    if let Some(difference) = &summary.difference {
        bail!("the replay is not the recording: {difference}");
    }
    if summary.equal == 0 {
        bail!(
            "nothing could be compared: of the recording of instance {} no entry fixes the state, or it has no estimates",
            head.instance
        );
    }
    Ok(())
}
