//! What the mathematics of one sample and of one fix costs, in nanoseconds and in instructions, beside plain dense
//! algebra.
//!
//! `cargo bench -p inekf-bench --bench compute [-- FILTER]` times; with `-- --instructions [FILTER]` callgrind counts
//! (needs valgrind). Every figure is one call on data in the first cache, as the daemon makes it: in place, on a belief
//! that the call before it did not touch. A name that ends in `/dense` is the same result by general matrix products,
//! written in [`dense`]; the two are compared before anything is measured. A name that ends in `/any processor` is
//! the same without the instructions that not every processor has; the results are the same bit for bit.

use std::process::ExitCode;

mod clock;
mod dense;
mod engine;
mod groups;
mod instructions;
mod late;
mod predict;
mod setup;
mod smoother;
mod suite;
mod update;

use clock::Clock;
use instructions::Request;
use suite::{Names, Suite};

fn routines(suite: &mut impl Suite) {
    predict::routines(suite);
    update::routines(suite);
    groups::routines(suite);
    late::routines(suite);
    smoother::routines(suite);
    engine::routines(suite);
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match Request::parse(&arguments) {
        None => {
            let mut clock = Clock::new();
            routines(&mut clock);
            clock.finish();
        }
        Some(Request::Run(mut calls)) => routines(&mut calls),
        Some(Request::Count(filter)) => {
            let mut names = Names::default();
            routines(&mut names);
            if let Err(error) = instructions::count(&names, &filter) {
                eprintln!("{error}");
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}
