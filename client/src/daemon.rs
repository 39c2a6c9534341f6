//! A daemon of one's own: started as a child process, stopped with it.

use std::io::{self, BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use inekf_shared::topic::Instance;
use rustix::process::{
    Pid, Signal, getpid, getppid, kill_process, set_parent_process_death_signal,
};

/// Name of the daemon's program.
const PROGRAM: &str = "inekf-service";
/// Environment variable that names the program's file.
pub const PROGRAM_VARIABLE: &str = "INEKF_SERVICE";
/// How long the daemon may take to be ready.
const READY_WITHIN: Duration = Duration::from_secs(10);
/// And with many vehicles.
const FLEET_READY_WITHIN: Duration = Duration::from_secs(300);
/// How long it may take to stop before it is killed.
const STOP_WITHIN: Duration = Duration::from_secs(5);

/// A running daemon. It is stopped when dropped, and also when the thread that started it is gone
/// for another reason, such as a kill.
///
/// It is not run here, for it starts the program `inekf-service`:
///
/// ```no_run
/// use std::path::Path;
///
/// use inekf_client::daemon::{Daemon, private_instance};
///
/// let mut daemon = Daemon::start(Path::new("car.toml"), &private_instance("trial")?)?;
/// assert!(daemon.ready_line().starts_with("ready") && daemon.is_running());
/// daemon.stop()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Daemon {
    child: Child,
    ready_line: String,
}

impl Daemon {
    /// Starts a daemon with this configuration and waits until it is ready.
    ///
    /// # Errors
    /// The program is not found or stops before it is ready; what it wrote to standard error has
    /// gone to this process's.
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// use std::path::Path;
    ///
    /// use inekf_client::daemon::{Daemon, private_instance};
    ///
    /// // Dropped, it is stopped as well.
    /// let daemon = Daemon::start(Path::new("car.toml"), &private_instance("trial")?)?;
    /// println!("process {}", daemon.id());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn start(config: &Path, instance: &Instance) -> anyhow::Result<Self> {
        Self::start_with(config, instance.as_str(), &[], READY_WITHIN)
    }

    /// The same for many vehicles, which `instances` names as on the daemon's command line. They take their time to open.
    ///
    /// # Errors
    /// As [`Daemon::start`].
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// use std::path::Path;
    ///
    /// use inekf_client::daemon::Daemon;
    ///
    /// let daemon = Daemon::start_fleet(Path::new("car.toml"), "car-{1..100}")?;
    /// println!("{}", daemon.ready_line());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn start_fleet(config: &Path, instances: &str) -> anyhow::Result<Self> {
        Self::start_with(config, instances, &[], FLEET_READY_WITHIN)
    }

    /// The same for a daemon that takes its inputs from requests, one by one.
    ///
    /// # Errors
    /// As [`Daemon::start`].
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// use std::path::Path;
    ///
    /// use inekf_client::daemon::{Daemon, private_instance};
    ///
    /// // It takes what `ControlRequest`s of the kind `CONTROL_TAKE` bring, and nothing else.
    /// let daemon = Daemon::start_stepped(Path::new("recorded.toml"), &private_instance("again")?)?;
    /// daemon.stop()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn start_stepped(config: &Path, instance: &Instance) -> anyhow::Result<Self> {
        Self::start_with(config, instance.as_str(), &["--stepped"], READY_WITHIN)
    }

    fn start_with(
        config: &Path,
        instances: &str,
        more: &[&str],
        ready_within: Duration,
    ) -> anyhow::Result<Self> {
        let program = program()?;
        let mut command = Command::new(&program);
        if std::env::var_os("RUST_LOG").is_none() {
            // A daemon that serves one command is heard when something is wrong.
            command.env("RUST_LOG", "warn,iceoryx2=error");
        }
        command
            .arg("--config")
            .arg(config)
            .args(["--instance", instances])
            .args(more)
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        stop_with_this_process(&mut command);
        let mut child = command
            .spawn()
            .with_context(|| format!("starting {}", program.display()))?;
        let stdout = child.stdout.take().context("the daemon's output")?;
        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            // The first line says ready; later ones are read so that the pipe never fills.
            let mut reader = BufReader::new(stdout);
            while reader.read_line(&mut line).is_ok_and(|read| read > 0) {
                let _ = sender.send(std::mem::take(&mut line));
            }
        });
        let mut daemon = Self {
            child,
            ready_line: String::new(),
        };
        match receiver.recv_timeout(ready_within) {
            Ok(line) if line.starts_with("ready") => {
                daemon.ready_line = line.trim_end().to_owned();
                Ok(daemon)
            }
            Ok(line) => bail!("the daemon said {line:?} instead of being ready"),
            Err(mpsc::RecvTimeoutError::Timeout) => {
                bail!("the daemon was not ready within {ready_within:?}")
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                let status = daemon.child.wait().context("waiting for the daemon")?;
                bail!("the daemon stopped before it was ready ({status}); its message is above")
            }
        }
    }

    /// What the daemon said when it was ready.
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// # use std::path::Path;
    /// # use inekf_client::daemon::{Daemon, private_instance};
    /// # let daemon = Daemon::start(Path::new("car.toml"), &private_instance("trial")?)?;
    /// assert!(daemon.ready_line().starts_with("ready: instance trial"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn ready_line(&self) -> &str {
        &self.ready_line
    }

    /// The daemon's process id.
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// # use std::path::Path;
    /// # use inekf_client::daemon::{Daemon, private_instance};
    /// # let daemon = Daemon::start(Path::new("car.toml"), &private_instance("trial")?)?;
    /// // Its ready line has it too.
    /// assert!(daemon.ready_line().contains(&format!("process {}", daemon.id())));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Stops the daemon with SIGTERM and waits for it.
    ///
    /// # Errors
    /// It did not stop in time (it is then killed), or ended with a failure.
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// # use std::path::Path;
    /// # use inekf_client::daemon::{Daemon, private_instance};
    /// let daemon = Daemon::start(Path::new("car.toml"), &private_instance("trial")?)?;
    /// // Dropped it would be stopped as well, but nobody would hear of a failure.
    /// daemon.stop()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn stop(mut self) -> anyhow::Result<()> {
        match self.terminate()? {
            Some(status) if status.success() => Ok(()),
            Some(status) => bail!("the daemon ended with {status}"),
            None => bail!("the daemon did not stop within {STOP_WITHIN:?} and was killed"),
        }
    }

    /// Whether the daemon still runs.
    ///
    /// It is not run here, for it starts the program `inekf-service`:
    ///
    /// ```no_run
    /// # use std::path::Path;
    /// # use inekf_client::daemon::{Daemon, private_instance};
    /// # let mut daemon = Daemon::start(Path::new("car.toml"), &private_instance("trial")?)?;
    /// assert!(daemon.is_running());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// `None` if it had to be killed.
    fn terminate(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        if let Some(status) = self.child.try_wait()? {
            return Ok(Some(status));
        }
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        if let Some(pid) = pid {
            kill_process(pid, Signal::TERM).context("sending SIGTERM to the daemon")?;
        }
        let started = Instant::now();
        while started.elapsed() < STOP_WITHIN {
            if let Some(status) = self.child.try_wait()? {
                return Ok(Some(status));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        self.child.kill()?;
        self.child.wait()?;
        Ok(None)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // A second attempt changes nothing after `stop`.
        let _ = self.terminate();
    }
}

/// Has the process that `command` starts stopped by SIGTERM when this one dies, so that a client
/// that is killed leaves no daemon behind.
fn stop_with_this_process(command: &mut Command) {
    let parent = getpid();
    let ask = move || {
        set_parent_process_death_signal(Some(Signal::TERM))?;
        // It may have died before it was asked for.
        if getppid() == Some(parent) {
            Ok(())
        } else {
            Err(io::ErrorKind::BrokenPipe.into())
        }
    };
    // SAFETY: between fork and exec only what is safe in a signal handler may be done: `ask` makes
    // two system calls and allocates nothing.
    unsafe { command.pre_exec(ask) };
}

/// The daemon's program: named by the environment, beside this one, or on the path.
fn program() -> anyhow::Result<PathBuf> {
    if let Some(named) = std::env::var_os(PROGRAM_VARIABLE) {
        let named = PathBuf::from(named);
        if !named.is_file() {
            bail!(
                "{PROGRAM_VARIABLE} names {}, which is no file",
                named.display()
            );
        }
        return Ok(named);
    }
    let own = std::env::current_exe().context("finding this program's folder")?;
    if let Some(beside) = own.parent().map(|folder| folder.join(PROGRAM))
        && beside.is_file()
    {
        return Ok(beside);
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .map(|folder| folder.join(PROGRAM))
        .find(|candidate| candidate.is_file())
        .with_context(|| {
            format!(
                "{PROGRAM} is neither beside {} nor on the PATH: build it with `cargo build \
                 --release`, or name it with {PROGRAM_VARIABLE}",
                own.display()
            )
        })
}

/// An instance name that no other process uses: for a daemon of one's own.
///
/// ```
/// use inekf_client::daemon::private_instance;
///
/// let instance = private_instance("replay")?;
/// assert_eq!(instance.as_str(), format!("replay-{}", std::process::id()));
/// // What cannot be a name is refused.
/// assert!(private_instance("a/b").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn private_instance(purpose: &str) -> anyhow::Result<Instance> {
    let name = format!("{purpose}-{}", std::process::id());
    Instance::new(&name).context("making an instance name")
}
