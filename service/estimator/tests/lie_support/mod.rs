//! A second, naive view of every group, to hold the closed forms against: homogeneous matrices, their
//! algebra, and the matrix exponential as a plain Taylor series with scaling and squaring.
//!
//! Lengths (everything in an element but its rotation) are divided by a `unit`, so that a pose a thousand
//! kilometres away is compared with the same relative tolerance in its rotation and in its position.

use inekf::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3, TwoFrames};
use inekf::model::NavState;
use nalgebra::{DMatrix, DVector, Matrix2, SVector, Vector3};

/// A group with its homogeneous matrices.
pub trait Homogeneous<const D: usize>: LieGroup<D> {
    const NAME: &'static str;
    /// How many entries of the tangent vector, its first ones, are a rotation.
    const ROTATION: usize;

    /// The matrix of an element; the matrix of a product is the product of the matrices.
    fn matrix(&self, unit: f64) -> DMatrix<f64>;
    /// The matrix of a tangent vector, `expm(algebra(xi)) = matrix(exp(xi))`.
    fn algebra(xi: &SVector<f64, D>, unit: f64) -> DMatrix<f64>;
}

/// The square matrix with `block` in its upper left corner and the `columns` beside it.
///
/// The rest is the identity times `fill`: 1 for an element of a group, 0 for one of an algebra.
fn beside(block: DMatrix<f64>, columns: &[DVector<f64>], fill: f64) -> DMatrix<f64> {
    let (n, k) = (block.nrows(), columns.len());
    let mut matrix = DMatrix::identity(n + k, n + k) * fill;
    matrix.view_mut((0, 0), (n, n)).copy_from(&block);
    for (i, column) in columns.iter().enumerate() {
        matrix.view_mut((0, n + i), (n, 1)).copy_from(column);
    }
    matrix
}

fn skew(a: &[f64]) -> DMatrix<f64> {
    DMatrix::from_row_slice(
        3,
        3,
        &[0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0],
    )
}

fn dynamic(a: &Vector3<f64>, unit: f64) -> DVector<f64> {
    DVector::from_column_slice((a / unit).as_slice())
}

fn slice<const D: usize>(xi: &SVector<f64, D>, start: usize, unit: f64) -> DVector<f64> {
    DVector::from_column_slice(&xi.as_slice()[start..start + 3]) / unit
}

fn block<const R: usize>(matrix: nalgebra::SMatrix<f64, R, R>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, R, matrix.as_slice())
}

impl Homogeneous<1> for SO2 {
    const NAME: &'static str = "SO(2)";
    const ROTATION: usize = 1;

    fn matrix(&self, _: f64) -> DMatrix<f64> {
        block(SO2::matrix(self))
    }

    fn algebra(xi: &SVector<f64, 1>, _: f64) -> DMatrix<f64> {
        block(Matrix2::new(0.0, -xi[0], xi[0], 0.0))
    }
}

impl Homogeneous<3> for SE2 {
    const NAME: &'static str = "SE(2)";
    const ROTATION: usize = 1;

    fn matrix(&self, unit: f64) -> DMatrix<f64> {
        let position = DVector::from_column_slice((self.position / unit).as_slice());
        beside(block(self.rotation.matrix()), &[position], 1.0)
    }

    fn algebra(xi: &SVector<f64, 3>, unit: f64) -> DMatrix<f64> {
        let rho = DVector::from_column_slice(&[xi[1] / unit, xi[2] / unit]);
        beside(block(Matrix2::new(0.0, -xi[0], xi[0], 0.0)), &[rho], 0.0)
    }
}

impl Homogeneous<3> for SO3 {
    const NAME: &'static str = "SO(3)";
    const ROTATION: usize = 3;

    fn matrix(&self, _: f64) -> DMatrix<f64> {
        block(SO3::matrix(self))
    }

    fn algebra(xi: &SVector<f64, 3>, _: f64) -> DMatrix<f64> {
        skew(xi.as_slice())
    }
}

impl Homogeneous<6> for SE3 {
    const NAME: &'static str = "SE(3)";
    const ROTATION: usize = 3;

    fn matrix(&self, unit: f64) -> DMatrix<f64> {
        let columns = [dynamic(&self.position, unit)];
        beside(block(self.rotation.matrix()), &columns, 1.0)
    }

    fn algebra(xi: &SVector<f64, 6>, unit: f64) -> DMatrix<f64> {
        beside(skew(xi.as_slice()), &[slice(xi, 3, unit)], 0.0)
    }
}

impl Homogeneous<9> for SE23 {
    const NAME: &'static str = "SE_2(3)";
    const ROTATION: usize = 3;

    fn matrix(&self, unit: f64) -> DMatrix<f64> {
        let columns = [&self.velocity, &self.position].map(|x| dynamic(x, unit));
        beside(block(self.rotation.matrix()), &columns, 1.0)
    }

    fn algebra(xi: &SVector<f64, 9>, unit: f64) -> DMatrix<f64> {
        let columns = [3, 6].map(|start| slice(xi, start, unit));
        beside(skew(xi.as_slice()), &columns, 0.0)
    }
}

/// World vectors in columns beside the rotation; body vectors in rows below a second copy of it, where
/// `[R 0; b^T 1]` multiplies as `b2 + R2^T b1`.
impl Homogeneous<15> for TwoFrames {
    const NAME: &'static str = "two frames";
    const ROTATION: usize = 3;

    fn matrix(&self, unit: f64) -> DMatrix<f64> {
        let r = block(self.rotation.matrix());
        let world = [&self.velocity, &self.position].map(|x| dynamic(x, unit));
        let body = [&self.gyro_bias, &self.accel_bias].map(|b| dynamic(b, unit));
        diagonal(
            &beside(r.clone(), &world, 1.0),
            &beside(r.transpose(), &body, 1.0).transpose(),
        )
    }

    fn algebra(xi: &SVector<f64, 15>, unit: f64) -> DMatrix<f64> {
        let phi = skew(xi.as_slice());
        let world = [3, 6].map(|start| slice(xi, start, unit));
        let body = [9, 12].map(|start| slice(xi, start, unit));
        diagonal(
            &beside(phi.clone(), &world, 0.0),
            &beside(phi.transpose(), &body, 0.0).transpose(),
        )
    }
}

/// The pose, and the biases as translations beside it.
impl Homogeneous<15> for NavState {
    const NAME: &'static str = "SE_2(3) x R^6";
    const ROTATION: usize = 3;

    fn matrix(&self, unit: f64) -> DMatrix<f64> {
        let biases = [&self.gyro_bias, &self.accel_bias].map(|b| dynamic(b, unit));
        diagonal(
            &Homogeneous::matrix(&self.pose, unit),
            &beside(DMatrix::identity(3, 3), &biases, 1.0),
        )
    }

    fn algebra(xi: &SVector<f64, 15>, unit: f64) -> DMatrix<f64> {
        let biases = [9, 12].map(|start| slice(xi, start, unit));
        diagonal(
            &SE23::algebra(&xi.fixed_rows::<9>(0).into_owned(), unit),
            &beside(DMatrix::zeros(3, 3), &biases, 0.0),
        )
    }
}

fn diagonal(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = (a.nrows(), b.nrows());
    let mut matrix = DMatrix::zeros(n + m, n + m);
    matrix.view_mut((0, 0), (n, n)).copy_from(a);
    matrix.view_mut((n, n), (m, m)).copy_from(b);
    matrix
}

/// `sum_n a^n / (n + shift)!`, 40 terms: exact to rounding for norms up to about 8.
pub fn exponential_series(a: &DMatrix<f64>, shift: usize) -> DMatrix<f64> {
    let mut term = DMatrix::identity(a.nrows(), a.ncols());
    for i in 1..=shift {
        term /= i as f64;
    }
    let mut sum = term.clone();
    for n in 1..40 {
        term = &term * a / (n + shift) as f64;
        sum += &term;
    }
    sum
}

/// The exact matrix exponential, by scaling and squaring.
pub fn matrix_exponential(a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut scaled = a.clone();
    let mut squarings = 0;
    while scaled.norm() > 0.5 {
        scaled /= 2.0;
        squarings += 1;
    }
    let mut exponential = exponential_series(&scaled, 0);
    for _ in 0..squarings {
        exponential = &exponential * &exponential;
    }
    exponential
}
