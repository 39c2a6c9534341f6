//! Benchmarks of the estimation service, as distributions and as ratios taken in one run, and the papers' experiments.
//!
//! [`latency`] measures the whole path between two processes: a sample sent, its estimate read; [`fleet`] many vehicles
//! in one daemon; [`wake`] whether a sleeping daemon ever oversleeps; [`late`] what a late fix costs. [`experiment`]
//! repeats what \[LC\], \[IS\] and \[PAR\] report, with every filter and smoother of the library.

pub mod experiment;
pub mod fleet;
pub mod late;
pub mod latency;
pub mod pin;
mod progress;
pub mod wake;
