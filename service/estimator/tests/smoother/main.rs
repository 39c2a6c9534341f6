//! The smoothers: the linear solver, the parametrisations, and whole trajectories, against golden vectors and
//! slower, plainer computations.

#[path = "../common/mod.rs"]
mod common;

// Shared with the tests of the window, which use more of it.
#[allow(dead_code)]
#[path = "../window/align_straight.rs"]
mod align_straight;
mod allocation;
mod batch;
#[path = "../common/counting.rs"]
mod counting;
mod deviation;
mod drive;
mod extended;
mod introduction;
mod linearisation;
mod reference;
mod solver;
mod theorem;
mod vanishing_noise;
