//! Removes segments whose maker was killed before it gave them a size.
//!
//! iceoryx2 0.10 makes a segment in steps: the file, its size, its content, and at last the permission to read it. Whoever
//! opens one that has no size yet waits for it without an end, when it makes a node or opens a service as well as when it
//! sends or receives, and no error ever comes (only the superuser gets as far; anybody else is refused by the missing
//! permission, and gives up in time). The steps lie microseconds apart, and iceoryx2 itself gives up on every later one
//! after its creation timeout. So does this: for as long as a node lives, a thread removes what has had no size, or no
//! permission to read, for longer than that. Who waits for it then finds nothing, and makes it anew.

use std::fs::{self, Metadata};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};

use rustix::process::setpriority_process;

use super::Config;
use super::folder::Folder;
use super::inspect::{self, SHARED_MEMORY};

/// A segment is readable once it is complete.
const OWNER_READ: u32 = 0o400;
/// Looks for each creation timeout.
const LOOKS: u32 = 2;
/// The time between two looks is at least so many times what a look takes: a fleet has tens of thousands of files.
const LEAST_REST: u32 = 50;
/// As `nice` counts.
const LEAST_PRIORITY: i32 = 19;
/// The thread needs little, and locked memory should not pay for more.
const STACK_BYTES: usize = 128 * 1024;

/// Whether a segment is complete.
pub(super) fn is_complete(segment: &Metadata) -> bool {
    segment.len() > 0 && segment.permissions().mode() & OWNER_READ != 0
}

/// Removes the segments under the prefix that are not complete and older than the creation timeout. Returns whether there
/// are any, old or young.
fn remove(config: &Config) -> bool {
    let prefix = config.global.prefix.to_string();
    let Ok(files) = inspect::files(Path::new(SHARED_MEMORY), &prefix) else {
        return true;
    };
    let mut any = false;
    for (path, _) in files.iter().filter(|(_, metadata)| !is_complete(metadata)) {
        any = true;
        // It may have been finished meanwhile.
        let is_stillborn = fs::metadata(path).is_ok_and(|metadata| {
            !is_complete(&metadata) && age(&metadata) > config.global.creation_timeout
        });
        if is_stillborn {
            // Another may have been faster; of another user's nothing can be removed.
            let _ = fs::remove_file(path);
        }
    }
    any
}

fn age(metadata: &Metadata) -> Duration {
    let modified = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
    modified.elapsed().unwrap_or_default()
}

/// Whether there is any shared memory that is not complete under the prefix.
pub(super) fn is_there(config: &Config) -> bool {
    let prefix = config.global.prefix.to_string();
    inspect::files(Path::new(SHARED_MEMORY), &prefix)
        .is_ok_and(|files| files.iter().any(|(_, metadata)| !is_complete(metadata)))
}

/// Looks for such segments from its making until it is dropped, which ends its thread at once.
#[derive(Debug)]
pub(super) struct Warden {
    prefix: String,
    /// Dropped first: it ends the thread.
    awake: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Warden {
    /// The one of this process for this prefix. If there can be no thread, nobody looks: all else works as well without.
    pub(super) fn of(config: &Config) -> Arc<Self> {
        static WARDENS: Mutex<Vec<Weak<Warden>>> = Mutex::new(Vec::new());
        let prefix = config.global.prefix.to_string();
        let mut wardens = WARDENS.lock().unwrap_or_else(PoisonError::into_inner);
        wardens.retain(|warden| warden.strong_count() > 0);
        let mut living = wardens.iter().filter_map(Weak::upgrade);
        if let Some(warden) = living.find(|warden| warden.prefix == prefix) {
            return warden;
        }
        let warden = Arc::new(Self::start(config, prefix));
        wardens.push(Arc::downgrade(&warden));
        warden
    }

    fn start(config: &Config, prefix: String) -> Self {
        let config = config.clone();
        let (awake, asleep) = channel::<()>();
        let shortest = config.global.creation_timeout / LOOKS;
        let mut period = shortest;
        let look = move || {
            // Of this thread alone: what is estimated meanwhile goes first. If it cannot be, it is short all the same.
            let _ = setpriority_process(None, LEAST_PRIORITY);
            let mut folder = Folder::new(SHARED_MEMORY.into());
            let mut any = true;
            while asleep.recv_timeout(period) == Err(RecvTimeoutError::Timeout) {
                let started = Instant::now();
                // Where nothing has come there is nothing new that is not complete.
                if folder.has_changed() || any {
                    any = remove(&config);
                }
                period = shortest.max(started.elapsed() * LEAST_REST);
            }
        };
        let thread = thread::Builder::new()
            .name("segments".to_owned())
            .stack_size(STACK_BYTES)
            .spawn(look);
        Self {
            prefix,
            awake: Some(awake),
            thread: thread.ok(),
        }
    }
}

impl Drop for Warden {
    fn drop(&mut self) {
        drop(self.awake.take());
        if let Some(thread) = self.thread.take() {
            // It has nothing to say.
            let _ = thread.join();
        }
    }
}
