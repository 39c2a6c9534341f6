//! What there is of a recording, whatever its bytes are.
//!
//! A frame that is cut short or damaged is left out and counted, and reading goes on at the next good one. So no damage
//! changes what is read: it can only make it less, and the numbers of entries and estimates show what is missing.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use anyhow::{Context, bail};
use inekf_shared::codec::{
    self, CodecError, FRAME_ENTRY, FRAME_ESTIMATE, FRAME_HEADER_LEN, FRAME_MAGIC, FRAME_RECORDING,
};
use inekf_shared::message::EstimateMessage;

use super::{Entry, Head, RECORDING_VERSION};

/// Bytes that are read at a time.
const CHUNK: usize = 64 * 1024;
/// A frame of a recording is shorter: a head with the longest configuration.
const MAX_FRAME: usize = 2 * 1024 * 1024;

/// One frame of a recording.
///
/// ```
/// use inekf_client::recording::{Head, Item, RECORDING_VERSION, Reader, Writer};
/// use inekf_shared::message::{
///     EstimateSe2, HeadingFix, JOURNAL_HEADING, JournalEntry, MODEL_ODOMETRY_2D, Message, Zero,
/// };
///
/// # let head = Head {
/// #     version: RECORDING_VERSION,
/// #     model: MODEL_ODOMETRY_2D,
/// #     instance: "cart".to_owned(),
/// #     began_unix_s: 0,
/// #     config: String::new(),
/// # };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("drive.rec");
/// let mut writer = Writer::create(&path, &head)?;
/// writer.entry(&JournalEntry::new(0, 0, JOURNAL_HEADING, HeadingFix::ZERO.as_bytes()))?;
/// writer.estimate(&EstimateSe2::ZERO)?;
/// writer.finish()?;
/// let mut reader = Reader::open(&path)?;
/// assert!(matches!(reader.next_item::<EstimateSe2>()?, Some(Item::Entry(entry)) if entry.index == 0));
/// assert_eq!(reader.next_item()?, Some(Item::Estimate(EstimateSe2::ZERO)));
/// assert_eq!(reader.next_item::<EstimateSe2>()?, None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Item<E> {
    /// An entry of the journal.
    Entry(Entry),
    /// An estimate.
    Estimate(E),
}

/// What could not be read.
///
/// ```
/// use inekf_client::recording::read::Damage;
///
/// // Nothing is wrong with a recording of which all could be read.
/// assert_eq!(Damage::default(), Damage { places: 0, bytes: 0, torn: 0 });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Places in the middle where bytes were left out.
    pub places: u64,
    /// Bytes left out there.
    pub bytes: u64,
    /// Bytes of an unfinished frame at the end.
    pub torn: u64,
}

/// Reads a recording from front to back.
///
/// ```
/// use inekf_client::recording::{Head, RECORDING_VERSION, Reader};
/// use inekf_shared::codec::{FRAME_ENTRY, FRAME_RECORDING, encode};
/// use inekf_shared::message::{EstimateSe23, MODEL_IMU};
///
/// # let head = Head {
/// #     version: RECORDING_VERSION,
/// #     model: MODEL_IMU,
/// #     instance: "car".to_owned(),
/// #     began_unix_s: 0,
/// #     config: String::new(),
/// # };
/// // From any source: here from memory, with bytes between the head and the end that are no frame.
/// let mut bytes = encode(FRAME_RECORDING, &head)?;
/// bytes.extend([0xff; 40]);
/// let mut reader = Reader::new(&bytes[..])?;
/// assert_eq!(reader.next_item::<EstimateSe23>()?, None);
/// assert_eq!(reader.damage().torn, 40);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Reader<R = File> {
    source: R,
    /// What has been read of the source and not yet been decoded.
    buffer: Vec<u8>,
    /// Where in the buffer the next frame begins.
    at: usize,
    at_end: bool,
    head: Head,
    damage: Damage,
}

impl Reader {
    /// Opens the recording at `path`.
    ///
    /// # Errors
    /// It cannot be read, or does not begin like a recording of this version.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use inekf_client::recording::Reader;
    ///
    /// // The error names the file.
    /// let error = Reader::open(Path::new("no-such.rec")).expect_err("there is none");
    /// assert!(format!("{error:#}").starts_with("no-such.rec: "));
    /// ```
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let opened = File::open(path).map_err(anyhow::Error::from);
        opened
            .and_then(Reader::new)
            .with_context(|| path.display().to_string())
    }
}

impl<R: Read> Reader<R> {
    /// Reads a recording from `source`.
    ///
    /// # Errors
    /// As [`Reader::open`].
    ///
    /// ```
    /// use inekf_client::recording::Reader;
    ///
    /// let error = Reader::new(&b"t_ns,theta,x,y\n"[..]).expect_err("a CSV");
    /// assert!(error.to_string().contains("this is no recording"));
    /// ```
    pub fn new(source: R) -> anyhow::Result<Self> {
        let mut reader = Self {
            source,
            buffer: Vec::new(),
            at: 0,
            at_end: false,
            head: Head {
                version: 0,
                model: 0,
                instance: String::new(),
                began_unix_s: 0,
                config: String::new(),
            },
            damage: Damage::default(),
        };
        let kind = reader.kind_here()?;
        let (head, len) = kind
            .and_then(|_| codec::decode_prefix::<Head>(FRAME_RECORDING, reader.rest()))
            .context("this is no recording, or its beginning is damaged")?;
        if head.version != RECORDING_VERSION {
            bail!(
                "the recording has version {}, this program reads version {RECORDING_VERSION}",
                head.version
            );
        }
        reader.at += len;
        reader.head = head;
        Ok(reader)
    }

    /// What the recording begins with.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::{Reader, Writer};
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
    /// assert_eq!(Reader::open(&path)?.head().instance, "car");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// What could not be read so far.
    ///
    /// ```
    /// # use inekf_client::recording::{Head, RECORDING_VERSION};
    /// # use inekf_shared::message::MODEL_IMU;
    /// use inekf_client::recording::{Reader, Writer};
    /// use inekf_client::recording::read::Damage;
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
    /// let mut reader = Reader::open(&path)?;
    /// while reader.next_item::<EstimateSe23>()?.is_some() {}
    /// assert_eq!(reader.damage(), Damage::default());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn damage(&self) -> Damage {
        self.damage
    }

    /// The next frame that is good; `None` at the end. Estimates are taken to be `E`, which is the head's model.
    ///
    /// # Errors
    /// The source cannot be read.
    ///
    /// ```
    /// use inekf_client::recording::{Head, Item, RECORDING_VERSION, Reader};
    /// use inekf_shared::codec::{FRAME_ESTIMATE, FRAME_RECORDING, encode};
    /// use inekf_shared::message::{EstimateSe2, MODEL_ODOMETRY_2D, Zero};
    ///
    /// # let head = Head {
    /// #     version: RECORDING_VERSION,
    /// #     model: MODEL_ODOMETRY_2D,
    /// #     instance: "cart".to_owned(),
    /// #     began_unix_s: 0,
    /// #     config: String::new(),
    /// # };
    /// let estimate = |theta_rad| EstimateSe2 { theta_rad, ..EstimateSe2::ZERO };
    /// let mut bytes = encode(FRAME_RECORDING, &head)?;
    /// let broken_at = bytes.len() + 100;
    /// bytes.extend(encode(FRAME_ESTIMATE, &estimate(0.1))?);
    /// bytes.extend(encode(FRAME_ESTIMATE, &estimate(0.2))?);
    /// bytes[broken_at] ^= 1;
    /// // One bit flipped: the frame is left out and counted, the next one is read.
    /// let mut reader = Reader::new(&bytes[..])?;
    /// assert_eq!(reader.next_item()?, Some(Item::Estimate(estimate(0.2))));
    /// assert_eq!(reader.damage().places, 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn next_item<E: EstimateMessage>(&mut self) -> io::Result<Option<Item<E>>> {
        let mut left_out = 0;
        loop {
            if let Some((item, len)) = self.item_here()? {
                self.at += len;
                if left_out > 0 {
                    self.damage.places += 1;
                    self.damage.bytes += left_out;
                }
                return Ok(Some(item));
            }
            if self.rest().is_empty() && self.at_end {
                self.damage.torn += left_out;
                return Ok(None);
            }
            left_out += self.skip()?;
        }
    }

    /// The item that begins here, with its length, if there is one.
    fn item_here<E: EstimateMessage>(&mut self) -> io::Result<Option<(Item<E>, usize)>> {
        let Ok(kind) = self.kind_here()? else {
            return Ok(None);
        };
        let rest = self.rest();
        Ok(match kind {
            FRAME_ENTRY => codec::decode_prefix::<Entry>(kind, rest)
                .ok()
                .filter(|(entry, _)| entry.is_sound())
                .map(|(entry, len)| (Item::Entry(entry), len)),
            FRAME_ESTIMATE => codec::decode_prefix::<E>(kind, rest)
                .ok()
                .map(|(estimate, len)| (Item::Estimate(estimate), len)),
            _ => None,
        })
    }

    /// The kind of the frame that begins here, once all of it has been read.
    fn kind_here(&mut self) -> io::Result<Result<u32, CodecError>> {
        loop {
            match codec::kind(self.rest()) {
                Err(CodecError::TooShort { needed, .. }) if !self.at_end && needed <= MAX_FRAME => {
                    self.read_more()?;
                }
                // Nothing says yet whether it begins like one.
                Err(_) if self.rest().len() < FRAME_HEADER_LEN && !self.at_end => {
                    self.read_more()?;
                }
                kind => return Ok(kind),
            }
        }
    }

    /// Skips to where a frame may begin, at least one byte on; says how many bytes these are.
    fn skip(&mut self) -> io::Result<u64> {
        let mut skipped = 0;
        loop {
            let rest = self.rest();
            let from = rest.get(1..).unwrap_or_default();
            let found = from
                .windows(FRAME_MAGIC.len())
                .position(|window| window == FRAME_MAGIC);
            // The last bytes may be the beginning of one.
            let on = match found {
                Some(position) => position + 1,
                None if self.at_end => rest.len(),
                None => rest
                    .len()
                    .saturating_sub(FRAME_MAGIC.len() - 1)
                    .max(1)
                    .min(rest.len()),
            };
            self.at += on;
            skipped += on as u64;
            if found.is_some() || self.at_end {
                return Ok(skipped);
            }
            self.read_more()?;
            if self.rest().starts_with(&FRAME_MAGIC) {
                return Ok(skipped);
            }
        }
    }

    fn rest(&self) -> &[u8] {
        &self.buffer[self.at..]
    }

    fn read_more(&mut self) -> io::Result<()> {
        self.buffer.drain(..self.at);
        self.at = 0;
        let before = self.buffer.len();
        let mut part = (&mut self.source).take(CHUNK as u64);
        part.read_to_end(&mut self.buffer)?;
        self.at_end = self.buffer.len() == before;
        Ok(())
    }
}
