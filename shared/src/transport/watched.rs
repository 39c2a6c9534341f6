//! Whether others can still attach to what this process has open.
//!
//! Shared memory stays usable for those who have it mapped after its file was removed; nothing fails, but nobody new
//! finds it. A long-lived process looks now and then whether its files are still there.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

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

/// A file as it was: its place, and which file of that name it is.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Seen {
    path: PathBuf,
    device: u64,
    inode: u64,
}

impl Seen {
    /// The file that is at `path` now.
    fn at(path: PathBuf) -> Option<Self> {
        let metadata = fs::symlink_metadata(&path).ok()?;
        Some(Self {
            path,
            device: metadata.dev(),
            inode: metadata.ino(),
        })
    }

    /// Whether it is there: `None` if nothing is, false if another file is.
    fn is_there(&self) -> Option<bool> {
        let now = Self::at(self.path.clone())?;
        Some(now == *self)
    }
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

        let mut files = vec![nodes.join(format!("{prefix}{own}{}", global.node.monitor_suffix))];
        let tag_suffix = global.node.service_tag_suffix.to_string();
        let mut used = Vec::new();
        for tag in names(&nodes.join(own.to_string()))? {
            let Some(service) = tag
                .strip_suffix(&tag_suffix)
                .filter(|name| name.starts_with(&prefix))
            else {
                continue;
            };
            let description = services.join(format!(
                "{service}{}",
                global.service.static_config_storage_suffix
            ));
            let text = fs::read_to_string(&description).ok();
            used.extend(text.and_then(|text| service_id(&text)));
            files.push(description);
        }
        let data_suffix = global.service.data_segment_suffix.to_string();
        let shared_suffix = global.service.dynamic_config_storage_suffix.to_string();
        let is_needed = |name: &String| {
            let ids = name.strip_prefix(&prefix).map(ids).unwrap_or_default();
            let [id] = ids[..] else { return false };
            (with_data && name.ends_with(&data_suffix) && process_of(id) == std::process::id())
                || (name.ends_with(&shared_suffix) && used.contains(&id))
        };
        let segments = names(Path::new(SHARED_MEMORY))?.into_iter();
        files.extend(
            segments
                .filter(is_needed)
                .map(|name| Path::new(SHARED_MEMORY).join(name)),
        );
        Ok(Self(files.into_iter().filter_map(Seen::at).collect()))
    }

    /// Whether all of them are still there, and are the same. One system call for each.
    #[must_use]
    pub fn is_intact(&self) -> bool {
        self.0.iter().all(|file| file.is_there() == Some(true))
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
        let others = self.0.iter().filter(|file| file.is_there() == Some(false));
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
