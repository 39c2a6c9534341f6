//! # inekf-service: the estimation daemon
//!
//! Sensor processes hand samples over shared memory, the daemon runs an invariant Kalman filter at IMU rate, and
//! readers take the estimate the same way. This library holds the daemon's parts, so that tests and tools can use
//! them without a process; the binary of the same name only puts them together.
//!
//! SI units and radians unless a name says otherwise (`_deg`, `_ms`); world frame ENU, body frame FLU.

pub mod checkpoint;
pub mod config;
pub mod daemon;
pub mod engine;
