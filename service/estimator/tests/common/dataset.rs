//! Dataset folders, found through `INEKF_DATASETS`.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a set, or nothing, with a word about it, if the data are not here.
pub fn folder(set: &str) -> Option<PathBuf> {
    let root = std::env::var_os("INEKF_DATASETS");
    if root.is_none() {
        println!("{set} skipped: INEKF_DATASETS is not set");
    }
    root.map(|root| Path::new(&root).join(set))
}

/// The rows of a CSV file as numbers, in the order of `names`; an empty cell is not a number.
pub fn table<const C: usize>(path: &Path, names: [&str; C]) -> Vec<[f64; C]> {
    let text = fs::read_to_string(path).expect("a file of the set");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let indices = names.map(|name| {
        header
            .iter()
            .position(|cell| *cell == name)
            .expect("a column")
    });
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        indices.map(|index| cells[index].parse().unwrap_or(f64::NAN))
    };
    lines.map(row).collect()
}
