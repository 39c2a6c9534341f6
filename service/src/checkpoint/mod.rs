//! The checkpoint: the newest state on disk, about once a second and at the stop, for the next start.
//!
//! The estimation thread only copies the state into a slot ([`handover`]); a thread of its own encodes it and writes the
//! file ([`mod@file`]). However slow the disk is and whatever it refuses, the estimate goes on: a failure is counted, and
//! said in the log once until it works again. A state that was forgotten, by a reset or a jump of the clock, is
//! forgotten on the disk too. What the next start does with the state is
//! [`crate::engine::resume`]'s.
//!
//! ```
//! use inekf_service::checkpoint::Keeper;
//! use inekf_service::checkpoint::file::{Identity, load};
//! use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
//!
//! let car = Identity {
//!     instance: "car".to_owned(),
//!     estimator: "inekf".to_owned(),
//!     model: MODEL_IMU,
//!     dimension: 15,
//!     mismatches: String::new(),
//! };
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("car.checkpoint");
//! let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
//! Keeper::start(path.clone(), car.clone(), 1_000_000_000, 0)?.finish(Some(state));
//! // The next start reads it.
//! assert_eq!(load(&path, &car)?, Some(state));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod file;
pub mod handover;

use core::time::Duration;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;

use anyhow::Context;
use inekf_shared::message::StateVector;
use tracing::{info, warn};

use file::Identity;
use handover::{Giver, Taker};

/// How long the last checkpoint may take at the stop.
const LAST_WITHIN: Duration = Duration::from_secs(1);
/// The writer looks for a new state as often as this, or sooner.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// And no sooner than this.
const LOOK_NO_SOONER: Duration = Duration::from_millis(2);

/// What has been written, and what could not be.
#[derive(Debug, Default)]
struct Counts {
    written: AtomicU64,
    failed: AtomicU64,
}

/// Keeps the checkpoint of a running daemon. It belongs to the estimation thread.
///
/// ```
/// use inekf_service::checkpoint::file::{Identity, load};
/// use inekf_service::checkpoint::Keeper;
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
/// let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
/// let mut keeper = Keeper::start(path.clone(), car.clone(), 1_000_000_000, 0)?;
/// keeper.keep(0, || Some(state));
/// // The last one is waited for.
/// keeper.finish(Some(state));
/// assert_eq!(load(&path, &car)?, Some(state));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Keeper {
    giver: Giver<Option<StateVector>>,
    /// What was given last; none before there was a state, and after it was forgotten.
    given: Option<StateVector>,
    period_ns: u64,
    next_ns: u64,
    counts: Arc<Counts>,
    /// Dropped to end the thread.
    running: Sender<()>,
    ended: Receiver<()>,
}

impl Keeper {
    /// Starts the thread that writes to `path`; `now_ns` is CLOCK_MONOTONIC.
    ///
    /// # Errors
    /// There is no thread to be had.
    ///
    /// ```
    /// use inekf_service::checkpoint::Keeper;
    /// use inekf_service::checkpoint::file::{Identity, load};
    /// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
    ///
    /// # let car = Identity {
    /// #     instance: "car".to_owned(),
    /// #     estimator: "inekf".to_owned(),
    /// #     model: MODEL_IMU,
    /// #     dimension: 15,
    /// #     mismatches: String::new(),
    /// # };
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("car.checkpoint");
    /// # let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
    /// let keeper = Keeper::start(path.clone(), car, 1_000_000_000, 0)?;
    /// // Nothing is written before there is a state.
    /// keeper.finish(None);
    /// assert!(!path.exists());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn start(
        path: PathBuf,
        identity: Identity,
        period_ns: u64,
        now_ns: u64,
    ) -> anyhow::Result<Self> {
        let (giver, taker) = handover::pair(None);
        let (running, end) = mpsc::channel();
        let (done, ended) = mpsc::channel();
        let counts = Arc::new(Counts::default());
        let mut writer = Writer {
            path,
            identity,
            counts: Arc::clone(&counts),
            fails: false,
        };
        let look = Duration::from_nanos(period_ns / 4).clamp(LOOK_NO_SOONER, LOOK_EVERY);
        thread::Builder::new()
            .name("checkpoint".to_owned())
            .spawn(move || {
                writer.run(taker, &end, look);
                // Nobody may wait for it any more.
                let _ = done.send(());
            })
            .context("starting the thread that writes the checkpoint")?;
        Ok(Self {
            giver,
            given: None,
            period_ns,
            next_ns: now_ns,
            counts,
            running,
            ended,
        })
    }

    /// Takes the state for a checkpoint, if one is due at `now_ns` (CLOCK_MONOTONIC) and `state` has another than the
    /// last; none, where there was one, removes the file. Neither waits nor allocates.
    ///
    /// ```
    /// use inekf_service::checkpoint::Keeper;
    /// use inekf_service::checkpoint::file::{Identity, load};
    /// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
    ///
    /// # let car = Identity {
    /// #     instance: "car".to_owned(),
    /// #     estimator: "inekf".to_owned(),
    /// #     model: MODEL_IMU,
    /// #     dimension: 15,
    /// #     mismatches: String::new(),
    /// # };
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("car.checkpoint");
    /// # let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
    /// let mut keeper = Keeper::start(path, car, 1_000_000_000, 500)?;
    /// // One second after the last: not asked for.
    /// keeper.keep(499, || panic!("it is not due"));
    /// let mut is_asked_for = false;
    /// keeper.keep(500, || {
    ///     is_asked_for = true;
    ///     Some(state)
    /// });
    /// assert!(is_asked_for);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn keep(&mut self, now_ns: u64, state: impl FnOnce() -> Option<StateVector>) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns = now_ns.saturating_add(self.period_ns);
        let state = state();
        if state != self.given {
            self.given = state;
            self.giver.give(&state);
        }
    }

    /// Checkpoints written, and those that could not be.
    ///
    /// ```
    /// use inekf_service::checkpoint::Keeper;
    /// use inekf_service::checkpoint::file::{Identity, load};
    /// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
    ///
    /// # let car = Identity {
    /// #     instance: "car".to_owned(),
    /// #     estimator: "inekf".to_owned(),
    /// #     model: MODEL_IMU,
    /// #     dimension: 15,
    /// #     mismatches: String::new(),
    /// # };
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("car.checkpoint");
    /// # let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
    /// let keeper = Keeper::start(path, car, 1_000_000_000, 0)?;
    /// // Health carries them.
    /// assert_eq!(keeper.counts(), (0, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn counts(&self) -> (u64, u64) {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        (of(&self.counts.written), of(&self.counts.failed))
    }

    /// Writes the last checkpoint, and waits for it, but not for long. If there has never been a state, the file stays
    /// as it is.
    ///
    /// ```
    /// use inekf_service::checkpoint::Keeper;
    /// use inekf_service::checkpoint::file::{Identity, load};
    /// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
    ///
    /// # let car = Identity {
    /// #     instance: "car".to_owned(),
    /// #     estimator: "inekf".to_owned(),
    /// #     model: MODEL_IMU,
    /// #     dimension: 15,
    /// #     mismatches: String::new(),
    /// # };
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("car.checkpoint");
    /// # let state = StateVector { model: MODEL_IMU, dimension: 15, stamp_ns: 7, ..StateVector::ZERO };
    /// let keeper = Keeper::start(path.clone(), car.clone(), 1_000_000_000, 0)?;
    /// // It is on the disk when this is back.
    /// keeper.finish(Some(state));
    /// assert_eq!(load(&path, &car)?, Some(state));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn finish(mut self, state: Option<StateVector>) {
        if state != self.given {
            self.giver.give(&state);
        }
        drop(self.running);
        if let Err(RecvTimeoutError::Timeout) = self.ended.recv_timeout(LAST_WITHIN) {
            warn!("the disk is slow: the last checkpoint is given up");
        }
    }
}

/// What the thread does.
struct Writer {
    path: PathBuf,
    identity: Identity,
    counts: Arc<Counts>,
    /// Whether the last one failed.
    fails: bool,
}

impl Writer {
    fn run(&mut self, mut taker: Taker<Option<StateVector>>, end: &Receiver<()>, look: Duration) {
        loop {
            let ends = end.recv_timeout(look) == Err(RecvTimeoutError::Disconnected);
            if let Some(state) = taker.take() {
                self.keep(state.as_ref());
            }
            if ends {
                return;
            }
        }
    }

    /// Writes the state, or removes the file where there is none any more.
    fn keep(&mut self, state: Option<&StateVector>) {
        match state {
            Some(state) => self.write(state),
            None => {
                if let Err(error) = file::remove(&self.path) {
                    warn!(path = %self.path.display(), "the checkpoint of a forgotten state stays: {error}");
                }
            }
        }
    }

    fn write(&mut self, state: &StateVector) {
        let outcome = file::encode(&self.identity, state)
            .map_err(anyhow::Error::from)
            .and_then(|bytes| Ok(file::store(&self.path, &bytes)?));
        let path = self.path.display();
        match outcome {
            Ok(()) => {
                self.counts.written.fetch_add(1, Ordering::Relaxed);
                if core::mem::take(&mut self.fails) {
                    info!(%path, "checkpoints are written again");
                }
            }
            Err(error) => {
                self.counts.failed.fetch_add(1, Ordering::Relaxed);
                if !core::mem::replace(&mut self.fails, true) {
                    warn!(%path, "checkpoints cannot be written, the estimate goes on: {error:#}");
                }
            }
        }
    }
}

/// The state of the last life, if there is a checkpoint that can be used; and whether there is one that cannot, of
/// which the log then says why.
pub(crate) fn last_state(path: &Path, identity: &Identity) -> Result<Option<StateVector>, Unused> {
    match file::load(path, identity) {
        Ok(None) => {
            info!(path = %path.display(), "no checkpoint yet: starting as configured");
            Ok(None)
        }
        Ok(state) => Ok(state),
        Err(reason) => {
            warn!(path = %path.display(), "checkpoint not used, starting as configured: {reason}");
            Err(Unused)
        }
    }
}

/// There is a checkpoint, and it is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Unused;

#[cfg(test)]
mod tests {
    use std::fs;
    use std::time::Instant;

    use inekf_shared::message::{MODEL_IMU, Zero};

    use super::*;

    fn identity() -> Identity {
        Identity {
            instance: "car".to_owned(),
            estimator: "inekf".to_owned(),
            model: MODEL_IMU,
            dimension: 9,
            mismatches: String::new(),
        }
    }

    fn state(stamp_ns: u64) -> StateVector {
        StateVector {
            model: MODEL_IMU,
            dimension: 9,
            stamp_ns,
            ..StateVector::ZERO
        }
    }

    fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
        let started = Instant::now();
        while !holds() {
            assert!(started.elapsed() < Duration::from_secs(60), "{what}");
            thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_checkpoint_is_kept_each_period_and_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept");
        let mut keeper = Keeper::start(path.clone(), identity(), 1000, 5).unwrap();
        keeper.keep(4, || panic!("it is not due"));
        keeper.keep(5, || None);
        keeper.keep(1005, || Some(state(7)));
        keeper.keep(1900, || panic!("it is not due"));
        eventually("written", || keeper.counts() == (1, 0));
        assert_eq!(last_state(&path, &identity()), Ok(Some(state(7))));
        // The same state is not written twice.
        keeper.keep(2005, || Some(state(7)));
        keeper.keep(3005, || Some(state(8)));
        eventually("written", || keeper.counts() == (2, 0));
        keeper.finish(Some(state(9)));
        assert_eq!(last_state(&path, &identity()), Ok(Some(state(9))));

        let keeper = Keeper::start(path.clone(), identity(), 1000, 5).unwrap();
        keeper.finish(None);
        assert_eq!(last_state(&path, &identity()), Ok(Some(state(9))));
        // A state that was forgotten.
        let mut keeper = Keeper::start(path.clone(), identity(), 1000, 5).unwrap();
        keeper.keep(5, || None);
        keeper.keep(1005, || Some(state(10)));
        eventually("written", || keeper.counts() == (1, 0));
        keeper.keep(2005, || None);
        eventually("removed", || !path.exists());
        keeper.keep(3005, || Some(state(11)));
        eventually("written", || keeper.counts() == (2, 0));
        keeper.finish(None);
        assert_eq!(last_state(&path, &identity()), Ok(None));

        fs::write(&path, b"torn").unwrap();
        assert_eq!(last_state(&path, &identity()), Err(Unused));
    }

    #[test]
    fn a_disk_that_refuses_is_counted_and_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let home = folder.path().join("home");
        let mut keeper = Keeper::start(home.join("kept"), identity(), 1, 0).unwrap();
        for n in 1..=3 {
            keeper.keep(n * 10, || Some(state(n)));
            eventually("failed", || keeper.counts() == (0, n));
        }
        fs::create_dir(&home).unwrap();
        keeper.keep(100, || Some(state(4)));
        eventually("written", || keeper.counts() == (1, 3));
        keeper.finish(Some(state(4)));
        assert_eq!(
            last_state(&home.join("kept"), &identity()),
            Ok(Some(state(4)))
        );
    }
}
