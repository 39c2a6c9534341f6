//! Other people's recordings as dataset folders: `inekf-client import`.
//!
//! [`euroc`] takes a folder of the EuRoC MAV benchmark whole; [`tum`] takes a trajectory of the TUM benchmark as the truth
//! of a folder. Stamps are kept as they are; files whose stamps do not increase are refused, with the line.

pub mod euroc;
mod lines;
pub mod tum;

use std::io;
use std::path::PathBuf;

use crate::dataset::DatasetError;

/// A recording could not be imported. `Display` is one line.
///
/// ```
/// use inekf_client::import::{ImportError, tum};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("poses.txt");
/// std::fs::write(&path, "0.5 1 2 3 0 0 0 1\n0.5 1 2 3 0 0 0 1\n")?;
/// // Stamps that do not increase are refused, with the line.
/// assert!(matches!(tum::read(&path), Err(ImportError::Line { line: 2, .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// A file cannot be read.
    #[error("{}: {cause}{}", path.display(), hint(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// A line does not hold what it should.
    #[error("{} line {line}: {problem}; {remedy}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: String,
    },
    /// There is nothing in the file.
    #[error("{} holds no rows", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The dataset folder could not be written.
    #[error("{0}")]
    Save(#[from] DatasetError),
}

/// Where the folder of a recording is looked for.
fn hint(path: &std::path::Path) -> &'static str {
    if path.ends_with("imu0/data.csv") {
        "; name the folder that holds mav0"
    } else {
        ""
    }
}
