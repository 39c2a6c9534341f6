//! A covariance that rounding has made indefinite, made definite again.
//!
//! Without process noise a filter at rest learns some directions to a precision that double numbers cannot hold beside
//! the others: after some thousand updates rounding errors are larger than what is left of the variance there, and an
//! eigenvalue turns negative. Symmetric arithmetic does not prevent that. The remedy is a floor: with P scaled to unit
//! variances, a Cholesky factorisation whose pivots (the variance of a component given those before it, as a share of
//! its own) are lifted to `LEAST_SHARE`, which adds to the variances and to nothing else.

use super::covariance::Covariance;

/// The least share of a variance that may be left once the components before it are known. Some ten thousand times
/// what rounding takes from a matrix of this size, and far below what any sensor can tell.
const LEAST_SHARE: f64 = 1e-11;

impl<const D: usize> Covariance<D> {
    /// The same if it is definite, else with the least addition to its variances that this factorisation finds. What
    /// it adds to a variance is of the size of the rounding that spoiled it. A matrix that is not finite stays as it
    /// is.
    ///
    /// ```
    /// use inekf::filter::{Covariance, Factor};
    /// use nalgebra::Matrix2;
    ///
    /// // Rounding has taken a little too much: fully correlated, and a bit more.
    /// let spoiled = Covariance::from_upper(Matrix2::new(1.0, 1.0 + 1e-15, 0.0, 1.0));
    /// assert!(Factor::new(spoiled.matrix()).is_none());
    /// let mended = spoiled.made_definite();
    /// assert!(Factor::new(mended.matrix()).is_some());
    /// assert!((mended.matrix() - spoiled.matrix()).norm() < 1e-9);
    /// ```
    #[must_use]
    pub fn made_definite(&self) -> Self {
        let p = self.matrix();
        let mut sigma = [0.0; D];
        for (i, sigma) in sigma.iter_mut().enumerate() {
            *sigma = p[(i, i)].sqrt();
        }
        // Row by row; a component without variance has no share in anything.
        let mut l = [[0.0; D]; D];
        let mut added = [0.0; D];
        for j in 0..D {
            if !(sigma[j] > 0.0 && sigma[j].is_finite()) {
                continue;
            }
            let mut pivot = 1.0;
            for entry in &l[j][..j] {
                pivot -= entry * entry;
            }
            if pivot < LEAST_SHARE {
                added[j] = LEAST_SHARE - pivot;
                pivot = LEAST_SHARE;
            }
            let root = pivot.sqrt();
            l[j][j] = root;
            let pivot_row = l[j];
            for i in j + 1..D {
                if sigma[i] > 0.0 {
                    let known = l[i][..j].iter().zip(&pivot_row[..j]);
                    let known: f64 = known.map(|(a, b)| a * b).sum();
                    l[i][j] = (p[(i, j)] / (sigma[i] * sigma[j]) - known) / root;
                }
            }
        }
        if added.iter().all(|added| *added == 0.0) || !added.iter().all(|added| added.is_finite()) {
            return *self;
        }
        let mut lifted = *p;
        for (j, added) in added.iter().enumerate() {
            lifted[(j, j)] += added * p[(j, j)];
        }
        Self::from_upper(lifted)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::*;

    #[test]
    fn a_definite_matrix_keeps_every_bit() {
        let p = Covariance::<3>::from_upper(SMatrix::from_row_slice(&[
            4.0, 1.0, 5e-7, 0.0, 3.0, 2e-7, 0.0, 0.0, 1e-12,
        ]));
        assert_eq!(p.made_definite(), p);
    }

    #[test]
    fn a_slightly_indefinite_matrix_becomes_definite_and_hardly_changes() {
        // Two components that are one but for a rounding error the wrong way.
        let off = 1.0 + 3e-13;
        let p = Covariance::<2>::from_upper(SMatrix::from_row_slice(&[1.0, off, 0.0, 1.0]));
        assert!(p.matrix().symmetric_eigenvalues().min() < 0.0);
        let q = p.made_definite();
        assert!(q.matrix().symmetric_eigenvalues().min() > 0.0);
        assert!((q.matrix() - p.matrix()).amax() < 2e-11);
    }

    #[test]
    fn certainty_and_what_is_not_finite_stay_as_they_are() {
        let certain = Covariance::from_variances(&SVector::from([0.0, 2.0, 0.0]));
        assert_eq!(certain.made_definite(), certain);
        let broken =
            Covariance::<2>::from_upper(SMatrix::from_row_slice(&[1.0, f64::NAN, 0.0, 1.0]));
        assert_eq!(
            broken.made_definite().matrix().map(f64::to_bits),
            broken.matrix().map(f64::to_bits)
        );
    }
}
