//! What SE(3), SE_2(3) and the two-frames group share: one rotation and `K` vectors that it turns.
//!
//! Their tangent vectors are `(phi, rho_1 .. rho_K)`, `D = 3 + 3 K`, and every matrix of theirs is an arrow:
//! one 3x3 block along the diagonal, one block per vector down the first column, zero elsewhere. A direct product
//! of such a group with a vector space has the same matrices, with the identity (in `ad` zero) on the latter.

use nalgebra::{ArrayStorage, Matrix3, SMatrix, SVector, Vector3};

use super::so3::{SO3, hat};
use super::{LieGroup, series::RotationSeries};
use crate::columns::combined;

/// The three entries of a tangent vector that begin at `start`.
#[inline]
pub(super) fn part<const D: usize>(xi: &SVector<f64, D>, start: usize) -> Vector3<f64> {
    Vector3::new(xi[start], xi[start + 1], xi[start + 2])
}

/// The tangent vector with the given parts.
#[inline]
pub(super) fn join<const K: usize, const D: usize>(
    phi: &Vector3<f64>,
    rho: &[Vector3<f64>; K],
) -> SVector<f64, D> {
    const { assert!(D == 3 + 3 * K) };
    let mut xi = SVector::<f64, D>::zeros();
    for j in 0..3 {
        xi[j] = phi[j];
        for i in 0..K {
            xi[3 + 3 * i + j] = rho[i][j];
        }
    }
    xi
}

/// The parts of a tangent vector: the rotation, and `K` others.
#[inline]
fn split<const K: usize, const D: usize>(
    xi: &SVector<f64, D>,
) -> (Vector3<f64>, [Vector3<f64>; K]) {
    const { assert!(D >= 3 + 3 * K) };
    (part(xi, 0), core::array::from_fn(|i| part(xi, 3 + 3 * i)))
}

/// The matrix with `diagonal` in every diagonal block and `below` under the first one; what lies beyond those
/// blocks is a vector space of its own, with `rest` on its diagonal.
#[inline]
fn arrow<const K: usize, const D: usize>(
    diagonal: &Matrix3<f64>,
    below: &[Matrix3<f64>; K],
    rest: f64,
) -> SMatrix<f64, D, D> {
    const { assert!(D >= 3 + 3 * K) };
    let mut matrix = SMatrix::<f64, D, D>::zeros();
    for i in 3 + 3 * K..D {
        matrix[(i, i)] = rest;
    }
    // Entry by entry, which unrolls: a quarter faster in 15 dimensions than copies through views.
    for j in 0..3 {
        for i in 0..3 {
            matrix[(i, j)] = diagonal[(i, j)];
            for (k, below) in below.iter().enumerate() {
                let block = 3 + 3 * k;
                matrix[(block + i, j)] = below[(i, j)];
                matrix[(block + i, block + j)] = diagonal[(i, j)];
            }
        }
    }
    matrix
}

/// `Ad` of the element with rotation `R` and the vectors `x_i` (world frame): `hat(x_i) R` below `R`.
pub(crate) fn adjoint<const K: usize, const D: usize>(
    rotation: &SO3,
    vectors: &[Vector3<f64>; K],
) -> SMatrix<f64, D, D> {
    let r = rotation.matrix();
    let columns = [r.column(0), r.column(1), r.column(2)];
    let below = vectors.map(|x| Matrix3::from_columns(&columns.map(|column| x.cross(&column))));
    arrow(&r, &below, 1.0)
}

/// `ad`: `hat(rho_i)` below `hat(phi)`.
pub(crate) fn ad<const K: usize, const D: usize>(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
    let (phi, rho) = split::<K, D>(xi);
    arrow(&hat(&phi), &rho.map(|rho| hat(&rho)), 0.0)
}

/// The left Jacobian: `Q(phi, rho_i)`, the derivative of `Gamma_1` along `rho_i`, below `Gamma_1(phi)`.
pub(crate) fn left_jacobian<const K: usize, const D: usize>(
    xi: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    let (phi, rho) = split::<K, D>(xi);
    let series = RotationSeries::at(&phi);
    arrow(
        &series.gamma::<1>(),
        &rho.map(|rho| series.gamma_along::<1>(&rho)),
        1.0,
    )
}

/// The inverse of the left Jacobian: `-J^-1 Q(phi, rho_i) J^-1` below `J^-1`.
pub(crate) fn left_jacobian_inverse<const K: usize, const D: usize>(
    xi: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    let (phi, rho) = split::<K, D>(xi);
    let series = RotationSeries::at(&phi);
    let inverse = SO3::left_jacobian_inverse(&phi);
    arrow(
        &inverse,
        &rho.map(|rho| -(inverse * series.gamma_along::<1>(&rho) * inverse)),
        1.0,
    )
}

/// `A P A^T` of a symmetric P in place, for an arrow A on the first COUPLED of D coordinates and the identity on
/// the others.
///
/// `T = P A^T` combines columns of P, whole; `A T` then needs only the upper triangle of what A touches.
pub(crate) fn congruence<const D: usize, const COUPLED: usize>(
    p: &mut SMatrix<f64, D, D>,
    a: &SMatrix<f64, D, D>,
) {
    const { assert!(COUPLED <= D && COUPLED.is_multiple_of(3)) };
    let p = &mut p.data.0;
    let nothing = [0.0; D];
    let mut t = [[0.0; D]; COUPLED];
    for (i, column) in t.iter_mut().enumerate() {
        let start = i - i % 3;
        let below = [a[(i, 0)], a[(i, 1)], a[(i, 2)]];
        *column = combined::<D, _, _, _, _>(&nothing, below, [&p[0], &p[1], &p[2]]);
        if start > 0 {
            let diagonal = [a[(i, start)], a[(i, start + 1)], a[(i, start + 2)]];
            let of_block = [&p[start], &p[start + 1], &p[start + 2]];
            *column = combined::<D, _, _, _, _>(column, diagonal, of_block);
        }
    }
    // Both triangles at once: of the two entries of a pair, the one written last stands in both.
    for (index, t) in t.iter().enumerate() {
        let mut put = |row: usize, entry: f64| {
            p[index][row] = entry;
            p[row][index] = entry;
        };
        for i in 0..3 {
            put(i, a[(i, 0)] * t[0] + a[(i, 1)] * t[1] + a[(i, 2)] * t[2]);
        }
        for start in (3..=index - index % 3).step_by(3) {
            for i in start..start + 3 {
                let below = a[(i, 0)] * t[0] + a[(i, 1)] * t[1] + a[(i, 2)] * t[2];
                let diagonal = a[(i, start)] * t[start]
                    + a[(i, start + 1)] * t[start + 1]
                    + a[(i, start + 2)] * t[start + 2];
                put(i, below + diagonal);
            }
        }
        for (row, entry) in t.iter().enumerate().skip(COUPLED) {
            put(row, *entry);
        }
    }
}

/// `H A` for an arrow A on the first COUPLED of D coordinates and the identity on the others, passing over the blocks
/// of H that are zero.
#[inline]
pub(crate) fn row_product<const M: usize, const D: usize, const COUPLED: usize>(
    h: &SMatrix<f64, M, D>,
    a: &SMatrix<f64, D, D>,
) -> SMatrix<f64, M, D> {
    const { assert!(COUPLED <= D && COUPLED.is_multiple_of(3)) };
    let (h, a) = (&h.data.0, &a.data.0);
    let mut product = *h;
    for column in product.iter_mut().take(3) {
        *column = [0.0; M];
    }
    for start in (0..COUPLED).step_by(3) {
        let block = [h[start], h[start + 1], h[start + 2]];
        if block == [[0.0; M]; 3] {
            continue;
        }
        for j in 0..3 {
            for row in 0..M {
                let times = |a: &[f64; D]| {
                    block[0][row] * a[start]
                        + block[1][row] * a[start + 1]
                        + block[2][row] * a[start + 2]
                };
                product[j][row] += times(&a[j]);
                if start > 0 {
                    product[start + j][row] = times(&a[start + j]);
                }
            }
        }
    }
    SMatrix::from_array_storage(ArrayStorage(product))
}
