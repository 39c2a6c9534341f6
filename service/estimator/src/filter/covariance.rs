//! Covariances that are symmetric by construction.
//!
//! Every operation computes the upper triangle and mirrors it. The textbook `P - K H P` on a full
//! matrix drifts from symmetry and goes singular after some hundred updates; this cannot. Where P is
//! singular by right, a variance can round below zero: it is put back to zero.

use nalgebra::{ArrayStorage, SMatrix, SVector};

use super::seen::Seen;
use crate::columns::{Column, combined};
use crate::lanes::Pair;
use crate::lie::LieGroup;

/// A symmetric D x D matrix, meant positive semidefinite.
///
/// ```
/// use inekf::filter::Covariance;
/// use nalgebra::Vector2;
///
/// let p = Covariance::from_variances(&Vector2::new(4.0, 1.0));
/// let entries: Vec<f64> = p.upper_triangle().collect();
/// assert_eq!(entries, [4.0, 0.0, 1.0]);
/// assert_eq!(Covariance::<2>::from_upper_triangle(&entries), Some(p));
/// ```
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
fn put_back_negative_variances<const D: usize>(matrix: &mut SMatrix<f64, D, D>) {
    for i in 0..D {
        if matrix[(i, i)] < 0.0 {
            matrix[(i, i)] = 0.0;
        }
    }
}

/// `column + factor * other`, in place.
#[inline(always)]
fn add<const D: usize>(column: &mut Column<D>, factor: f64, other: &Column<D>) {
    *column = combined::<D, _, _, _, _>(column, [factor], [other]);
}

/// The first ROWS rows of `column - others row^T`, `row` being a row of `factors`.
#[inline(always)]
fn without<const ROWS: usize, const D: usize, const M: usize>(
    column: &Column<D>,
    factors: &[Column<D>; M],
    row: usize,
    others: &[Column<D>; M],
) -> Column<D> {
    let factors = core::array::from_fn(|k| -factors[k][row]);
    combined::<ROWS, _, _, _, _>(column, factors, others.each_ref())
}

/// `A H^T`. A sensor sees few of the states: the others are passed over.
#[inline(always)]
fn times_transposed<const D: usize, const M: usize>(
    a: &SMatrix<f64, D, D>,
    seen: &Seen<D>,
    h: &SMatrix<f64, M, D>,
) -> SMatrix<f64, D, M> {
    let (a, h) = (&a.data.0, &h.data.0);
    let mut product = [[0.0; D]; M];
    for half in 0..D / 2 {
        let row = 2 * half;
        let mut sums = [Pair::splat(0.0); M];
        for &k in seen.states() {
            let entries = Pair::load(&a[k], row);
            for m in 0..M {
                sums[m] = sums[m] + entries * Pair::splat(h[k][m]);
            }
        }
        for m in 0..M {
            sums[m].store(&mut product[m], row);
        }
    }
    if D % 2 == 1 {
        for &k in seen.states() {
            for m in 0..M {
                product[m][D - 1] += a[k][D - 1] * h[k][m];
            }
        }
    }
    SMatrix::from_array_storage(ArrayStorage(product))
}

/// `(B A^T)^T` of a symmetric B, passing over the zeros of A; after a second time with the result it is
/// `A B A^T`.
fn half_transformed<const D: usize>(
    b: &SMatrix<f64, D, D>,
    a: &SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    let mut product = [[0.0; D]; D];
    for (row, column) in product.iter_mut().enumerate() {
        for k in 0..D {
            let factor = a[(row, k)];
            if factor != 0.0 {
                add(column, factor, &b.data.0[k]);
            }
        }
    }
    SMatrix::from_array_storage(ArrayStorage(product)).transpose()
}

impl<const D: usize> Covariance<D> {
    /// The matrix with the upper triangle of `matrix`; what lies below is ignored.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::Matrix2;
    ///
    /// // What lies below the diagonal is not looked at.
    /// let p = Covariance::from_upper(Matrix2::new(4.0, 1.0, f64::NAN, 9.0));
    /// assert_eq!(p.matrix(), &Matrix2::new(4.0, 1.0, 1.0, 9.0));
    /// ```
    pub fn from_upper(mut matrix: SMatrix<f64, D, D>) -> Self {
        mirror(&mut matrix);
        Self(matrix)
    }

    /// Lets `change` work on the matrix, which it leaves exactly symmetric; a variance that rounding took below
    /// zero is put back.
    #[inline]
    pub(crate) fn change_symmetrically(&mut self, change: impl FnOnce(&mut SMatrix<f64, D, D>)) {
        change(&mut self.0);
        put_back_negative_variances(&mut self.0);
    }

    /// Independent components with these variances.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// let p = Covariance::from_variances(&Vector2::new(4.0, 9.0));
    /// assert_eq!(p.matrix(), &Matrix2::new(4.0, 0.0, 0.0, 9.0));
    /// ```
    pub fn from_variances(variances: &SVector<f64, D>) -> Self {
        Self(SMatrix::from_diagonal(variances))
    }

    /// The full matrix.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::Matrix2;
    ///
    /// // Symmetric, to the last bit.
    /// let p = Covariance::from_upper(Matrix2::new(4.0, 0.1 + 0.2, 0.3, 9.0));
    /// assert_eq!(p.matrix(), &p.matrix().transpose());
    /// ```
    pub fn matrix(&self) -> &SMatrix<f64, D, D> {
        &self.0
    }

    /// `A P A^T`.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// // Twice as long is four times the variance.
    /// let p = Covariance::from_variances(&Vector2::new(1.0, 1.0));
    /// let stretched = p.transformed(&Matrix2::from_diagonal(&Vector2::new(2.0, 1.0)));
    /// assert_eq!(stretched, Covariance::from_variances(&Vector2::new(4.0, 1.0)));
    /// ```
    pub fn transformed(&self, a: &SMatrix<f64, D, D>) -> Self {
        let mut result = half_transformed(&half_transformed(&self.0, a), a);
        mirror(&mut result);
        put_back_negative_variances(&mut result);
        Self(result)
    }

    /// [`transformed`](Self::transformed) by a matrix with the zeros of the adjoint of G, in place.
    #[inline]
    pub(super) fn transform_by<G: LieGroup<D>>(&mut self, a: &SMatrix<f64, D, D>) {
        self.change_symmetrically(|p| G::congruence(p, a));
    }

    /// `P + Q` for a symmetric Q.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// // Variances of independent noises add.
    /// let p = Covariance::from_variances(&Vector2::new(9.0, 1.0)).plus(&Matrix2::from_diagonal_element(16.0));
    /// assert_eq!(p.matrix()[(0, 0)], 25.0);
    /// ```
    pub fn plus(&self, q: &SMatrix<f64, D, D>) -> Self {
        Self::from_upper(self.0 + q)
    }

    /// `P H^T`, D x M.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::{RowVector2, Vector2};
    ///
    /// let p = Covariance::from_variances(&Vector2::new(4.0, 9.0));
    /// let h = RowVector2::new(0.0, 1.0); // it sees the second state
    /// assert_eq!(p.times_transposed(&h), Vector2::new(0.0, 9.0));
    /// ```
    pub fn times_transposed<const M: usize>(&self, h: &SMatrix<f64, M, D>) -> SMatrix<f64, D, M> {
        self.times_transposed_of(&Seen::by(h), h)
    }

    /// [`times_transposed`](Self::times_transposed), where it is known which states H sees.
    #[inline(always)]
    pub(super) fn times_transposed_of<const M: usize>(
        &self,
        seen: &Seen<D>,
        h: &SMatrix<f64, M, D>,
    ) -> SMatrix<f64, D, M> {
        times_transposed(&self.0, seen, h)
    }

    /// `P - W R W^T` for a diagonal R.
    #[inline(always)]
    pub(super) fn reduced<const M: usize>(
        &self,
        w: &SMatrix<f64, D, M>,
        r: &SVector<f64, M>,
    ) -> Self {
        let mut reduced = *self;
        reduced.reduce(w, r);
        reduced
    }

    /// Makes P `P - W R W^T` for a diagonal R.
    #[inline(always)]
    pub(crate) fn reduce<const M: usize>(&mut self, w: &SMatrix<f64, D, M>, r: &SVector<f64, M>) {
        let w = &w.data.0;
        for (index, column) in self.0.data.0.iter_mut().enumerate() {
            let mut factors = [0.0; M];
            for m in 0..M {
                factors[m] = -(w[m][index] * r[m]);
            }
            // As many rows as reach the diagonal, in lengths that are known.
            *column = if index < 4 && D > 4 {
                combined::<4, _, _, _, _>(column, factors, w.each_ref())
            } else if index < 8 && D > 8 {
                combined::<8, _, _, _, _>(column, factors, w.each_ref())
            } else {
                combined::<D, _, _, _, _>(column, factors, w.each_ref())
            };
        }
        mirror(&mut self.0);
        put_back_negative_variances(&mut self.0);
    }

    /// The covariance after a measurement with gain K (D x M), Jacobian H (M x D) and noise N (M x M):
    /// Joseph's `(I - K H) P (I - K H)^T + K N K^T`, as `A - (A H^T - K N) K^T` with `A = P - K H P`.
    ///
    /// A alone loses every digit where the measurement is 1e8 times as precise as the prior; the
    /// second term takes its rounding back.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::{Matrix1, RowVector2, Vector2};
    ///
    /// let p = Covariance::from_variances(&Vector2::new(1.0, 1.0));
    /// let (h, n) = (RowVector2::new(1.0, 0.0), Matrix1::new(1.0));
    /// // As good as what was known: half the variance is left, by half the gain.
    /// let after = p.corrected(&Vector2::new(0.5, 0.0), &h, &n);
    /// assert_eq!(after, Covariance::from_variances(&Vector2::new(0.5, 1.0)));
    /// // Joseph's form holds for any gain, a bad one too: none leaves all.
    /// assert_eq!(p.corrected(&Vector2::zeros(), &h, &n), p);
    /// ```
    pub fn corrected<const M: usize>(
        &self,
        gain: &SMatrix<f64, D, M>,
        h: &SMatrix<f64, M, D>,
        noise: &SMatrix<f64, M, M>,
    ) -> Self {
        let seen = Seen::by(h);
        self.corrected_with(&self.times_transposed_of(&seen, h), gain, &seen, h, noise)
    }

    /// [`corrected`](Self::corrected) where `P H^T` is known.
    pub(crate) fn corrected_with<const M: usize>(
        &self,
        p_ht: &SMatrix<f64, D, M>,
        gain: &SMatrix<f64, D, M>,
        seen: &Seen<D>,
        h: &SMatrix<f64, M, D>,
        noise: &SMatrix<f64, M, M>,
    ) -> Self {
        let (p_ht, gains) = (&p_ht.data.0, &gain.data.0);
        let mut corrected = *self;
        // A H^T - K N, of which A is needed in the columns of the states that are seen.
        let mut excess = [[0.0; D]; M];
        for &state in seen.states() {
            let a = without::<D, D, M>(&self.0.data.0[state], p_ht, state, gains);
            for (row, column) in excess.iter_mut().enumerate() {
                add(column, h[(row, state)], &a);
            }
        }
        for (row, column) in excess.iter_mut().enumerate() {
            let factors = core::array::from_fn(|k| -noise[(k, row)]);
            *column = combined::<D, _, _, _, _>(column, factors, gains.each_ref());
        }
        for (index, column) in corrected.0.data.0.iter_mut().enumerate() {
            // As many rows as reach the diagonal, in lengths that are known.
            *column = if index < 4 && D > 4 {
                let a = without::<4, D, M>(column, p_ht, index, gains);
                without::<4, D, M>(&a, gains, index, &excess)
            } else if index < 8 && D > 8 {
                let a = without::<8, D, M>(column, p_ht, index, gains);
                without::<8, D, M>(&a, gains, index, &excess)
            } else {
                let a = without::<D, D, M>(column, p_ht, index, gains);
                without::<D, D, M>(&a, gains, index, &excess)
            };
        }
        mirror(&mut corrected.0);
        put_back_negative_variances(&mut corrected.0);
        corrected
    }

    /// `factor * P`.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::Vector2;
    ///
    /// // Three standard deviations instead of one.
    /// let p = Covariance::from_variances(&Vector2::new(4.0, 1.0)).scaled(9.0);
    /// assert_eq!(p.matrix()[(0, 0)].sqrt(), 3.0 * 2.0);
    /// ```
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0 * factor)
    }

    /// Whether every entry is finite and no variance negative.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::Vector2;
    ///
    /// assert!(Covariance::from_variances(&Vector2::new(0.0, 1.0)).is_plausible());
    /// assert!(!Covariance::from_variances(&Vector2::new(-1.0, 1.0)).is_plausible());
    /// assert!(!Covariance::from_variances(&Vector2::new(f64::NAN, 1.0)).is_plausible());
    /// ```
    pub fn is_plausible(&self) -> bool {
        // 0 times what is not finite is NaN, and stays NaN in a sum: no branch for each entry.
        let mut sums = [0.0; D];
        for column in &self.0.data.0 {
            add(&mut sums, 0.0, column);
        }
        sums.iter().all(|sum| *sum == 0.0) && (0..D).all(|i| self.0[(i, i)] >= 0.0)
    }

    /// Writes the upper triangle, row by row, to the front of `entries`, as far as there is room.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::Matrix2;
    ///
    /// // Into a message that has room for more.
    /// let mut entries = [0.0; 5];
    /// Covariance::from_upper(Matrix2::new(4.0, 1.0, 0.0, 9.0)).write_upper_triangle(&mut entries);
    /// assert_eq!(entries, [4.0, 1.0, 9.0, 0.0, 0.0]);
    /// ```
    pub fn write_upper_triangle(&self, entries: &mut [f64]) {
        let mut rest = entries;
        for (row, column) in self.0.data.0.iter().enumerate() {
            // The matrix is symmetric: what stands right of the diagonal in a row lies together below it in a column.
            let Some((front, behind)) = rest.split_at_mut_checked(D - row) else {
                return;
            };
            front.copy_from_slice(&column[row..]);
            rest = behind;
        }
    }

    /// The upper triangle, row by row.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use nalgebra::Matrix2;
    ///
    /// let p = Covariance::from_upper(Matrix2::new(4.0, 1.0, 0.0, 9.0));
    /// assert_eq!(p.upper_triangle().collect::<Vec<f64>>(), [4.0, 1.0, 9.0]);
    /// ```
    pub fn upper_triangle(&self) -> impl Iterator<Item = f64> + '_ {
        (0..D).flat_map(move |row| (row..D).map(move |column| self.0[(row, column)]))
    }

    /// From an upper triangle, row by row; `None` if `entries` has not exactly D (D + 1) / 2.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    ///
    /// let p = Covariance::<2>::from_upper_triangle(&[4.0, 1.0, 9.0]).expect("three entries");
    /// assert_eq!(p.matrix()[(1, 0)], 1.0);
    /// assert!(Covariance::<2>::from_upper_triangle(&[4.0, 1.0]).is_none());
    /// ```
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
