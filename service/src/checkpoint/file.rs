//! The file of a checkpoint: one frame of [`inekf_shared::codec`] (magic, version, length, CRC) with the state and whose
//! it is.
//!
//! It is written beside its place and renamed, so that at every moment there is a whole one or none. It is read as if
//! it came from a stranger: whatever its bytes are, there is a state that was written, or the reason why there is none.
//!
//! ```
//! use inekf_service::checkpoint::file::{Identity, load};
//!
//! let folder = tempfile::tempdir()?;
//! let car = Identity {
//!     instance: "car".to_owned(),
//!     estimator: "inekf".to_owned(),
//!     model: inekf_shared::message::MODEL_IMU,
//!     dimension: 15,
//!     mismatches: String::new(),
//! };
//! // None yet is no fault.
//! assert_eq!(load(&folder.path().join("car.checkpoint"), &car)?, None);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use inekf_shared::codec::{self, CodecError, FRAME_CHECKPOINT, FRAME_HEADER_LEN};
use inekf_shared::message::{StateVector, model_name};
use serde::{Deserialize, Serialize};

/// Version of what is in the frame.
const VERSION: u32 = 2;
/// No checkpoint has as many bytes.
const MAX_BYTES: u64 = 64 * 1024;

/// Whose state it is: a state is continued only by the same.
///
/// ```
/// use inekf_service::checkpoint::file::{Identity, Unusable, encode, load};
/// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
///
/// let car = Identity {
///     instance: "car".to_owned(),
///     estimator: "inekf".to_owned(),
///     model: MODEL_IMU,
///     dimension: 15,
///     mismatches: String::new(),
/// };
/// let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("car.checkpoint");
/// std::fs::write(&path, encode(&car, &state)?)?;
/// assert_eq!(load(&path, &car)?, Some(state));
/// // A state is continued by its own daemon, and by no other.
/// let truck = Identity { instance: "truck".to_owned(), ..car };
/// assert!(matches!(load(&path, &truck), Err(Unusable::Foreign { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Name of the instance.
    pub instance: String,
    /// Name of the estimator, as the configuration has it.
    pub estimator: String,
    /// `MODEL_*` code.
    pub model: u32,
    /// Dimension of the state's error.
    pub dimension: u32,
    /// What is taken to be wrong with the inputs, and how it is treated: what the learned parameters mean. Empty if
    /// nothing is.
    pub mismatches: String,
}

/// What the frame holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Checkpoint {
    version: u32,
    identity: Identity,
    state: StateVector,
}

/// Why a checkpoint cannot be used.
///
/// ```
/// use inekf_service::checkpoint::file::{Identity, Unusable, load};
/// use inekf_shared::message::MODEL_IMU;
///
/// let car = Identity {
///     instance: "car".to_owned(),
///     estimator: "inekf".to_owned(),
///     model: MODEL_IMU,
///     dimension: 15,
///     mismatches: String::new(),
/// };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("car.checkpoint");
/// std::fs::write(&path, b"half a fra")?;
/// assert!(matches!(load(&path, &car), Err(Unusable::Bad(_))));
/// // A folder is no file either.
/// assert!(matches!(load(folder.path(), &car), Err(Unusable::NoFile)));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug, thiserror::Error)]
pub enum Unusable {
    /// The file cannot be read.
    #[error("it cannot be read: {0}")]
    Unreadable(io::Error),
    /// It is not a regular file.
    #[error("it is no file")]
    NoFile,
    /// It is longer than any checkpoint.
    #[error("it is longer than any checkpoint")]
    TooLong,
    /// It is cut short, damaged, or something else.
    #[error(transparent)]
    Bad(#[from] CodecError),
    /// Another version of this program wrote it.
    #[error("it has version {0}, this program reads version {VERSION}")]
    OtherVersion(u32),
    /// It is the state of another.
    #[error("it is of {found}, this daemon is {own}")]
    Foreign {
        /// Whose it is.
        found: String,
        /// Who asks.
        own: String,
    },
}

impl Identity {
    fn in_words(&self) -> String {
        format!(
            "instance {}, model {}, estimator {}, {} states, mismatches: {}",
            self.instance,
            model_name(self.model),
            self.estimator,
            self.dimension,
            match self.mismatches.as_str() {
                "" => "none",
                mismatches => mismatches,
            }
        )
    }
}

/// The bytes of a checkpoint.
///
/// # Errors
/// [`CodecError`]; a state of any numbers can be encoded.
///
/// ```
/// use inekf_service::checkpoint::file::{Identity, encode};
/// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
///
/// let car = Identity {
///     instance: "car".to_owned(),
///     estimator: "inekf".to_owned(),
///     model: MODEL_IMU,
///     dimension: 15,
///     mismatches: String::new(),
/// };
/// let bytes = encode(&car, &StateVector { stamp_ns: 7, ..StateVector::ZERO })?;
/// // The same state has the same bytes, another one has others.
/// assert_eq!(bytes, encode(&car, &StateVector { stamp_ns: 7, ..StateVector::ZERO })?);
/// assert_ne!(bytes, encode(&car, &StateVector { stamp_ns: 8, ..StateVector::ZERO })?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn encode(identity: &Identity, state: &StateVector) -> Result<Vec<u8>, CodecError> {
    let checkpoint = Checkpoint {
        version: VERSION,
        identity: identity.clone(),
        state: *state,
    };
    codec::encode(FRAME_CHECKPOINT, &checkpoint)
}

/// The state in the bytes of a checkpoint.
///
/// # Errors
/// [`Unusable`], if they are not whole or not of `identity`.
pub(super) fn decode(identity: &Identity, bytes: &[u8]) -> Result<StateVector, Unusable> {
    let Checkpoint {
        version,
        identity: found,
        state,
    } = match codec::decode(FRAME_CHECKPOINT, bytes) {
        // The bytes are whole, and mean something else: the version, which comes first in all of them, says so.
        Err(error @ (CodecError::Malformed { .. } | CodecError::Trailing { .. })) => {
            return Err(match version_of(bytes) {
                Some(version) if version != VERSION => Unusable::OtherVersion(version),
                _ => error.into(),
            });
        }
        decoded => decoded?,
    };
    if version != VERSION {
        return Err(Unusable::OtherVersion(version));
    }
    let is_own = (state.model, state.dimension) == (identity.model, identity.dimension);
    if found != *identity || !is_own {
        return Err(Unusable::Foreign {
            found: found.in_words(),
            own: identity.in_words(),
        });
    }
    Ok(state)
}

/// The version of what is in a frame, which a payload of any version begins with.
fn version_of(frame: &[u8]) -> Option<u32> {
    let version = frame.get(FRAME_HEADER_LEN..FRAME_HEADER_LEN + 4)?;
    Some(u32::from_le_bytes(version.try_into().ok()?))
}

/// The state in the file at `path`; `None` if there is no such file.
///
/// # Errors
/// [`Unusable`], naming the reason.
///
/// ```
/// use inekf_service::checkpoint::file::{Identity, encode, load};
/// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
///
/// let car = Identity {
///     instance: "car".to_owned(),
///     estimator: "inekf".to_owned(),
///     model: MODEL_IMU,
///     dimension: 15,
///     mismatches: String::new(),
/// };
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("car.checkpoint");
/// // None yet is no fault.
/// assert_eq!(load(&path, &car)?, None);
/// let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
/// std::fs::write(&path, encode(&car, &state)?)?;
/// assert_eq!(load(&path, &car)?, Some(state));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(path: &Path, identity: &Identity) -> Result<Option<StateVector>, Unusable> {
    match fs::metadata(path) {
        // A pipe would keep the daemon waiting.
        Ok(metadata) if !metadata.is_file() => return Err(Unusable::NoFile),
        Ok(_) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(Unusable::Unreadable(error)),
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
        .map_err(Unusable::Unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Unusable::TooLong);
    }
    decode(identity, &bytes).map(Some)
}

/// Puts `bytes` into the file at `path`: beside it, to the disk, renamed. The file is its owner's alone.
///
/// # Errors
/// As the system says; what was at `path` is then still there.
pub(super) fn store(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let beside = beside(path);
    let written = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(&beside)
        .and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        })
        .and_then(|()| fs::rename(&beside, path));
    if let Err(error) = written {
        // Half a checkpoint is of no use, and takes space that there may be none of.
        let _ = fs::remove_file(&beside);
        return Err(error);
    }
    // The name reaches the disk with its folder. Not every file system can be asked for that.
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Removes the file at `path`, if it is there.
///
/// # Errors
/// As the system says.
pub(super) fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Where the file is written before it is renamed.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use inekf_shared::message::{MODEL_IMU, Zero};

    use super::*;

    fn identity() -> Identity {
        Identity {
            instance: "car".to_owned(),
            estimator: "inekf".to_owned(),
            model: MODEL_IMU,
            dimension: 15,
            mismatches: String::new(),
        }
    }

    fn state() -> StateVector {
        let mut state = StateVector {
            model: MODEL_IMU,
            dimension: 15,
            stamp_ns: 1_234_567_890,
            q_wb: [0.5, -0.5, 0.5, 0.5],
            p_w_m: [1e6, -2.5, f64::MIN_POSITIVE],
            ..StateVector::ZERO
        };
        (0..120).for_each(|i| state.covariance[i] = 1.0 / (1.0 + i as f64));
        state
    }

    #[test]
    fn what_is_stored_is_loaded_and_only_its_owner_may_read_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("car.checkpoint");
        assert!(load(&path, &identity()).unwrap().is_none());
        for stamp_ns in [1, 2] {
            let state = StateVector {
                stamp_ns,
                ..state()
            };
            store(&path, &encode(&identity(), &state).unwrap()).unwrap();
            assert_eq!(load(&path, &identity()).unwrap(), Some(state));
        }
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn no_cut_and_no_flipped_bit_is_taken_for_a_checkpoint() {
        let mut bytes = encode(&identity(), &state()).unwrap();
        assert_eq!(decode(&identity(), &bytes).unwrap(), state());
        for len in 0..bytes.len() {
            assert!(decode(&identity(), &bytes[..len]).is_err(), "{len} bytes");
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                bytes[at] ^= 1 << bit;
                assert!(decode(&identity(), &bytes).is_err(), "byte {at}, bit {bit}");
                bytes[at] ^= 1 << bit;
            }
            let byte = bytes[at];
            bytes[at] = !byte;
            assert!(decode(&identity(), &bytes).is_err(), "byte {at}");
            bytes[at] = byte;
        }
        bytes.push(0);
        assert!(decode(&identity(), &bytes).is_err(), "one byte more");
    }

    #[test]
    fn the_state_of_another_is_refused_with_both_names() {
        let bytes = encode(&identity(), &state()).unwrap();
        let others = [
            Identity {
                instance: "van".to_owned(),
                ..identity()
            },
            Identity {
                estimator: "smoother".to_owned(),
                ..identity()
            },
            Identity {
                model: 3,
                ..identity()
            },
            Identity {
                dimension: 9,
                ..identity()
            },
            Identity {
                mismatches: "augmented: odometry scale".to_owned(),
                ..identity()
            },
        ];
        for other in others {
            let text = decode(&other, &bytes).unwrap_err().to_string();
            assert!(
                text.contains(
                    "instance car, model imu, estimator inekf, 15 states, mismatches: none"
                ),
                "{text}"
            );
            assert!(text.contains(&other.in_words()), "{text}");
        }
        // A file that contradicts itself.
        let state = StateVector {
            dimension: 9,
            ..state()
        };
        let bytes = encode(&identity(), &state).unwrap();
        assert!(matches!(
            decode(&identity(), &bytes),
            Err(Unusable::Foreign { .. })
        ));
    }

    #[test]
    fn what_an_older_version_wrote_is_refused_by_its_number() {
        /// A checkpoint before it had what was learned.
        #[derive(Serialize)]
        struct Before {
            version: u32,
            instance: String,
            estimator: String,
            model: u32,
            dimension: u32,
            state: Vec<f64>,
        }
        for version in [1, 3] {
            let before = Before {
                version,
                instance: "car".to_owned(),
                estimator: "inekf".to_owned(),
                model: MODEL_IMU,
                dimension: 15,
                state: vec![0.5; 140],
            };
            let bytes = codec::encode(FRAME_CHECKPOINT, &before).unwrap();
            let text = decode(&identity(), &bytes).unwrap_err().to_string();
            assert_eq!(
                text,
                format!("it has version {version}, this program reads version 2")
            );
        }
    }

    #[test]
    fn what_is_no_file_or_far_too_long_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(
            load(folder.path(), &identity()),
            Err(Unusable::NoFile)
        ));
        let long = folder.path().join("long");
        fs::write(&long, vec![0; 70_000]).unwrap();
        assert!(matches!(load(&long, &identity()), Err(Unusable::TooLong)));
        let inside = long.join("inside");
        assert!(matches!(
            load(&inside, &identity()),
            Err(Unusable::Unreadable(_))
        ));
    }

    #[test]
    fn a_write_that_fails_leaves_the_checkpoint_before_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        let bytes = encode(&identity(), &state()).unwrap();
        store(&path, &bytes).unwrap();
        // A folder in the way of the file beside it.
        fs::create_dir(folder.path().join("kept.new")).unwrap();
        assert!(store(&path, &[]).is_err());
        assert_eq!(load(&path, &identity()).unwrap(), Some(state()));
        assert!(store(&folder.path().join("no/such/folder"), &bytes).is_err());
    }

    #[test]
    fn what_is_not_there_need_not_be_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("car.checkpoint");
        store(&path, b"a state").unwrap();
        remove(&path).unwrap();
        assert!(!path.exists());
        remove(&path).unwrap();
    }
}
