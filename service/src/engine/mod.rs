//! The engine: checked samples in, estimates out. No shared memory, no clock, no files.
//!
//! The daemon feeds it from its ports and publishes what it emits; tests feed it from a vector.
//! The same inputs in the same order give the same bytes. After construction it does not allocate,
//! lock, log or call the system.
//!
//! - [`intake`]: checks; [`tally`]: counters; [`time_base`]: jumps of the clock
//! - [`levelling`], [`set_state`]: the first belief
//! - [`timeline`]: samples, fixes at their own stamps, late ones by replay; [`recovery`]: out of a lock-out
//! - [`output`]: the messages

pub mod fix;
pub mod inertial;
pub mod intake;
pub mod levelling;
pub mod output;
pub mod recovery;
pub mod set_state;
pub mod settings;
pub mod tally;
pub mod time_base;
pub mod timeline;

pub use inertial::{InertialEngine, MAX_AHEAD_NS};
pub use output::Outbox;
pub use settings::Settings;
