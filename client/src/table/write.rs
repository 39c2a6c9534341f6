//! Writing numbers and rows: shortest decimals that read back to the same double.

use std::io::{self, Write};

/// Writes `values` to an open row, each with a comma before it.
///
/// The standard library's `{:?}` is the shortest decimal that reads back exactly; it writes an
/// exponent for very small and very large numbers and keeps the sign of zero.
pub(crate) fn write_numbers(out: &mut impl Write, values: &[f64]) -> io::Result<()> {
    for value in values {
        write!(out, ",{value:?}")?;
    }
    Ok(())
}
