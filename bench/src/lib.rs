//! Benchmarks of the estimation service, as distributions and as ratios taken in one run, and the papers' experiments.
//!
//! [`fleet`] many vehicles in one daemon. [`late`] is what a late fix costs. [`latency`] measures the whole path between two processes: a sample sent, its estimate read. [`experiment`] repeats
//! what \[LC\], \[IS\] and \[PAR\] report, with every filter and smoother of the library.

pub mod experiment;
pub mod fleet;
pub mod late;
pub mod latency;
pub mod pin;
mod progress;
