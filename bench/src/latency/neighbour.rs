//! A busy neighbour: a process that does on every processor what others do, read and write more memory than any cache
//! holds, at the lowest priority.

use std::process::{Child, Command};
use std::thread;

use anyhow::Context;
use rustix::process::nice;

use super::partner::end_with_parent;
use crate::pin;

/// Numbers that each thread goes through: 64 MiB.
const NUMBERS: usize = 8 << 20;
/// The lowest priority of an ordinary process.
const NICEST: i32 = 19;

/// The neighbour, which leaves when dropped.
#[derive(Debug)]
pub struct Neighbour(Child);

impl Neighbour {
    /// Lets it move in.
    ///
    /// # Errors
    /// The process cannot be started.
    pub fn start() -> anyhow::Result<Self> {
        let child = Command::new(std::env::current_exe()?)
            .arg("neighbour")
            .spawn()
            .context("starting the busy neighbour")?;
        Ok(Self(child))
    }
}

impl Drop for Neighbour {
    fn drop(&mut self) {
        // Both do nothing to a process that has been waited for.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The neighbour's process: never returns but with an error.
///
/// # Errors
/// The system refuses its priority or its processors.
pub fn live() -> anyhow::Result<()> {
    end_with_parent()?;
    nice(NICEST).context("lowering the priority")?;
    let processors = pin::processors()?;
    thread::scope(|scope| {
        let threads: Vec<_> = processors
            .into_iter()
            .map(|cpu| scope.spawn(move || pin::pin(None, cpu).map(|()| stream())))
            .collect();
        for thread in threads {
            if let Ok(outcome) = thread.join() {
                outcome?;
            }
        }
        Ok(())
    })
}

/// Reads and writes for ever.
fn stream() {
    let mut numbers = vec![1_u64; NUMBERS];
    loop {
        for number in &mut numbers {
            *number = number.wrapping_mul(3);
        }
        std::hint::black_box(&numbers);
    }
}
