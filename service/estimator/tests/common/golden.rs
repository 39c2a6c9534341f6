//! Reading golden vectors: nested arrays of JSON as vectors and matrices, row by row.

use nalgebra::SMatrix;
use serde_json::Value;

/// Every number below `value`, in order.
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().expect("a number")],
    }
}

/// A matrix from its rows; a vector from its entries.
pub fn matrix<const R: usize, const C: usize>(value: &Value) -> SMatrix<f64, R, C> {
    SMatrix::from_row_slice(&numbers(value))
}

/// The largest difference, relative to the largest entry of `expected`; infinite if not a number.
pub fn relative_error<const R: usize, const C: usize>(
    actual: &SMatrix<f64, R, C>,
    expected: &SMatrix<f64, R, C>,
) -> f64 {
    let worst = |largest: f64, x: &f64| if x.abs() <= largest { largest } else { x.abs() };
    let error = (actual - expected).iter().fold(0.0, worst) / expected.amax();
    if error.is_nan() { f64::INFINITY } else { error }
}
