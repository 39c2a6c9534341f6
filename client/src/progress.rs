//! A progress bar on standard error, for whatever may take more than two seconds.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Steps between two updates of the bar.
const STRIDE: usize = 256;

/// A bar over a known number of steps; silent where standard error is not a terminal.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar that says what is being done.
    pub fn new(what: &'static str, steps: usize) -> Self {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr_with_hz(10)
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(steps as u64), target);
        let style = "{msg} {bar:40} {percent:>3} %  {elapsed} / {duration}";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        bar.set_message(what);
        Self { bar }
    }

    /// Notes that `done` steps are done.
    pub fn advance(&self, done: usize) {
        if done.is_multiple_of(STRIDE) {
            self.bar.set_position(done as u64);
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
