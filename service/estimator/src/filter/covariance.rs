//! Covariances that are symmetric by construction.
//!
//! Every operation computes the upper triangle and mirrors it. The textbook `P - K H P` on a full
//! matrix drifts from symmetry and goes singular after some hundred updates; this cannot. Where P is
//! singular by right, a variance can round below zero: it is put back to zero.

use nalgebra::{SMatrix, SVector};

/// A symmetric D x D matrix, meant positive semidefinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance<const D: usize>(SMatrix<f64, D, D>);

fn mirror<const D: usize>(matrix: &mut SMatrix<f64, D, D>) {
    for row in 0..D {
        for column in row + 1..D {
            matrix[(column, row)] = matrix[(row, column)];
        }
    }
}

/// Puts back what rounding took below zero, where no true variance is; NaN stays.
fn without_negative_variances<const D: usize>(
    mut matrix: SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    for i in 0..D {
        if matrix[(i, i)] < 0.0 {
            matrix[(i, i)] = 0.0;
        }
    }
    matrix
}

/// `A H^T`. A sensor sees few of the states: the zeros of H are passed over.
fn times_transposed<const D: usize, const M: usize>(
    a: &SMatrix<f64, D, D>,
    h: &SMatrix<f64, M, D>,
) -> SMatrix<f64, D, M> {
    let mut product = SMatrix::<f64, D, M>::zeros();
    for k in 0..D {
        for column in 0..M {
            let factor = h[(column, k)];
            if factor == 0.0 {
                continue;
            }
            for row in 0..D {
                product[(row, column)] += a[(row, k)] * factor;
            }
        }
    }
    product
}

impl<const D: usize> Covariance<D> {
    /// The matrix with the upper triangle of `matrix`; what lies below is ignored.
    pub fn from_upper(mut matrix: SMatrix<f64, D, D>) -> Self {
        mirror(&mut matrix);
        Self(matrix)
    }

    /// The same, of a product that is a covariance but for rounding.
    pub(crate) fn from_rounded(matrix: SMatrix<f64, D, D>) -> Self {
        let mut matrix = without_negative_variances(matrix);
        mirror(&mut matrix);
        Self(matrix)
    }

    /// Independent components with these variances.
    pub fn from_variances(variances: &SVector<f64, D>) -> Self {
        Self(SMatrix::from_diagonal(variances))
    }

    /// The full matrix.
    pub fn matrix(&self) -> &SMatrix<f64, D, D> {
        &self.0
    }

    /// `A P A^T`.
    pub fn transformed(&self, a: &SMatrix<f64, D, D>) -> Self {
        let half = a * self.0;
        let mut result = SMatrix::<f64, D, D>::zeros();
        let at = a.transpose();
        // Column by column: entry (row, column) for row <= column is half.row(row) . a.row(column).
        for column in 0..D {
            for k in 0..D {
                let factor = at[(k, column)];
                if factor == 0.0 {
                    continue;
                }
                for row in 0..=column {
                    result[(row, column)] += half[(row, k)] * factor;
                }
            }
        }
        mirror(&mut result);
        Self(without_negative_variances(result))
    }

    /// `P + Q` for a symmetric Q.
    pub fn plus(&self, q: &SMatrix<f64, D, D>) -> Self {
        Self::from_upper(self.0 + q)
    }

    /// `P H^T`, D x M.
    pub fn times_transposed<const M: usize>(&self, h: &SMatrix<f64, M, D>) -> SMatrix<f64, D, M> {
        times_transposed(&self.0, h)
    }

    /// The covariance after a measurement with gain K (D x M), Jacobian H (M x D) and noise N (M x M):
    /// Joseph's `(I - K H) P (I - K H)^T + K N K^T`, as `A - (A H^T - K N) K^T` with `A = P - K H P`.
    ///
    /// A alone loses every digit where the measurement is 1e8 times as precise as the prior; the
    /// second term takes its rounding back.
    pub fn corrected<const M: usize>(
        &self,
        gain: &SMatrix<f64, D, M>,
        h: &SMatrix<f64, M, D>,
        noise: &SMatrix<f64, M, M>,
    ) -> Self {
        let p_ht = self.times_transposed(h);
        let mut a = self.0;
        for column in 0..D {
            for k in 0..M {
                let factor = p_ht[(column, k)];
                for row in 0..D {
                    a[(row, column)] -= gain[(row, k)] * factor;
                }
            }
        }
        let excess = times_transposed(&a, h) - gain * noise;
        let corrected = Self(a).minus_product(&excess, gain);
        Self(without_negative_variances(corrected.0))
    }

    /// `P - V V^T`, V of shape D x M, for a V that is known to be far from P.
    pub fn downdated<const M: usize>(&self, v: &SMatrix<f64, D, M>) -> Self {
        self.minus_product(v, v)
    }

    /// `P - X Y^T`, of which the upper triangle is computed.
    fn minus_product<const M: usize>(
        &self,
        x: &SMatrix<f64, D, M>,
        y: &SMatrix<f64, D, M>,
    ) -> Self {
        let mut result = self.0;
        for column in 0..D {
            for k in 0..M {
                let factor = y[(column, k)];
                for row in 0..=column {
                    result[(row, column)] -= x[(row, k)] * factor;
                }
            }
        }
        mirror(&mut result);
        Self(result)
    }

    /// `factor * P`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0 * factor)
    }

    /// Whether every entry is finite and no variance negative.
    pub fn is_plausible(&self) -> bool {
        self.0.iter().all(|entry| entry.is_finite()) && (0..D).all(|i| self.0[(i, i)] >= 0.0)
    }

    /// The upper triangle, row by row.
    pub fn upper_triangle(&self) -> impl Iterator<Item = f64> + '_ {
        (0..D).flat_map(move |row| (row..D).map(move |column| self.0[(row, column)]))
    }

    /// From an upper triangle, row by row; `None` if `entries` has not exactly D (D + 1) / 2.
    pub fn from_upper_triangle(entries: &[f64]) -> Option<Self> {
        if entries.len() != D * (D + 1) / 2 {
            return None;
        }
        let mut matrix = SMatrix::<f64, D, D>::zeros();
        let mut rest = entries.iter();
        for row in 0..D {
            for (column, entry) in (row..D).zip(&mut rest) {
                matrix[(row, column)] = *entry;
            }
        }
        Some(Self::from_upper(matrix))
    }
}
