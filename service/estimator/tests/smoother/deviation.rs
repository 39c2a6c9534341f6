//! The deviation of a residual under a singular covariance, against the pseudo-inverse by eigenvectors.

use inekf::smoother::deviation;
use nalgebra::{DMatrix, SMatrix, SVector};

use crate::common::{normal, seeded};

#[test]
fn a_deviation_is_measured_where_the_covariance_spreads_and_reported_where_not() {
    let mut rng = seeded(821);
    for rank in 0..=6 {
        for _ in 0..10 {
            // Units from microradians to hundreds of metres.
            let units = SMatrix::<f64, 6, 6>::from_diagonal(&SVector::from([
                1e-6, 1e-6, 1e-3, 1.0, 10.0, 300.0,
            ]));
            let mut root: SMatrix<f64, 6, 6> = normal(&mut rng);
            root.columns_mut(rank, 6 - rank).fill(0.0);
            let covariance = units * root * root.transpose() * units;
            let weights: SVector<f64, 6> = normal(&mut rng);
            let residual = units * root * weights;

            let plain = root * root.transpose();
            let inverse = DMatrix::from_column_slice(6, 6, plain.as_slice())
                .pseudo_inverse(1e-9)
                .expect("a pseudo-inverse");
            let inverse = SMatrix::<f64, 6, 6>::from_column_slice(inverse.as_slice());
            let reduced = root * weights;
            let expected = reduced.dot(&(inverse * reduced));
            let inside = deviation(&residual, &covariance);
            assert!((inside.square - expected).abs() <= 1e-6 * expected.max(1.0));
            assert!(inside.outside <= 1e-9);

            if rank < 6 {
                let elsewhere = units * normal::<6, 1>(&mut rng);
                assert!(deviation(&elsewhere, &covariance).outside > 1e-9);
            }
        }
    }
}

#[test]
fn without_a_covariance_every_residual_lies_outside() {
    let residual = SVector::from([0.0, -3.0, 2.0]);
    let measured = deviation(&residual, &SMatrix::zeros());
    assert_eq!((measured.square, measured.outside), (0.0, 3.0));
}
