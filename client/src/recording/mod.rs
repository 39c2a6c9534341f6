//! Recordings: everything that a daemon took, in its order, and every estimate that came of it.
//!
//! A recording is one file of frames ([`inekf_shared::codec`]: magic, version, length, CRC), written from front to back
//! and never changed: first a [`Head`] with the text of the configuration, then the entries of the journal and the
//! estimates, each in their own order. If its writer is killed or the disk is full, all but the last frame is good.
//!
//! * [`mod@write`]: the file as it grows; [`read`]: what there is of it, whatever its bytes are
//! * [`estimates`]: its estimates as a table
//! * [`mod@record`]: from a running daemon to a file; [`replay`]: from a file through a daemon of its own, and the comparison
//!
//! ```
//! use inekf_client::recording::estimates::{is_recording, read_estimates};
//! use inekf_client::recording::{Head, RECORDING_VERSION, Writer};
//! use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23, MODEL_IMU, Zero};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("drive.rec");
//! let head = Head {
//!     version: RECORDING_VERSION,
//!     model: MODEL_IMU,
//!     instance: "car".to_owned(),
//!     began_unix_s: 0,
//!     config: "model = 'imu'".to_owned(),
//! };
//! let mut writer = Writer::create(&path, &head)?;
//! let mut estimate = EstimateSe23::ZERO;
//! (estimate.head.stamp_ns, estimate.head.flags, estimate.head.dimension) = (10, ESTIMATE_PROPAGATED, 15);
//! writer.estimate(&estimate)?;
//! writer.finish()?;
//!
//! assert!(is_recording(&path)?);
//! assert_eq!(read_estimates(&path)?.table.rows[0].stamp_ns, 10);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod estimates;
pub mod read;
pub mod record;
pub mod replay;
pub mod write;

use inekf_shared::message::{JOURNAL_PAYLOAD_LEN, JournalEntry};
use serde::{Deserialize, Serialize};

pub use read::{Item, Reader};
pub use record::{RecordOptions, RecordSummary, record};
pub use replay::{RerunOptions, RerunSummary, rerun};
pub use write::Writer;

/// Version of what is in the frames.
pub const RECORDING_VERSION: u32 = 2;

/// What a recording begins with.
///
/// ```
/// use inekf_client::recording::{Head, RECORDING_VERSION, Reader, Writer};
/// use inekf_shared::message::MODEL_IMU;
///
/// let head = Head {
///     version: RECORDING_VERSION,
///     model: MODEL_IMU,
///     instance: "car".to_owned(),
///     began_unix_s: 1_700_000_000,
///     config: "model = 'imu'".to_owned(),
/// };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("drive.rec");
/// Writer::create(&path, &head)?.finish()?;
/// // All that is needed to replay is in the file.
/// assert_eq!(Reader::open(&path)?.head(), &head);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Head {
    /// [`RECORDING_VERSION`].
    pub version: u32,
    /// `MODEL_*` code: the type of the estimates.
    pub model: u32,
    /// Name of the instance that was recorded.
    pub instance: String,
    /// When the recording began, seconds since 1970-01-01 UTC.
    pub began_unix_s: u64,
    /// The text of the daemon's configuration.
    pub config: String,
}

/// An entry of the journal without the bytes that its message does not use.
///
/// ```
/// use inekf_client::recording::Entry;
/// use inekf_shared::message::{ImuSample, JOURNAL_IMU, JournalEntry, Message};
///
/// let sample = ImuSample { gyro_rps: [0.1, 0.0, 0.0], ..ImuSample::default() };
/// let entry = Entry::of(&JournalEntry::new(7, 12, JOURNAL_IMU, sample.as_bytes()));
/// // On the topic it has room for the longest message, on disk it has what it uses.
/// assert_eq!(entry.message.len(), size_of::<ImuSample>());
/// assert_eq!(ImuSample::from_bytes(&entry.message), Some(sample));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// Counts the entries of one daemon, from 0.
    pub index: u64,
    /// How many estimates had been published when it was done with.
    pub estimates: u64,
    /// `JOURNAL_*` kind.
    pub kind: u32,
    /// The bytes of the message.
    pub message: Vec<u8>,
}

impl Entry {
    /// What is kept of an entry.
    ///
    /// ```
    /// use inekf_client::recording::Entry;
    /// use inekf_shared::message::{JOURNAL_SETTLE, JournalEntry};
    ///
    /// let entry = Entry::of(&JournalEntry::new(3, 5, JOURNAL_SETTLE, &[]));
    /// assert_eq!((entry.index, entry.estimates, entry.message.len()), (3, 5, 0));
    /// ```
    pub fn of(entry: &JournalEntry) -> Self {
        Self {
            index: entry.index,
            estimates: entry.estimates,
            kind: entry.kind,
            message: entry.message().to_vec(),
        }
    }

    /// Whether it is one that a daemon could have published.
    ///
    /// ```
    /// use inekf_client::recording::Entry;
    /// use inekf_shared::message::{JOURNAL_IMU, JOURNAL_PAYLOAD_LEN};
    ///
    /// let entry = |len| Entry { index: 0, estimates: 0, kind: JOURNAL_IMU, message: vec![0; len] };
    /// assert!(entry(80).is_sound() && !entry(JOURNAL_PAYLOAD_LEN + 1).is_sound());
    /// ```
    pub fn is_sound(&self) -> bool {
        self.message.len() <= JOURNAL_PAYLOAD_LEN
    }
}
