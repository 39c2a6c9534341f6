//! Backs shared memory with memory before it is needed.
//!
//! A file in `/dev/shm` takes up space only when it is written to. If the space has run out by then, the writer is
//! killed by SIGBUS in the middle of a send, long after everything was opened without an error. A long-lived process
//! asks for all the space at its start instead.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use rustix::fs::{FallocateFlags, fallocate, statvfs};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::inspect::SHARED_MEMORY;
use super::{Config, TransportError};

/// Backs all shared memory of iceoryx2 that this process has mapped by now, and returns its size in bytes. Call it when
/// all ports are made, once: it looks at every file. Connections to ports that come later are not covered; they are small.
///
/// # Errors
/// [`TransportError::Space`] if there is too little, [`TransportError::Reserve`] if the files cannot be worked with.
///
/// ```
/// use inekf_shared::message::EstimateSe23;
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let publisher = transport::estimate::<EstimateSe23>(&node, &Instance::new("car")?)?.publisher()?;
/// // A reader's buffer full of estimates, at least.
/// assert!(transport::reserve_shared_memory(node.config())? > 1024 * 1288);
/// # drop(publisher);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn reserve_shared_memory(config: &Config) -> Result<u64, TransportError> {
    let maps = fs::read_to_string("/proc/self/maps").map_err(|error| TransportError::Reserve {
        path: "/proc/self/maps".to_owned(),
        cause: error.to_string(),
    })?;
    let prefix = config.global.prefix.to_string();
    let mut total = 0;
    for path in mapped_files(&maps, &prefix) {
        total += reserve(&path)?;
    }
    Ok(total)
}

/// Shared memory that must be free for anything to be opened, bytes: descriptions, connections and events are small.
pub(super) const LEAST_FREE: u64 = 1 << 20;
/// File descriptors that a process needs at least: a daemon has 53 open, and some for every party.
const LEAST_DESCRIPTORS: u64 = 128;

/// Whether this process may open enough files; raises its limit where it can.
///
/// # Errors
/// [`TransportError::Descriptors`].
pub(super) fn require_descriptors() -> Result<(), TransportError> {
    let limit = getrlimit(Resource::Nofile);
    if limit.current.is_none_or(|now| now >= LEAST_DESCRIPTORS) {
        return Ok(());
    }
    let raised = Rlimit {
        current: Some(LEAST_DESCRIPTORS),
        ..limit
    };
    setrlimit(Resource::Nofile, raised).map_err(|_| TransportError::Descriptors {
        needed: LEAST_DESCRIPTORS,
        allowed: limit.current.unwrap_or(0),
    })
}

/// How the names of data segments begin before the id of their port: what stands there is a hash of iceoryx2's own,
/// found out by looking once, because a folder with thousands of files is slow to look through for every port.
static BEGINNINGS: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Backs the data segment of the port `id` as a whole.
pub(super) fn reserve_segment_of(config: &Config, id: u128) -> Result<(), TransportError> {
    let prefix = config.global.prefix.to_string();
    let end = format!("{id}{}", config.global.service.data_segment_suffix);
    let mut beginnings = BEGINNINGS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = beginnings
        .iter()
        .filter(|beginning| beginning.starts_with(&prefix))
        .map(|beginning| Path::new(SHARED_MEMORY).join(format!("{beginning}{end}")))
        .find(|path| path.exists());
    if let Some(path) = known {
        return reserve(&path.display().to_string()).map(drop);
    }
    let Ok(entries) = fs::read_dir(SHARED_MEMORY) else {
        return Ok(());
    };
    for entry in entries.filter_map(Result::ok) {
        let name = entry.file_name().to_string_lossy().into_owned();
        if let Some(beginning) = name.strip_suffix(&end)
            && beginning.starts_with(&prefix)
        {
            beginnings.insert(beginning.to_owned());
            reserve(&entry.path().display().to_string())?;
        }
    }
    Ok(())
}

/// Whether so many bytes of shared memory are free. Asked before the first segment is made: iceoryx2 writes to a new
/// segment at once, and would be killed by SIGBUS in the middle of it.
///
/// # Errors
/// [`TransportError::Space`].
pub(super) fn require_shared_memory(needed: u64) -> Result<(), TransportError> {
    let free = free_shared_memory();
    if free < needed {
        return Err(TransportError::Space { needed, free });
    }
    Ok(())
}

/// Paths of the files in `/dev/shm` whose names start with `prefix`, out of the text of `/proc/self/maps`, each once.
fn mapped_files(maps: &str, prefix: &str) -> BTreeSet<String> {
    let start = format!("{SHARED_MEMORY}/{prefix}");
    maps.lines()
        .filter_map(|line| line.find(&start).map(|at| line[at..].to_owned()))
        // A file that has been removed while mapped is on its way out.
        .filter(|path| !path.ends_with(" (deleted)"))
        .collect()
}

fn reserve(path: &str) -> Result<u64, TransportError> {
    let refuse = |error: io::Error| TransportError::Reserve {
        path: path.to_owned(),
        cause: error.to_string(),
    };
    let file = match OpenOptions::new().read(true).write(true).open(path) {
        Ok(file) => file,
        // Its owner left in the meantime.
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        Err(error) => return Err(refuse(error)),
    };
    let len = file.metadata().map_err(refuse)?.len();
    if len == 0 {
        return Ok(0);
    }
    match fallocate(&file, FallocateFlags::empty(), 0, len) {
        Ok(()) => Ok(len),
        Err(rustix::io::Errno::NOSPC) => Err(TransportError::Space {
            needed: len,
            free: free_shared_memory(),
        }),
        Err(error) => Err(refuse(error.into())),
    }
}

/// Bytes free in `/dev/shm`; 0 if it cannot be asked.
fn free_shared_memory() -> u64 {
    statvfs(Path::new(SHARED_MEMORY)).map_or(0, |status| status.f_bavail * status.f_frsize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_own_files_that_still_exist_are_taken_each_once() {
        let maps = "\
7f00-7f01 rw-s 00000000 00:19 12 /dev/shm/ours_a.data
7f01-7f02 rw-s 00001000 00:19 12 /dev/shm/ours_a.data
7f02-7f03 rw-s 00000000 00:19 13 /dev/shm/ours_b.dynamic (deleted)
7f03-7f04 r--s 00000000 00:19 14 /dev/shm/ours_c.connection
7f04-7f05 rw-s 00000000 00:19 15 /dev/shm/theirs.data
7f05-7f06 r-xp 00000000 08:01 16 /usr/lib/libours_.so
7f06-7f07 rw-p 00000000 00:00 0
";
        let files: Vec<String> = mapped_files(maps, "ours_").into_iter().collect();
        assert_eq!(
            files,
            ["/dev/shm/ours_a.data", "/dev/shm/ours_c.connection"]
        );
    }
}
