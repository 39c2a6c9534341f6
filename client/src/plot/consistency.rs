//! A chi-square number over time, logarithmic, with the band that holds 95 % of it.

use plotters::chart::ChartBuilder;
use plotters::coord::combinators::IntoLogRange;
use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;

use super::canvas::{self, Key, Mark, reason};
use super::{PlotError, palette, thin};

/// Height of the axes, pixels.
const HEIGHT: u32 = 260;
/// Columns that a series is thinned to.
const COLUMNS: usize = 800;

/// What is drawn.
///
/// ```
/// use inekf_client::consistency::band_95;
/// use inekf_client::plot::{ConsistencyPlot, consistency};
///
/// let plot = ConsistencyPlot {
///     name: "NEES",
///     time_s: &[0.0, 1.0, 2.0],
///     values: &[2.5, 3.1, 40.0],
///     band: band_95(3),
/// };
/// // The key names what is drawn.
/// assert!(consistency("A run", &plot)?.contains("NEES"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ConsistencyPlot<'a> {
    /// What the numbers are, such as `NEES`.
    pub name: &'a str,
    /// Times, s, increasing.
    pub time_s: &'a [f64],
    /// The numbers, as many.
    pub values: &'a [f64],
    /// The band.
    pub band: (f64, f64),
}

/// Draws it; SVG text.
///
/// # Errors
/// [`PlotError`] if the drawing library fails.
///
/// ```
/// use inekf_client::plot::{ConsistencyPlot, consistency};
///
/// let none = ConsistencyPlot { name: "NIS", time_s: &[], values: &[], band: (0.2, 9.3) };
/// // Nothing to show is an empty figure and no failure.
/// let svg = consistency("No fix came", &none)?;
/// assert!(svg.starts_with("<svg") && svg.contains("No fix came"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn consistency(title: &str, plot: &ConsistencyPlot<'_>) -> Result<String, PlotError> {
    let keys = [
        Key {
            mark: Mark::Line(2),
            colour: palette::ESTIMATE.to_rgba(),
            text: plot.name,
        },
        Key {
            mark: Mark::Band,
            colour: palette::TRUTH.mix(0.4),
            text: "holds 95 % if the covariance is right",
        },
    ];
    let (begin, end) = canvas::extent(plot.time_s.iter().copied()).unwrap_or((0.0, 1.0));
    let end = if end > begin { end } else { begin + 1.0 };
    // Two decades around the band at least; a value below the picture stands on its edge.
    let highest = canvas::extent(plot.values.iter().copied()).map_or(1.0, |(_, high)| high);
    let low = (plot.band.0 / 10.0).max(1e-3);
    let high = highest.max(plot.band.1 * 3.0).max(10.0 * low);
    let height = canvas::TOP + HEIGHT + canvas::X_LABELS;
    canvas::figure(title, height, &keys, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin_top(canvas::TOP)
            .margin_left(canvas::LEFT)
            .margin_right(canvas::RIGHT)
            .x_label_area_size(canvas::X_LABELS)
            .y_label_area_size(canvas::Y_LABELS)
            .build_cartesian_2d(begin..end, (low..high).log_scale())
            .map_err(reason)?;
        let x_digits = canvas::decimals(end - begin, 10);
        chart
            .configure_mesh()
            .light_line_style(palette::GRID.mix(0.5))
            .bold_line_style(palette::GRID)
            .axis_style(palette::FAINT)
            .label_style(canvas::label_style())
            .x_labels(10)
            .x_label_formatter(&|value| format!("{value:.x_digits$}"))
            .y_label_formatter(&|value| format!("{value}"))
            .x_desc("Time (s)")
            .y_desc(plot.name)
            .draw()
            .map_err(reason)?;
        let corners = [(begin, plot.band.0.max(low)), (end, plot.band.1)];
        let band = Rectangle::new(corners, palette::TRUTH.mix(0.4).filled());
        chart.draw_series([band]).map_err(reason)?;
        let line: Vec<(f64, f64)> = thin::buckets(plot.values.len(), COLUMNS)
            .flat_map(|(start, end)| thin::extremes(plot.values, start, end))
            .filter_map(|index| Some((*plot.time_s.get(index)?, plot.values[index].max(low))))
            .collect();
        let line = PathElement::new(line, palette::ESTIMATE.stroke_width(1));
        chart.draw_series([line]).map_err(reason)?;
        Ok(())
    })
}
