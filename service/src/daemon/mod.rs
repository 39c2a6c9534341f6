//! The daemon: the engine between shared-memory ports.
//!
//! [`ports`] opens everything, [`mod@run`] is the estimation loop, [`control`] answers requests,
//! [`smoothed`] publishes what leaves a smoother's window, [`watch`] keeps the health message and reports changes to the log,
//! [`realtime`] asks the system for a processor, priority and memory.

pub mod control;
pub mod ports;
pub mod realtime;
pub mod run;
pub mod smoothed;
pub mod watch;

pub use ports::Ports;
pub use run::run;
