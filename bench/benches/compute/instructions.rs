//! The routines' instructions, counted by callgrind: figures that do not depend on the machine's load.
//!
//! This program runs itself under callgrind with a number of calls of one routine, and again with twice as many; the
//! difference, divided by the number, is one call, its fresh copy of the belief and the loop's few instructions
//! included.

use std::env::current_exe;
use std::io;
use std::process::Command;

use crate::suite::{Calls, Names};

/// The argument that asks for this, and for a run of one routine.
pub const FLAG: &str = "--instructions";
const RUN: &str = "--calls-of";

/// Calls in the shorter run.
const CALLS: u64 = 1000;

/// What the arguments after the program's name ask for.
pub enum Request {
    /// Counts of the routines whose names contain this.
    Count(String),
    /// Calls of one routine.
    Run(Calls),
}

impl Request {
    /// `None` if the arguments ask for times.
    pub fn parse(arguments: &[String]) -> Option<Self> {
        if let [flag, name, count] = arguments
            && flag == RUN
        {
            let (name, count) = (name.clone(), count.parse().ok()?);
            return Some(Self::Run(Calls { name, count }));
        }
        arguments.iter().any(|argument| argument == FLAG).then(|| {
            // Cargo adds flags of its own.
            let filter = arguments.iter().find(|argument| !argument.starts_with('-'));
            Self::Count(filter.cloned().unwrap_or_default())
        })
    }
}

/// All instructions of a run of this program with `calls` calls of the routine `name`.
fn collected(name: &str, calls: u64) -> io::Result<u64> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(current_exe()?)
        .args([RUN, name, &calls.to_string()])
        .output()
        .map_err(|error| {
            io::Error::other(format!("valgrind did not start ({error}): install it"))
        })?;
    let log = String::from_utf8_lossy(&output.stderr);
    let mut words = log
        .split_whitespace()
        .skip_while(|word| *word != "Collected");
    words
        .nth(2)
        .and_then(|count| count.parse().ok())
        .ok_or_else(|| io::Error::other(format!("callgrind counted nothing:\n{log}")))
}

/// Prints the instructions of one call of each routine whose name contains `filter`.
///
/// # Errors
/// If valgrind is missing, or says nothing that is understood.
pub fn count(names: &Names, filter: &str) -> io::Result<()> {
    println!("instructions  routine");
    for name in names.0.iter().filter(|name| name.contains(filter)) {
        let (once, twice) = (collected(name, CALLS)?, collected(name, 2 * CALLS)?);
        println!("{:12}  {name}", (twice - once) / CALLS);
    }
    Ok(())
}
