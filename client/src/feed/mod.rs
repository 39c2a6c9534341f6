//! Feeding a daemon: from rows to messages on its topics.

pub mod feeder;
pub mod number;

pub use feeder::{Feeder, SendError};
pub use number::{Input, Numbering};
