//! What the tests of this crate share: messages filled with bytes, and shared memory of one test's own.

// Each test binary compiles this module and uses a part of it.
#![allow(dead_code)]

use std::sync::atomic::{AtomicU32, Ordering};

use inekf_shared::message::Message;
use inekf_shared::transport::{Config, Node, config, open_node_with};
use tempfile::TempDir;

/// Calls `$check::<M>()` for every message type.
#[macro_export]
macro_rules! for_every_message {
    ($check:ident) => {{
        use inekf_shared::message::*;
        $check::<Header>();
        $check::<ImuSample>();
        $check::<Odometry2d>();
        $check::<Odometry3d>();
        $check::<PositionFix>();
        $check::<VelocityFix>();
        $check::<HeadingFix>();
        $check::<Counters>();
        $check::<EstimateHead>();
        $check::<EstimateSe23>();
        $check::<EstimateSe3>();
        $check::<EstimateSe2>();
        $check::<Health>();
        $check::<StateVector>();
        $check::<ControlRequest>();
        $check::<ControlResponse>();
        $check::<SmoothedState>();
        $check::<ProcessNoise>();
        $check::<JournalEntry>();
    }};
}

/// A message made of these bytes, which must be as many as it has.
pub fn from_bytes<M: Message>(bytes: &[u8]) -> M {
    M::from_bytes(bytes).unwrap()
}

/// The bytes of a message.
pub fn to_bytes<M: Message>(message: &M) -> &[u8] {
    message.as_bytes()
}

/// Shared memory that no other test sees: own directory, own prefix.
pub struct Isolated {
    pub root: TempDir,
    pub prefix: String,
    pub config: Config,
}

impl Isolated {
    pub fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        // Not where TMPDIR says: the path of a socket has to stay short.
        let root = tempfile::tempdir_in("/tmp").unwrap();
        let prefix = format!(
            "inekf_test_{}_{}_",
            std::process::id(),
            COUNT.fetch_add(1, Ordering::Relaxed)
        );
        let config = config(root.path().to_str(), Some(&prefix)).unwrap();
        Self {
            root,
            prefix,
            config,
        }
    }

    pub fn node(&self) -> Node {
        open_node_with("test", &self.config).unwrap()
    }

    pub fn assert_no_file_is_left(&self) {
        assert_eq!(self.shared_memory_files(), Vec::<String>::new());
        assert_eq!(self.root_files(), Vec::<String>::new());
    }

    /// Names of this test's files in /dev/shm.
    pub fn shared_memory_files(&self) -> Vec<String> {
        std::fs::read_dir("/dev/shm")
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.contains(&self.prefix))
            .collect()
    }

    /// Paths of the files, not directories, under the root.
    pub fn root_files(&self) -> Vec<String> {
        let mut files = Vec::new();
        let mut directories = vec![self.root.path().to_path_buf()];
        while let Some(directory) = directories.pop() {
            for entry in std::fs::read_dir(directory).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    directories.push(path);
                } else {
                    files.push(path.display().to_string());
                }
            }
        }
        files
    }
}

impl Drop for Isolated {
    /// Removes what is left, also by a failed test: nobody else uses this prefix.
    fn drop(&mut self) {
        for file in self.shared_memory_files() {
            let _ = std::fs::remove_file(format!("/dev/shm/{file}"));
        }
    }
}
