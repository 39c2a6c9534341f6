//! The daemon: engines between shared-memory ports.
//!
//! From outside: [`serve`] runs what an [`Order`] names until it is told to stop. Tests put one together themselves, from
//! an engine, its [`Ports`] and the [loop](run()).
//!
//! ```
#![doc = include_str!("example.txt")]
//! let ports = Ports::open_on(Rc::clone(&node), &car, &config, false)?;
//! let mut vehicles = [Box::new(Vehicle::new(engine, ports, terms, None))];
//! let (guard, stop) = (Guard::of(Watched::of(&node)?), AtomicBool::new(true));
//! assert_eq!(run(&mut vehicles, &config.runtime, &guard, &stop)?, Ended::Stopped);
//! # Ok::<(), anyhow::Error>(())
//! ```
//!
//! Inside: `fleet` opens the vehicles and gives them threads, a `group` are those of one thread, `run` is its loop and
//! `vehicle` what it does with each. `ports` are a vehicle's ports (`fix_port` those of what aids), `guard` looks after
//! their files, `control` answers requests, `journal` publishes what the engine takes, `smoothed` what leaves a smoother's
//! window; `watch` keeps the health message and reports changes to the log, `realtime` asks the system for a processor,
//! priority and memory, [`supervisor`] tells systemd how it is.

mod control;
mod fix_port;
mod fleet;
mod group;
mod guard;
mod journal;
mod ports;
mod realtime;
mod run;
mod smoothed;
pub mod supervisor;
mod vehicle;
mod watch;

pub use control::answer;
pub use fleet::{Order, serve};
pub use guard::Guard;
pub use ports::Ports;
pub use run::{Ended, run};
pub use smoothed::SmoothedPort;
pub use vehicle::{Terms, Vehicle};
