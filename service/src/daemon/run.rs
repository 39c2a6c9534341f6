//! The estimation loop: one thread, bounded waits, no allocation between a sample and its estimate.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use inekf_shared::topic::Instance;

use crate::config::{Runtime, WaitMode};

/// What came of one look at a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// No sample waited.
    Idle,
    /// There was a sample.
    Busy,
    /// Files of its ports were removed: the ports have to be opened anew.
    FilesGone,
}

/// Why a loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It was asked to stop.
    Stopped,
    /// The ports of the vehicle with this index have to be opened anew.
    FilesGone(usize),
}

/// One vehicle's work, as a loop sees it.
pub trait Work<'a> {
    /// Takes the samples that have come, then does one chore if it is time for one.
    ///
    /// # Errors
    /// A port that fails for good. What a sender wrote is never an error.
    fn turn(&mut self) -> anyhow::Result<Turn>;

    /// Takes the samples that have come, then does every chore.
    ///
    /// # Errors
    /// As [`Work::turn`].
    fn round(&mut self) -> anyhow::Result<Turn>;

    /// Sleeps until a sender wakes it, but never longer than `bound`.
    ///
    /// # Errors
    /// Waiting is not possible.
    fn sleep(&mut self, bound: Duration) -> anyhow::Result<()>;

    /// Opens its ports anew, on another node: tries until it can, or until `stop` is set; then there is none.
    fn reopen(
        self: Box<Self>,
        instance: &Instance,
        stop: &AtomicBool,
    ) -> Option<Box<dyn Work<'a> + 'a>>;

    /// Accounts for what has come and will not be used, says so, and keeps what the next start needs.
    ///
    /// # Errors
    /// As [`Work::turn`].
    fn finish(self: Box<Self>) -> anyhow::Result<()>;
}

/// Works until `stop` is set, or ports have to be opened anew. Asleep between samples there can be one vehicle only: it
/// is a loop's only reason to wake.
///
/// # Errors
/// A port that fails for good. What a sender wrote is never an error.
pub fn run<'a, W: Work<'a> + ?Sized>(
    vehicles: &mut [Box<W>],
    runtime: &Runtime,
    stop: &AtomicBool,
) -> anyhow::Result<Ended> {
    match (runtime.wait, vehicles) {
        (WaitMode::Event, [vehicle]) => {
            let bound = runtime.event_timeout();
            while !stop.load(Ordering::Relaxed) {
                match vehicle.round()? {
                    Turn::Busy => {}
                    // Every sleep is followed by a look at all inputs, so a lost wake-up costs at most the bound.
                    Turn::Idle => vehicle.sleep(bound)?,
                    Turn::FilesGone => return Ok(Ended::FilesGone(0)),
                }
            }
        }
        (_, vehicles) => {
            while !stop.load(Ordering::Relaxed) {
                for (index, vehicle) in vehicles.iter_mut().enumerate() {
                    if vehicle.turn()? == Turn::FilesGone {
                        return Ok(Ended::FilesGone(index));
                    }
                }
                core::hint::spin_loop();
            }
        }
    }
    Ok(Ended::Stopped)
}
