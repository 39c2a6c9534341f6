//! The odometry models in the engine: every filter against the library called directly, rows and fixes and requests of
//! every kind, and the recordings.

mod allocation;
#[path = "../../estimator/tests/common/counting.rs"]
mod counting;
mod filters;
mod gate;
mod harness;
mod late;
mod learned;
mod oracle;
mod random;
mod recordings;
mod refusals;
mod reports;
mod requests;
mod rows;
mod stacking;
