//! The client side of the estimation daemon: recorded and simulated data, and what becomes of it.
//!
//! The modules here need no daemon and no shared memory, and can be used alone:
//!
//! * [`dataset`] reads and writes dataset folders (CSV files and a `meta.json`) and merges them into one stream of events;
//! * [`simulate`] makes such datasets: analytic trajectories, a MEMS IMU, position, velocity and heading fixes;
//! * [`model`] says what each model of the daemon is fed and estimates, [`initial`] what state it starts from;
//! * [`table`] reads and writes the estimate CSV, and holds the CSV reader both share;
//! * [`noise`] reads the process noise of a configuration, for a request;
//! * [`evaluate`] compares estimates with the truth;
//! * [`plot`] draws the comparison as SVG and assembles a report of one HTML file.
//!
//! Conventions everywhere: SI units and radians, world ENU, body FLU, quaternions Hamilton, body to world, stored
//! `x, y, z, w`; stamps are `u64` nanoseconds of the sensor clock.
//!
//! ```
//! use inekf_client::dataset::Dataset;
//! use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
//!
//! // A drive of two seconds, through a folder and back: no bit changes.
//! let options = SimulationOptions { duration_s: 2.0, ..SimulationOptions::default() };
//! let drive = simulate(Scenario::RoadCircuit, &options)?;
//! let folder = tempfile::tempdir()?;
//! drive.save(folder.path())?;
//! assert_eq!(Dataset::load(folder.path())?.imu, drive.imu);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attach;
pub mod consistency;
pub mod control;
pub mod daemon;
pub mod dataset;
pub mod demo;
pub mod evaluate;
pub mod exchange;
pub mod feed;
pub mod geodetic;
pub mod import;
pub mod initial;
pub mod layout;
pub mod live;
pub mod model;
pub mod monitor;
pub mod noise;
pub mod pace;
pub mod plot;
mod progress;
pub mod read;
pub mod recording;
pub mod replay;
pub mod report;
pub mod rows;
pub mod session;
pub mod simulate;
mod smoothed;
pub mod table;
