//! Nodes, and where their files are.

use core::cell::RefCell;
use core::mem::replace;
use core::ops::Deref;
use core::time::Duration;
use std::env::{self, VarError};
use std::sync::Arc;
use std::thread::sleep;
use std::time::Instant;

use iceoryx2::config::Config;
use iceoryx2::prelude::{
    CallbackProgression, FileName, NodeBuilder, NodeName, Path, PortFactory, SemanticString,
    SignalHandlingMode, ipc,
};

use super::reserve::{LEAST_FREE, require_descriptors, require_shared_memory};
use super::stillborn::{self, Warden};
use super::{TransportError, sweep};

/// How long a node is tried to be made while there is something half made in its way.
const PATIENCE: Duration = Duration::from_secs(3);
const LOOK_EVERY: Duration = Duration::from_millis(20);

type IpcNode = iceoryx2::node::Node<ipc::Service>;

/// A process's (or thread's) access to shared memory; in use as iceoryx2's own node.
///
/// Drop it after the ports and services that were made from it: the last one of all processes then
/// leaves no file in `/dev/shm`.
///
/// ```
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, inspect};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// let node = transport::open_node_with("my-robot", &config)?;
/// let health = transport::health(&node, &Instance::default())?;
/// // Ports and services first, then the node: nothing is left.
/// drop(health);
/// drop(node);
/// assert!(inspect::shared_memory_files(&config)?.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Node {
    node: IpcNode,
    /// The services that were opened on it: hash of the name, and id.
    opened: RefCell<Vec<(String, u128)>>,
    // After the node: fields are dropped in the order of their declaration.
    _counter: NodeCounter,
    // To the end: ports that outlive this hold the node itself, and may meet such segments too.
    _warden: Arc<Warden>,
}

impl Node {
    /// Notes that a service has been opened on it.
    pub(super) fn note(&self, service: &impl PortFactory) {
        let hash = service.service_hash().as_str().to_owned();
        let id = service.unique_service_id().value();
        let mut opened = self.opened.borrow_mut();
        opened.retain(|(known, _)| *known != hash);
        opened.push((hash, id));
    }

    /// The id of the service with this hash, if it was opened on this node.
    pub(super) fn opened(&self, hash: &str) -> Option<u128> {
        let opened = self.opened.borrow();
        let found = opened.iter().find(|(known, _)| known == hash);
        found.map(|(_, id)| *id)
    }
}

impl Deref for Node {
    type Target = IpcNode;

    fn deref(&self) -> &IpcNode {
        &self.node
    }
}

/// iceoryx2's count of the nodes there ever were: a file of 16 bytes for each root and prefix, which
/// it never removes. Removed when dropped, unless there is still a node.
#[derive(Debug)]
struct NodeCounter(Config);

impl Drop for NodeCounter {
    fn drop(&mut self) {
        let mut in_use = false;
        let listed = IpcNode::list(&self.0, |_| {
            in_use = true;
            CallbackProgression::Stop
        });
        if listed.is_ok() && !in_use {
            // A file that is left is no failure: the next process counts on in it.
            // SAFETY: asked is that no other process uses the same root and prefix, and no node was
            // there a moment ago. One that comes now keeps the file mapped or makes a new one, and
            // its id stays unique: the count is only a part of it, beside the process id and the
            // time in nanoseconds.
            let _ =
                unsafe { iceoryx2::testing::remove_global_mgmt_segment::<ipc::Service>(&self.0) };
        }
    }
}

/// Removes iceoryx2's count of nodes if there is no node, for a process that cleans up and has none of its own.
///
/// ```
/// use inekf_shared::transport::{self, inspect};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// transport::remove_node_counter(&config);
/// assert!(inspect::shared_memory_files(&config)?.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn remove_node_counter(config: &Config) {
    drop(NodeCounter(config.clone()));
}

/// Environment variable: absolute directory of the files that describe nodes and services.
pub const IPC_ROOT_VARIABLE: &str = "INEKF_IPC_ROOT";

/// Environment variable: start of the names of all files.
pub const IPC_PREFIX_VARIABLE: &str = "INEKF_IPC_PREFIX";

/// Most bytes that root and prefix may have together. What wakes the daemon is a socket in the root, and the path of a
/// socket has at most 107 bytes: root, `/`, prefix, an id of up to 39 digits, `.event`.
pub const IPC_ROOT_AND_PREFIX_MAX_LEN: usize = 107 - 1 - 39 - 6;

/// iceoryx2's configuration with its defaults but for `root` and `prefix`, where given.
///
/// # Errors
/// [`TransportError::Setting`] if `root` is not an absolute path, `prefix` no start of a file name, or both together too
/// long.
///
/// ```
/// use inekf_shared::transport::config;
///
/// let apart = config(Some("/tmp/mine"), Some("mine_"))?;
/// assert_eq!(apart.global.prefix.to_string(), "mine_");
/// assert!(config(Some("not/absolute"), None).is_err());
/// assert!(config(None, Some("a/b")).is_err());
/// # Ok::<(), inekf_shared::transport::TransportError>(())
/// ```
pub fn config(root: Option<&str>, prefix: Option<&str>) -> Result<Config, TransportError> {
    let refuse = |variable, value: Option<&str>, fault| TransportError::Setting {
        variable,
        value: value.unwrap_or_default().to_owned(),
        fault,
    };
    let refuse_root = |fault| refuse(IPC_ROOT_VARIABLE, root, fault);
    let refuse_prefix = |fault| refuse(IPC_PREFIX_VARIABLE, prefix, fault);
    let mut config = Config::default();
    // iceoryx2 panics over a path it cannot put together, so a long one must not get as far.
    let root_len = root.map_or(config.global.root_path().len(), str::len);
    let prefix_len = prefix.map_or(config.global.prefix.len(), str::len);
    if root_len + prefix_len > IPC_ROOT_AND_PREFIX_MAX_LEN {
        let fault = "is too long: root and prefix may have 61 bytes together";
        return Err(match root {
            Some(_) => refuse_root(fault),
            None => refuse_prefix(fault),
        });
    }
    if let Some(root) = root {
        if !root.starts_with('/') {
            return Err(refuse_root("must be an absolute path"));
        }
        let path =
            Path::new(root.as_bytes()).map_err(|_| refuse_root("contains what a path must not"))?;
        config.global.set_root_path(&path);
    }
    if let Some(prefix) = prefix {
        config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| {
            refuse_prefix("must be the start of a file name: not empty, without '/'")
        })?;
    }
    Ok(config)
}

/// The configuration as the environment has it: see the [module](super).
///
/// # Errors
/// [`TransportError::Setting`] if a variable is set to what cannot be used.
///
/// ```
/// use inekf_shared::transport::{config_from_env, open_node_with};
///
/// // The same as `open_node("my-robot")`; in between the configuration can be looked at.
/// let config = config_from_env()?;
/// let root = config.global.root_path().to_string();
/// assert!(root.starts_with('/'));
/// # Ok::<(), inekf_shared::transport::TransportError>(())
/// ```
pub fn config_from_env() -> Result<Config, TransportError> {
    let read = |variable| match env::var(variable) {
        Ok(value) => Ok(Some(value)),
        Err(VarError::NotPresent) => Ok(None),
        Err(VarError::NotUnicode(value)) => Err(TransportError::Setting {
            variable,
            value: value.to_string_lossy().into_owned(),
            fault: "is not UTF-8",
        }),
    };
    config(
        read(IPC_ROOT_VARIABLE)?.as_deref(),
        read(IPC_PREFIX_VARIABLE)?.as_deref(),
    )
}

/// Creates a node where the environment says. `name` is for people who list the nodes.
///
/// # Errors
/// As [`config_from_env`] and [`open_node_with`].
///
/// It is not run here, for it opens the shared memory that the environment names, and is others' too:
///
/// ```no_run
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// let node = transport::open_node("my-robot")?;
/// let health = transport::health(&node, &Instance::new("car")?)?.subscriber()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open_node(name: &str) -> Result<Node, TransportError> {
    open_node_with(name, &config_from_env()?)
}

/// Creates one node of many in a process that has swept ([`sweep()`](super::sweep())): nodes that each look at all others
/// would take the square of the time.
///
/// # Errors
/// As [`open_node`].
///
/// It is not run here, for it opens the shared memory that the environment names, and is others' too:
///
/// ```no_run
/// use inekf_shared::transport;
///
/// transport::sweep(&transport::config_from_env()?)?;
/// let nodes: Result<Vec<_>, _> = (0..100).map(|_| transport::open_another_node("fleet")).collect();
/// assert_eq!(nodes?.len(), 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open_another_node(name: &str) -> Result<Node, TransportError> {
    require_descriptors()?;
    let mut config = config_from_env()?;
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    create(name, &config)
}

/// Creates a node under `config`.
///
/// Signals are left alone: iceoryx2 would otherwise take over SIGINT and SIGTERM at the first wait. What killed
/// processes left is swept away first.
///
/// # Errors
/// [`TransportError::Node`]; [`TransportError::Space`] or [`TransportError::Descriptors`] if there is too little of
/// either for anything to be opened.
///
/// ```
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// let config = transport::config(root.path().to_str(), prefix)?;
/// let node = transport::open_node_with("my-robot", &config)?;
/// assert_eq!(node.name().as_str(), "my-robot");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open_node_with(name: &str, config: &Config) -> Result<Node, TransportError> {
    require_descriptors()?;
    require_shared_memory(LEAST_FREE)?;
    // One for both.
    let _warden = Warden::of(config);
    // What could not be swept need not stand in the way; if it does, whatever it blocks says so.
    let _ = sweep(config);
    create(name, config)
}

fn create(name: &str, config: &Config) -> Result<Node, TransportError> {
    let refuse = |cause: String| TransportError::Node {
        node: name.to_owned(),
        root: config.global.root_path().to_string(),
        cause,
    };
    let node_name = NodeName::new(name).map_err(|error| refuse(format!("{error:?}")))?;
    require_shared_memory(LEAST_FREE)?;
    // Before the node, which may have to wait for it.
    let warden = Warden::of(config);
    let started = Instant::now();
    let mut is_last = false;
    let node = loop {
        let created = NodeBuilder::new()
            .name(&node_name)
            .config(config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>();
        match created {
            Ok(node) => break node,
            // The count of nodes may have been left half made; it goes away soon, or has just gone.
            Err(_)
                if started.elapsed() < PATIENCE
                    && (stillborn::is_there(config) || !replace(&mut is_last, true)) =>
            {
                sleep(LOOK_EVERY);
            }
            Err(error) => return Err(refuse(format!("{error:?}"))),
        }
    };
    Ok(Node {
        node,
        opened: RefCell::default(),
        _counter: NodeCounter(config.clone()),
        _warden: warden,
    })
}
