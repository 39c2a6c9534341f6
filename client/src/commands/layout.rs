//! `inekf-client layout`: the messages in another language.

use clap::Args;
use inekf_client::layout;

/// What to print.
#[derive(Args)]
#[group(required = true, multiple = false)]
pub struct Arguments {
    /// A header for C and C++.
    #[arg(long)]
    c: bool,
    /// A Python module.
    #[arg(long)]
    python: bool,
    /// JSON: sizes, offsets, types and codes.
    #[arg(long)]
    json: bool,
}

/// Prints it.
///
/// # Errors
/// None.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let text = if arguments.c {
        layout::c()
    } else if arguments.python {
        layout::python()
    } else {
        layout::json()
    };
    print!("{text}");
    Ok(())
}
