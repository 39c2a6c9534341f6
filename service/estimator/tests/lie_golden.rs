//! SO(3), SE(2), SE(3) and SE_2(3) against tables made by an independent implementation and checked with
//! long arithmetic: 48 tangent vectors each, with angles from 0 and 1e-300 to pi - 3e-15.
//!
//! `exp` is the homogeneous matrix, `[R p]` or `[R v p]` over the identity.

use inekf::lie::{LieGroup, SE2, SE3, SE23, SO3};
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use serde::Deserialize;

/// Relative to the largest entry of the expected matrix.
const TOLERANCE: f64 = 1e-13;

#[derive(Deserialize)]
struct Tables {
    #[serde(rename = "SO3")]
    so3: Vec<Row>,
    #[serde(rename = "SE2")]
    se2: Vec<Row>,
    #[serde(rename = "SE3")]
    se3: Vec<Row>,
    #[serde(rename = "SE23")]
    se23: Vec<Row>,
}

#[derive(Deserialize)]
struct Row {
    xi: Vec<f64>,
    exp: Vec<Vec<f64>>,
    #[serde(rename = "Ad")]
    adjoint: Vec<Vec<f64>>,
    #[serde(rename = "Jl")]
    left: Vec<Vec<f64>>,
    #[serde(rename = "Jr")]
    right: Vec<Vec<f64>>,
    #[serde(rename = "Jl_inv")]
    left_inverse: Vec<Vec<f64>>,
    #[serde(rename = "Jr_inv")]
    right_inverse: Vec<Vec<f64>>,
}

fn tables() -> Tables {
    serde_json::from_str(include_str!("data/lie_tables.json")).expect("the table parses")
}

fn assert_close(what: &str, actual: &[f64], expected: &[f64]) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    for (a, e) in actual.iter().zip(expected) {
        let close = (a - e).abs() <= TOLERANCE * largest;
        assert!(close, "{what}: {a:e} for {e:e}, largest {largest:e}");
    }
}

/// The entries of a matrix, row by row.
fn rows<const R: usize, const C: usize>(matrix: &SMatrix<f64, R, C>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// The entries of `[R columns]`: the homogeneous matrix without its constant rows.
fn upper<const N: usize>(r: &SMatrix<f64, N, N>, columns: &[SVector<f64, N>]) -> Vec<f64> {
    let matrix = DMatrix::from_fn(N, N + columns.len(), |i, j| {
        if j < N { r[(i, j)] } else { columns[j - N][i] }
    });
    matrix.transpose().as_slice().to_vec()
}

/// The log of the printed matrix is compared too: its rotation passes through a quaternion, which loses
/// nothing near pi.
fn check<G: LieGroup<D>, const D: usize>(
    table: &[Row],
    upper_rows: impl Fn(&G) -> Vec<f64>,
    element: impl Fn(&[Vec<f64>]) -> G,
) {
    assert_eq!(table.len(), 48);
    for (index, row) in table.iter().enumerate() {
        let xi = SVector::<f64, D>::from_column_slice(&row.xi);
        let x = G::exp(&xi);
        let compare = |what: &str, actual: Vec<f64>, expected: &[Vec<f64>]| {
            assert_close(&format!("row {index}, {what}"), &actual, &expected.concat());
        };
        let actual = upper_rows(&x);
        let constant_rows = row.exp.len() - actual.len() / row.exp.len();
        compare("exp", actual, &row.exp[..row.exp.len() - constant_rows]);
        compare("Ad", rows(&x.adjoint()), &row.adjoint);
        compare("Jl", rows(&G::left_jacobian(&xi)), &row.left);
        compare("Jr", rows(&G::right_jacobian(&xi)), &row.right);
        compare(
            "Jl^-1",
            rows(&G::left_jacobian_inverse(&xi)),
            &row.left_inverse,
        );
        compare(
            "Jr^-1",
            rows(&G::right_jacobian_inverse(&xi)),
            &row.right_inverse,
        );
        assert_close(
            &format!("row {index}, log exp"),
            x.log().as_slice(),
            &row.xi,
        );

        // The printed matrix is rounded to double: absolute, at the size of its largest entry.
        let log = element(&row.exp).log();
        let scale = row.exp.concat().iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        let error = (log - xi).amax();
        assert!(
            error <= TOLERANCE * scale,
            "row {index}, log of the matrix: {error:e}"
        );
    }
}

/// Column `j` of the first three rows.
fn column(matrix: &[Vec<f64>], j: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| matrix[i][j])
}

fn rotation(matrix: &[Vec<f64>]) -> SO3 {
    let columns = [0, 1, 2].map(|j| column(matrix, j));
    SO3::from_matrix(&SMatrix::from_columns(&columns)).expect("the table holds rotations")
}

#[test]
fn so3() {
    check::<SO3, 3>(&tables().so3, |x| upper(&x.matrix(), &[]), rotation);
}

#[test]
fn se2() {
    check::<SE2, 3>(
        &tables().se2,
        |x| upper(&x.rotation.matrix(), &[x.position]),
        |matrix| SE2 {
            rotation: inekf::lie::SO2::from_angle(matrix[1][0].atan2(matrix[0][0])),
            position: SVector::from([matrix[0][2], matrix[1][2]]),
        },
    );
}

#[test]
fn se3() {
    check::<SE3, 6>(
        &tables().se3,
        |x| upper(&x.rotation.matrix(), &[x.position]),
        |matrix| SE3 {
            rotation: rotation(matrix),
            position: column(matrix, 3),
        },
    );
}

#[test]
fn se23() {
    check::<SE23, 9>(
        &tables().se23,
        |x| upper(&x.rotation.matrix(), &[x.velocity, x.position]),
        |matrix| SE23 {
            rotation: rotation(matrix),
            velocity: column(matrix, 3),
            position: column(matrix, 4),
        },
    );
}
