//! Subcommands of the program, one a file: their arguments, and what they print.

pub mod export;
pub mod import;
pub mod layout;
pub mod monitor;
pub mod report;
