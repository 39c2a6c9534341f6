//! Whether anything came, went or was renamed in a folder: one system call instead of one for each file.

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// The time of a folder's last change is as coarse as the system's clock tick: what changes right after a look may bear
/// the same time. A change that is younger than this at a look is therefore looked at once more.
const SETTLED_AFTER: Duration = Duration::from_millis(100);

/// A folder that is looked at again and again.
///
/// ```
/// use inekf_shared::transport::Folder;
///
/// let place = tempfile::tempdir()?;
/// let mut folder = Folder::new(place.path().to_path_buf());
/// assert!(folder.has_changed(), "so far nothing was known of it");
/// std::fs::write(place.path().join("new"), "")?;
/// assert!(folder.has_changed());
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// The last change that was known, and settled, at the last look.
    known: Option<SystemTime>,
}

impl Folder {
    /// Nothing is known of it yet.
    ///
    /// ```
    /// use inekf_shared::transport::Folder;
    ///
    /// let mut nowhere = Folder::new("/nowhere".into());
    /// // Of a folder that cannot be asked nobody can say that it has not changed.
    /// assert!(nowhere.has_changed() && nowhere.has_changed());
    /// ```
    #[must_use]
    pub fn new(path: PathBuf) -> Self {
        Self { path, known: None }
    }

    /// Whether its entries may have changed since the last call. What is in its files does not count.
    ///
    /// ```
    /// use inekf_shared::transport::Folder;
    ///
    /// let place = tempfile::tempdir()?;
    /// // A folder whose last change is long past.
    /// std::fs::File::open(place.path())?.set_modified(std::time::UNIX_EPOCH)?;
    /// let mut folder = Folder::new(place.path().to_path_buf());
    /// assert!(folder.has_changed() && !folder.has_changed());
    /// std::fs::write(place.path().join("new"), "")?;
    /// assert!(folder.has_changed());
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn has_changed(&mut self) -> bool {
        let now = SystemTime::now();
        let changed = fs::metadata(&self.path).and_then(|metadata| metadata.modified());
        let last = changed.ok();
        let is_known = last.is_some() && last == self.known;
        self.known = last.filter(|last| {
            now.duration_since(*last)
                .is_ok_and(|age| age > SETTLED_AFTER)
        });
        !is_known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_and_goes_is_a_change_and_what_is_written_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let mut looked = Folder::new(folder.path().to_path_buf());
        // Until the making of the folder has settled.
        assert!(looked.has_changed() && looked.has_changed());
        let settle = || std::thread::sleep(SETTLED_AFTER * 2);
        let file = folder.path().join("file");
        let steps: [&dyn Fn(); 3] = [&|| {}, &|| fs::write(&file, "1").unwrap(), &|| {
            fs::remove_file(&file).unwrap()
        }];
        for step in steps {
            step();
            assert!(looked.has_changed());
            settle();
            looked.has_changed();
            assert!(!looked.has_changed());
        }
        fs::write(&file, "1").unwrap();
        settle();
        looked.has_changed();
        fs::write(&file, "2").unwrap();
        assert!(!looked.has_changed());
    }
}
