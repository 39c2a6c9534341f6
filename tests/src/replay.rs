//! The real `inekf-client replay` with a daemon of its own.

use std::ffi::OsString;
use std::fs;
use std::path::Path;

use inekf_client::table::EstimateRow;
use tempfile::TempDir;

use crate::memory::Memory;
use crate::process::{Ended, client, config_file};
use crate::score::estimates;

/// What a replay gave.
#[derive(Debug)]
pub struct Replayed {
    /// The estimate CSV.
    pub csv: Vec<u8>,
    /// Its rows.
    pub rows: Vec<EstimateRow>,
    /// What the client said.
    pub ended: Ended,
}

/// Replays `folder` with a daemon of this configuration, as fast as it goes, in shared memory of its own, of which
/// nothing may be left. `more` are further arguments.
pub fn replay(folder: &Path, config: &str, more: &[&str]) -> Replayed {
    let memory = Memory::new();
    let replayed = replay_in(&memory, folder, config, more);
    memory.assert_nothing_left();
    replayed
}

/// The same with the smoothed states too: what the replay gave, the bytes of their CSV, and its rows.
pub fn replay_smoothed(
    folder: &Path,
    config: &str,
    more: &[&str],
) -> (Replayed, Vec<u8>, Vec<EstimateRow>) {
    let output = TempDir::new().expect("a folder for the output");
    let smoothed = output.path().join("smoothed.csv");
    let path = smoothed.to_str().expect("a path of text");
    let replayed = replay(folder, config, &[&["--smoothed", path], more].concat());
    let csv = fs::read(&smoothed).expect("the smoothed CSV");
    (replayed, csv, estimates(&smoothed))
}

/// The same in shared memory that is there already.
pub fn replay_in(memory: &Memory, folder: &Path, config: &str, more: &[&str]) -> Replayed {
    let (_config, config) = config_file(config);
    let output = TempDir::new().expect("a folder for the output");
    let out = output.path().join("estimate.csv");
    let mut arguments: Vec<OsString> = vec!["replay".into(), folder.into()];
    arguments.extend([
        "--config".into(),
        config.into(),
        "--out".into(),
        out.clone().into(),
    ]);
    arguments.extend(more.iter().map(OsString::from));
    let ended = client(memory, arguments).succeeded();
    Replayed {
        csv: fs::read(&out).expect("the estimate CSV"),
        rows: estimates(&out),
        ended,
    }
}
