//! The estimation loop: one thread, bounded waits, no allocation between a sample and its estimate.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use std::rc::Rc;

use inekf_shared::topic::Instance;
use inekf_shared::transport::Node;

use super::guard::Guard;
use crate::config::{Runtime, WaitMode};

/// What came of one look at a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// No sample waited.
    Idle,
    /// There was a sample.
    Busy,
}

/// Why a loop ended.
///
/// ```
#[doc = include_str!("example.txt")]
/// let ports = Ports::open_on(Rc::clone(&node), &car, &config, false)?;
/// let vehicle = Vehicle::new(engine, ports, terms, None);
/// let guard = Guard::of(Watched::of(&node)?);
/// // Set by a signal's handler, or as here before it has begun.
/// let stop = AtomicBool::new(true);
/// // With files gone, all ports would have to be opened anew.
/// assert_ne!(run(&mut [Box::new(vehicle)], &config.runtime, &guard, &stop)?, Ended::FilesGone);
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It was asked to stop.
    Stopped,
    /// Files of the ports were removed: all have to be opened anew.
    FilesGone,
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

    /// Lets go of its ports, and keeps its state.
    fn close(self: Box<Self>) -> Box<dyn Closed<'a> + 'a>;

    /// Accounts for what has come and will not be used, says so, and keeps what the next start needs.
    ///
    /// # Errors
    /// As [`Work::turn`].
    fn finish(self: Box<Self>) -> anyhow::Result<()>;
}

/// A vehicle without ports.
pub trait Closed<'a> {
    /// Opens its ports on this node.
    ///
    /// # Errors
    /// They cannot be opened; the vehicle comes back with the reason.
    fn open(
        self: Box<Self>,
        node: Rc<Node>,
        instance: &Instance,
    ) -> Result<Box<dyn Work<'a> + 'a>, StillClosed<'a>>;

    /// Keeps what the next start needs.
    fn finish(self: Box<Self>);
}

/// A vehicle whose ports could not be opened, and why.
pub type StillClosed<'a> = (Box<dyn Closed<'a> + 'a>, anyhow::Error);

/// Works until `stop` is set, or ports have to be opened anew. Asleep between samples there can be one vehicle only: it
/// is a loop's only reason to wake.
///
/// # Errors
/// A port that fails for good. What a sender wrote is never an error.
///
/// ```
#[doc = include_str!("example.txt")]
/// let ports = Ports::open_on(Rc::clone(&node), &car, &config, false)?;
/// let vehicle = Vehicle::new(engine, ports, terms, None);
/// let guard = Guard::of(Watched::of(&node)?);
/// // Set by a signal's handler, or as here before it has begun.
/// let stop = AtomicBool::new(true);
/// assert_eq!(run(&mut [Box::new(vehicle)], &config.runtime, &guard, &stop)?, Ended::Stopped);
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn run<'a, W: Work<'a> + ?Sized>(
    vehicles: &mut [Box<W>],
    runtime: &Runtime,
    guard: &Guard,
    stop: &AtomicBool,
) -> anyhow::Result<Ended> {
    match (runtime.wait, vehicles) {
        (WaitMode::Event, [vehicle]) => {
            let bound = runtime.event_timeout();
            while !stop.load(Ordering::Relaxed) {
                if guard.has_lost() {
                    return Ok(Ended::FilesGone);
                }
                match vehicle.round()? {
                    Turn::Busy => {}
                    // Every sleep is followed by a look at all inputs, so a lost wake-up costs at most the bound.
                    Turn::Idle => vehicle.sleep(bound)?,
                }
            }
        }
        (_, vehicles) => {
            while !stop.load(Ordering::Relaxed) {
                if guard.has_lost() {
                    return Ok(Ended::FilesGone);
                }
                for vehicle in vehicles.iter_mut() {
                    vehicle.turn()?;
                }
                core::hint::spin_loop();
            }
        }
    }
    Ok(Ended::Stopped)
}
