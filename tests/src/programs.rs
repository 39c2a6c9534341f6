//! The daemon's and the client's programs, as they are in the working tree.
//!
//! Cargo builds the programs of a package for that package's own tests only, so the harness asks for them itself, once
//! in each test program. Where nothing has changed that costs a fraction of a second.

use std::env;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;

/// Files of the programs, which lie side by side.
#[derive(Clone, Debug)]
pub struct Programs {
    /// `inekf-service`.
    pub service: PathBuf,
    /// `inekf-client`.
    pub client: PathBuf,
}

/// The programs, built in the profile of this test.
pub fn programs() -> &'static Programs {
    static PROGRAMS: OnceLock<Programs> = OnceLock::new();
    PROGRAMS.get_or_init(build)
}

/// The file of an example of the client, built in the profile of this test.
pub fn example(name: &str) -> PathBuf {
    let chosen = format!("--example={name}");
    executable(&built(&["--package=inekf-client", &chosen]), name)
}

/// The file of `inekf-bench`, built in the profile of this test.
pub fn bench() -> PathBuf {
    let messages = built(&["--bins", "--package=inekf-bench"]);
    executable(&messages, "inekf-bench")
}

/// The library for C, as a file that programs are linked with and find at run time.
pub fn c_library() -> PathBuf {
    let messages = built(&["--package=inekf-c"]);
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .filter(|message| message["target"]["name"] == "inekf_c")
        .filter_map(|message| message["filenames"].as_array().cloned())
        .flatten()
        .filter_map(|file| file.as_str().map(PathBuf::from))
        .find(|file| file.extension().is_some_and(|extension| extension == "so"))
        .expect("cargo says where the library is")
}

fn build() -> Programs {
    let messages = built(&[
        "--bins",
        "--package=inekf-service",
        "--package=inekf-client",
    ]);
    Programs {
        service: executable(&messages, "inekf-service"),
        client: executable(&messages, "inekf-client"),
    }
}

/// Builds, and returns cargo's messages.
fn built(what: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["build", "--quiet", "--message-format=json"])
        .args(what)
        .stderr(Stdio::inherit());
    match profile().as_str() {
        "debug" => {}
        profile => drop(command.args(["--profile", profile])),
    }
    let output = command.output().expect("cargo cannot be started");
    assert!(output.status.success(), "the programs cannot be built");
    String::from_utf8(output.stdout).expect("cargo's messages are UTF-8")
}

/// The folder of this program's profile: a test program is `PROFILE/deps/NAME`, any other `PROFILE/NAME`.
fn profile() -> String {
    let own = env::current_exe().expect("the test's own file");
    let folders = own
        .ancestors()
        .skip(1)
        .filter_map(|folder| folder.file_name());
    let folder = folders
        .map(|name| name.to_string_lossy())
        .find(|name| name != "deps");
    folder.expect("the folder of a profile").into_owned()
}

/// The file of the program `name`, out of cargo's messages: one JSON object a line.
fn executable(messages: &str, name: &str) -> PathBuf {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .filter(|message| message["target"]["name"] == name)
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .unwrap_or_else(|| panic!("cargo did not say where {name} is"))
}
