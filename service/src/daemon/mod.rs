//! The daemon: the engine between shared-memory ports.
//!
//! [`ports`] opens everything, [`mod@run`] is the estimation loop, [`control`] answers requests, [`journal`] publishes
//! what the engine takes,
//! [`smoothed`] publishes what leaves a smoother's window, [`watch`] keeps the health message and reports changes to the log.

pub mod control;
pub mod journal;
pub mod ports;
pub mod run;
pub mod smoothed;
pub mod watch;

pub use ports::Ports;
pub use run::{Terms, run};
