//! What the estimation thread asks of the system: a processor of its own, real-time priority, memory that is never
//! paged out. What is refused is warned about with its remedy, and the daemon runs without it.

use anyhow::Context;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};
use tracing::{info, warn};

use crate::config::Runtime;

/// Applies the `[runtime]` options to the calling thread, the `index`th of the daemon's, which gets the processor so many
/// after the first one's. Call it once the ports are open: the memory that is locked is that which is mapped by then.
///
/// A reader that attaches later is mapped later, and that mapping is not locked; its memory is shared memory that
/// exists already.
pub fn apply(runtime: &Runtime, index: usize) {
    if let Some(first) = runtime.cpu {
        let cpu = first as usize + index;
        note(
            format!("running on processor {cpu} only"),
            "does this machine, and this process's cpuset, have it?",
            pin(cpu),
        );
    }
    if let Some(priority) = runtime.priority {
        note(
            format!("SCHED_FIFO with priority {priority}"),
            "it takes CAP_SYS_NICE, or RLIMIT_RTPRIO as high: LimitRTPRIO= in a systemd unit",
            schedule(priority),
        );
    }
    if runtime.lock_memory {
        note(
            "memory locked".to_owned(),
            "it takes CAP_IPC_LOCK, or RLIMIT_MEMLOCK as large: LimitMEMLOCK=infinity in a systemd unit",
            mlockall(MlockAllFlags::CURRENT).context("mlockall"),
        );
    }
}

fn note(what: String, remedy: &str, outcome: anyhow::Result<()>) {
    match outcome {
        Ok(()) => info!("{what}"),
        Err(error) => warn!("refused: {what}: {error:#}; {remedy}"),
    }
}

fn pin(cpu: usize) -> anyhow::Result<()> {
    anyhow::ensure!(
        cpu < CpuSet::MAX_CPU,
        "the system numbers processors up to {}",
        CpuSet::MAX_CPU - 1
    );
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).context("sched_setaffinity")
}

fn schedule(priority: i32) -> anyhow::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: priority,
    };
    // SAFETY: 0 means the calling thread, and `parameters` is a valid sched_param that outlives the call, which only
    // reads it.
    let outcome = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) };
    if outcome == 0 {
        return Ok(());
    }
    Err(std::io::Error::last_os_error()).context("sched_setscheduler")
}
