//! Dataset folders and configurations, to be changed at will: always a copy, never the original.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use inekf_client::dataset::{Dataset, LoadOptions, PositionRow};
use tempfile::TempDir;

/// The recording called `name`, below the folder that `INEKF_DATASETS` names. Without the variable it says that the
/// test is skipped, and there is none.
pub fn recording(name: &str) -> Option<PathBuf> {
    let Some(root) = env::var_os("INEKF_DATASETS") else {
        println!("skipped: INEKF_DATASETS does not say where {name} is");
        return None;
    };
    let folder = Path::new(&root).join(name);
    assert!(folder.is_dir(), "{} is no folder", folder.display());
    Some(folder)
}

/// A dataset folder of a test's own.
#[derive(Debug)]
pub struct Folder(TempDir);

impl Default for Folder {
    fn default() -> Self {
        Self::new()
    }
}

impl Folder {
    /// An empty folder.
    pub fn new() -> Self {
        Self(TempDir::new().expect("a folder"))
    }

    /// A folder with this dataset.
    pub fn of(dataset: &Dataset) -> Self {
        let folder = Self::new();
        dataset.save(folder.path()).expect("the dataset is saved");
        folder
    }

    /// A folder with these files of another.
    pub fn with_files(from: &Path, files: &[&str]) -> Self {
        let folder = Self::new();
        for file in files {
            folder.take(from, file, file);
        }
        folder
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// Copies the file `name` of another folder, under the name `here`.
    pub fn take(&self, from: &Path, name: &str, here: &str) {
        let source = from.join(name);
        fs::copy(&source, self.file(here))
            .unwrap_or_else(|error| panic!("{}: {error}", source.display()));
    }

    /// The text of a file.
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.file(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.file(name), text).unwrap_or_else(|error| panic!("{name}: {error}"));
    }

    /// Replaces a line, counted from 1, by what `edit` makes of it.
    pub fn edit_line(&self, name: &str, line: usize, edit: impl Fn(&str) -> String) {
        let text = self.read(name);
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines[line - 1] = edit(&lines[line - 1]);
        self.write(name, &(lines.join("\n") + "\n"));
    }

    /// Keeps the header of a table and every n-th row, from the first.
    pub fn thin(&self, name: &str, every: usize) {
        let text = self.read(name);
        let kept = |line: &(usize, &str)| line.0 == 0 || (line.0 - 1).is_multiple_of(every);
        let lines: Vec<&str> = text
            .lines()
            .enumerate()
            .filter(kept)
            .map(|(_, line)| line)
            .collect();
        self.write(name, &(lines.join("\n") + "\n"));
    }
}

/// The position fixes of a folder.
pub fn fixes(folder: &Path, file: &str) -> Vec<PositionRow> {
    let options = LoadOptions {
        position_file: file.to_owned(),
        ..LoadOptions::default()
    };
    let dataset = Dataset::load_with(folder, &options).unwrap_or_else(|error| panic!("{error}"));
    dataset.position
}

/// The configuration with another initial heading and standard deviation, deg: its two lines replaced.
pub fn with_heading(config: &str, heading_deg: f64, sigma_deg: f64) -> String {
    let config = replace_line(config, "heading_deg", heading_deg);
    replace_line(&config, "heading_sigma_deg", sigma_deg)
}

/// The initial heading of a configuration, deg.
pub fn heading_of(config: &str) -> f64 {
    let start = "heading_deg = ";
    let line = config.lines().find_map(|line| line.strip_prefix(start));
    let value = line.expect("a line with heading_deg");
    let number = value.split('#').next().expect("a value").trim();
    number.parse().expect("a number")
}

/// Replaces the value of the one line `key = ...`.
fn replace_line(config: &str, key: &str, value: f64) -> String {
    let start = format!("{key} = ");
    let count = config
        .lines()
        .filter(|line| line.starts_with(&start))
        .count();
    assert_eq!(count, 1, "the configuration has {count} lines `{start}...`");
    let replace = |line: &str| match line.starts_with(&start) {
        true => format!("{start}{value:?}\n"),
        false => format!("{line}\n"),
    };
    config.lines().map(replace).collect()
}
