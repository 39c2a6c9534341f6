//! The CSV of smoothed states: `inekf-client replay --smoothed`.
//!
//! Columns as in the estimate CSV; one row for each moment at which the smoother had a fix, in the order of time: the
//! states that have left the window, and those that are in it at the end. Of several states of one moment the last is
//! the row, for it has seen them all. With covariance, that of each state given all fixes, before and after.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use inekf_shared::message::SmoothedState;
use inekf_shared::topic::Instance;

use crate::control::Controller;
use crate::read::SmoothedReader;
use crate::table::estimate::{Layout, triangle_len};
use crate::table::{EstimateState, EstimateWriter};

/// The mean, as in the estimate CSV.
pub fn state(state: &SmoothedState) -> EstimateState {
    EstimateState::Navigation {
        q_wb: state.q_wb,
        v_w_mps: state.v_w_mps,
        p_w_m: state.p_w_m,
        gyro_bias_rps: state.gyro_bias_rps,
        accel_bias_mps2: state.accel_bias_mps2,
    }
}

/// The smoothed CSV under construction.
pub struct SmoothedOutput {
    path: PathBuf,
    reader: SmoothedReader,
    covariance: bool,
    /// Until the first state says how large the covariance is.
    file: Option<File>,
    writer: Option<EstimateWriter<BufWriter<File>>>,
    /// The row that the next state of its moment replaces.
    current: Option<SmoothedState>,
    rows: usize,
}

impl SmoothedOutput {
    /// Reads from the daemon of `instance` from now on, and writes to `path`, the covariances too if `covariance` says so.
    ///
    /// # Errors
    /// The topic cannot be opened, or the file not be created.
    pub fn new(instance: &Instance, path: &Path, covariance: bool) -> anyhow::Result<Self> {
        let file = File::create(path).with_context(|| format!("creating {}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            reader: SmoothedReader::open(instance)?,
            covariance,
            file: Some(file),
            writer: None,
            current: None,
            rows: 0,
        })
    }

    /// Takes the states that have left the window. Never waits.
    ///
    /// # Errors
    /// A state was lost, or the file cannot be written.
    pub fn take_left(&mut self) -> anyhow::Result<()> {
        while let Some(state) = self.reader.next_state()? {
            if state.request_id == 0 {
                self.take(state)?;
            }
        }
        self.require_all()
    }

    /// Takes what has left the window and, on request, what is still in it; returns the number of rows.
    ///
    /// # Errors
    /// As [`take_left`](Self::take_left), or the daemon has no smoother.
    pub fn finish(mut self, controller: &mut Controller) -> anyhow::Result<usize> {
        self.take_left()?;
        let answer = controller.smoothed()?;
        let mut taken = 0;
        while let Some(state) = self.reader.next_state()? {
            if state.request_id == 0 || state.request_id == answer.request_id {
                taken += u64::from(state.request_id != 0);
                self.take(state)?;
            }
        }
        self.require_all()?;
        if taken != answer.smoothed {
            bail!("{taken} of {} states of the window came", answer.smoothed);
        }
        if let Some(last) = self.current.take() {
            self.write(&last)?;
        }
        let context = || format!("writing {}", self.path.display());
        if let Some(file) = self.file.take() {
            self.writer = Some(header(file, None).with_context(context)?);
        }
        if let Some(writer) = self.writer {
            writer.finish().with_context(context)?;
        }
        Ok(self.rows)
    }

    fn take(&mut self, state: SmoothedState) -> anyhow::Result<()> {
        match self.current.replace(state) {
            Some(complete) if complete.stamp_ns != state.stamp_ns => self.write(&complete),
            _ => Ok(()),
        }
    }

    fn write(&mut self, row: &SmoothedState) -> anyhow::Result<()> {
        let context = || format!("writing {}", self.path.display());
        let dimension = self.covariance.then_some(row.dimension as usize);
        if let Some(file) = self.file.take() {
            self.writer = Some(header(file, dimension).with_context(context)?);
        }
        let entries = dimension.map_or(0, triangle_len).min(row.covariance.len());
        self.rows += 1;
        match &mut self.writer {
            Some(writer) => writer
                .write(row.stamp_ns, &state(row), &row.covariance[..entries])
                .with_context(context),
            None => Ok(()),
        }
    }

    fn require_all(&self) -> anyhow::Result<()> {
        if self.reader.missed() > 0 {
            bail!(
                "{} smoothed states were lost: this process was held up for too long",
                self.reader.missed()
            );
        }
        Ok(())
    }
}

/// The table with its first line.
fn header(file: File, dimension: Option<usize>) -> io::Result<EstimateWriter<BufWriter<File>>> {
    EstimateWriter::new(BufWriter::new(file), Layout::Navigation, dimension)
}
