//! Covariances against plain matrix algebra, and exactly symmetric.

mod common;

use common::{assert_close, covariance_of_scale, noise_of_scale, normal, seeded, sigmas};
use inekf::filter::Covariance;
use nalgebra::{SMatrix, SVector, Vector3};

type Matrix15 = SMatrix<f64, 15, 15>;

fn assert_symmetric(p: &Covariance<15>) {
    assert_eq!(p.matrix(), &p.matrix().transpose());
}

#[test]
fn only_the_upper_triangle_counts() {
    let p = Covariance::from_upper(SMatrix::<f64, 3, 3>::new(
        1.0, 2.0, 3.0, 70.0, 4.0, 5.0, 80.0, 90.0, 6.0,
    ));
    let expected = SMatrix::<f64, 3, 3>::new(1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0);
    assert_eq!(p.matrix(), &expected);
}

#[test]
fn a_change_of_coordinates_is_a_p_a_transposed() {
    let mut rng = seeded(51);
    for _ in 0..50 {
        let p = covariance_of_scale::<15>(&sigmas(1.0), &mut rng);
        let mut a: Matrix15 = normal(&mut rng);
        // Zeros, which are passed over, and a row of them.
        a.fixed_view_mut::<4, 6>(9, 0).fill(0.0);
        a.row_mut(3).fill(0.0);
        let moved = p.transformed(&a);
        assert_close(
            "A P A^T",
            moved.matrix(),
            &(a * p.matrix() * a.transpose()),
            1e-14,
        );
        assert_symmetric(&moved);
    }
}

#[test]
fn a_correction_is_josephs() {
    let mut rng = seeded(55);
    for _ in 0..50 {
        let p = covariance_of_scale::<15>(&sigmas(1.0), &mut rng);
        let mut h: SMatrix<f64, 3, 15> = normal(&mut rng);
        h.fixed_view_mut::<3, 6>(0, 9).fill(0.0);
        let noise = noise_of_scale(&Vector3::new(0.1, 0.2, 0.3), &mut rng);
        // For any gain, not the best one only.
        let gain: SMatrix<f64, 15, 3> = normal(&mut rng);
        let kept = Matrix15::identity() - gain * h;
        let expected = kept * p.matrix() * kept.transpose() + gain * noise * gain.transpose();
        let corrected = p.corrected(&gain, &h, &noise);
        assert_close("Joseph", corrected.matrix(), &expected, 1e-13);
        assert_symmetric(&corrected);
        let seen = p.times_transposed(&h);
        assert_close("P H^T", &seen, &(p.matrix() * h.transpose()), 1e-14);
    }
}

/// Along a direction that P does not have, the variance is zero, not what it rounds to.
#[test]
fn no_variance_rounds_below_zero() {
    let mut rng = seeded(56);
    for _ in 0..1000 {
        let v: SVector<f64, 15> = normal(&mut rng);
        let mut a: Matrix15 = normal(&mut rng);
        let blind = a.row(0) - (a.row(0) * v) * v.transpose() / v.norm_squared();
        a.set_row(0, &blind);
        let moved = Covariance::from_upper(v * v.transpose()).transformed(&a);
        assert!(moved.is_plausible(), "{:e}", moved.matrix()[(0, 0)]);
        assert!(moved.matrix()[(0, 0)] < 1e-12);
    }
}

#[test]
fn sums_and_multiples_are_those_of_the_matrices() {
    let mut rng = seeded(53);
    let p = covariance_of_scale::<15>(&sigmas(1.0), &mut rng);
    let q = covariance_of_scale::<15>(&sigmas(0.1), &mut rng);
    assert_eq!(p.plus(q.matrix()).matrix(), &(p.matrix() + q.matrix()));
    assert_eq!(p.scaled(2.5).matrix(), &(p.matrix() * 2.5));
    let variances = SVector::<f64, 15>::from_fn(|i, _| i as f64);
    let diagonal = Covariance::from_variances(&variances);
    assert_eq!(diagonal.matrix(), &Matrix15::from_diagonal(&variances));
}

/// The order that messages and files use.
#[test]
fn the_upper_triangle_is_read_row_by_row() {
    let rows = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let p = Covariance::<3>::from_upper_triangle(&rows).expect("six entries");
    let expected = SMatrix::<f64, 3, 3>::new(1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0);
    assert_eq!(p.matrix(), &expected);
    assert_eq!(p.upper_triangle().collect::<Vec<_>>(), rows);
    let mut written = [0.0; 7];
    p.write_upper_triangle(&mut written);
    assert_eq!(written, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0]);
}

#[test]
fn the_upper_triangle_comes_back_bit_for_bit() {
    let p = covariance_of_scale::<15>(&sigmas(1.0), &mut seeded(54));
    let entries: Vec<f64> = p.upper_triangle().collect();
    assert_eq!(entries.len(), 120);
    let mut written = [0.0; 120];
    p.write_upper_triangle(&mut written);
    assert_eq!(written, entries[..]);
    assert_eq!(Covariance::from_upper_triangle(&entries), Some(p));
    assert_eq!(Covariance::<15>::from_upper_triangle(&entries[1..]), None);
    let one_more = [entries.as_slice(), &[0.0]].concat();
    assert_eq!(Covariance::<15>::from_upper_triangle(&one_more), None);
    assert_eq!(Covariance::<9>::from_upper_triangle(&entries), None);
}

#[test]
fn negative_variances_and_what_is_not_finite_are_implausible() {
    let good = Covariance::from_variances(&SVector::from([1.0, 0.0, 2.0]));
    assert!(good.is_plausible());
    let with = |row, column, entry| {
        let mut matrix = *good.matrix();
        matrix[(row, column)] = entry;
        Covariance::from_upper(matrix).is_plausible()
    };
    assert!(with(0, 2, -1.0), "a negative covariance is nothing odd");
    assert!(!with(1, 1, -1e-9));
    assert!(!with(2, 2, f64::NAN));
    assert!(!with(0, 1, f64::NAN));
    assert!(!with(0, 1, f64::INFINITY));
}
