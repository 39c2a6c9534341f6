//! Who may open what a daemon and its parties make: their user alone.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use inekf_tests::drive::drive;
use inekf_tests::faults::scene::Scene;
use inekf_tests::link::Link;

/// The one file that iceoryx2 opens to all: it counts nodes, 16 bytes, and holds nothing else.
const COUNTER: &str = ".global_mgmt";

#[test]
fn what_lies_in_shared_memory_is_open_to_its_owner_alone() {
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut link = Link::open(&scene.memory, "car");
    assert!(!link.feed_all(&drive(1, 1.0)).is_empty());
    let mut seen = 0;
    let shared = scene.memory.shared_paths();
    for path in shared.iter().chain(&scene.memory.root_files()) {
        let metadata = fs::symlink_metadata(path).unwrap();
        let mode = metadata.permissions().mode() & 0o777;
        if path.ends_with(COUNTER) {
            assert_eq!(metadata.len(), 16, "{path}");
            continue;
        }
        assert_eq!(mode & 0o077, 0, "{path}: {mode:o}");
        seen += 1;
    }
    assert!(seen > 20, "{seen} files");
    drop(link);
    daemon.stop();
}
