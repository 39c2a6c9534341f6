//! Latency by percentile: both axes logarithmic, the percentile by what lies beyond it.
//!
//! The x axis is `1 / (1 - q)`: every decade is one more nine, so that the rare slow samples that
//! matter to a control loop take as much room as the common fast ones.

use hdrhistogram::Histogram;
use plotters::chart::ChartBuilder;
use plotters::coord::combinators::IntoLogRange;
use plotters::element::PathElement;
use plotters::style::Color;

use super::canvas::{self, Key, Mark, reason};
use super::{PlotError, palette};

/// Height of the axes, pixels.
const HEIGHT: u32 = 380;
/// Points per decade of the x axis.
const PER_DECADE: f64 = 60.0;

/// One curve: a name and a histogram of nanoseconds.
///
/// ```
/// use hdrhistogram::Histogram;
/// use inekf_client::plot::{LatencySeries, latency};
///
/// let mut histogram = Histogram::<u64>::new(3)?;
/// for ns in [800, 900, 1_000, 25_000] {
///     histogram.record(ns)?;
/// }
/// let svg = latency("Round trip", &[LatencySeries { name: "sent to read", histogram: &histogram }])?;
/// assert!(svg.contains("sent to read"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LatencySeries<'a> {
    /// What was measured, such as `sent to read`.
    pub name: &'a str,
    /// Latencies, ns.
    pub histogram: &'a Histogram<u64>,
}

/// Draws the latencies of one or more histograms; SVG text. Empty histograms are left out.
///
/// # Errors
/// [`PlotError`] if the drawing library fails.
///
/// ```
/// use hdrhistogram::Histogram;
/// use inekf_client::plot::{LatencySeries, latency};
///
/// // What was never measured is left out.
/// let empty = Histogram::<u64>::new(3)?;
/// let svg = latency("Round trip", &[LatencySeries { name: "nobody read", histogram: &empty }])?;
/// assert!(svg.starts_with("<svg") && !svg.contains("nobody read"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn latency(title: &str, series: &[LatencySeries<'_>]) -> Result<String, PlotError> {
    let series: Vec<LatencySeries<'_>> = series
        .iter()
        .filter(|series| !series.histogram.is_empty())
        .copied()
        .collect();
    let most = series
        .iter()
        .map(|series| series.histogram.len())
        .max()
        .unwrap_or(1000);
    let beyond = (most as f64).max(100.0);
    let slowest = series
        .iter()
        .map(|series| series.histogram.max())
        .max()
        .unwrap_or(1_000_000);
    let fastest = series
        .iter()
        .map(|series| series.histogram.min())
        .min()
        .unwrap_or(1000);
    let low = 10_f64.powf((fastest.max(1) as f64).log10().floor());
    let high = 10_f64
        .powf((slowest.max(1) as f64).log10().ceil())
        .max(10.0 * low);
    let names: Vec<String> = series.iter().map(summary).collect();
    let keys: Vec<Key<'_>> = names
        .iter()
        .zip(palette::SERIES.iter().cycle())
        .map(|(text, colour)| Key {
            mark: Mark::Line(2),
            colour: colour.to_rgba(),
            text,
        })
        .collect();
    let height = canvas::TOP + HEIGHT + canvas::X_LABELS;
    canvas::figure(title, height, &keys, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin_top(canvas::TOP)
            .margin_left(canvas::LEFT)
            .margin_right(canvas::RIGHT + 24)
            .x_label_area_size(canvas::X_LABELS)
            .y_label_area_size(canvas::Y_LABELS)
            .build_cartesian_2d((1.0..beyond).log_scale(), (low..high).log_scale())
            .map_err(reason)?;
        chart
            .configure_mesh()
            .light_line_style(palette::GRID.mix(0.5))
            .bold_line_style(palette::GRID)
            .axis_style(palette::FAINT)
            .label_style(canvas::label_style())
            .x_label_formatter(&|x| percentile_label(*x))
            .y_label_formatter(&|y| format_ns(*y))
            .x_desc("Percentile of samples")
            .y_desc("Latency")
            .draw()
            .map_err(reason)?;
        for (series, colour) in series.iter().zip(palette::SERIES.iter().cycle()) {
            let line = PathElement::new(curve(series.histogram), colour.stroke_width(2));
            chart.draw_series([line]).map_err(reason)?;
        }
        Ok(())
    })
}

/// Points `(1 / (1 - q), latency)`; the slowest sample stands at the end.
fn curve(histogram: &Histogram<u64>) -> Vec<(f64, f64)> {
    let last = (histogram.len() as f64).log10();
    let steps = (last * PER_DECADE).ceil().max(1.0) as u32;
    let at = |latency_ns: u64| latency_ns.max(1) as f64;
    (0..=steps)
        .map(|step| 10_f64.powf(last * f64::from(step) / f64::from(steps)))
        .map(|x| (x, at(histogram.value_at_quantile(1.0 - x.recip()))))
        .chain([(histogram.len() as f64, at(histogram.max()))])
        .collect()
}

fn summary(series: &LatencySeries<'_>) -> String {
    let at = |quantile| format_ns(series.histogram.value_at_quantile(quantile) as f64);
    let max = format_ns(series.histogram.max() as f64);
    let name = series.name;
    format!(
        "{name}: p50 {}, p99 {}, p99.9 {}, max {max}",
        at(0.5),
        at(0.99),
        at(0.999)
    )
}

/// `x = 1 / (1 - q)` as a percentage: 1 is 0 %, 10 is 90 %, 1000 is 99.9 %.
fn percentile_label(x: f64) -> String {
    let nines = x.log10().round().max(0.0) as usize;
    match nines {
        0 => "0 %".to_owned(),
        1 => "90 %".to_owned(),
        2 => "99 %".to_owned(),
        more => format!("99.{} %", "9".repeat(more - 2)),
    }
}

/// Nanoseconds in a unit that suits them, three digits: `850 ns`, `1.25 µs`, `3.4 ms`, `2 s`.
///
/// ```
/// use inekf_client::plot::format_ns;
///
/// assert_eq!(format_ns(850.0), "850 ns");
/// assert_eq!(format_ns(1_250.0), "1.25 µs");
/// assert_eq!(format_ns(2e9), "2 s");
/// ```
pub fn format_ns(ns: f64) -> String {
    let (value, unit) = [(1e9, "s"), (1e6, "ms"), (1e3, "µs")]
        .into_iter()
        .find(|(scale, _)| ns >= *scale)
        .map_or((ns, "ns"), |(scale, unit)| (ns / scale, unit));
    let digits = match value {
        value if value >= 99.95 => 0,
        value if value >= 9.995 => 1,
        _ => 2,
    };
    let text = format!("{value:.digits$}");
    let text = if digits > 0 {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    format!("{text} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 1000th of 1000 samples is ten times slower than all others: it has to be seen.
    #[test]
    fn the_slowest_sample_ends_the_curve() {
        let mut histogram = Histogram::<u64>::new(3).expect("three digits are allowed");
        histogram.record_n(100, 999).expect("100 ns fits");
        histogram.record(1000).expect("1000 ns fits");
        let curve = curve(&histogram);
        assert_eq!(curve.last(), Some(&(1000.0, 1000.0)));
        assert_eq!(curve.first(), Some(&(1.0, 100.0)));
        let rising = curve
            .windows(2)
            .all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 <= pair[1].1);
        assert!(rising, "{curve:?}");
    }
}
