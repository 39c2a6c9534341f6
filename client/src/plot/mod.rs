//! Figures as SVG text, and a report that holds them in one HTML file.
//!
//! One colour per meaning in all figures ([`palette`]): truth grey, estimate blue, fixes orange.
//! Long series are thinned before drawing so that a figure stays under a few hundred kilobytes;
//! extremes are kept.

mod canvas;
mod consistency;
mod error_band;
mod latency;
pub mod palette;
mod report;
mod thin;
mod trajectory;

pub use consistency::{ConsistencyPlot, consistency};
pub use error_band::{Panel, error_bands, error_panels};
pub use latency::{LatencySeries, format_ns, latency};
pub use report::{Report, Section, Table};
pub use trajectory::{TrajectoryPlot, trajectory};

/// A figure could not be drawn.
///
/// ```
/// use inekf_client::plot::PlotError;
///
/// let error = PlotError { figure: "Trajectory".to_owned(), reason: "no font".to_owned() };
/// assert_eq!(error.to_string(), "the figure `Trajectory` could not be drawn: no font");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the figure `{figure}` could not be drawn: {reason}")]
pub struct PlotError {
    /// The figure's title.
    pub figure: String,
    /// What the drawing library says.
    pub reason: String,
}
