//! A trajectory of the TUM benchmark (`seconds x y z qx qy qz qw`) as the `truth.csv` of a dataset folder.
//!
//! The format has no velocity: it is the central difference of the positions, one-sided at the ends. World and body are
//! taken to be ENU and FLU already.

use std::path::Path;

use super::ImportError;
use super::lines::{self, Line, three, unit};
use crate::dataset::{Truth, TruthRow};

const COLUMNS: &str = "seconds x y z qx qy qz qw";

/// Reads a trajectory.
///
/// # Errors
/// [`ImportError`] with the line; stamps have to increase.
///
/// ```
/// use inekf_client::dataset::Truth;
/// use inekf_client::import::tum;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("poses.txt");
/// std::fs::write(&path, "# seconds x y z qx qy qz qw\n1.0 0 0 0 0 0 0 1\n1.5 2 0 0 0 0 0 1\n")?;
/// let Truth::Spatial(rows) = tum::read(&path)? else { unreachable!() };
/// // Two metres in half a second; the format has no velocity of its own.
/// assert_eq!((rows[1].stamp_ns, rows[1].v_w_mps[0]), (1_500_000_000, 4.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: &Path) -> Result<Truth, ImportError> {
    let rows = lines::read(path, 7, COLUMNS, seconds_to_ns)?;
    let truth = (0..rows.len())
        .map(|index| row(path, &rows, index))
        .collect::<Result<Vec<TruthRow>, ImportError>>()?;
    Ok(Truth::Spatial(truth))
}

fn row(path: &Path, rows: &[Line], index: usize) -> Result<TruthRow, ImportError> {
    let line = &rows[index];
    let [x, y, z] = three(&line.values, 3);
    let q_wb = unit([x, y, z, line.values[6]]).ok_or_else(|| ImportError::Line {
        path: path.to_owned(),
        line: line.number,
        problem: "the quaternion is not of length one".to_owned(),
        remedy: format!("a row is `{COLUMNS}`"),
    })?;
    let (before, after) = (
        &rows[index.saturating_sub(1)],
        &rows[(index + 1).min(rows.len() - 1)],
    );
    let elapsed_s = (after.stamp_ns - before.stamp_ns) as f64 * 1e-9;
    let (from, to) = (three(&before.values, 0), three(&after.values, 0));
    let velocity = |axis: usize| match elapsed_s > 0.0 {
        true => (to[axis] - from[axis]) / elapsed_s,
        false => 0.0,
    };
    Ok(TruthRow {
        stamp_ns: line.stamp_ns,
        q_wb,
        v_w_mps: std::array::from_fn(velocity),
        p_w_m: three(&line.values, 0),
        bias: None,
    })
}

/// Decimal seconds as nanoseconds, exactly where they are written without an exponent and with nine decimals at most.
fn seconds_to_ns(text: &str) -> Option<u64> {
    let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
    let exact = !decimals.is_empty() && decimals.len() <= 9 || !text.contains('.');
    let digits = |text: &str| text.bytes().all(|c| c.is_ascii_digit());
    if exact && !whole.is_empty() && digits(whole) && digits(decimals) {
        let nanoseconds = format!("{decimals:0<9}").parse::<u64>().ok()?;
        return whole
            .parse::<u64>()
            .ok()?
            .checked_mul(1_000_000_000)?
            .checked_add(nanoseconds);
    }
    let seconds = text.parse::<f64>().ok()?;
    // Below 2^64 ns; a negative or endless time is none.
    (0.0..1.8e10)
        .contains(&seconds)
        .then(|| (seconds * 1e9).round() as u64)
}

#[cfg(test)]
mod tests {
    use super::seconds_to_ns;

    #[test]
    fn stamps_keep_every_nanosecond() {
        for (text, expected) in [
            ("1403636579.763555527", Some(1_403_636_579_763_555_527)),
            ("1.5", Some(1_500_000_000)),
            ("7", Some(7_000_000_000)),
            ("1.403636579e9", Some(1_403_636_579_000_000_000)),
            ("0.1234567894", Some(123_456_789)),
            ("-1.0", None),
            ("nan", None),
            ("x", None),
            ("", None),
        ] {
            assert_eq!(seconds_to_ns(text), expected, "{text}");
        }
    }
}
