//! The colours of all figures.

use plotters::style::RGBColor;

/// The truth: a broad grey line that stays visible beneath the estimate.
pub const TRUTH: RGBColor = RGBColor(0xa8, 0xad, 0xb4);
/// The estimate and its band.
pub const ESTIMATE: RGBColor = RGBColor(0x0b, 0x5f, 0xb8);
/// Position fixes.
pub const FIX: RGBColor = RGBColor(0xe8, 0x7d, 0x1e);
/// Titles and numbers.
pub const TEXT: RGBColor = RGBColor(0x24, 0x29, 0x2f);
/// Notes, axes.
pub const FAINT: RGBColor = RGBColor(0x6b, 0x72, 0x7b);
/// Grid lines.
pub const GRID: RGBColor = RGBColor(0xe4, 0xe7, 0xeb);
/// Several curves in one figure, in this order; the first is [`ESTIMATE`].
pub const SERIES: [RGBColor; 5] = [
    ESTIMATE,
    FIX,
    RGBColor(0x2a, 0x8c, 0x55),
    RGBColor(0xb8, 0x32, 0x5a),
    RGBColor(0x6f, 0x4f, 0xb3),
];
