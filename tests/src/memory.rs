//! Shared memory of one test's own: its own root folder and its own start of file names, so that tests run side by side
//! and whatever is left has one owner.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use inekf_shared::transport::{
    Config, IPC_PREFIX_VARIABLE, IPC_ROOT_VARIABLE, Node, config, open_node_with,
};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

/// Where POSIX shared memory lies on Linux.
const SHARED_MEMORY: &str = "/dev/shm";

/// One test's shared memory. What is left of it is removed when dropped.
#[derive(Debug)]
pub struct Memory {
    root: TempDir,
    prefix: String,
    config: Config,
}

impl Default for Memory {
    fn default() -> Self {
        Self::new()
    }
}

impl Memory {
    /// Shared memory that nobody else uses.
    pub fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        // Not where TMPDIR says: the path of a socket has to stay short.
        let root = tempfile::tempdir_in("/tmp").expect("a folder in /tmp");
        let prefix = format!(
            "inekf_tests_{}_{}_",
            std::process::id(),
            COUNT.fetch_add(1, Ordering::Relaxed)
        );
        let config = config(root.path().to_str(), Some(&prefix)).expect("a root and a prefix");
        Self {
            root,
            prefix,
            config,
        }
    }

    /// The folder of iceoryx2's files.
    pub fn root(&self) -> &Path {
        self.root.path()
    }

    /// What the names of its files in `/dev/shm` start with.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// A node of this process's own.
    pub fn node(&self) -> Node {
        open_node_with("test", &self.config).expect("a node")
    }

    /// A command that uses this shared memory.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command
            .env(IPC_ROOT_VARIABLE, self.root.path())
            .env(IPC_PREFIX_VARIABLE, &self.prefix)
            .env_remove("RUST_LOG")
            .env_remove("INEKF_SERVICE");
        command
    }

    /// Names of the files in `/dev/shm`.
    pub fn shared_files(&self) -> Vec<String> {
        names(Path::new(SHARED_MEMORY))
            .into_iter()
            .filter(|name| name.contains(&self.prefix))
            .collect()
    }

    /// Paths of the files in `/dev/shm`.
    pub fn shared_paths(&self) -> Vec<String> {
        let path = |name: String| format!("{SHARED_MEMORY}/{name}");
        self.shared_files().into_iter().map(path).collect()
    }

    /// Paths of the files (not the folders) under the root.
    pub fn root_files(&self) -> Vec<String> {
        let mut files = Vec::new();
        let mut folders = vec![self.root.path().to_path_buf()];
        while let Some(folder) = folders.pop() {
            for name in names(&folder) {
                let path = folder.join(name);
                if path.is_dir() {
                    folders.push(path);
                } else {
                    files.push(path.display().to_string());
                }
            }
        }
        files
    }

    /// Ids of the processes that were started by [`Memory::command`], or by one that was.
    pub fn processes(&self) -> Vec<u32> {
        let mark = format!("{IPC_PREFIX_VARIABLE}={}", self.prefix);
        let is_ours = |id: &u32| {
            fs::read(format!("/proc/{id}/environ")).is_ok_and(|environment| {
                environment
                    .split(|byte| *byte == 0)
                    .any(|entry| entry == mark.as_bytes())
            })
        };
        names(Path::new("/proc"))
            .iter()
            .filter_map(|name| name.parse().ok())
            .filter(is_ours)
            .collect()
    }

    /// Asserts that no process and no file is left. iceoryx2 keeps empty folders under the root.
    pub fn assert_nothing_left(&self) {
        assert_eq!(self.processes(), Vec::<u32>::new());
        assert_eq!(self.shared_files(), Vec::<String>::new());
        assert_eq!(self.root_files(), Vec::<String>::new());
    }
}

impl Drop for Memory {
    /// Ends and removes what a failed test left; the prefix is no one else's.
    fn drop(&mut self) {
        for id in self.processes() {
            let id = i32::try_from(id).ok().and_then(Pid::from_raw);
            // It may have ended by itself.
            let _ = id.map(|id| kill_process(id, Signal::KILL));
        }
        for name in self.shared_files() {
            // The test has failed for a better reason than this.
            let _ = fs::remove_file(Path::new(SHARED_MEMORY).join(name));
        }
    }
}

/// Names in a folder; what goes away meanwhile is not among them.
fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .filter_map(Result::ok)
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect()
}
