//! # inekf-service: the estimation daemon
//!
//! Sensor processes hand samples over shared memory, the daemon runs an invariant Kalman filter at IMU rate, and
//! readers take the estimate the same way. This library holds the daemon's parts, so that tests and tools can use
//! them without a process; the binary of the same name only puts them together.
//!
//! SI units and radians unless a name says otherwise (`_deg`, `_ms`); world frame ENU, body frame FLU.
//!
//! ```
//! use inekf_service::config::Config;
//! use inekf_service::engine::{Engine, History, Model, Use, build};
//!
//! /// Whatever the model and the filter are.
//! struct IsWaiting;
//!
//! impl Use for IsWaiting {
//!     type Output = bool;
//!
//!     fn with<M: Model, H: History<M>>(self, engine: Engine<M, H>) -> bool {
//!         engine.snapshot().is_none()
//!     }
//! }
//!
//! let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
//! let config = Config::from_toml_str(text, "example")?;
//! assert!(build(&config, IsWaiting)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod checkpoint;
pub mod config;
pub mod daemon;
pub mod engine;
