//! A progress bar on standard error, for whatever may take more than two seconds.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over so many `steps`, with a word for what they are; silent where standard error is not a
/// terminal.
pub fn progress(what: &'static str, steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    let style = "{msg} {bar:40} {pos}/{len}  {elapsed} / {duration}";
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}
