//! Smoothing: the most likely trajectory given all measurements, \[IS\] (12).

pub mod solver;

pub use solver::{Gain, Gaussian, LinearMeasurement, LinearMotion, SmootherError, Solver};
