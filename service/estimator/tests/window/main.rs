//! Preintegration and the sliding-window smoother.
//!
//! [`golden`] holds them to vectors of an independent implementation on the alignment of \[IS\] section V;
//! [`preintegration`] to the samples one by one and to numerical derivatives; [`gains`] and [`edges`] the window to
//! itself, to the Kalman filter and to the batch smoother; [`slices`] the window in slices to the same at once; [`biased`] the same with biases; [`heading`] fixes of the heading; [`recording`] to a car's
//! truth. `cargo test --release -p inekf --test window -- --ignored --nocapture timing` prints what an update costs.

#[path = "../common/mod.rs"]
mod common;

mod align_straight;
mod beside_batch;
mod biased;
#[path = "../common/counting.rs"]
mod counting;
mod drive;
mod edges;
mod gains;
mod golden;
mod heading;
mod preintegration;
mod recording;
mod slices;
mod timing;
