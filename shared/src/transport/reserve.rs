//! Backs shared memory with memory before it is needed.
//!
//! A file in `/dev/shm` takes up space only when it is written to. If the space has run out by then, the writer is
//! killed by SIGBUS in the middle of a send, long after everything was opened without an error. A long-lived process
//! asks for all the space at its start instead.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io;
use std::path::Path;

use rustix::fs::{FallocateFlags, fallocate, statvfs};

use super::{Node, TransportError};

/// Where POSIX shared memory lies on Linux.
const SHARED_MEMORY: &str = "/dev/shm";

/// Backs all shared memory of iceoryx2 that this process has mapped by now, and returns its size in bytes. Call it when
/// all ports are made. Connections to ports that come later are not covered; they are small.
///
/// # Errors
/// [`TransportError::Space`] if there is too little, [`TransportError::Reserve`] if the files cannot be worked with.
pub fn reserve_shared_memory(node: &Node) -> Result<u64, TransportError> {
    let maps = fs::read_to_string("/proc/self/maps").map_err(|error| TransportError::Reserve {
        path: "/proc/self/maps".to_owned(),
        cause: error.to_string(),
    })?;
    let prefix = node.config().global.prefix.to_string();
    let mut total = 0;
    for path in mapped_files(&maps, &prefix) {
        total += reserve(&path)?;
    }
    Ok(total)
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
