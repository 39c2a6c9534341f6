//! Class 1 of \[LC\] III for states that an IMU drives: the columns of a wrong gyroscope or accelerometer against
//! numerical derivatives, the constrained update with them on SE_2(3), and what it does to the estimate.

#[path = "../common/mod.rs"]
mod common;

mod columns;
mod drive;
mod fault;
mod updates;
