//! Looks after the files of the daemon's ports, on a thread of its own: the estimation thread makes no system call.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use inekf_shared::transport::Watched;
use rustix::process::setpriority_process;
use tracing::warn;

/// As `nice` counts.
const LEAST_PRIORITY: i32 = 19;
/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(250);

/// Whether somebody has removed files of the ports while they are in use. Ends its thread when dropped.
///
/// ```
#[doc = include_str!("example.txt")]
/// let ports = transport::inputs(&node, &car)?;
/// let guard = Guard::of(Watched::of(&node)?);
/// // Nobody has removed a file of theirs.
/// assert!(!guard.has_lost());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Guard {
    watched: Arc<Watched>,
    gone: Arc<AtomicBool>,
    /// Dropped first: it ends the thread.
    awake: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Guard {
    /// Looks after these files from now on. If there can be no thread, nobody does, and the log says so.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let guard = Guard::of(Watched::services_of(&node)?);
    /// assert!(!guard.has_lost());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(watched: Watched) -> Self {
        let watched = Arc::new(watched);
        let looked_after = Arc::clone(&watched);
        let gone = Arc::new(AtomicBool::new(false));
        let (awake, asleep) = channel::<()>();
        let told = Arc::clone(&gone);
        let look = move || {
            // Of this thread alone: what is estimated meanwhile goes first. If it cannot be, it is short all the same.
            let _ = setpriority_process(None, LEAST_PRIORITY);
            let mut folders = looked_after.folders();
            while asleep.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                // Each of them, or the next look would take what this one has not noted for a change.
                let mut changed = false;
                for folder in &mut folders {
                    changed |= folder.has_changed();
                }
                if changed && !looked_after.is_intact() {
                    told.store(true, Ordering::Relaxed);
                    return;
                }
            }
        };
        let thread = thread::Builder::new().name("files".to_owned()).spawn(look);
        if let Err(error) = &thread {
            warn!("no thread to look after the files in shared memory: {error}");
        }
        Self {
            watched,
            gone,
            awake: Some(awake),
            thread: thread.ok(),
        }
    }

    /// Ends it; what it looked after.
    pub(super) fn end(mut self) -> Arc<Watched> {
        core::mem::take(&mut self.watched)
    }

    /// Whether a file has gone. One load.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let guard = Guard::of(Watched::of(&node)?);
    /// // To be asked by a loop that has no time to look for itself.
    /// assert!(!guard.has_lost());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn has_lost(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        drop(self.awake.take());
        if let Some(thread) = self.thread.take() {
            // It has nothing to say.
            let _ = thread.join();
        }
    }
}
