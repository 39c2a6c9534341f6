//! `inekf-client monitor`: a live view of a running daemon.

use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use inekf_client::monitor::{monitor, text};
use inekf_shared::topic::Instance;

/// Whom to watch, and how.
#[derive(Args)]
pub struct Arguments {
    /// The daemon to watch.
    #[arg(long, value_name = "NAME", default_value = "default")]
    instance: Instance,
    /// A line a second in place of the full screen; so it is without a terminal, too.
    #[arg(long)]
    plain: bool,
    /// End after so long, s.
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
}

/// Watches.
///
/// # Errors
/// No daemon answers, or the terminal fails.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    let signalled = Arc::clone(&stop);
    ctrlc::set_handler(move || signalled.store(true, Ordering::Relaxed))
        .context("installing the handler of SIGINT and SIGTERM")?;
    let end = match arguments.duration {
        None => None,
        Some(seconds) => {
            let length = Duration::try_from_secs_f64(seconds)
                .with_context(|| format!("--duration {seconds}"))?;
            Instant::now().checked_add(length)
        }
    };
    let stopped = || stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end);
    if arguments.plain || !std::io::stdout().is_terminal() {
        return plain(&arguments.instance, &stopped);
    }
    full_screen(&arguments.instance, &stopped)
}

fn plain(instance: &Instance, stopped: &dyn Fn() -> bool) -> anyhow::Result<()> {
    let mut out = std::io::stdout();
    monitor(instance, &mut || Ok(stopped()), &mut |picture| {
        // A pipe that has been closed ends the monitor, and is no failure.
        Ok(writeln!(out, "{}", text::line(picture))
            .and_then(|()| out.flush())
            .is_ok())
    })
}

#[cfg(feature = "monitor")]
fn full_screen(instance: &Instance, stopped: &dyn Fn() -> bool) -> anyhow::Result<()> {
    inekf_client::monitor::screen::show(instance, stopped)
}

#[cfg(not(feature = "monitor"))]
fn full_screen(instance: &Instance, stopped: &dyn Fn() -> bool) -> anyhow::Result<()> {
    plain(instance, stopped)
}
