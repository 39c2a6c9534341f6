//! Tables on disk: CSV with a header line, columns found by name.
//!
//! * [`fault`]: what can be wrong in a table, said so that the user can mend it;
//! * [`estimate`]: the estimate CSV (`replay --out`), writer and reader.
//!
//! The reader by column name is shared with [`dataset`](crate::dataset). Numbers are written as the
//! shortest decimal that reads back to the same double, so that a round trip through a file changes
//! no bit.

pub mod estimate;
pub mod fault;
pub(crate) mod read;
pub(crate) mod write;

pub use estimate::{
    EstimateRow, EstimateState, EstimateTable, EstimateWriter, Layout, read_estimates,
};
pub use fault::{Fault, Faults};
