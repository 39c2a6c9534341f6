//! Pinning to processors, so that two runs measure the same placement.

use anyhow::Context;
use rustix::process::Pid;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// The processors this process may use.
///
/// # Errors
/// The system does not say.
pub fn processors() -> anyhow::Result<Vec<usize>> {
    let set = sched_getaffinity(None).context("asking for this process's processors")?;
    Ok((0..CpuSet::MAX_CPU)
        .filter(|cpu| set.is_set(*cpu))
        .collect())
}

/// Lets the calling thread run on any of these again.
///
/// # Errors
/// The system refuses.
pub fn unpin(processors: &[usize]) -> anyhow::Result<()> {
    let mut set = CpuSet::new();
    for cpu in processors {
        set.set(*cpu);
    }
    sched_setaffinity(None, &set).context("undoing the pinning")
}

/// Pins the calling thread, or the process `pid` before it starts threads of its own.
///
/// # Errors
/// The system refuses.
pub fn pin(pid: Option<u32>, cpu: usize) -> anyhow::Result<()> {
    let mut set = CpuSet::new();
    set.set(cpu);
    let pid = pid
        .and_then(|pid| i32::try_from(pid).ok())
        .and_then(Pid::from_raw);
    sched_setaffinity(pid, &set).with_context(|| format!("pinning to processor {cpu}"))
}
