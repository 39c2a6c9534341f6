//! The distributions as one SVG file: figures of a few curves each, below one another, all of the
//! placement that the processors had most of the time.

use anyhow::Context;
use inekf_client::plot::{LatencySeries, latency};

use super::mechanism::{Mechanism, PACES, Pace, Wait};
use super::report::Report;
use super::row::Row;

/// Curves of one figure: as many as there are colours.
const CURVES: usize = 5;

/// A figure: its title, and which rows it shows.
type Panel = (&'static str, fn(&Row) -> bool);

const PANELS: [Panel; 6] = [
    ("Spinning at saturation: shared memory", |row| {
        is_of(
            row,
            Wait::Spin,
            Pace::Saturated,
            &[
                Mechanism::CacheLine,
                Mechanism::Blackboard,
                Mechanism::PreLoanedEcho,
                Mechanism::Echo,
            ],
        )
    }),
    ("Spinning at saturation: the daemon", |row| {
        is_of(
            row,
            Wait::Spin,
            Pace::Saturated,
            &[
                Mechanism::Echo,
                Mechanism::Filter15,
                Mechanism::Filter9,
                Mechanism::LcInekf,
                Mechanism::LcInekfFix,
            ],
        )
    }),
    ("Spinning at saturation: sockets", |row| {
        is_of(
            row,
            Wait::Spin,
            Pace::Saturated,
            &[
                Mechanism::Filter15,
                Mechanism::UnixSocket,
                Mechanism::UdpSocket,
            ],
        )
    }),
    ("Woken, at 1000 Hz", |row| {
        is_of(
            row,
            Wait::Event,
            Pace::Hz(1000),
            &[
                Mechanism::Futex,
                Mechanism::Echo,
                Mechanism::Filter15,
                Mechanism::UnixSocket,
                Mechanism::UdpSocket,
            ],
        )
    }),
    ("Spinning at 1000 Hz: filter and smoother", |row| {
        is_of(
            row,
            Wait::Spin,
            Pace::Hz(1000),
            &[
                Mechanism::Filter15,
                Mechanism::Aided15,
                Mechanism::Smoother15,
            ],
        )
    }),
    ("Spinning: the daemon, 15 states, by pace", |row| {
        row.case.mechanism == Mechanism::Filter15 && row.case.wait == Wait::Spin
    }),
];

// A further pace would repeat a colour.
const _: () = assert!(PACES.len() <= CURVES);

fn is_of(row: &Row, wait: Wait, pace: Pace, mechanisms: &[Mechanism]) -> bool {
    row.pace == pace && row.case.wait == wait && mechanisms.contains(&row.case.mechanism)
}

/// Draws all of them; SVG text.
///
/// # Errors
/// What the drawing library says.
pub fn svg(report: &Report) -> anyhow::Result<String> {
    let placement = report.main_placement();
    let mut figures = Vec::new();
    for (title, shows) in PANELS {
        let rows = report.rows.iter().filter(|row| shows(row));
        let measured = rows.filter_map(|row| Some((row, row.at(placement)?)));
        let measured: Vec<_> = measured.map(|(row, it)| (name(row), &it.rounds)).collect();
        let series = measured
            .iter()
            .map(|(name, histogram)| LatencySeries { name, histogram });
        let series: Vec<_> = series.collect();
        if !series.is_empty() {
            figures.push(latency(&format!("{title}, {}", placement.name()), &series)?);
        }
    }
    stack(&figures)
}

fn name(row: &Row) -> String {
    format!("{}, {}", row.case.mechanism.name(), row.pace.name())
}

/// SVG figures below one another: an SVG element may hold others, each at its own height.
fn stack(figures: &[String]) -> anyhow::Result<String> {
    let (mut width, mut top) = (0, 0);
    let mut body = String::new();
    for figure in figures {
        width = width.max(attribute(figure, "width")?);
        body += &figure.replacen("<svg ", &format!("<svg y=\"{top}\" "), 1);
        top += attribute(figure, "height")?;
    }
    Ok(format!(
        "<svg width=\"{width}\" height=\"{top}\" viewBox=\"0 0 {width} {top}\" \
         xmlns=\"http://www.w3.org/2000/svg\">\n{body}</svg>\n"
    ))
}

/// A whole number among the attributes of the outermost element.
fn attribute(svg: &str, name: &str) -> anyhow::Result<u32> {
    let (_, rest) = svg
        .split_once(&format!(" {name}=\""))
        .with_context(|| format!("the figure has no {name}"))?;
    let digits = rest.split('"').next().unwrap_or_default();
    digits.parse().with_context(|| format!("{name} {digits:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_stand_below_one_another() {
        let figure = |height| format!("<svg width=\"96\" height=\"{height}\"><g/></svg>\n");
        let stacked = stack(&[figure(10), figure(20)]).expect("two figures");
        assert!(stacked.starts_with("<svg width=\"96\" height=\"30\""));
        assert!(stacked.contains("<svg y=\"0\" width=\"96\" height=\"10\">"));
        assert!(stacked.contains("<svg y=\"10\" width=\"96\" height=\"20\">"));
        assert!(stack(&["<svg>".to_owned()]).is_err());
    }
}
