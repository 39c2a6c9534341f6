//! Whether errors are as large as their covariance says.
//!
//! Error: left-invariant, `chi = chi_hat * exp(xi)` on SE_2(3) (rotation, velocity, position, in body axes) and the
//! difference of the biases. `xi^T P^-1 xi` is chi-square with 15 degrees of freedom if the filter is consistent, and
//! the sum over N independent runs with 15 N. The logarithm is written out here and shares nothing with the filter:
//! with `R_e = R_hat^T R = Exp(phi)`, `xi = (phi, J(phi)^-1 R_hat^T (v - v_hat), J(phi)^-1 R_hat^T (p - p_hat))`, J the
//! left Jacobian of SO(3).

use inekf_client::dataset::TruthRow;
use inekf_client::evaluate::nees;
use inekf_client::rows::triangle;
use inekf_client::simulate::left_jacobian_inverse;
use inekf_shared::message::EstimateSe23;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Standard normal quantile that leaves 0.5 % outside, on either side: the 99 % band.
pub const Z_99: f64 = 2.575_829_303_548_901;

/// Standard normal quantile that leaves one in a million above it.
pub const Z_ONE_IN_A_MILLION: f64 = 4.753_424_308_822_899;

/// The 15-dimensional error of an estimate.
///
/// # Panics
/// If the stamps differ or the truth has no biases.
pub fn error(estimate: &EstimateSe23, truth: &TruthRow) -> [f64; 15] {
    assert_eq!(estimate.head.stamp_ns, truth.stamp_ns);
    let bias = truth.bias.expect("the biases are known");
    let to_body = rotation(estimate.q_wb).inverse();
    let phi = (to_body * rotation(truth.q_wb)).scaled_axis();
    let carried = left_jacobian_inverse(&phi);
    let apart =
        |truth: [f64; 3], estimate: [f64; 3]| Vector3::from(truth) - Vector3::from(estimate);
    let parts = [
        phi,
        carried * (to_body * apart(truth.v_w_mps, estimate.v_w_mps)),
        carried * (to_body * apart(truth.p_w_m, estimate.p_w_m)),
        apart(bias.gyro_rps, estimate.gyro_bias_rps),
        apart(bias.accel_mps2, estimate.accel_bias_mps2),
    ];
    std::array::from_fn(|i| parts[i / 3][i % 3])
}

/// Normalised error squared of a 15-state estimate.
pub fn normalised(estimate: &EstimateSe23, truth: &TruthRow) -> f64 {
    nees(&error(estimate, truth), triangle(estimate)).expect("the covariance is positive definite")
}

/// Quantile of the chi-square distribution at the standard normal quantile `z` (Wilson and Hilferty, 1931: the cube
/// root is almost normal). Relative error below 1e-4 from 100 degrees of freedom on, below 1 % at 15.
pub fn chi_square_quantile(degrees: f64, z: f64) -> f64 {
    let variance = 2.0 / (9.0 * degrees);
    degrees * (1.0 - variance + z * variance.sqrt()).powi(3)
}

/// The band in which the mean of `count` chi-square numbers of `degrees` each lies with 99 % probability.
pub fn band_99(count: usize, degrees: usize) -> (f64, f64) {
    let (count, total) = (count as f64, (count * degrees) as f64);
    (
        chi_square_quantile(total, -Z_99) / count,
        chi_square_quantile(total, Z_99) / count,
    )
}

fn rotation(xyzw: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::from(xyzw))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_quantiles_are_those_of_the_tables() {
        // From tables: 99.5 % and 0.5 % at 100 degrees, 99.9 % at 15.
        for (degrees, z, table, accuracy) in [
            (100.0, Z_99, 140.169, 1e-3),
            (100.0, -Z_99, 67.328, 1e-3),
            (15.0, 3.090_232_306_167_813, 37.697, 5e-3),
        ] {
            let quantile = chi_square_quantile(degrees, z);
            assert!(
                (quantile / table - 1.0).abs() < accuracy,
                "{quantile} {table}"
            );
        }
    }
}
