//! The estimation loop: one thread, bounded waits, no allocation between a sample and its estimate.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use crate::config::{Runtime, WaitMode};

/// One vehicle's work, as a loop sees it.
pub trait Work {
    /// Takes the samples that have come, then does one chore.
    ///
    /// # Errors
    /// A port that fails for good. What a sender wrote is never an error.
    fn turn(&mut self) -> anyhow::Result<()>;

    /// Takes the samples that have come, then does every chore. True if there was a sample.
    ///
    /// # Errors
    /// As [`Work::turn`].
    fn round(&mut self) -> anyhow::Result<bool>;

    /// Sleeps until a sender wakes it, but never longer than `bound`.
    ///
    /// # Errors
    /// Waiting is not possible.
    fn sleep(&mut self, bound: Duration) -> anyhow::Result<()>;

    /// Keeps what the next start needs.
    fn finish(self: Box<Self>);
}

/// Works until `stop` is set. Asleep between samples there can be one vehicle only: it is a loop's only reason to wake.
///
/// # Errors
/// A port that fails for good. What a sender wrote is never an error.
pub fn run<W: Work + ?Sized>(
    vehicles: &mut [Box<W>],
    runtime: &Runtime,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    match (runtime.wait, vehicles) {
        (WaitMode::Event, [vehicle]) => {
            let bound = runtime.event_timeout();
            while !stop.load(Ordering::Relaxed) {
                // Every sleep is followed by a look at all inputs, so a lost wake-up costs at most the bound.
                if !vehicle.round()? {
                    vehicle.sleep(bound)?;
                }
            }
        }
        (_, vehicles) => {
            while !stop.load(Ordering::Relaxed) {
                for vehicle in &mut *vehicles {
                    vehicle.turn()?;
                }
                core::hint::spin_loop();
            }
        }
    }
    Ok(())
}
