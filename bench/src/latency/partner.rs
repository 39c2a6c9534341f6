//! The other side of a round trip: a process of this program that answers, and how it is held while
//! something else has its processor.

use std::ffi::OsStr;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::ValueEnum;
use inekf_shared::clock::monotonic_ns;
use rustix::process::{
    Pid, Signal, WaitId, WaitIdOptions, kill_process, set_parent_process_death_signal, waitid,
};

use super::mechanism::{Mechanism, Wait};

/// How long a partner may take for one answer, ns.
const ANSWER_WITHIN_NS: u64 = 5_000_000_000;
/// How long it may take to be there, and to end.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// Longest sleep of a partner that waits to be woken: it looks at its inputs after each.
pub const LONGEST_SLEEP: Duration = Duration::from_millis(10);
/// The number that ends a partner.
pub const STOP: u64 = u64::MAX;

/// Something that answers, measured from this process.
pub trait RoundTrip {
    /// One round trip; returns its length, ns.
    ///
    /// # Errors
    /// The other side does not answer.
    fn round(&mut self) -> anyhow::Result<u64>;

    /// What of the last round a daemon needed from the sample in hand to its estimate sent, ns.
    fn inside(&self) -> Option<u64> {
        None
    }

    /// The partner's process, if it is one.
    fn process(&self) -> Option<u32>;

    /// Frees the partner's processor until [`RoundTrip::resume`]. A partner that is no process frees
    /// it in a way of its own.
    ///
    /// # Errors
    /// It cannot be stopped, or has gone.
    fn pause(&mut self) -> anyhow::Result<()> {
        self.process().map_or(Ok(()), pause)
    }

    /// Goes on.
    ///
    /// # Errors
    /// It has gone.
    fn resume(&mut self) -> anyhow::Result<()> {
        self.process().map_or(Ok(()), resume)
    }
}

/// Fails once a round that began at `sent_ns` has taken too long.
///
/// # Errors
/// Says who does not answer.
pub fn still_patient(sent_ns: u64, who: &str) -> anyhow::Result<()> {
    if monotonic_ns() - sent_ns > ANSWER_WITHIN_NS {
        bail!("{who} does not answer");
    }
    Ok(())
}

/// A process of this program that serves one mechanism; killed when dropped, unless it has ended.
#[derive(Debug)]
pub struct Partner(Child);

impl Partner {
    /// Starts the partner of a mechanism on processor `cpu`, with what it needs beside.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(
        mechanism: Mechanism,
        wait: Wait,
        instance: &str,
        cpu: usize,
        stdin: Stdio,
    ) -> anyhow::Result<Self> {
        let (mechanism, wait) = (value_name(mechanism), value_name(wait));
        let cpu = cpu.to_string();
        let child = Command::new(std::env::current_exe()?)
            .args(["partner", &mechanism, &wait, instance, &cpu].map(OsStr::new))
            .stdin(stdin)
            .spawn()
            .context("starting the partner process")?;
        Ok(Self(child))
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Waits until it has ended by itself, which whoever drops it asked for.
    pub fn await_end(&mut self) {
        let started = Instant::now();
        while started.elapsed() < PATIENCE && matches!(self.0.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Partner {
    fn drop(&mut self) {
        // Both do nothing to a process that has been waited for.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn value_name(value: impl ValueEnum) -> String {
    let name = value.to_possible_value();
    name.map_or_else(String::new, |name| name.get_name().to_owned())
}

/// Has this process, a partner, end with the one that started it.
///
/// # Errors
/// The system refuses.
pub fn end_with_parent() -> anyhow::Result<()> {
    set_parent_process_death_signal(Some(Signal::KILL)).context("asking to end with the parent")
}

/// Stops the child process `id`; returns when it has stopped.
///
/// # Errors
/// It has gone.
fn pause(id: u32) -> anyhow::Result<()> {
    let pid = pid(id)?;
    kill_process(pid, Signal::STOP).context("pausing the partner process")?;
    // NOWAIT leaves the news of its end to whoever owns the process.
    let options = WaitIdOptions::STOPPED | WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
    let status = waitid(WaitId::Pid(pid), options).context("waiting for the partner to pause")?;
    if !status.is_some_and(|status| status.stopped()) {
        bail!("the partner process has ended");
    }
    Ok(())
}

/// Has the child process `id` go on.
///
/// # Errors
/// It has gone.
fn resume(id: u32) -> anyhow::Result<()> {
    kill_process(pid(id)?, Signal::CONT).context("resuming the partner process")
}

fn pid(id: u32) -> anyhow::Result<Pid> {
    let raw = i32::try_from(id).ok().and_then(Pid::from_raw);
    raw.with_context(|| format!("{id} is no process id"))
}
