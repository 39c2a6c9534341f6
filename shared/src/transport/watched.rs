//! Whether others can still attach to what this process has open.
//!
//! Shared memory stays usable for those who have it mapped after its file was removed; nothing fails, but nobody new
//! finds it. A long-lived process looks now and then whether its files are still there.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::folder::Folder;
use super::inspect::SHARED_MEMORY;
use super::sweep::{ids, process_of, service_id};
use super::{Node, TransportError};
use crate::clock::monotonic_ns;

/// The files without which nobody can attach: the node's own, the services' that it has open, and its ports' data.
///
/// ```
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, Watched};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let health = transport::health(&node, &Instance::new("car")?)?.publisher()?;
/// let watched = Watched::of(&node)?;
/// assert!(watched.is_intact());
/// // Somebody tidies up.
/// std::fs::remove_dir_all(root.path().join("services"))?;
/// assert!(!watched.is_intact());
/// # drop(health);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Watched(Vec<Seen>);

/// A file that should be there.
#[derive(Clone, Debug)]
struct Seen {
    path: PathBuf,
    identity: Identity,
}

/// How a file is told from others of its name. Not by its inode: the number of one that was removed is given to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Identity {
    /// Its name holds an id that nobody else ever has.
    Name,
    /// It describes the service with this id.
    Service(u128),
    /// It had gone before it was seen, whatever there is in its place.
    Gone,
}

impl Seen {
    fn is_there(&self) -> bool {
        match self.identity {
            Identity::Name => fs::symlink_metadata(&self.path).is_ok(),
            Identity::Service(id) => described(&self.path) == Some(id),
            Identity::Gone => false,
        }
    }

    /// Whether another file is there.
    fn is_replaced(&self) -> bool {
        self.identity != Identity::Name && self.path.exists() && !self.is_there()
    }
}

/// The id of the service that a file describes.
fn described(path: &Path) -> Option<u128> {
    service_id(&fs::read_to_string(path).ok()?)
}

impl Watched {
    /// Those of a node whose ports are all made. Assumes that no other node of this process uses the same prefix.
    ///
    /// # Errors
    /// [`TransportError::Internal`] if the folders cannot be read.
    pub fn of(node: &Node) -> Result<Self, TransportError> {
        Self::listed(node, true)
    }

    /// Those of a node whose services are all open, without its ports' data: for one of several nodes of a process.
    ///
    /// # Errors
    /// As [`Watched::of`].
    ///
    /// ```
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport::{self, Watched};
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = transport::open_node_with("doc", &config)?;
    /// let health = transport::health(&node, &Instance::new("car")?)?;
    /// assert!(Watched::services_of(&node)?.is_intact());
    /// # drop(health);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn services_of(node: &Node) -> Result<Self, TransportError> {
        Self::listed(node, false)
    }

    fn listed(node: &Node, with_data: bool) -> Result<Self, TransportError> {
        let global = &node.config().global;
        let own = node.id().value();
        let prefix = global.prefix.to_string();
        let nodes = PathBuf::from(global.node_dir().to_string());
        let services = PathBuf::from(global.service_dir().to_string());

        let monitor = nodes.join(format!("{prefix}{own}{}", global.node.monitor_suffix));
        let unique = |path: PathBuf| Seen {
            path,
            identity: Identity::Name,
        };
        let mut files = vec![unique(monitor)];
        let tag_suffix = global.node.service_tag_suffix.to_string();
        let mut used = Vec::new();
        for tag in names(&nodes.join(own.to_string()))? {
            let hash = tag
                .strip_suffix(&tag_suffix)
                .and_then(|name| name.strip_prefix(&prefix));
            let Some(hash) = hash else { continue };
            let description = services.join(format!(
                "{prefix}{hash}{}",
                global.service.static_config_storage_suffix
            ));
            // Between its opening and now others may have removed it, or made another of its name.
            let id = node.opened(hash).or_else(|| described(&description));
            used.extend(id);
            files.push(Seen {
                path: description,
                identity: id.map_or(Identity::Gone, Identity::Service),
            });
        }
        let data_suffix = global.service.data_segment_suffix.to_string();
        let shared_suffix = global.service.dynamic_config_storage_suffix.to_string();
        let mut found = BTreeSet::new();
        for name in names(Path::new(SHARED_MEMORY))? {
            let ids = name.strip_prefix(&prefix).map(ids).unwrap_or_default();
            let [id] = ids[..] else { continue };
            let is_own = name.ends_with(&data_suffix) && process_of(id) == std::process::id();
            let is_shared = name.ends_with(&shared_suffix) && used.contains(&id);
            if is_shared {
                found.insert(id);
            }
            if is_shared || (with_data && is_own) {
                files.push(unique(Path::new(SHARED_MEMORY).join(name)));
            }
        }
        let missing = used.into_iter().filter(|id| !found.contains(id));
        files.extend(missing.map(|id| {
            let name = format!("{prefix}{id}{shared_suffix}");
            Seen {
                path: Path::new(SHARED_MEMORY).join(name),
                identity: Identity::Gone,
            }
        }));
        Ok(Self(files))
    }

    /// The folders they are in. While none of these changes, all files are still there and the same.
    #[must_use]
    pub fn folders(&self) -> Vec<Folder> {
        let folders: BTreeSet<&Path> = self
            .0
            .iter()
            .filter_map(|file| file.path.parent())
            .collect();
        folders
            .into_iter()
            .map(|folder| Folder::new(folder.to_path_buf()))
            .collect()
    }

    /// Whether all of them are still there, and are the same. A few system calls for each.
    #[must_use]
    pub fn is_intact(&self) -> bool {
        self.0.iter().all(Seen::is_there)
    }

    /// Runs `let_go`, which ends the use of these files, and puts back what others have made of the same name since: the
    /// last user of a service removes its description by name.
    ///
    /// ```
    /// use inekf_shared::transport::{self, Watched};
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = transport::open_node_with("doc", &config)?;
    /// // What ends the use of the files, and what it returns.
    /// let watched = Watched::of(&node)?;
    /// let left = watched.sparing_others(|| {
    ///     drop(node);
    ///     true
    /// });
    /// assert!(left && !watched.is_intact());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sparing_others<T>(&self, let_go: impl FnOnce() -> T) -> T {
        let others = self.0.iter().filter(|file| file.is_replaced());
        let aside: Vec<(&Path, PathBuf)> = others
            .filter_map(|file| {
                let aside = aside(&file.path);
                // What cannot be put aside is made anew by its owner, who looks after it as well.
                fs::hard_link(&file.path, &aside).ok()?;
                Some((file.path.as_path(), aside))
            })
            .collect();
        let done = let_go();
        for (path, aside) in aside {
            // Fails where there is one, as there should be.
            let _ = fs::hard_link(&aside, path);
            let _ = fs::remove_file(&aside);
        }
        done
    }
}

/// A name beside `path` that nobody else uses, and that is none of a service.
fn aside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".aside.{}.{}", std::process::id(), monotonic_ns()));
    PathBuf::from(name)
}

fn names(folder: &Path) -> Result<Vec<String>, TransportError> {
    let entries = fs::read_dir(folder).map_err(|error| TransportError::Internal {
        service: folder.display().to_string(),
        cause: error.to_string(),
    })?;
    Ok(entries
        .filter_map(Result::ok)
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect())
}
