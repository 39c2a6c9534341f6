//! The rows as text and as JSON.

use hdrhistogram::Histogram;
use inekf_client::plot::format_ns;
use serde_json::{Value, json};

use super::{cache_line, echo};

/// One mechanism's round trips.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was measured.
    pub name: &'static str,
    /// Round trips, ns.
    pub histogram: Histogram<u64>,
}

const QUANTILES: [(&str, f64); 4] = [
    ("p50", 0.5),
    ("p99", 0.99),
    ("p999", 0.999),
    ("p9999", 0.9999),
];

/// The ratio of two rows at a quantile.
fn ratio(row: &Row, base: Option<&Row>, quantile: f64) -> Option<f64> {
    let base = base?.histogram.value_at_quantile(quantile);
    (base > 0).then(|| row.histogram.value_at_quantile(quantile) as f64 / base as f64)
}

fn find<'a>(rows: &'a [Row], name: &str) -> Option<&'a Row> {
    rows.iter().find(|row| row.name == name)
}

/// A table for people.
pub fn text(rows: &[Row]) -> String {
    let mut text = format!(
        "{:<22}{:>10}{:>10}{:>10}{:>10}{:>10}{:>12}\n",
        "round trip", "p50", "p99", "p99.9", "p99.99", "max", "p50 / echo"
    );
    let base = find(rows, echo::NAME);
    for row in rows {
        text += &format!("{:<22}", row.name);
        for (_, quantile) in QUANTILES {
            let ns = row.histogram.value_at_quantile(quantile);
            text += &format!("{:>10}", format_ns(ns as f64));
        }
        text += &format!("{:>10}", format_ns(row.histogram.max() as f64));
        let ratio = ratio(row, base, 0.5).map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
        text += &format!("{ratio:>12}\n");
    }
    text
}

/// Everything, for programs: each row with its quantiles in nanoseconds and its ratios to the echo
/// and to the raw cache line; on top the ratios of the last row, the 15-state estimate.
pub fn json(rows: &[Row]) -> Value {
    let (echo, raw) = (find(rows, echo::NAME), find(rows, cache_line::NAME));
    let of = |row: &Row| {
        let mut value = json!({
            "name": row.name,
            "rounds": row.histogram.len(),
            "max_ns": row.histogram.max(),
            "ratio_p50": ratio(row, echo, 0.5),
            "ratio_p999": ratio(row, echo, 0.999),
            "ratio_p50_cache_line": ratio(row, raw, 0.5),
        });
        for (name, quantile) in QUANTILES {
            value[format!("{name}_ns")] = row.histogram.value_at_quantile(quantile).into();
        }
        value
    };
    json!({
        "rows": rows.iter().map(of).collect::<Vec<_>>(),
        "ratio_p50": rows.last().and_then(|row| ratio(row, echo, 0.5)),
        "ratio_p999": rows.last().and_then(|row| ratio(row, echo, 0.999)),
    })
}
