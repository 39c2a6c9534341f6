//! Cholesky factors of the small matrices of an update: `S = L L^T`, M x M, unrolled.
//!
//! With the reciprocals of the diagonal kept, so that solving divides by nothing; half the time of the
//! general factorisation at M = 3.

use nalgebra::{SMatrix, SVector};

/// L, lower triangular with a positive diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor<const M: usize> {
    l: SMatrix<f64, M, M>,
    /// `1 / l_ii`.
    reciprocals: SVector<f64, M>,
}

impl<const M: usize> Factor<M> {
    /// The factor of a symmetric matrix, of which the lower triangle is read. `None` if it is not positive
    /// definite, or not finite.
    #[inline]
    pub fn new(s: &SMatrix<f64, M, M>) -> Option<Self> {
        let mut l = SMatrix::<f64, M, M>::zeros();
        let mut reciprocals = SVector::<f64, M>::zeros();
        for j in 0..M {
            let mut pivot = s[(j, j)];
            for k in 0..j {
                pivot -= l[(j, k)] * l[(j, k)];
            }
            // A NaN is not above zero either.
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            let root = pivot.sqrt();
            l[(j, j)] = root;
            reciprocals[j] = 1.0 / root;
            for i in j + 1..M {
                let mut entry = s[(i, j)];
                for k in 0..j {
                    entry -= l[(i, k)] * l[(j, k)];
                }
                l[(i, j)] = entry * reciprocals[j];
            }
        }
        Some(Self { l, reciprocals })
    }

    /// L.
    pub fn l(&self) -> SMatrix<f64, M, M> {
        self.l
    }

    /// `L^-1 z`, whose square is `z^T S^-1 z`.
    #[inline]
    pub fn whitened(&self, z: &SVector<f64, M>) -> SVector<f64, M> {
        let mut w = *z;
        for i in 0..M {
            for k in 0..i {
                w[i] -= self.l[(i, k)] * w[k];
            }
            w[i] *= self.reciprocals[i];
        }
        w
    }

    /// `S^-1 z`.
    #[inline]
    pub fn solve(&self, z: &SVector<f64, M>) -> SVector<f64, M> {
        let mut x = self.whitened(z);
        for i in (0..M).rev() {
            for k in i + 1..M {
                x[i] -= self.l[(k, i)] * x[k];
            }
            x[i] *= self.reciprocals[i];
        }
        x
    }

    /// `S^-1`.
    #[inline]
    pub fn inverse(&self) -> SMatrix<f64, M, M> {
        let mut inverse = SMatrix::<f64, M, M>::zeros();
        for column in 0..M {
            let mut unit = SVector::<f64, M>::zeros();
            unit[column] = 1.0;
            let solved = self.solve(&unit);
            for row in 0..M {
                inverse[(row, column)] = solved[row];
            }
        }
        inverse
    }

    /// `z^T S^-1 z`.
    #[inline]
    pub fn normalised_square(&self, z: &SVector<f64, M>) -> f64 {
        self.whitened(z).norm_squared()
    }

    /// `ln det S`.
    pub fn log_determinant(&self) -> f64 {
        let product: f64 = (0..M).map(|i| self.l[(i, i)]).product();
        // One logarithm for all, unless the product leaves the numbers.
        let log_root = if product.is_normal() {
            product.ln()
        } else {
            (0..M).map(|i| self.l[(i, i)].ln()).sum()
        };
        2.0 * log_root
    }
}
