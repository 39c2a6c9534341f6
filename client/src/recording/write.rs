//! The file of a recording as it grows.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use inekf_shared::codec::{self, FRAME_ENTRY, FRAME_ESTIMATE, FRAME_RECORDING};
use inekf_shared::message::{EstimateMessage, JournalEntry};
use serde::Serialize;

use super::{Entry, Head};

/// Appends frames to a new file.
#[derive(Debug)]
pub struct Writer {
    file: BufWriter<File>,
}

impl Writer {
    /// Creates the file, which must not be there: nothing that was recorded is ever overwritten.
    ///
    /// # Errors
    /// As the system says.
    pub fn create(path: &Path, head: &Head) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        let mut writer = Self {
            file: BufWriter::new(file),
        };
        writer.append(FRAME_RECORDING, head)?;
        writer.flush()?;
        Ok(writer)
    }

    /// Appends an entry of the journal.
    ///
    /// # Errors
    /// As the system says.
    pub fn entry(&mut self, entry: &JournalEntry) -> io::Result<()> {
        self.append(FRAME_ENTRY, &Entry::of(entry))
    }

    /// Appends an estimate.
    ///
    /// # Errors
    /// As the system says.
    pub fn estimate<E: EstimateMessage>(&mut self, estimate: &E) -> io::Result<()> {
        self.append(FRAME_ESTIMATE, estimate)
    }

    /// Hands what is buffered to the system.
    ///
    /// # Errors
    /// As the system says.
    pub fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }

    /// Hands everything to the disk, and ends the recording.
    ///
    /// # Errors
    /// As the system says.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        self.file.get_ref().sync_all()
    }

    fn append<T: Serialize>(&mut self, kind: u32, value: &T) -> io::Result<()> {
        let frame = codec::encode(kind, value).map_err(io::Error::other)?;
        self.file.write_all(&frame)
    }
}
