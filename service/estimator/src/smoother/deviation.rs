//! How far a residual lies from zero under a covariance that may be singular.

use nalgebra::{SMatrix, SVector};

/// A pivot below this share of its own variance counts as zero: the covariance is singular there.
const SINGULAR: f64 = 1e-12;

/// A residual, measured by a covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// `r^T C^+ r` in the directions that C spreads into.
    pub square: f64,
    /// The largest component that C does not allow at all, in the units of the residual.
    pub outside: f64,
}

/// The `residual` under `covariance`, D x D, symmetric positive semidefinite.
///
/// A Cholesky factorisation with pivoting of the correlations, so that units do not matter; the residual is
/// reduced along with it, and what is left where no variance is left lies outside.
pub fn deviation<const D: usize>(
    residual: &SVector<f64, D>,
    covariance: &SMatrix<f64, D, D>,
) -> Deviation {
    let scale = covariance
        .diagonal()
        .map(|variance| if variance > 0.0 { variance.sqrt() } else { 1.0 });
    let mut rest = residual.component_div(&scale);
    let mut c = SMatrix::<f64, D, D>::from_fn(|row, column| {
        covariance[(row, column)] / (scale[row] * scale[column])
    });
    let mut done = [false; D];
    let mut square = 0.0;
    for _ in 0..D {
        let mut pivot = None;
        let mut largest = SINGULAR;
        for i in 0..D {
            if !done[i] && c[(i, i)] > largest {
                largest = c[(i, i)];
                pivot = Some(i);
            }
        }
        let Some(p) = pivot else {
            break;
        };
        done[p] = true;
        square += rest[p] * rest[p] / largest;
        let column = c.column(p) / largest;
        let (row, value) = (c.row(p).into_owned(), rest[p]);
        c -= column * row;
        rest -= column * value;
    }
    let outside = (0..D).filter(|i| !done[*i]).fold(0.0, |outside: f64, i| {
        outside.max((rest[i] * scale[i]).abs())
    });
    Deviation { square, outside }
}
