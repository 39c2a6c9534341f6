//! The engine: checked samples in, estimates out. No shared memory, no clock, no files.
//!
//! The daemon feeds it from its ports and publishes what it emits; tests feed it from a vector.
//! The same inputs in the same order give the same bytes. After construction it does not allocate,
//! lock, log or call the system.
//!
//! - [`driver`]: time, order, restarts; [`model`]: what it needs of a model; [`inertial`]: the model `imu`;
//!   [`odometry`]: the models `odometry2d` and `odometry3d`; [`mod@build`]: from a configuration to one of them
//! - [`intake`]: checks; [`tally`]: counters; [`time_base`]: jumps of the clock
//! - [`levelling`], [`set_state`]: the first state
//! - [`resume`]: the state of an earlier life
//! - [`history`]: samples, fixes at their own stamps, late ones; [`timeline`]: those of a filter; [`smoothing`]: those of
//!   a smoother; [`stack`]: fixes taken together;
//!   [`recovery`]: out of a lock-out
//! - [`output`]: the messages
//! - [`processor`]: instructions that not every processor has

pub mod build;
pub mod driver;
pub mod fix;
pub mod history;
pub mod inertial;
pub mod intake;
pub mod levelling;
pub mod model;
pub mod odometry;
pub mod output;
pub mod processor;
pub mod recovery;
pub mod resume;
pub mod set_state;
pub mod settings;
pub mod smoothing;
pub mod stack;
pub mod tally;
pub mod time_base;
pub mod timeline;

pub use build::{Use, build};
pub use driver::{Engine, MAX_AHEAD_NS};
pub use history::History;
pub use inertial::{Inertial, InertialEngine};
pub use model::Model;
pub use output::Outbox;
pub use settings::Settings;
