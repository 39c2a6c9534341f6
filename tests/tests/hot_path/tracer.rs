//! A tracer: counts the system calls of a thread of another process.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;

use nix::errno::Errno;
use nix::sys::ptrace::{self, Options};
use nix::sys::signal::Signal;
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;

/// The system calls that were made, by number.
pub type Calls = BTreeMap<String, u64>;

/// What was seen.
#[derive(Debug, Default)]
pub struct Seen {
    /// While it was counted.
    pub counted: Calls,
    /// Before and after.
    pub beside: Calls,
}

/// Traces the thread until it is asked to terminate, and counts its calls, apart while `counts` is true. Says on `ready`
/// whether it may. Runs on a thread of its own, for tracing belongs to the thread that began it.
pub fn trace(thread: u32, counts: &AtomicBool, ready: &Sender<Result<(), Errno>>) -> Seen {
    let pid = Pid::from_raw(i32::try_from(thread).expect("a process id"));
    let mut seen = Seen::default();
    let begun =
        ptrace::seize(pid, Options::PTRACE_O_TRACESYSGOOD).and_then(|()| ptrace::interrupt(pid));
    if let Err(error) = begun {
        let _ = ready.send(Err(error));
        return seen;
    }
    let mut is_told = false;
    // An error is the end of a process that somebody else has waited for.
    while let Ok(status) = waitpid(pid, Some(WaitPidFlag::__WALL)) {
        let signal = match status {
            WaitStatus::PtraceSyscall(_) => {
                let calls = match counts.load(Ordering::SeqCst) {
                    true => &mut seen.counted,
                    false => &mut seen.beside,
                };
                *calls.entry(number(thread)).or_default() += 1;
                None
            }
            WaitStatus::Stopped(_, Signal::SIGTERM) => {
                // Whoever sent it waits for the process.
                let _ = ptrace::detach(pid, Signal::SIGTERM);
                break;
            }
            WaitStatus::Stopped(_, signal) => Some(signal),
            WaitStatus::Exited(..) | WaitStatus::Signaled(..) => break,
            _ => None,
        };
        if ptrace::syscall(pid, signal).is_err() {
            break;
        }
        if !is_told {
            is_told = true;
            let _ = ready.send(Ok(()));
        }
    }
    seen
}

/// Number of the call in which a stopped thread is.
fn number(thread: u32) -> String {
    let text = std::fs::read_to_string(format!("/proc/{thread}/syscall")).unwrap_or_default();
    text.split_whitespace()
        .next()
        .unwrap_or("unknown")
        .to_owned()
}
