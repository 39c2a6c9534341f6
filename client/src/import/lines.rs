//! Text files of numbers: a row a line, separated by commas or spaces; `#` begins a comment.

use std::fs;
use std::path::Path;

use super::ImportError;

/// One row: its line in the file, its stamp as it is written, and the numbers after it.
pub struct Line {
    /// The line, from 1.
    pub number: usize,
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// What follows.
    pub values: Vec<f64>,
}

/// Reads a file whose rows have a stamp, made of text by `stamp`, and `count` numbers or more after it; what is beyond
/// them is ignored.
pub fn read(
    path: &Path,
    count: usize,
    columns: &str,
    stamp: impl Fn(&str) -> Option<u64>,
) -> Result<Vec<Line>, ImportError> {
    let text = fs::read_to_string(path).map_err(|cause| ImportError::Read {
        path: path.to_owned(),
        cause,
    })?;
    let mut lines: Vec<Line> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let number = index + 1;
        let fault = |problem: String, remedy: String| ImportError::Line {
            path: path.to_owned(),
            line: number,
            problem,
            remedy,
        };
        let mut words = line
            .split(|c: char| c == ',' || c.is_whitespace())
            .filter(|word| !word.is_empty());
        let first = words.next().unwrap_or_default();
        let stamp_ns = stamp(first).ok_or_else(|| {
            fault(
                format!("{first:?} is no stamp"),
                format!("a row is `{columns}`"),
            )
        })?;
        if let Some(before) = lines.last()
            && stamp_ns <= before.stamp_ns
        {
            return Err(fault(
                format!(
                    "the stamp {stamp_ns} ns does not come after {} ns",
                    before.stamp_ns
                ),
                "sort the rows by time".to_owned(),
            ));
        }
        let values = words
            .take(count)
            .map(|word| {
                let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
                value.ok_or_else(|| {
                    fault(
                        format!("{word:?} is no finite number"),
                        format!("a row is `{columns}`"),
                    )
                })
            })
            .collect::<Result<Vec<f64>, ImportError>>()?;
        if values.len() < count {
            return Err(fault(
                format!("{} numbers after the stamp, not {count}", values.len()),
                format!("a row is `{columns}`"),
            ));
        }
        lines.push(Line {
            number,
            stamp_ns,
            values,
        });
    }
    if lines.is_empty() {
        return Err(ImportError::Empty {
            path: path.to_owned(),
        });
    }
    Ok(lines)
}

/// Three of the numbers, from `at` on; what `read` has counted is there.
pub fn three(values: &[f64], at: usize) -> [f64; 3] {
    std::array::from_fn(|i| values.get(at + i).copied().unwrap_or_default())
}

/// A quaternion written `w, x, y, z` or `x, y, z, w`, normalised, as `x, y, z, w`; `None` if it has no direction.
pub fn unit([x, y, z, w]: [f64; 4]) -> Option<[f64; 4]> {
    let norm = (x * x + y * y + z * z + w * w).sqrt();
    (norm > 0.5).then(|| [x, y, z, w].map(|entry| entry / norm))
}
