//! What lies in shared memory: nodes alive and dead, files.
//!
//! For people and for cleaning up ([`super::sweep()`]); no port is opened.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::node::{Node, NodeState, NodeView};
use iceoryx2::prelude::{CallbackProgression, ipc};

use super::{Config, TransportError};

/// Where the system keeps shared memory.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";
/// How long the clean-up of one dead node may take.
const CLEANUP_WITHIN: Duration = Duration::from_secs(5);

/// A process's access to shared memory, as others see it.
///
/// ```
/// use inekf_shared::transport::{self, inspect};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let mine = &inspect::nodes(&config)?[0];
/// assert_eq!((mine.process, mine.alive), (std::process::id(), true));
/// # drop(node);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeReport {
    /// Name the process gave it; empty if its details cannot be read.
    pub name: String,
    /// Name of the program; empty if its details cannot be read.
    pub program: String,
    /// Process id; 0 if its details cannot be read.
    pub process: u32,
    /// Whether the process is alive.
    pub alive: bool,
}

fn internal(cause: String) -> TransportError {
    TransportError::Internal {
        service: "the list of nodes".to_owned(),
        cause,
    }
}

/// What iceoryx2 0.10 calls the lock on the state of a node.
const LOCK_SUFFIX: &str = "_owner_lock";

fn each_node(
    config: &Config,
    mut take: impl FnMut(NodeState<ipc::Service>),
) -> Result<(), TransportError> {
    Node::<ipc::Service>::list(config, |state| {
        take(state);
        CallbackProgression::Continue
    })
    .map_err(|error| internal(format!("{error:?}")))
}

/// All nodes under `config`. Those of other users cannot be looked into and are left out.
///
/// # Errors
/// [`TransportError::Internal`] if they cannot be listed.
///
/// ```
/// use inekf_shared::transport::{self, inspect};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// assert!(inspect::nodes(&config)?.is_empty());
/// let node = transport::open_node_with("my-robot", &config)?;
/// assert_eq!(inspect::nodes(&config)?[0].name, "my-robot");
/// # drop(node);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn nodes(config: &Config) -> Result<Vec<NodeReport>, TransportError> {
    let mut reports = Vec::new();
    each_node(config, |state| {
        let (details, alive) = match &state {
            NodeState::Alive(view) => (view.details(), true),
            NodeState::Dead(view) => (view.details(), false),
            NodeState::Inaccessible(_) | NodeState::Undefined(_) => return,
        };
        reports.push(match details {
            Some(details) => NodeReport {
                name: details.name().to_string(),
                program: details.executable().to_string(),
                process: u32::try_from(details.process_id().value()).unwrap_or(0),
                alive,
            },
            None => NodeReport {
                name: String::new(),
                program: String::new(),
                process: 0,
                alive,
            },
        });
    })?;
    Ok(reports)
}

/// A node, as a sweep needs it.
pub(super) struct NodeId {
    pub(super) id: u128,
    /// Whether its process is alive, or may be: a node of another user tells nothing.
    pub(super) alive: bool,
    pub(super) has_details: bool,
}

/// The ids of all nodes under `config`.
pub(super) fn node_ids(config: &Config) -> Result<Vec<NodeId>, TransportError> {
    let mut ids = Vec::new();
    each_node(config, |state| {
        let (alive, has_details) = match &state {
            NodeState::Dead(view) => (false, view.details().is_some()),
            NodeState::Undefined(id) if is_half_removed(config, id.value()) => (false, false),
            _ => (true, true),
        };
        let id = state.node_id().value();
        ids.push(NodeId {
            id,
            alive,
            has_details,
        });
    })?;
    Ok(ids)
}

/// Whether the lock by which a node is known to live has been removed, and its state has not: who cleaned up after it was
/// killed at that moment. iceoryx2 cannot say then whether the node lives, and never cleans up after it; one that lives
/// has its lock from before its state to after it.
fn is_half_removed(config: &Config, id: u128) -> bool {
    let global = &config.global;
    let state = format!("{}{id}{}", global.prefix, global.node.monitor_suffix);
    let folder = PathBuf::from(global.node_dir().to_string());
    folder.join(&state).exists() && !folder.join(format!("{state}{LOCK_SUFFIX}")).exists()
}

/// Removes what dead nodes left. Returns how many were removed and how many could not be.
///
/// # Errors
/// As [`nodes`].
pub(super) fn remove_dead_nodes(config: &Config) -> Result<(usize, usize), TransportError> {
    let (mut removed, mut kept) = (0, 0);
    each_node(config, |state| {
        if let NodeState::Dead(view) = state {
            match view.blocking_remove_stale_resources(CLEANUP_WITHIN) {
                Ok(()) => removed += 1,
                Err(_) => kept += 1,
            }
        }
    })?;
    Ok((removed, kept))
}

/// The files in shared memory under `config`, with their sizes in bytes.
///
/// # Errors
/// They cannot be listed.
///
/// ```
/// use inekf_shared::message::ImuSample;
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, inspect};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let publisher = transport::input::<ImuSample>(&node, &Instance::default())?.publisher()?;
/// // Room for thousands of samples of 80 bytes each.
/// let bytes: u64 = inspect::shared_memory_files(&config)?.iter().map(|(_, bytes)| bytes).sum();
/// assert!(bytes > 4096 * 80);
/// # drop(publisher);
/// # drop(node);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn shared_memory_files(config: &Config) -> io::Result<Vec<(PathBuf, u64)>> {
    let files = files(Path::new(SHARED_MEMORY), &config.global.prefix.to_string())?;
    Ok(files
        .into_iter()
        .map(|(path, metadata)| (path, metadata.len()))
        .collect())
}

/// The files of `folder` whose names start with `prefix`; none if there is no such folder.
pub(super) fn files(folder: &Path, prefix: &str) -> io::Result<Vec<(PathBuf, fs::Metadata)>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut files = Vec::new();
    for entry in entries {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(prefix)
            // A file that has gone meanwhile is no file of interest.
            && let Ok(metadata) = entry.metadata()
            && metadata.is_file()
        {
            files.push((entry.path(), metadata));
        }
    }
    files.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(files)
}
