//! Factors of the small matrices of an update: `S = L D L^T`, M x M, unrolled.
//!
//! L has ones on its diagonal, so that no root is taken, and the reciprocals of D are kept, so that solving divides
//! by nothing.

use nalgebra::{SMatrix, SVector};

/// L, lower triangular with a diagonal of ones, and a positive diagonal D.
///
/// ```
/// use inekf::filter::Factor;
/// use nalgebra::{Matrix2, Vector2};
///
/// let s = Matrix2::new(4.0, 2.0, 2.0, 3.0);
/// let factor = Factor::new(&s).expect("positive definite");
/// let z = Vector2::new(1.0, -1.0);
/// assert!((s * factor.solve(&z) - z).norm() < 1e-14);
/// // ln det S, for the likelihood of an innovation.
/// assert!((factor.log_determinant() - 8_f64.ln()).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor<const M: usize> {
    /// Below its diagonal; zero elsewhere.
    l: SMatrix<f64, M, M>,
    pivots: SVector<f64, M>,
    /// `1 / d_i`.
    reciprocals: SVector<f64, M>,
}

impl<const M: usize> Factor<M> {
    /// The factor of a symmetric matrix, of which the lower triangle is read. `None` if it is not positive
    /// definite, or not finite.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::Matrix2;
    ///
    /// assert!(Factor::new(&Matrix2::new(1.0, 2.0, 2.0, 1.0)).is_none());
    /// assert!(Factor::new(&Matrix2::new(1.0, f64::NAN, f64::NAN, 1.0)).is_none());
    /// ```
    #[inline]
    pub fn new(s: &SMatrix<f64, M, M>) -> Option<Self> {
        let mut l = SMatrix::<f64, M, M>::zeros();
        let mut pivots = SVector::<f64, M>::zeros();
        let mut reciprocals = SVector::<f64, M>::zeros();
        for j in 0..M {
            // Row j of L D.
            let mut scaled = [0.0; M];
            let mut pivot = s[(j, j)];
            for k in 0..j {
                scaled[k] = l[(j, k)] * pivots[k];
                pivot -= l[(j, k)] * scaled[k];
            }
            // A NaN is not above zero either.
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            pivots[j] = pivot;
            reciprocals[j] = 1.0 / pivot;
            for i in j + 1..M {
                let mut entry = s[(i, j)];
                for k in 0..j {
                    entry -= l[(i, k)] * scaled[k];
                }
                l[(i, j)] = entry * reciprocals[j];
            }
        }
        Some(Self {
            l,
            pivots,
            reciprocals,
        })
    }

    /// The Cholesky factor, `L D^1/2`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::Matrix2;
    ///
    /// let s = Matrix2::new(4.0, 2.0, 2.0, 3.0);
    /// let l = Factor::new(&s).expect("positive definite").l();
    /// assert!((l * l.transpose() - s).norm() < 1e-14 && l[(0, 1)] == 0.0);
    /// ```
    pub fn l(&self) -> SMatrix<f64, M, M> {
        let mut root = self.l;
        root.fill_diagonal(1.0);
        for (column, pivot) in self.pivots.iter().enumerate() {
            root.column_mut(column).scale_mut(pivot.sqrt());
        }
        root
    }

    /// `1 / d_i`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::Matrix2;
    ///
    /// // det S is the product of the d_i.
    /// let s = Matrix2::new(4.0, 2.0, 2.0, 3.0);
    /// let factor = Factor::new(&s).expect("positive definite");
    /// assert!((factor.reciprocals().product() * s.determinant() - 1.0).abs() < 1e-14);
    /// ```
    #[inline]
    pub fn reciprocals(&self) -> &SVector<f64, M> {
        &self.reciprocals
    }

    /// `L^-1 z`: `z^T S^-1 z` is the sum of its squares, each divided by its `d_i`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// let factor = Factor::new(&Matrix2::new(4.0, 2.0, 2.0, 3.0)).expect("positive definite");
    /// let z = Vector2::new(1.0, -1.0);
    /// let white = factor.decorrelated(&z);
    /// let square: f64 = white.component_mul(&white).component_mul(factor.reciprocals()).sum();
    /// assert!((square - factor.normalised_square(&z)).abs() < 1e-14);
    /// ```
    #[inline]
    pub fn decorrelated(&self, z: &SVector<f64, M>) -> SVector<f64, M> {
        let mut w = *z;
        for i in 0..M {
            for k in 0..i {
                w[i] -= self.l[(i, k)] * w[k];
            }
        }
        w
    }

    /// `B L^-T`: the rows of B, [`decorrelated`](Self::decorrelated).
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// let factor = Factor::new(&Matrix2::new(4.0, 2.0, 2.0, 3.0)).expect("positive definite");
    /// let z = Vector2::new(1.0, -1.0);
    /// // A row at a time it is `decorrelated`.
    /// assert_eq!(factor.decorrelated_rows(&z.transpose()).transpose(), factor.decorrelated(&z));
    /// ```
    #[inline(always)]
    pub fn decorrelated_rows<const D: usize>(&self, b: &SMatrix<f64, D, M>) -> SMatrix<f64, D, M> {
        let mut w = *b;
        for i in 0..M {
            for k in 0..i {
                let factor = self.l[(i, k)];
                for row in 0..D {
                    w[(row, i)] -= factor * w[(row, k)];
                }
            }
        }
        w
    }

    /// `S^-1 z`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// let s = Matrix2::new(4.0, 2.0, 2.0, 3.0);
    /// let x = Factor::new(&s).expect("positive definite").solve(&Vector2::new(6.0, 5.0));
    /// assert!((x - Vector2::new(1.0, 1.0)).norm() < 1e-14);
    /// ```
    #[inline]
    pub fn solve(&self, z: &SVector<f64, M>) -> SVector<f64, M> {
        let mut x = self.decorrelated(z);
        for i in 0..M {
            x[i] *= self.reciprocals[i];
        }
        for i in (0..M).rev() {
            for k in i + 1..M {
                x[i] -= self.l[(k, i)] * x[k];
            }
        }
        x
    }

    /// `S^-1`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::Matrix2;
    ///
    /// let s = Matrix2::new(4.0, 2.0, 2.0, 3.0);
    /// let inverse = Factor::new(&s).expect("positive definite").inverse();
    /// assert!((s * inverse - Matrix2::identity()).norm() < 1e-14);
    /// ```
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

    /// `tr(S^-1 A)` of a symmetric A, M x M: of `D^-1 L^-1 A L^-T`.
    #[inline]
    pub(crate) fn trace_of_quotient(&self, a: &SMatrix<f64, M, M>) -> f64 {
        let mut b = *a;
        let mut trace = 0.0;
        for i in 0..M {
            for k in 0..i {
                for column in 0..M {
                    b[(i, column)] -= self.l[(i, k)] * b[(k, column)];
                }
            }
            let mut row = [0.0; M];
            for j in 0..=i {
                row[j] = b[(i, j)];
                for k in 0..j {
                    row[j] -= self.l[(j, k)] * row[k];
                }
            }
            trace += row[i] * self.reciprocals[i];
        }
        trace
    }

    /// `z^T S^-1 z`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// // Two standard deviations on one of two axes.
    /// let factor = Factor::new(&Matrix2::new(4.0, 0.0, 0.0, 9.0)).expect("positive definite");
    /// assert_eq!(factor.normalised_square(&Vector2::new(4.0, 0.0)), 4.0);
    /// ```
    #[inline]
    pub fn normalised_square(&self, z: &SVector<f64, M>) -> f64 {
        let w = self.decorrelated(z);
        let mut sum = 0.0;
        for i in 0..M {
            sum += w[i] * w[i] * self.reciprocals[i];
        }
        sum
    }

    /// `ln det S`.
    ///
    /// ```
    /// use inekf::filter::Factor;
    /// use nalgebra::Matrix2;
    ///
    /// let factor = Factor::new(&Matrix2::new(4.0, 0.0, 0.0, 9.0)).expect("positive definite");
    /// assert!((factor.log_determinant() - 36_f64.ln()).abs() < 1e-14);
    /// ```
    pub fn log_determinant(&self) -> f64 {
        let product: f64 = self.pivots.iter().product();
        // One logarithm for all, unless the product leaves the numbers.
        if product.is_normal() {
            product.ln()
        } else {
            self.pivots.iter().map(|pivot| pivot.ln()).sum()
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

    #[test]
    fn the_trace_of_a_quotient_is_that_of_the_product_with_the_inverse() {
        let s = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.2, -0.5, 0.2, 2.0);
        let a = Matrix3::new(7.0, -2.0, 0.3, -2.0, 5.0, 1.1, 0.3, 1.1, 9.0);
        let expected = (s.try_inverse().expect("definite") * a).trace();
        let factor = Factor::new(&s).expect("definite");
        assert!((factor.trace_of_quotient(&a) - expected).abs() < 1e-14 * expected);
    }
}
