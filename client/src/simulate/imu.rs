//! The IMU sample that reproduces a motion exactly under the zero-order-hold model.
//!
//! Convention `hold = "backward"`: a sample speaks for the interval that ends at its stamp. With
//! rate and specific force constant over the interval the daemon's model is
//!
//! `R+ = R Exp(w dt)`, `v+ = v + (R Gamma1(w dt) a + g) dt`, Gamma1 the left Jacobian of SO(3);
//!
//! solved for the sample:
//!
//! `w = Log(R^T R+) / dt`, `a = Gamma1(w dt)^-1 R^T ((v+ - v) / dt - g)`.

use nalgebra::{Matrix3, Vector3};

use super::scenario::Kinematics;

/// The noise-free gyro (rad/s) and accelerometer (m/s^2) sample for the motion from `before` to
/// `after`, `dt_s` later; body frame, gravity of magnitude `gravity_mps2` downwards.
///
/// ```
/// use inekf_client::simulate::{Scenario, ideal_sample};
///
/// // A car that stands: no rate, and all that the accelerometer feels is gravity, held up.
/// let car = Scenario::StandThenDrive;
/// let (gyro_rps, accel_mps2) = ideal_sample(&car.at(1.0), &car.at(1.005), 0.005, 9.80665);
/// assert!(gyro_rps.norm() < 1e-12 && (accel_mps2.norm() - 9.80665).abs() < 1e-9);
/// ```
pub fn ideal_sample(
    before: &Kinematics,
    after: &Kinematics,
    dt_s: f64,
    gravity_mps2: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let rotation = (before.q_wb.inverse() * after.q_wb).scaled_axis();
    let gravity_w = Vector3::new(0.0, 0.0, -gravity_mps2);
    let force_w = (after.v_w_mps - before.v_w_mps) / dt_s - gravity_w;
    let force_b = left_jacobian_inverse(&rotation) * before.q_wb.inverse_transform_vector(&force_w);
    (rotation / dt_s, force_b)
}

/// Below this angle, rad, the coefficients come from their series: the next term is under 1e-16.
const SMALL_ANGLE_RAD: f64 = 0.02;

/// Left Jacobian of SO(3): `I + (1 - cos t)/t^2 [phi]x + (t - sin t)/t^3 [phi]x^2`, t the length.
///
/// ```
/// use inekf_client::simulate::left_jacobian;
/// use nalgebra::{Rotation3, Vector3};
///
/// // It leaves phi as it is, and Exp(phi) = I + [phi]x J(phi).
/// let phi = Vector3::new(0.3, -0.5, 0.8);
/// let jacobian = left_jacobian(&phi);
/// assert!((jacobian * phi - phi).norm() < 1e-15);
/// let turn = Rotation3::from_scaled_axis(phi).into_inner();
/// assert!((phi.cross_matrix() * jacobian + nalgebra::Matrix3::identity() - turn).norm() < 1e-14);
/// ```
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let square = angle * angle;
    let (first, second) = if angle < SMALL_ANGLE_RAD {
        (
            0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0)),
            1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362_880.0)),
        )
    } else {
        (
            (1.0 - angle.cos()) / square,
            (angle - angle.sin()) / (square * angle),
        )
    };
    let skew = phi.cross_matrix();
    Matrix3::identity() + skew * first + skew * skew * second
}

/// Its inverse: `I - 1/2 [phi]x + (1 - t/2 cot(t/2))/t^2 [phi]x^2`, for angles below a full turn.
///
/// ```
/// use inekf_client::simulate::{left_jacobian, left_jacobian_inverse};
/// use nalgebra::{Matrix3, Vector3};
///
/// let phi = Vector3::new(0.3, -0.5, 0.8);
/// let product = left_jacobian(&phi) * left_jacobian_inverse(&phi);
/// assert!((product - Matrix3::identity()).norm() < 1e-14);
/// ```
pub fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let square = angle * angle;
    let second = if angle < SMALL_ANGLE_RAD {
        1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1_209_600.0))
    } else {
        (1.0 - 0.5 * angle / (0.5 * angle).tan()) / square
    };
    let skew = phi.cross_matrix();
    Matrix3::identity() - skew * 0.5 + skew * skew * second
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The left Jacobian is the mean of `Exp(s phi)` over s in 0..1: compared with Simpson's rule.
    #[test]
    fn left_jacobian_is_the_mean_rotation() {
        for scale in [1e-9, 1e-3, 0.019999, 0.020001, 0.5, 2.0, 3.1] {
            let phi = Vector3::new(0.6, -0.64, 0.48) * scale;
            let steps = 200;
            let mut mean = Matrix3::zeros();
            for step in 0..=steps {
                let weight = match step {
                    0 => 1.0,
                    _ if step == steps => 1.0,
                    _ if step % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                let part = phi * (f64::from(step) / f64::from(steps));
                let rotation = nalgebra::Rotation3::from_scaled_axis(part);
                mean += rotation.matrix() * (weight / (3.0 * f64::from(steps)));
            }
            let difference = (left_jacobian(&phi) - mean).abs().max();
            assert!(difference < 1e-9, "{scale}: {difference:e}");
        }
    }

    #[test]
    fn inverse_undoes_the_left_jacobian() {
        for scale in [0.0, 1e-9, 1e-3, 0.019999, 0.020001, 0.5, 2.0, 3.1, 5.0] {
            let phi = Vector3::new(0.6, -0.64, 0.48) * scale;
            let product = left_jacobian(&phi) * left_jacobian_inverse(&phi);
            let difference = (product - Matrix3::identity()).abs().max();
            assert!(difference < 1e-12, "{scale}: {difference:e}");
        }
    }
}
