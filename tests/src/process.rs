//! Running programs: their output, a limit on their time, and an end in any case.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

use crate::memory::Memory;
use crate::programs::programs;

/// Longest time for anything that a test waits for: far more than it takes, on a busy machine too.
pub const PATIENCE: Duration = Duration::from_secs(60);
const POLL: Duration = Duration::from_millis(2);

/// Waits until `look` finds something.
///
/// # Panics
/// If it takes longer than [`PATIENCE`]; `what` is said to be missing.
pub fn eventually<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(started.elapsed() < PATIENCE, "waited in vain for {what}");
        sleep(POLL);
    }
}

/// What a program left.
#[derive(Clone, Debug)]
pub struct Ended {
    /// How it ended.
    pub status: ExitStatus,
    /// Everything it wrote to standard output.
    pub stdout: String,
    /// Everything it wrote to standard error.
    pub stderr: String,
}

impl Ended {
    /// Asserts that it was successful, and gives it back.
    pub fn succeeded(self) -> Self {
        assert!(self.status.success(), "{self:#?}");
        self
    }

    /// Asserts that it failed with this exit status and one line that says why; returns the line.
    pub fn failed_with_one_line(&self, code: i32) -> &str {
        assert_eq!(self.status.code(), Some(code), "{self:#?}");
        let lines: Vec<&str> = self.stderr.lines().collect();
        assert_eq!(lines.len(), 1, "{self:#?}");
        lines[0]
    }
}

/// A running program. It is killed when dropped.
#[derive(Debug)]
pub struct Running {
    child: Child,
    // Files and not pipes: a program must never wait for the test to read.
    output: TempDir,
}

impl Running {
    /// Starts `command`.
    pub fn start(mut command: Command) -> Self {
        let output = TempDir::new().expect("a folder for the output");
        let file = |name| File::create(output.path().join(name)).expect("a file for the output");
        let child = command
            .stdin(Stdio::null())
            .stdout(file("stdout"))
            .stderr(file("stderr"))
            .spawn()
            .unwrap_or_else(|error| panic!("{command:?}: {error}"));
        Self { child, output }
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// What it has written to standard output by now.
    pub fn stdout(&self) -> String {
        self.read("stdout")
    }

    /// What it has written to standard error by now.
    pub fn stderr(&self) -> String {
        self.read("stderr")
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) {
        let id = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        kill_process(id.expect("a process id"), signal).expect("the process is still there");
    }

    /// Whether it still runs.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().expect("its status").is_none()
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// If it takes longer than [`PATIENCE`].
    pub fn wait(mut self) -> Ended {
        let status = eventually("the end of a process", || {
            self.child.try_wait().expect("its status")
        });
        Ended {
            status,
            stdout: self.stdout(),
            stderr: self.stderr(),
        }
    }

    fn read(&self, name: &str) -> String {
        let bytes = fs::read(self.output.path().join(name)).expect("its output");
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A test that fails says what its programs had to say.
        if std::thread::panicking() {
            eprintln!("process {} wrote:\n{}", self.id(), self.stderr());
        }
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Whether SIGINT is ignored here, as under `nohup` or behind a shell's `&`: programs that are started inherit that, and
/// leave it so unless they handle it.
pub fn ignores_interrupts() -> bool {
    let status = fs::read_to_string("/proc/self/status").expect("the status of this process");
    let mask = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // Bit 0 is signal 1.
    mask.expect("the ignored signals") & (1 << (Signal::INT.as_raw() - 1)) != 0
}

/// Runs the client with these arguments to its end.
pub fn client<A: AsRef<std::ffi::OsStr>>(
    memory: &Memory,
    arguments: impl IntoIterator<Item = A>,
) -> Ended {
    start_client(memory, arguments).wait()
}

/// Starts the client with these arguments.
pub fn start_client<A: AsRef<std::ffi::OsStr>>(
    memory: &Memory,
    arguments: impl IntoIterator<Item = A>,
) -> Running {
    let mut command = memory.command(&programs().client);
    command.args(arguments);
    Running::start(command)
}

/// Runs the daemon's program with these arguments to its end.
pub fn service<A: AsRef<std::ffi::OsStr>>(
    memory: &Memory,
    arguments: impl IntoIterator<Item = A>,
) -> Ended {
    let mut command = memory.command(&programs().service);
    command.args(arguments);
    Running::start(command).wait()
}

/// A daemon that is ready.
#[derive(Debug)]
pub struct Daemon {
    running: Running,
    // Kept for as long as the daemon runs.
    _config: TempDir,
}

impl Daemon {
    /// Starts a daemon with the text of a configuration and waits until it is ready.
    pub fn start(memory: &Memory, instance: &str, config: &str) -> Self {
        let command = memory.command(&programs().service);
        Self::start_as(command, instance, config)
    }

    /// The same by a command that is, or becomes, the daemon's program with the arguments it is given.
    pub fn start_as(mut command: Command, instance: &str, config: &str) -> Self {
        let (folder, file) = config_file(config);
        command.arg("--config").arg(file);
        command.args(["--instance", instance]);
        let mut running = Running::start(command);
        eventually("a daemon's ready line", || {
            assert!(running.is_running(), "{}", running.stderr());
            running.stdout().starts_with("ready").then_some(())
        });
        Self {
            running,
            _config: folder,
        }
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.running.id()
    }

    /// What it has written to standard error by now.
    pub fn stderr(&self) -> String {
        self.running.stderr()
    }

    /// The line it wrote when it was ready.
    pub fn ready_line(&self) -> String {
        self.running
            .stdout()
            .lines()
            .next()
            .unwrap_or_default()
            .to_owned()
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) {
        self.running.signal(signal);
    }

    /// Stops it with a signal and waits for its end.
    pub fn stop_with(self, signal: Signal) -> Ended {
        self.running.signal(signal);
        self.running.wait()
    }

    /// Stops it as a supervisor does, and asserts that it was successful.
    pub fn stop(self) -> Ended {
        self.stop_with(Signal::TERM).succeeded()
    }
}

/// A file with the text of a configuration, in a folder that is removed when dropped.
pub fn config_file(text: &str) -> (TempDir, PathBuf) {
    let folder = TempDir::new().expect("a folder for a configuration");
    let file = folder.path().join("config.toml");
    fs::write(&file, text).expect("a configuration");
    (folder, file)
}

/// Reads a configuration of the project by name.
pub fn project_config(name: &str) -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../service/config")
        .join(name)
        .with_extension("toml");
    fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}
