//! Errors over time with the filter's own band of three standard deviations, one panel a quantity.

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::element::{PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBAColor, TRANSPARENT};

use super::canvas::{self, Area, Key, Mark, reason};
use super::{PlotError, palette, thin};
use crate::evaluate::{Deviations, ErrorSample};

/// Height of a panel's axes, pixels.
const PANEL: u32 = 165;
/// Space between panels, pixels.
const GAP: u32 = 12;
/// Columns that a series is thinned to.
const COLUMNS: usize = 800;

/// One quantity over time.
///
/// ```
/// use inekf_client::plot::{Panel, error_bands};
///
/// let panel = Panel {
///     label: "East error".to_owned(),
///     unit: "m".to_owned(),
///     time_s: vec![0.0, 1.0],
///     error: vec![0.5, -0.2],
///     sigma: vec![], // not known: no band
/// };
/// let svg = error_bands("A run", &[panel])?;
/// assert!(svg.contains("East error") && !svg.contains("three standard deviations"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What it is, such as `East error`.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// Times, s, increasing.
    pub time_s: Vec<f64>,
    /// Errors, as long as the times.
    pub error: Vec<f64>,
    /// One standard deviation, as long as the times, or empty if not known.
    pub sigma: Vec<f64>,
}

/// Panels of position by axis (m) and heading (degrees). `deviations` is as long as `errors`, or
/// empty; time counts from `start_ns`.
///
/// ```
/// use inekf_client::evaluate::{Deviations, ErrorSample};
/// use inekf_client::plot::error_panels;
/// use nalgebra::Vector3;
///
/// let error = ErrorSample {
///     stamp_ns: 3_000_000_000,
///     position_m: Vector3::new(1.0, 2.0, 3.0),
///     velocity_mps: None,
///     heading_rad: 90_f64.to_radians(),
///     attitude_rad: 90_f64.to_radians(),
/// };
/// let sigma = Deviations { position_m: Vector3::repeat(0.5), heading_rad: 0.1 };
/// let panels = error_panels(&[error], &[sigma], 1_000_000_000);
/// let labels: Vec<&str> = panels.iter().map(|panel| panel.label.as_str()).collect();
/// assert_eq!(labels, ["East error", "North error", "Up error", "Heading error"]);
/// // Two seconds after the start; degrees for the heading.
/// assert_eq!((panels[1].time_s[0], panels[1].error[0], panels[1].sigma[0]), (2.0, 2.0, 0.5));
/// assert!((panels[3].error[0] - 90.0).abs() < 1e-12);
/// ```
pub fn error_panels(
    errors: &[ErrorSample],
    deviations: &[Deviations],
    start_ns: u64,
) -> Vec<Panel> {
    let banded = deviations.len() == errors.len();
    let seconds = |e: &ErrorSample| (e.stamp_ns as f64 - start_ns as f64) * 1e-9;
    let time_s: Vec<f64> = errors.iter().map(seconds).collect();
    let panel = |label: &str, unit: &str, error: Vec<f64>, sigma: Vec<f64>| Panel {
        label: label.to_owned(),
        unit: unit.to_owned(),
        time_s: time_s.clone(),
        error,
        sigma: if banded { sigma } else { Vec::new() },
    };
    let mut panels: Vec<Panel> = ["East error", "North error", "Up error"]
        .into_iter()
        .enumerate()
        .map(|(axis, label)| {
            let error = errors.iter().map(|e| e.position_m[axis]).collect();
            let sigma = deviations.iter().map(|d| d.position_m[axis]).collect();
            panel(label, "m", error, sigma)
        })
        .collect();
    let heading = errors.iter().map(|e| e.heading_rad.to_degrees()).collect();
    let sigma = deviations
        .iter()
        .map(|d| d.heading_rad.to_degrees())
        .collect();
    panels.push(panel("Heading error", "deg", heading, sigma));
    panels
}

/// Draws the panels below each other over one time axis; SVG text.
///
/// # Errors
/// [`PlotError`] if the drawing library fails.
///
/// ```
/// use inekf_client::plot::{Panel, error_bands};
///
/// let panel = Panel {
///     label: "North error".to_owned(),
///     unit: "m".to_owned(),
///     time_s: vec![0.0, 1.0],
///     error: vec![0.5, -0.2],
///     sigma: vec![0.4, 0.3],
/// };
/// let svg = error_bands("A run", &[panel])?;
/// assert!(svg.contains("three standard deviations, as the filter sees them"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn error_bands(title: &str, panels: &[Panel]) -> Result<String, PlotError> {
    let mut keys = vec![Key {
        mark: Mark::Line(2),
        colour: palette::ESTIMATE.to_rgba(),
        text: "estimate minus truth",
    }];
    if panels.iter().any(|panel| !panel.sigma.is_empty()) {
        let text = "three standard deviations, as the filter sees them";
        keys.push(Key {
            mark: Mark::Band,
            colour: band_colour(),
            text,
        });
    }
    let count = u32::try_from(panels.len().max(1)).unwrap_or(1);
    let height = count * (PANEL + GAP) + canvas::X_LABELS;
    let times = panels.iter().flat_map(|panel| panel.time_s.iter().copied());
    let (begin, end) = canvas::extent(times).unwrap_or((0.0, 1.0));
    let end = if end > begin { end } else { begin + 1.0 };
    canvas::figure(title, height, &keys, |area| {
        let mut rest = area.clone();
        for (index, panel) in panels.iter().enumerate() {
            let last = index + 1 == panels.len();
            let (part, below) = rest.split_vertically(PANEL + GAP);
            draw_panel(if last { &rest } else { &part }, panel, (begin, end), last)?;
            rest = below;
        }
        Ok(())
    })
}

fn band_colour() -> RGBAColor {
    palette::ESTIMATE.mix(0.17)
}

type Chart<'a> = ChartContext<
    'a,
    plotters::backend::SVGBackend<'a>,
    Cartesian2d<RangedCoordf64, RangedCoordf64>,
>;

fn draw_panel<'a>(
    area: &Area<'a>,
    panel: &Panel,
    time: (f64, f64),
    last: bool,
) -> Result<(), String> {
    let limit = limit(panel);
    let mut chart: Chart<'a> = ChartBuilder::on(area)
        .margin_top(GAP)
        .margin_left(canvas::LEFT)
        .margin_right(canvas::RIGHT)
        .x_label_area_size(if last { canvas::X_LABELS } else { 0 })
        .y_label_area_size(canvas::Y_LABELS)
        .build_cartesian_2d(time.0..time.1, -limit..limit)
        .map_err(reason)?;
    let (x_digits, y_digits) = (
        canvas::decimals(time.1 - time.0, 10),
        canvas::decimals(2.0 * limit, 5),
    );
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(palette::GRID)
        .axis_style(palette::FAINT)
        .label_style(canvas::label_style())
        .x_labels(10)
        .y_labels(5)
        .x_label_formatter(&|value| format!("{value:.x_digits$}"))
        .y_label_formatter(&|value| format!("{value:.y_digits$}"))
        .x_desc("Time (s)")
        .y_desc(format!("{} ({})", panel.label, panel.unit))
        .draw()
        .map_err(reason)?;
    if !panel.sigma.is_empty() {
        let band = Polygon::new(band(panel, limit), band_colour());
        chart.draw_series([band]).map_err(reason)?;
    }
    let zero = PathElement::new([(time.0, 0.0), (time.1, 0.0)], palette::FAINT.mix(0.5));
    chart.draw_series([zero]).map_err(reason)?;
    let line: Vec<(f64, f64)> = thin::buckets(panel.error.len(), COLUMNS)
        .flat_map(|(start, end)| thin::extremes(&panel.error, start, end))
        .filter_map(|index| {
            Some((
                *panel.time_s.get(index)?,
                panel.error[index].clamp(-limit, limit),
            ))
        })
        .collect();
    let line = PathElement::new(line, palette::ESTIMATE.stroke_width(1));
    chart.draw_series([line]).map_err(reason)?;
    let style = canvas::text_style(15, palette::TEXT, HPos::Right, VPos::Top);
    let at = (time.1 - 0.008 * (time.1 - time.0), limit * 0.94);
    chart
        .draw_series([Text::new(note(panel, limit), at, style)])
        .map_err(reason)?;
    Ok(())
}

/// The outline of the band: the upper edge forwards, the lower edge back. Where the series is
/// thinned the widest deviation of a run stands for it.
fn band(panel: &Panel, limit: f64) -> Vec<(f64, f64)> {
    let edge: Vec<(f64, f64)> = thin::buckets(panel.sigma.len(), COLUMNS)
        .flat_map(|(start, end)| {
            let widest = panel.sigma[start..end].iter().copied().fold(0.0, f64::max);
            let half = (3.0 * widest).min(limit);
            [start, end - 1].map(|index| (panel.time_s.get(index).copied(), half))
        })
        .filter_map(|(time, half)| Some((time?, half)))
        .collect();
    let back = edge.iter().rev().map(|(time, half)| (*time, -half));
    edge.iter().copied().chain(back).collect()
}

/// Half the height of the y axis: room for all errors and, up to three times as much, for the band.
/// A short transient (over five times what 95 % of the errors keep to) is cut off, and noted, so
/// that the rest can be seen.
fn limit(panel: &Panel) -> f64 {
    let mut sizes: Vec<f64> = panel.error.iter().map(|error| error.abs()).collect();
    sizes.retain(|size| size.is_finite());
    sizes.sort_unstable_by(f64::total_cmp);
    let Some(largest) = sizes.last().copied().filter(|largest| *largest > 0.0) else {
        return 1.0;
    };
    let usual = sizes[(sizes.len() - 1) * 95 / 100];
    let room = if largest > 5.0 * usual && usual > 0.0 {
        2.5 * usual
    } else {
        largest
    };
    let mut bands: Vec<f64> = panel.sigma.iter().map(|sigma| 3.0 * sigma).collect();
    bands.sort_unstable_by(f64::total_cmp);
    let band = bands.get(bands.len() * 95 / 100).copied().unwrap_or(0.0);
    1.1 * room.max(band.min(3.0 * room))
}

/// Root mean square, share within the band, and what is cut off.
fn note(panel: &Panel, limit: f64) -> String {
    if panel.error.is_empty() {
        return "no data".to_owned();
    }
    let count = panel.error.len() as f64;
    let rms = (panel.error.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
    let mut note = format!("rms {rms:.3} {}", panel.unit);
    if panel.sigma.len() == panel.error.len() {
        let pairs = panel.error.iter().zip(&panel.sigma);
        let within = pairs
            .filter(|(error, sigma)| error.abs() <= 3.0 * **sigma)
            .count() as f64;
        note.push_str(&format!(
            ", {:.1} % within the band",
            100.0 * within / count
        ));
    }
    let largest = panel
        .error
        .iter()
        .map(|error| error.abs())
        .fold(0.0, f64::max);
    if largest > limit {
        note.push_str(&format!(", cut off: largest {largest:.2} {}", panel.unit));
    }
    note
}
