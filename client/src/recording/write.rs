//! The file of a recording as it grows.
//!
//! Frames are gathered and handed to the system whole. If the disk refuses (it is full, or has become read-only) the
//! file is cut back to its last whole frame, and what was gathered is kept, up to a limit, for the next try: a disk that
//! has room again in time costs nothing, one that has not costs frames, which are counted. The numbers of entries and
//! estimates then show the gap.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use inekf_shared::codec::{self, FRAME_ENTRY, FRAME_ESTIMATE, FRAME_RECORDING};
use inekf_shared::message::{EstimateMessage, JournalEntry};
use serde::Serialize;

use super::{Entry, Head};

/// So much is gathered before it is handed to the system without being asked, bytes.
const GATHERED: usize = 64 * 1024;
/// So much is kept while the disk refuses, bytes: some ten seconds at 500 samples a second.
const KEPT: usize = 8 * 1024 * 1024;

/// Appends frames to a new file.
///
/// ```
/// use inekf_client::recording::{Head, RECORDING_VERSION, Reader, Writer};
/// use inekf_shared::message::{EstimateSe23, MODEL_IMU, Zero};
///
/// # let head = Head {
/// #     version: RECORDING_VERSION,
/// #     model: MODEL_IMU,
/// #     instance: "car".to_owned(),
/// #     began_unix_s: 0,
/// #     config: String::new(),
/// # };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("drive.rec");
/// let mut writer = Writer::create(&path, &head)?;
/// writer.estimate(&EstimateSe23::ZERO)?;
/// // Flushed, it can be read while the recording goes on.
/// writer.flush()?;
/// assert!(Reader::open(&path)?.next_item::<EstimateSe23>()?.is_some());
/// assert_eq!(writer.given_up(), 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Writer {
    file: File,
    /// Bytes of the file that are whole frames.
    written: u64,
    /// Whole frames that are not in the file yet.
    gathered: Vec<u8>,
    /// Frames that were given up.
    given_up: u64,
    /// Whether the last try failed.
    fails: bool,
}

impl Writer {
    /// Creates the file, which must not be there: nothing that was recorded is ever overwritten.
    ///
    /// # Errors
    /// As the system says; there is then no file.
    ///
    /// ```
    /// use std::io::ErrorKind;
    ///
    /// use inekf_client::recording::{Head, RECORDING_VERSION, Writer};
    /// # use inekf_shared::message::MODEL_IMU;
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_IMU,
    /// #     instance: "car".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("drive.rec");
    /// Writer::create(&path, &head)?.finish()?;
    /// // Nothing that was recorded is ever overwritten.
    /// let refused = Writer::create(&path, &head).expect_err("it is there");
    /// assert_eq!(refused.kind(), ErrorKind::AlreadyExists);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn create(path: &Path, head: &Head) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        let mut writer = Self {
            file,
            written: 0,
            gathered: Vec::new(),
            given_up: 0,
            fails: false,
        };
        let begun = writer
            .append(FRAME_RECORDING, head)
            .and_then(|()| writer.flush());
        if let Err(error) = begun {
            // Half a head is in the way of the next try, and nothing else.
            let _ = fs::remove_file(path);
            return Err(error);
        }
        Ok(writer)
    }

    /// Appends an entry of the journal. What the disk refuses is kept or counted; [`Writer::flush`] says so.
    ///
    /// # Errors
    /// It cannot be encoded.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::{Item, Reader, Writer};
    /// use inekf_shared::message::{EstimateSe23, JournalEntry, Zero};
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_IMU,
    /// #     instance: "car".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("drive.rec");
    /// let mut writer = Writer::create(&path, &head)?;
    /// writer.entry(&JournalEntry::ZERO)?;
    /// writer.finish()?;
    /// let mut reader = Reader::open(&path)?;
    /// assert!(matches!(reader.next_item::<EstimateSe23>()?, Some(Item::Entry(_))));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn entry(&mut self, entry: &JournalEntry) -> io::Result<()> {
        self.append(FRAME_ENTRY, &Entry::of(entry))
    }

    /// Appends an estimate, in the same way.
    ///
    /// # Errors
    /// It cannot be encoded.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::{Item, Reader, Writer};
    /// use inekf_shared::message::{EstimateSe23, Zero};
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_IMU,
    /// #     instance: "car".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("drive.rec");
    /// let mut writer = Writer::create(&path, &head)?;
    /// let mut estimate = EstimateSe23::ZERO;
    /// estimate.head.stamp_ns = 5;
    /// writer.estimate(&estimate)?;
    /// writer.finish()?;
    /// let Some(Item::Estimate(read)) = Reader::open(&path)?.next_item::<EstimateSe23>()? else { panic!("an estimate") };
    /// assert_eq!(read, estimate);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn estimate<E: EstimateMessage>(&mut self, estimate: &E) -> io::Result<()> {
        self.append(FRAME_ESTIMATE, estimate)
    }

    /// Hands what was gathered to the system.
    ///
    /// # Errors
    /// As the system says; what was gathered is kept, and the file ends with a whole frame.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::Writer;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_IMU,
    /// #     instance: "car".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("drive.rec");
    /// let mut writer = Writer::create(&path, &head)?;
    /// writer.estimate(&EstimateSe23::ZERO)?;
    /// // Gathered until then: many frames are one write.
    /// let before = std::fs::metadata(&path)?.len();
    /// writer.flush()?;
    /// assert!(std::fs::metadata(&path)?.len() > before);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn flush(&mut self) -> io::Result<()> {
        let written = self.file.write_all(&self.gathered);
        self.fails = written.is_err();
        if let Err(error) = written {
            self.written = match self.file.set_len(self.written) {
                Ok(()) => self.file.seek(SeekFrom::Start(self.written))?,
                // What cannot be cut off is read as damage, and costs no other frame.
                Err(_) => self.file.stream_position()?,
            };
            return Err(error);
        }
        self.written += self.gathered.len() as u64;
        self.gathered.clear();
        Ok(())
    }

    /// Frames that were given up because the disk refused for too long.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::Writer;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_IMU,
    /// #     instance: "car".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("drive.rec");
    /// let mut writer = Writer::create(&path, &head)?;
    /// // A disk that takes everything costs nothing.
    /// writer.estimate(&EstimateSe23::ZERO)?;
    /// writer.flush()?;
    /// assert_eq!(writer.given_up(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn given_up(&self) -> u64 {
        self.given_up
    }

    /// Hands everything to the disk, and ends the recording.
    ///
    /// # Errors
    /// As the system says.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::{Reader, Writer};
    /// use inekf_shared::message::EstimateSe23;
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_IMU,
    /// #     instance: "car".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("drive.rec");
    /// let mut writer = Writer::create(&path, &head)?;
    /// writer.finish()?;
    /// // A recording of nothing is one.
    /// assert!(Reader::open(&path)?.next_item::<EstimateSe23>()?.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        self.file.sync_all()
    }

    fn append<T: Serialize>(&mut self, kind: u32, value: &T) -> io::Result<()> {
        let frame = codec::encode(kind, value).map_err(io::Error::other)?;
        if self.gathered.len() + frame.len() > KEPT {
            self.given_up += 1;
            return Ok(());
        }
        self.gathered.extend_from_slice(&frame);
        if self.gathered.len() >= GATHERED && !self.fails {
            // Said by the next flush, which is soon.
            let _ = self.flush();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RECORDING_VERSION;

    /// A writer on a device that is always full.
    #[test]
    fn what_a_full_disk_refuses_is_kept_up_to_a_limit_and_then_counted() {
        let file = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut writer = Writer {
            file,
            written: 0,
            gathered: Vec::new(),
            given_up: 0,
            fails: false,
        };
        let head = Head {
            version: RECORDING_VERSION,
            model: 1,
            instance: "car".to_owned(),
            began_unix_s: 0,
            config: "x".repeat(1 << 20),
        };
        for _ in 0..7 {
            writer.append(FRAME_RECORDING, &head).unwrap();
            assert!(writer.flush().is_err());
        }
        assert_eq!((writer.written, writer.given_up()), (0, 0));
        assert!(writer.gathered.len() > 7 << 20);
        writer.append(FRAME_RECORDING, &head).unwrap();
        writer.append(FRAME_RECORDING, &head).unwrap();
        assert_eq!(writer.given_up(), 2);
        assert!(writer.gathered.len() <= KEPT);
        assert!(writer.finish().is_err());
    }
}
