//! The daemon: engines between shared-memory ports.
//!
//! [`fleet`] opens the vehicles and gives them threads, a [`group`] are those of one thread, [`mod@run`] is its loop and
//! [`vehicle`] what it does with each. [`ports`] are a vehicle's ports ([`fix_port`] those of what aids), [`guard`] looks
//! after their files, [`control`] answers requests, [`journal`] publishes what the engine takes, [`smoothed`] what leaves a smoother's window; [`watch`] keeps the
//! health message and reports changes to the log, [`realtime`] asks the system for a processor, priority and memory,
//! [`supervisor`] tells systemd how it is.

pub mod control;
pub mod fix_port;
pub mod fleet;
pub mod group;
pub mod guard;
pub mod journal;
pub mod ports;
pub mod realtime;
pub mod run;
pub mod smoothed;
pub mod supervisor;
pub mod vehicle;
pub mod watch;

pub use fleet::{Order, serve};
pub use ports::Ports;
pub use vehicle::{Terms, Vehicle};
