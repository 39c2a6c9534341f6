//! What all figures share: a white page with a title and a legend above the axes.

use std::fmt::Display;

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoFont, RGBAColor, RGBColor, TextStyle, WHITE};

use super::PlotError;
use super::palette;

/// Width of every figure, pixels.
pub const WIDTH: u32 = 960;
/// Height of the title, pixels.
const TITLE: u32 = 42;
/// Height of one line of the legend, pixels.
const LEGEND_LINE: u32 = 26;
/// Free space to the left of the axes' names, pixels.
pub const LEFT: u32 = 16;
/// Space for the labels of the y axis, pixels.
pub const Y_LABELS: u32 = 70;
/// Space for the labels of the x axis, pixels.
pub const X_LABELS: u32 = 50;
/// Free space to the right of the axes, pixels.
pub const RIGHT: u32 = 26;
/// Free space above the axes, pixels.
pub const TOP: u32 = 6;

/// A drawing area of an SVG figure.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// How an entry of the legend is drawn.
#[derive(Clone, Copy)]
pub enum Mark {
    /// A line of this width.
    Line(u32),
    /// A filled band.
    Band,
    /// A dot.
    Dot,
}

/// An entry of the legend. Entries stand side by side as far as they fit, then on a further line.
pub struct Key<'a> {
    /// The sign before the text.
    pub mark: Mark,
    /// Its colour.
    pub colour: RGBAColor,
    /// The text.
    pub text: &'a str,
}

/// Draws a figure: title and legend here, the rest, `body_height` pixels high, in `body`. Returns
/// SVG text.
pub fn figure(
    title: &str,
    body_height: u32,
    keys: &[Key<'_>],
    body: impl FnOnce(&Area<'_>) -> Result<(), String>,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    let places = places(keys);
    let lines = places.last().map_or(0, |(_, line)| line + 1);
    let header = TITLE + lines * LEGEND_LINE + 4;
    let height = header + body_height;
    let drawn = {
        let page = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        draw_header(&page, title, keys, &places)
            .and_then(|()| body(&page.split_vertically(header).1))
            .and_then(|()| page.present().map_err(reason))
    };
    drawn.map(|()| svg).map_err(|reason| PlotError {
        figure: title.to_owned(),
        reason,
    })
}

/// Left edge and line of each entry of the legend.
fn places(keys: &[Key<'_>]) -> Vec<(i32, u32)> {
    let (mut x, mut line) = (20, 0);
    let mut places = Vec::new();
    for key in keys {
        // Text is set by the viewer, whose font is not known here: 7 pixels a letter is ample.
        let letters = i32::try_from(key.text.chars().count()).unwrap_or(0);
        let width = 31 + 7 * letters;
        if x > 20 && x + width > WIDTH as i32 {
            (x, line) = (20, line + 1);
        }
        places.push((x, line));
        x += width + 24;
    }
    places
}

fn draw_header(
    page: &Area<'_>,
    title: &str,
    keys: &[Key<'_>],
    places: &[(i32, u32)],
) -> Result<(), String> {
    page.fill(&WHITE).map_err(reason)?;
    let heading = ("sans-serif", 24, FontStyle::Bold)
        .into_font()
        .color(&palette::TEXT);
    page.draw(&Text::new(title.to_owned(), (20, 12), heading))
        .map_err(reason)?;
    for (key, (x, line)) in keys.iter().zip(places) {
        draw_key(
            page,
            key,
            *x,
            (TITLE + line * LEGEND_LINE + LEGEND_LINE / 2) as i32,
        )?;
    }
    Ok(())
}

/// Draws one entry with its left edge at `x`, around the height `middle`.
fn draw_key(page: &Area<'_>, key: &Key<'_>, x: i32, middle: i32) -> Result<(), String> {
    let drawn = match key.mark {
        Mark::Line(width) => {
            let ends = [(x, middle), (x + 24, middle)];
            page.draw(&PathElement::new(ends, key.colour.stroke_width(width)))
        }
        Mark::Band => {
            let corners = [(x, middle - 6), (x + 24, middle + 6)];
            page.draw(&Rectangle::new(corners, key.colour.filled()))
        }
        Mark::Dot => page.draw(&Circle::new((x + 12, middle), 4, key.colour.filled())),
    };
    drawn.map_err(reason)?;
    let style = text_style(16, palette::TEXT, HPos::Left, VPos::Center);
    page.draw(&Text::new(key.text.to_owned(), (x + 31, middle), style))
        .map_err(reason)
}

/// Text of a size and colour that is anchored at a corner or centre.
pub fn text_style(size: u32, colour: RGBColor, h: HPos, v: VPos) -> TextStyle<'static> {
    ("sans-serif", size)
        .into_font()
        .color(&colour)
        .pos(Pos::new(h, v))
}

/// Text of the axes' numbers.
pub fn label_style() -> TextStyle<'static> {
    ("sans-serif", 15).into_font().color(&palette::TEXT)
}

/// A drawing library's error as text.
pub fn reason(error: impl Display) -> String {
    error.to_string()
}

/// The least and greatest finite value, if there is one.
pub fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|value| value.is_finite());
    finite.fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    })
}

/// The numbers of decimals that axis labels need: the axis takes the least step of the form 1, 2
/// or 5 times a power of ten that gives at most `labels` of them.
pub fn decimals(span: f64, labels: usize) -> usize {
    let least = span / labels.max(1) as f64;
    let decade = 10_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|factor| factor * decade >= least);
    let power = (step.unwrap_or(10.0) * decade * (1.0 + 1e-9))
        .log10()
        .floor();
    (-power).clamp(0.0, 9.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_the_decimals_of_their_step() {
        // Span and labels, and by hand the step: 20, 5, 1, 0.5, 0.01.
        for (span, labels, expected) in [
            (150.0, 9, 0),
            (30.0, 9, 0),
            (4.4, 5, 0),
            (2.4, 5, 1),
            (0.1, 10, 2),
        ] {
            assert_eq!(decimals(span, labels), expected, "{span}");
        }
    }

    #[test]
    fn legend_entries_that_do_not_fit_move_to_the_next_line() {
        let long = "x".repeat(80);
        let key = |text| Key {
            mark: Mark::Dot,
            colour: palette::FIX.to_rgba(),
            text,
        };
        let places = places(&[key("a"), key(&long), key(&long)]);
        assert_eq!(places, [(20, 0), (82, 0), (20, 1)]);
    }
}
