//! Tools that are not part of the project and may not be there: a test that needs one says that it skips.
//!
//! `INEKF_PYTHON` names the Python to use (default `python3`); `bash .ci/python` makes one that has everything and prints
//! its path. `ICEORYX2_CXX` names the folder where iceoryx2's C++
//! bindings are installed.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::process::{Ended, Running};

/// Environment variable: the Python.
pub const PYTHON: &str = "INEKF_PYTHON";
/// Environment variable: the folder of the C++ bindings.
pub const CXX_BINDINGS: &str = "ICEORYX2_CXX";

/// A Python that has these modules; `None`, and a line that says so, if there is none.
#[must_use]
pub fn python_with(modules: &[&str]) -> Option<OsString> {
    let python = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
    let import = format!("import sys, {}", [&["sys"], modules].concat().join(", "));
    if quietly(Command::new(&python).args(["-c", &import])) {
        return Some(python);
    }
    println!(
        "skipped: {} cannot import {}; export {PYTHON}=\"$(bash .ci/python)\"",
        python.display(),
        modules.join(", ")
    );
    None
}

/// A program on the path; `None`, and a line that says so, if it is not there.
#[must_use]
pub fn program(name: &str) -> Option<&str> {
    if quietly(Command::new(name).arg("--version")) {
        return Some(name);
    }
    println!("skipped: {name} is not there");
    None
}

/// The folder of the C++ bindings; `None`, and a line that says so, if it is not named.
#[must_use]
pub fn cxx_bindings() -> Option<PathBuf> {
    let named = std::env::var_os(CXX_BINDINGS).map(PathBuf::from);
    if named.is_none() {
        println!("skipped: {CXX_BINDINGS} does not name where iceoryx2's C++ bindings are");
    }
    named
}

/// Longest time for a tool: they are large, and the machine may be busy.
const PATIENCE: Duration = Duration::from_secs(300);

/// Waits for the end of a tool, longer than for a program of the project.
///
/// # Panics
/// If it takes longer than five minutes.
pub fn finish(mut running: Running) -> Ended {
    let started = Instant::now();
    while running.is_running() {
        let late = started.elapsed() > PATIENCE;
        assert!(!late, "it does not end: {running:?}, {}", running.stderr());
        sleep(Duration::from_millis(20));
    }
    running.wait()
}

/// Whether it can be started and succeeds.
fn quietly(command: &mut Command) -> bool {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}
