//! Removes what processes left behind that were killed, above all while they created or removed something.
//!
//! iceoryx2 cleans up after a dead node only as far as it can read what the node had: a service whose description was
//! half written stays for good, and its name cannot be opened any more. Two facts tell what nobody uses:
//!
//! * A node marks a service with a tag *before* it creates or opens it, and takes the tag away when it leaves. A
//!   service without the tag of a node that is alive is nobody's.
//! * The name of every port and every segment holds the id of the process that made it ([`process_of`]). A file of a
//!   process without a node that is alive is nobody's, unless a service that stays refers to it.
//!
//! Who is alive is asked of iceoryx2 (a lock on the node's file), never of process ids alone, which another container
//! counts differently. Files are listed before the living are, so what is made meanwhile is not touched. Only one
//! process sweeps at a time: the lock is on the root folder itself and leaves no file.

use std::collections::BTreeSet;
use std::fs::{self, File, Metadata, TryLockError};
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

use super::inspect::{self, SHARED_MEMORY};
use super::stillborn::{Warden, is_complete};
use super::{Config, TransportError};

/// A node or a service is made within milliseconds: a half-made one that is older was left by a process that died.
pub(super) const ABANDONED_AFTER: Duration = Duration::from_secs(2);
/// How long another process may sweep before this one goes without.
const PATIENCE: Duration = Duration::from_secs(3);
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Digits of the hash of a type, with which the names of segments begin; an id has one less at most.
const HASH_LEN: usize = 40;
/// Permissions of a service's description while it is being written; it is finished read-only.
const BEING_WRITTEN: u32 = 0o600;

/// What a sweep did.
///
/// ```
/// use inekf_shared::transport::Swept;
///
/// // A daemon was killed: one node, its services, and files besides.
/// let swept = Swept { nodes: 1, services: 13, files: 2, ..Swept::default() };
/// assert_eq!(swept.kept, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Swept {
    /// Nodes of dead processes that were removed.
    pub nodes: usize,
    /// Nodes of dead processes that could not be removed, as those of other users.
    pub kept: usize,
    /// Services that were removed because no process used them.
    pub services: usize,
    /// Other files that belonged to no process.
    pub files: usize,
}

/// Sweeps. What a living process uses is never touched. Does nothing if another process is still sweeping after some
/// seconds, or where the root folder belongs to another user.
///
/// # Errors
/// [`TransportError::Internal`] if nodes or folders cannot be listed.
///
/// ```
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, Swept, sweep};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let health = transport::health(&node, &Instance::new("car")?)?;
/// // What a living process uses is never touched.
/// assert_eq!(sweep(&config)?, Swept::default());
/// assert!(health.publisher().is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn sweep(config: &Config) -> Result<Swept, TransportError> {
    // Cleaning up after a node opens what it had open, and may meet what was never finished.
    let _warden = Warden::of(config);
    let Some(_lock) = lock(&root(config)) else {
        return Ok(Swept::default());
    };
    let (mut nodes, mut kept) = inspect::remove_dead_nodes(config)?;
    let services = abandoned_services(config)?;
    remove_all(&services);
    if kept > 0 {
        // What stood in the way of a node may just have been removed.
        let (more, still) = inspect::remove_dead_nodes(config)?;
        nodes += more;
        kept = still;
    }
    let leftovers = abandoned_nodes(config)?;
    let segments = abandoned_segments(config)?;
    Ok(Swept {
        nodes,
        kept,
        services: services.len(),
        files: remove_all(&leftovers) + remove_all(&segments),
    })
}

/// The process that made what bears this id, as iceoryx2 0.10 writes ids: seconds, nanoseconds, process, count, of 32
/// bits each, as one number of 128 bits.
///
/// ```
/// use inekf_shared::transport::{self, process_of};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// assert_eq!(process_of(node.id().value()), std::process::id());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub const fn process_of(id: u128) -> u32 {
    (id >> 64) as u32
}

/// Waits for the lock on a folder; `None` if it cannot be had.
fn lock(folder: &Path) -> Option<File> {
    let file = File::open(folder).ok()?;
    let started = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Some(file),
            Err(TryLockError::WouldBlock) if started.elapsed() < PATIENCE => sleep(LOOK_EVERY),
            Err(_) => return None,
        }
    }
}

/// Services that no living node has a tag of, and those that hang half made although somebody waits for them.
fn abandoned_services(config: &Config) -> Result<Vec<PathBuf>, TransportError> {
    let suffix = text(&config.global.service.static_config_storage_suffix);
    let tag_suffix = text(&config.global.node.service_tag_suffix);
    let prefix = text(&config.global.prefix);
    let services = list(&services_folder(config), &prefix, &suffix)?;
    if services.is_empty() {
        return Ok(Vec::new());
    }
    let mut used = BTreeSet::new();
    for node in living(config)? {
        let tags = list(
            &nodes_folder(config).join(node.to_string()),
            &prefix,
            &tag_suffix,
        )?;
        used.extend(tags.into_iter().map(|tag| tag.stem));
    }
    let abandoned = |service: &Entry| {
        is_hash(&service.stem)
            && (!used.contains(&service.stem) || hangs_half_made(config, service))
    };
    Ok(services
        .into_iter()
        .filter(abandoned)
        .filter(Entry::is_as_listed)
        .map(|service| service.path)
        .collect())
}

/// Whether a service has been without the segment that all its users share for longer than its creation takes.
fn hangs_half_made(config: &Config, service: &Entry) -> bool {
    if !is_older(&service.metadata, ABANDONED_AFTER) {
        return false;
    }
    if service.metadata.permissions().mode() & 0o777 == BEING_WRITTEN {
        return true;
    }
    let Some(id) = fs::read_to_string(&service.path)
        .ok()
        .and_then(|description| service_id(&description))
    else {
        return false;
    };
    let prefix = text(&config.global.prefix);
    let suffix = text(&config.global.service.dynamic_config_storage_suffix);
    let Ok(segments) = list(Path::new(SHARED_MEMORY), &prefix, &suffix) else {
        return false;
    };
    let segment = segments.iter().find(|segment| ids(&segment.stem) == [id]);
    segment.is_none_or(|segment| !is_complete(&segment.metadata))
}

/// The id of a service out of its description (TOML), where it stands in two halves.
pub(super) fn service_id(description: &str) -> Option<u128> {
    let half = |key: &str| {
        let line = description
            .lines()
            .find_map(|line| line.strip_prefix(key))?;
        line.trim_start()
            .strip_prefix('=')?
            .trim()
            .parse::<u64>()
            .ok()
    };
    Some(u128::from(half("unique_value")?) << 64 | u128::from(half("payload_value")?))
}

/// Files of nodes that are neither alive nor known as dead: their processes were killed while they made them.
fn abandoned_nodes(config: &Config) -> Result<Vec<PathBuf>, TransportError> {
    let folder = nodes_folder(config);
    let prefix = text(&config.global.prefix);
    let monitor = text(&config.global.node.monitor_suffix);
    let mut found = Vec::new();
    for (name, path, metadata) in entries(&folder)? {
        let id = if metadata.is_dir() {
            // Two sets of processes may share a root: a folder does not bear the prefix, its files do.
            own_folder(&path, &prefix)?
                .then(|| name.parse().ok())
                .flatten()
        } else {
            name.strip_prefix(&prefix)
                .and_then(|name| leading_id(name).filter(|_| name.contains(&monitor)))
        };
        if let Some(id) = id
            && is_older(&metadata, ABANDONED_AFTER)
        {
            found.push((id, path));
        }
    }
    if found.is_empty() {
        return Ok(Vec::new());
    }
    let known: BTreeSet<u128> = inspect::node_ids(config)?
        .into_iter()
        // A dead node without details cannot be cleaned up by iceoryx2, which does not know then where its files are.
        .filter(|node| node.alive || node.has_details)
        .map(|node| node.id)
        .collect();
    Ok(found
        .into_iter()
        .filter(|(id, _)| !known.contains(id))
        .map(|(_, path)| path)
        .collect())
}

/// Whether everything in a node's folder is named as under this prefix; another may only begin like it. An empty one is
/// anybody's.
fn own_folder(folder: &Path, prefix: &str) -> Result<bool, TransportError> {
    let is_own = |name: &str| {
        name.strip_prefix(prefix).is_some_and(|rest| {
            let stem = rest.split('.').next().unwrap_or_default();
            stem == "node" || is_hash(stem) || stem.parse::<u128>().is_ok()
        })
    };
    let files = entries(folder)?;
    Ok(files.iter().all(|(name, _, _)| is_own(name)))
}

/// Whether it is the hash of a service's name.
fn is_hash(stem: &str) -> bool {
    stem.len() == HASH_LEN && stem.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Segments, connections and sockets whose makers have no living node, and that no service refers to.
fn abandoned_segments(config: &Config) -> Result<Vec<PathBuf>, TransportError> {
    let prefix = text(&config.global.prefix);
    let service = &config.global.service;
    let shared = list(Path::new(SHARED_MEMORY), &prefix, "")?;
    let sockets = list(
        &root(config),
        &prefix,
        &text(&service.event_connection_suffix),
    )?;
    if shared.is_empty() && sockets.is_empty() {
        return Ok(Vec::new());
    }
    let descriptions: Vec<String> = list(
        &services_folder(config),
        &prefix,
        &text(&service.static_config_storage_suffix),
    )?
    .iter()
    // One that cannot be read may refer to anything, but then it has no segment yet.
    .filter_map(|description| fs::read_to_string(&description.path).ok())
    .collect();
    let referred: BTreeSet<u128> = descriptions
        .iter()
        .filter_map(|text| service_id(text))
        .collect();
    let living: BTreeSet<u32> = living(config)?.into_iter().map(process_of).collect();

    let of_a_port = [
        text(&service.data_segment_suffix),
        text(&service.connection_suffix),
        format!("{}_mgmt", service.event_connection_suffix),
    ];
    let of_a_service = [
        &service.dynamic_config_storage_suffix,
        &service.blackboard_mgmt_suffix,
        &service.blackboard_data_suffix,
    ]
    .map(text);
    let abandoned = |file: &Entry| {
        let makers = ids(&file.stem);
        let dead = !makers.is_empty() && makers.iter().all(|id| !living.contains(&process_of(*id)));
        let ends_with = |suffixes: &[String]| suffixes.iter().any(|s| file.stem.ends_with(s));
        dead && (ends_with(&of_a_port)
            || (ends_with(&of_a_service) && makers.iter().all(|id| !referred.contains(id))))
    };
    let orphan_socket = |file: &Entry| {
        file.metadata.file_type().is_socket()
            && leading_id(&file.stem).is_some_and(|id| !living.contains(&process_of(id)))
    };
    let shared = shared.into_iter().filter(abandoned);
    let sockets = sockets.into_iter().filter(orphan_socket);
    Ok(shared.chain(sockets).map(|file| file.path).collect())
}

/// Ids of the nodes that are alive, or that cannot be looked into.
fn living(config: &Config) -> Result<Vec<u128>, TransportError> {
    Ok(inspect::node_ids(config)?
        .into_iter()
        .filter(|node| node.alive)
        .map(|node| node.id)
        .collect())
}

/// The ids in a name without its prefix, `[HASH_]ID[_ID].SUFFIX`: of one port or service, or of the two ends of a
/// connection. Nothing if it is another kind of name.
pub(super) fn ids(name: &str) -> Vec<u128> {
    let base = name.split('.').next().unwrap_or_default();
    let ids: Option<Vec<u128>> = base
        .split('_')
        .filter(|part| part.len() != HASH_LEN)
        .map(|part| part.parse().ok())
        .collect();
    ids.unwrap_or_default()
}

/// The number that a name starts with.
fn leading_id(name: &str) -> Option<u128> {
    let end = name
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(name.len());
    name[..end].parse().ok()
}

/// A file whose name starts with the prefix and ends with the suffix.
struct Entry {
    path: PathBuf,
    /// The name without prefix and suffix.
    stem: String,
    metadata: Metadata,
}

impl Entry {
    /// Whether it is still the file that was listed, and not another that has taken its name since.
    fn is_as_listed(&self) -> bool {
        fs::symlink_metadata(&self.path).is_ok_and(|now| {
            let which = |metadata: &Metadata| (metadata.dev(), metadata.ino(), metadata.ctime());
            which(&now) == which(&self.metadata)
        })
    }
}

/// The files of a folder with this prefix and this suffix.
fn list(folder: &Path, prefix: &str, suffix: &str) -> Result<Vec<Entry>, TransportError> {
    let entries = entries(folder)?.into_iter();
    Ok(entries
        .filter(|(_, _, metadata)| !metadata.is_dir())
        .filter_map(|(name, path, metadata)| {
            let stem = name.strip_prefix(prefix)?.strip_suffix(suffix)?;
            Some(Entry {
                stem: stem.to_owned(),
                path,
                metadata,
            })
        })
        .collect())
}

/// What lies in a folder, by name; nothing if there is no such folder. What goes away meanwhile is left out.
fn entries(folder: &Path) -> Result<Vec<(String, PathBuf, Metadata)>, TransportError> {
    let refuse = |error: io::Error| TransportError::Internal {
        service: folder.display().to_string(),
        cause: error.to_string(),
    };
    let listed = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        listed => listed.map_err(refuse)?,
    };
    let mut found = Vec::new();
    for entry in listed {
        let entry = entry.map_err(refuse)?;
        // Not followed: a link is nobody's segment.
        if let Ok(metadata) = entry.metadata() {
            let name = entry.file_name().to_string_lossy().into_owned();
            found.push((name, entry.path(), metadata));
        }
    }
    Ok(found)
}

/// Removes files and folders, and says how many were there.
fn remove_all(paths: &[PathBuf]) -> usize {
    let removed = |path: &&PathBuf| match fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(path).is_ok(),
        Ok(_) => fs::remove_file(path).is_ok(),
        Err(_) => false,
    };
    paths.iter().filter(removed).count()
}

fn is_older(metadata: &Metadata, age: Duration) -> bool {
    let modified = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
    modified.elapsed().is_ok_and(|elapsed| elapsed > age)
}

fn root(config: &Config) -> PathBuf {
    PathBuf::from(config.global.root_path().to_string())
}

fn services_folder(config: &Config) -> PathBuf {
    PathBuf::from(config.global.service_dir().to_string())
}

fn nodes_folder(config: &Config) -> PathBuf {
    PathBuf::from(config.global.node_dir().to_string())
}

fn text(name: &impl ToString) -> String {
    name.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ids_in_a_name_are_those_of_its_makers() {
        let hash = "0354a209029e7d094a819e2d4030ea331e6caaf0";
        assert_eq!(ids("12.data"), [12]);
        assert_eq!(ids(&format!("{hash}_12.data")), [12]);
        assert_eq!(ids(&format!("{hash}_12_34.connection")), [12, 34]);
        assert_eq!(ids(&format!("{hash}_node.0_10_0.global_mgmt")), []);
        assert_eq!(ids("x12.data"), []);
        assert_eq!(leading_id("12.node_monitor_context"), Some(12));
        assert_eq!(leading_id("node"), None);
    }

    #[test]
    fn the_id_of_a_service_is_made_of_its_two_halves() {
        let description =
            "[unique_service_id]\npayload_value = 7\nunique_value = 2\n[other]\nmax = 9";
        assert_eq!(service_id(description), Some((2 << 64) + 7));
        assert_eq!(service_id("payload_value = 7"), None);
        assert_eq!(service_id("payload_value = -7\nunique_value = 2"), None);
    }
}
