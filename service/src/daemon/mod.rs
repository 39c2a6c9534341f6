//! The daemon: the engine between shared-memory ports.
//!
//! [`ports`] opens everything, [`mod@run`] is the estimation loop, [`control`] answers requests,
//! [`smoothed`] publishes what leaves a smoother's window, [`watch`] keeps the health message and reports changes to the log,
//! [`supervisor`] tells systemd.

pub mod control;
pub mod ports;
pub mod run;
pub mod smoothed;
pub mod supervisor;
pub mod watch;

pub use ports::Ports;
pub use run::run;
