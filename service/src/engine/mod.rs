//! The engine: checked samples in, estimates out. No shared memory, no clock, no files.
//!
//! The daemon feeds it from its ports and publishes what it emits; tests feed it from a vector.
//! The same inputs in the same order give the same bytes. After construction it does not allocate,
//! lock, log or call the system.
//!
//! From outside: [`Engine`] takes messages and gives estimates to an [`Outbox`]; [`build`](build()) makes the one that a
//! configuration asks for, [`Settings`] are what it needs of it; [`tally`] counts, [`resume`] continues an earlier life,
//! [`smoothing`] is the engine of a smoother.
//!
//! ```
#![doc = include_str!("example.txt")]
//! for step in 1..=100 {
//!     engine.sample(&at_rest(10 * step), 0, &mut estimates);
//! }
//! engine.position(&east(1000, 3.0), &mut estimates);
//! let corrected = estimates.last().expect("published again");
//! assert!((corrected.p_w_m[0] - 3.0).abs() < 0.01);
//! assert_eq!(engine.tally().counters.accepted, 1);
//! ```
//!
//! Inside:
//!
//! - `driver`: time, order, restarts; `model`: what it needs of a model; `inertial`: the model `imu`; `odometry`: the
//!   models `odometry2d` and `odometry3d`; `build`: from a configuration to one of them
//! - `intake`: checks; `tally`: counters; `time_base`: jumps of the clock
//! - `levelling`, `set_state`: the first state
//! - `resume`: the state of an earlier life
//! - `history`: samples, fixes at their own stamps, late ones; `timeline`: those of a filter; `smoothing`: those of a
//!   smoother; `stack`: fixes taken together; `recovery`: out of a lock-out
//! - `output`: the messages
//! - `processor`: instructions that not every processor has

mod build;
mod driver;
mod fix;
mod history;
mod inertial;
mod intake;
mod levelling;
mod model;
mod odometry;
mod output;
pub mod processor;
mod recovery;
pub mod resume;
mod set_state;
pub mod settings;
pub mod smoothing;
mod stack;
pub mod tally;
mod time_base;
mod timeline;

pub use build::{Use, build};
pub use driver::Engine;
pub(crate) use driver::MAX_AHEAD_NS;
pub use history::History;
pub use inertial::{Inertial, InertialEngine};
pub use model::Model;
pub use output::Outbox;
pub use settings::Settings;
