//! The experiments' figures as SVG text, in the colours of the project's other figures.

use std::fmt::Display;

use inekf_client::plot::palette;
use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoFont, RGBAColor, TRANSPARENT, TextStyle, WHITE};

/// Width of a figure, pixels.
const WIDTH: u32 = 960;
/// Height of the title, pixels.
const TITLE: u32 = 42;
/// Height of a line of the legend, pixels.
const LEGEND_LINE: u32 = 26;
/// Space for the names and numbers of the y axis, pixels.
const LEFT: u32 = 86;
/// Free space to the right of the axes, pixels.
const RIGHT: u32 = 26;
/// Space for the name and numbers of the x axis, pixels.
const BELOW: u32 = 50;
/// Height of one panel of [`panels`], pixels.
const PANEL: u32 = 300;
/// Heights that the axes of [`from_above`] may have, pixels.
const HEIGHTS: [f64; 2] = [300.0, 720.0];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// How a series is drawn.
#[derive(Clone, Copy, Debug)]
pub enum Mark {
    /// A line of this width, pixels.
    Line(u32),
    /// A dot for each point.
    Dots,
}

/// A named series of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Its colour.
    pub colour: RGBAColor,
    /// How it is drawn.
    pub mark: Mark,
    /// Its points, in the units of the axes.
    pub points: Vec<(f64, f64)>,
}

/// How a panel's y axis runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly, from zero.
    FromZero,
    /// In decades. Points that are not positive are left out.
    Logarithmic,
}

/// One of the panels of [`panels`].
#[derive(Clone, Debug)]
pub struct Panel {
    /// The name of its y axis.
    pub name: String,
    /// How that axis runs.
    pub scale: Scale,
    /// What it shows.
    pub series: Vec<Series>,
}

/// One pair of axes; `y` is in decades where its scale is logarithmic.
struct Axes<'a> {
    x: (f64, f64),
    y: (f64, f64),
    scale: Scale,
    names: [&'a str; 2],
}

/// Paths from above, one metre as long on both axes; later series lie on earlier ones.
///
/// # Errors
/// What the drawing library says.
pub fn from_above(title: &str, series: &[Series]) -> anyhow::Result<String> {
    let points = || series.iter().flat_map(|series| &series.points);
    let (x, y) = (extent(points().map(|p| p.0)), extent(points().map(|p| p.1)));
    let span = |(low, high): (f64, f64)| (high - low) * 1.08;
    let width = f64::from(WIDTH - LEFT - RIGHT);
    let height = (width * span(y) / span(x)).clamp(HEIGHTS[0], HEIGHTS[1]);
    let per_pixel = (span(x) / width).max(span(y) / height);
    let around = |(low, high): (f64, f64), pixels: f64| {
        let (middle, half) = (0.5 * (low + high), 0.5 * pixels * per_pixel);
        (middle - half, middle + half)
    };
    let axes = Axes {
        x: around(x, width),
        y: around(y, height),
        scale: Scale::FromZero,
        names: ["East (m)", "North (m)"],
    };
    figure(title, height as u32 + BELOW, series, |area| {
        draw_axes(area, &axes, series)
    })
}

/// Panels below each other over `x_name`, with the same series in each, which share names and colours.
///
/// # Errors
/// What the drawing library says.
pub fn panels(title: &str, x_name: &str, panels: &[Panel]) -> anyhow::Result<String> {
    let legend = panels.first().map_or(&[][..], |panel| &panel.series);
    let count = u32::try_from(panels.len()).unwrap_or(1);
    figure(title, count * PANEL, legend, |area| {
        let mut rest = area.clone();
        for panel in panels {
            let points = || panel.series.iter().flat_map(|series| &series.points);
            let (x, y) = (points().map(|p| p.0), points().map(|p| p.1));
            let (part, below) = rest.split_vertically(PANEL);
            let mut axes = Axes {
                x: extent(x),
                y: (0.0, 1.05 * extent(y.clone()).1),
                scale: panel.scale,
                names: [x_name, &panel.name],
            };
            if panel.scale == Scale::FromZero {
                draw_axes(&part, &axes, &panel.series)?;
            } else {
                axes.y = extent(y.filter(|y| *y > 0.0).map(f64::log10));
                draw_axes(&part, &axes, &in_decades(&panel.series))?;
            }
            rest = below;
        }
        Ok(())
    })
}

/// `series` with the logarithms of its positive values.
fn in_decades(series: &[Series]) -> Vec<Series> {
    let of_points = |points: &[(f64, f64)]| {
        let positive = points.iter().filter(|(_, y)| *y > 0.0);
        positive.map(|(x, y)| (*x, y.log10())).collect()
    };
    let one = |series: &Series| Series {
        points: of_points(&series.points),
        ..series.clone()
    };
    series.iter().map(one).collect()
}

/// Title, legend, and `body` below them.
fn figure(
    title: &str,
    body_height: u32,
    series: &[Series],
    body: impl FnOnce(&Area<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<String> {
    let places = places(series);
    let lines = places.last().map_or(0, |(_, line)| line + 1);
    let header = TITLE + lines * LEGEND_LINE + 4;
    let mut svg = String::new();
    {
        let page = SVGBackend::with_string(&mut svg, (WIDTH, header + body_height));
        let page = page.into_drawing_area();
        page.fill(&WHITE).map_err(drawing)?;
        let heading = ("sans-serif", 24, FontStyle::Bold).into_font();
        let heading = heading.color(&palette::TEXT);
        page.draw(&Text::new(title.to_owned(), (20, 12), heading))
            .map_err(drawing)?;
        for (series, (x, line)) in series.iter().zip(places) {
            let middle = (TITLE + line * LEGEND_LINE + LEGEND_LINE / 2) as i32;
            draw_key(&page, series, x, middle)?;
        }
        body(&page.split_vertically(header).1)?;
        page.present().map_err(drawing)?;
    }
    Ok(svg)
}

/// Left edge and line of each entry of the legend.
fn places(series: &[Series]) -> Vec<(i32, u32)> {
    let (mut x, mut line) = (20, 0);
    let mut places = Vec::new();
    for series in series {
        // The viewer sets the text in a font of its own: 8 pixels a letter is ample.
        let width = 31 + 8 * i32::try_from(series.name.chars().count()).unwrap_or(0);
        if x > 20 && x + width > WIDTH as i32 {
            (x, line) = (20, line + 1);
        }
        places.push((x, line));
        x += width + 20;
    }
    places
}

fn draw_key(page: &Area<'_>, series: &Series, x: i32, middle: i32) -> anyhow::Result<()> {
    match series.mark {
        Mark::Line(width) => {
            let ends = [(x, middle), (x + 24, middle)];
            page.draw(&PathElement::new(ends, series.colour.stroke_width(width)))
        }
        Mark::Dots => page.draw(&Circle::new((x + 12, middle), 4, series.colour.filled())),
    }
    .map_err(drawing)?;
    let style = label_style(16).pos(Pos::new(HPos::Left, VPos::Center));
    page.draw(&Text::new(series.name.clone(), (x + 31, middle), style))
        .map_err(drawing)
}

fn draw_axes(area: &Area<'_>, axes: &Axes<'_>, series: &[Series]) -> anyhow::Result<()> {
    let mut chart = ChartBuilder::on(area)
        .margin_top(8)
        .margin_left(16)
        .margin_right(RIGHT)
        .x_label_area_size(BELOW - 8)
        .y_label_area_size(LEFT - 16)
        .build_cartesian_2d(axes.x.0..axes.x.1, axes.y.0..axes.y.1)
        .map_err(drawing)?;
    let (x_digits, y_digits) = (decimals(axes.x), decimals(axes.y));
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(palette::GRID)
        .axis_style(palette::FAINT)
        .label_style(label_style(15))
        .x_labels(10)
        .y_labels(7)
        .x_label_formatter(&|value| format!("{value:.x_digits$}"))
        .y_label_formatter(&|value| match axes.scale {
            Scale::FromZero => format!("{value:.y_digits$}"),
            Scale::Logarithmic => in_full(10_f64.powf(*value)),
        })
        .x_desc(axes.names[0])
        .y_desc(axes.names[1])
        .draw()
        .map_err(drawing)?;
    for series in series {
        match series.mark {
            Mark::Line(width) => {
                let style = series.colour.stroke_width(width);
                chart
                    .draw_series([PathElement::new(series.points.clone(), style)])
                    .map_err(drawing)?;
            }
            Mark::Dots => {
                let dot = |point: &(f64, f64)| Circle::new(*point, 2, series.colour.filled());
                chart
                    .draw_series(series.points.iter().map(dot))
                    .map_err(drawing)?;
            }
        }
    }
    Ok(())
}

fn label_style(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&palette::TEXT)
}

/// The least and greatest finite value; a range of some width in any case.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let empty = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold(empty, |(low, high), value| {
            (low.min(value), high.max(value))
        });
    if high > low { (low, high) } else { (0.0, 1.0) }
}

/// Decimals that tell about ten labels apart.
fn decimals((low, high): (f64, f64)) -> usize {
    (1.3 - (high - low).log10()).ceil().clamp(0.0, 9.0) as usize
}

/// Two digits of a positive number, with an exponent where it is far from one.
fn in_full(value: f64) -> String {
    match value {
        0.0095..0.095 => format!("{value:.3}"),
        0.095..0.95 => format!("{value:.2}"),
        0.95..9.5 => format!("{value:.1}"),
        9.5..10_000.0 => format!("{value:.0}"),
        _ => format!("{value:.0e}"),
    }
}

/// A drawing library's error.
fn drawing(error: impl Display) -> anyhow::Error {
    anyhow::anyhow!("the figure could not be drawn: {error}")
}
