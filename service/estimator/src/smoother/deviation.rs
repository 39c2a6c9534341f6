//! How far a residual lies from zero under a covariance that may be singular.

use nalgebra::{SMatrix, SVector};

/// A pivot below this share of its own variance counts as zero: the covariance is singular there.
const SINGULAR: f64 = 1e-12;

/// A residual, measured by a covariance.
///
/// ```
/// use inekf::smoother::{Deviation, deviation};
/// use nalgebra::{Matrix2, Vector2};
///
/// // Two standard deviations where there is a variance, and a residual where there is none.
/// let off = deviation(&Vector2::new(6.0, 0.5), &Matrix2::new(9.0, 0.0, 0.0, 0.0));
/// assert_eq!(off, Deviation { square: 4.0, outside: 0.5 });
/// ```
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
///
/// ```
/// use inekf::smoother::deviation;
/// use nalgebra::{Matrix2, Vector2};
///
/// // Fully correlated: together is allowed, apart is not.
/// let together = Matrix2::new(1.0, 1.0, 1.0, 1.0);
/// assert!(deviation(&Vector2::new(1.0, 1.0), &together).outside < 1e-12);
/// assert!(deviation(&Vector2::new(1.0, -1.0), &together).outside > 0.5);
/// ```
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
    // The components in the order of elimination.
    let mut order: [usize; D] = core::array::from_fn(|i| i);
    let mut square = 0.0;
    let mut rank = 0;
    while rank < D {
        let largest = (rank..D).fold(rank, |best, k| {
            let variance = |k: usize| c[(order[k], order[k])];
            if variance(k) > variance(best) {
                k
            } else {
                best
            }
        });
        order.swap(rank, largest);
        let p = order[rank];
        let variance = c[(p, p)];
        if variance.is_nan() || variance <= SINGULAR {
            break;
        }
        square += rest[p] * rest[p] / variance;
        rank += 1;
        for (k, &i) in order.iter().enumerate().skip(rank) {
            let factor = c[(i, p)] / variance;
            rest[i] -= factor * rest[p];
            for &j in &order[rank..=k] {
                let entry = c[(i, j)] - factor * c[(j, p)];
                c[(i, j)] = entry;
                c[(j, i)] = entry;
            }
        }
    }
    let outside = order[rank..].iter().fold(0.0, |outside: f64, &i| {
        outside.max((rest[i] * scale[i]).abs())
    });
    Deviation { square, outside }
}
