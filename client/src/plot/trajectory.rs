//! The trajectory from above: truth, estimate and fixes, one metre as long on both axes.

use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, TRANSPARENT};

use super::canvas::{self, Key, Mark, reason};
use super::{PlotError, palette, thin};

/// Heights that the axes may have, pixels.
const LEAST_HEIGHT: f64 = 300.0;
const GREATEST_HEIGHT: f64 = 720.0;
/// More fixes than this are thinned out evenly.
const MOST_FIXES: usize = 3000;

/// What is drawn; points are `[east, north]` in metres. Any of the lists may be empty.
///
/// ```
/// use inekf_client::plot::{TrajectoryPlot, trajectory};
///
/// // East and north in metres; a list may be missing.
/// let plot = TrajectoryPlot {
///     truth: &[[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]],
///     estimate: &[[0.2, 0.1], [9.8, 0.2], [10.1, 4.9]],
///     ..TrajectoryPlot::default()
/// };
/// let svg = trajectory("A corner", &plot)?;
/// assert!(svg.contains("estimate") && !svg.contains("position fixes"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct TrajectoryPlot<'a> {
    /// The true path.
    pub truth: &'a [[f64; 2]],
    /// The estimated path.
    pub estimate: &'a [[f64; 2]],
    /// Position fixes.
    pub fixes: &'a [[f64; 2]],
}

/// Draws the trajectory; SVG text.
///
/// # Errors
/// [`PlotError`] if the drawing library fails.
///
/// ```
/// use inekf_client::dataset::Truth;
/// use inekf_client::plot::{TrajectoryPlot, trajectory};
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions { duration_s: 5.0, ..SimulationOptions::default() };
/// let drive = simulate(Scenario::RoadCircuit, &options)?;
/// let Truth::Spatial(truth) = &drive.truth else { unreachable!() };
/// let truth: Vec<[f64; 2]> = truth.iter().map(|row| [row.p_w_m[0], row.p_w_m[1]]).collect();
/// let fixes: Vec<[f64; 2]> =
///     drive.position.iter().map(|fix| [fix.position_w_m[0], fix.position_w_m[1]]).collect();
/// let plot = TrajectoryPlot { truth: &truth, fixes: &fixes, ..TrajectoryPlot::default() };
/// let svg = trajectory("Five seconds on the road", &plot)?;
/// // A dot for each fix, at least.
/// assert!(fixes.len() >= 25 && svg.matches("<circle").count() >= fixes.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn trajectory(title: &str, plot: &TrajectoryPlot<'_>) -> Result<String, PlotError> {
    let frame = Frame::around(plot);
    let mut keys = Vec::new();
    let mut key = |points: &[[f64; 2]], mark, colour, text| {
        if !points.is_empty() {
            keys.push(Key { mark, colour, text });
        }
    };
    key(plot.truth, Mark::Line(5), palette::TRUTH.to_rgba(), "truth");
    key(
        plot.estimate,
        Mark::Line(2),
        palette::ESTIMATE.to_rgba(),
        "estimate",
    );
    key(
        plot.fixes,
        Mark::Dot,
        palette::FIX.mix(0.6),
        "position fixes",
    );

    canvas::figure(title, frame.body_height, &keys, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin_top(canvas::TOP)
            .margin_left(canvas::LEFT)
            .margin_right(canvas::RIGHT)
            .x_label_area_size(canvas::X_LABELS)
            .y_label_area_size(canvas::Y_LABELS)
            .build_cartesian_2d(frame.east.0..frame.east.1, frame.north.0..frame.north.1)
            .map_err(reason)?;
        let digits = |range: (f64, f64)| canvas::decimals(range.1 - range.0, 9);
        let (x_digits, y_digits) = (digits(frame.east), digits(frame.north));
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(palette::GRID)
            .axis_style(palette::FAINT)
            .label_style(canvas::label_style())
            .x_labels(9)
            .y_labels(9)
            .x_label_formatter(&|value| format!("{value:.x_digits$}"))
            .y_label_formatter(&|value| format!("{value:.y_digits$}"))
            .x_desc("East (m)")
            .y_desc("North (m)")
            .draw()
            .map_err(reason)?;
        let line = |points: &[[f64; 2]]| -> Vec<(f64, f64)> {
            thin::path(points, 0.7 * frame.per_pixel)
                .iter()
                .map(|[x, y]| (*x, *y))
                .collect()
        };
        let truth = PathElement::new(line(plot.truth), palette::TRUTH.stroke_width(5));
        chart.draw_series([truth]).map_err(reason)?;
        let every = plot.fixes.len().div_ceil(MOST_FIXES).max(1);
        let dot = |[x, y]: &[f64; 2]| Circle::new((*x, *y), 2, palette::FIX.mix(0.6).filled());
        chart
            .draw_series(plot.fixes.iter().step_by(every).map(dot))
            .map_err(reason)?;
        let estimate = PathElement::new(line(plot.estimate), palette::ESTIMATE.stroke_width(2));
        chart.draw_series([estimate]).map_err(reason)?;
        let path = if plot.truth.is_empty() {
            plot.estimate
        } else {
            plot.truth
        };
        if let Some([x, y]) = path.first() {
            let start = Circle::new((*x, *y), 5, palette::TEXT.filled());
            chart.draw_series([start]).map_err(reason)?;
            let style = canvas::text_style(16, palette::TEXT, HPos::Left, VPos::Bottom);
            let offset = 8.0 * frame.per_pixel;
            let text = Text::new("start", (*x + offset, *y + offset), style);
            chart.draw_series([text]).map_err(reason)?;
        }
        Ok(())
    })
}

/// Ranges of the axes with one scale.
struct Frame {
    east: (f64, f64),
    north: (f64, f64),
    /// Metres per pixel.
    per_pixel: f64,
    body_height: u32,
}

impl Frame {
    /// The smallest frame around everything, with 4 % to spare.
    fn around(plot: &TrajectoryPlot<'_>) -> Self {
        let all = || plot.truth.iter().chain(plot.estimate).chain(plot.fixes);
        let east = canvas::extent(all().map(|point| point[0])).unwrap_or((-1.0, 1.0));
        let north = canvas::extent(all().map(|point| point[1])).unwrap_or((-1.0, 1.0));
        let span = |range: (f64, f64)| ((range.1 - range.0) * 1.08).max(1e-3);
        let width = f64::from(canvas::WIDTH - canvas::LEFT - canvas::Y_LABELS - canvas::RIGHT);
        let height = (width * span(north) / span(east)).clamp(LEAST_HEIGHT, GREATEST_HEIGHT);
        let height = height.round();
        let per_pixel = (span(east) / width).max(span(north) / height);
        let around = |range: (f64, f64), pixels: f64| {
            let middle = 0.5 * (range.0 + range.1);
            let half = 0.5 * pixels * per_pixel;
            (middle - half, middle + half)
        };
        Self {
            east: around(east, width),
            north: around(north, height),
            per_pixel,
            body_height: canvas::TOP + canvas::X_LABELS + height as u32,
        }
    }
}
