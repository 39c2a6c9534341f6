//! The daemon: the engine between shared-memory ports.
//!
//! [`ports`] opens everything ([`fix_port`] what aids, [`guard`] looks after the files), [`mod@run`] is the estimation loop, [`control`] answers requests,
//! [`smoothed`] publishes what leaves a smoother's window, [`watch`] keeps the health message and reports changes to the log.

pub mod control;
pub mod fix_port;
pub mod guard;
pub mod ports;
pub mod run;
pub mod smoothed;
pub mod watch;

pub use ports::Ports;
pub use run::{Ended, run};
