//! What one IMU sample says about the motion over its interval, before anything is turned to its end.
//!
//! With `phi = omega dt`: the turn `Exp(phi)`, the increments of velocity and position in the body axes at the
//! start of the interval, what gravity adds in world axes, and the derivatives of the increments by the sample,
//! in the axes of the start as well. Every scheme of [`Discretisation`] fills the same numbers:
//!
//! | | `zoh` | `euler`, \[IS\] (17)-(18) |
//! |---|---|---|
//! | velocity, body | `Gamma_1(phi) a dt` | `a dt` |
//! | position, body | `Gamma_2(phi) a dt^2` | 0 |
//! | velocity, world | `g dt` | `g dt` |
//! | position, world | `g dt^2 / 2` | 0 |

use nalgebra::{Matrix3, Vector3};

use super::imu::{Discretisation, ImuInput};
use super::transition::Transition;
use crate::lie::series::RotationSeries;
use crate::lie::{LieGroup, SE23, SO3};

/// The motion over one interval; SI units, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuIncrement {
    /// Rate and force over the interval, biases removed.
    pub input: ImuInput,
    /// Length of the interval, s.
    pub dt_s: f64,
    /// Orientation of the body at the end, seen from the start.
    pub turn: SO3,
    /// `turn` as a matrix.
    pub turn_matrix: Matrix3<f64>,
    /// Velocity and position gained by the specific force, body axes at the start: m/s, m.
    pub body: [Vector3<f64>; 2],
    /// Velocity and position gained by gravity, world axes: m/s, m.
    pub world: [Vector3<f64>; 2],
    /// What a change of the angular rate (rad/s) adds to rotation, velocity and position, axes of the start.
    pub by_rate: [Matrix3<f64>; 3],
    /// What a change of the specific force (m/s^2) adds to velocity and position, axes of the start.
    pub by_force: [Matrix3<f64>; 2],
}

impl ImuIncrement {
    /// The motion over `dt_s` seconds with the bias-free `input` under gravity `g_w`, m/s^2.
    #[inline]
    pub fn new(
        input: &ImuInput,
        g_w: &Vector3<f64>,
        dt_s: f64,
        discretisation: Discretisation,
    ) -> Self {
        let phi = input.omega_b * dt_s;
        let force_b = &input.force_b;
        let series = RotationSeries::at(&phi);
        let gamma_1 = series.gamma::<1>();
        let nothing = Vector3::zeros();
        let no_effect = Matrix3::zeros();
        let by_rate_rotation = gamma_1 * dt_s;
        let (body, world, by_rate, by_force) = match discretisation {
            Discretisation::Euler => (
                [force_b * dt_s, nothing],
                [g_w * dt_s, nothing],
                [by_rate_rotation, no_effect, no_effect],
                [Matrix3::identity() * dt_s, no_effect],
            ),
            Discretisation::ZeroOrderHold => {
                // Gamma_m(omega dt) a dt^m in its two arguments; one more dt from phi = omega dt.
                let (first, second) = (dt_s, dt_s * dt_s);
                let velocity = series.gamma_times_derivative::<1>(force_b) * (first * dt_s);
                let position = series.gamma_times_derivative::<2>(force_b) * (second * dt_s);
                (
                    [
                        series.gamma_times::<1>(force_b) * first,
                        series.gamma_times::<2>(force_b) * second,
                    ],
                    [g_w * first, g_w * (0.5 * second)],
                    [by_rate_rotation, velocity, position],
                    [by_rate_rotation, series.gamma::<2>() * second],
                )
            }
        };
        Self {
            input: *input,
            dt_s,
            turn: SO3::exp(&phi),
            turn_matrix: series.gamma::<0>(),
            body,
            world,
            by_rate,
            by_force,
        }
    }

    /// Where the motion takes `pose`: `W phi(pose) U`, without the products by what is known to be neutral.
    #[inline]
    pub fn apply(&self, pose: &SE23) -> SE23 {
        moved(pose, self.dt_s, &self.turn, &self.body, &self.world)
    }

    /// How the left-invariant error moves, `chi = chi_hat exp(xi)`: seen from the body, which turns.
    #[inline]
    pub fn left_transition(&self) -> Transition {
        Transition {
            dt_s: self.dt_s,
            turn: Some(self.turn_matrix.transpose()),
            couplings: [-self.body[0], -self.body[1]],
            by_rate: self.by_rate,
            by_force: self.by_force,
        }
    }

    /// How the right-invariant error moves, `chi = exp(xi) chi_hat`: gravity alone couples it, and the noise
    /// enters as \[PAR\] (14) has it, by the adjoint of `after`, the pose at the end; `before` is that at the
    /// start.
    #[inline]
    pub fn right_transition(&self, before: &SE23, after: &SE23) -> Transition {
        let r_wb = before.rotation.matrix();
        let [rotation, velocity, position] = self.by_rate.map(|block| r_wb * block);
        Transition {
            dt_s: self.dt_s,
            turn: None,
            couplings: self.world,
            by_rate: [
                rotation,
                velocity + crossed(&after.velocity, &rotation),
                position + crossed(&after.position, &rotation),
            ],
            by_force: self.by_force.map(|block| r_wb * block),
        }
    }

    /// How the additive error of the EKF moves, every part of it in world axes; `before` is the pose at the
    /// start.
    #[inline]
    pub fn additive_transition(&self, before: &SE23) -> Transition {
        let r_wb = before.rotation.matrix();
        Transition {
            dt_s: self.dt_s,
            turn: None,
            couplings: self.body.map(|part| -(r_wb * part)),
            by_rate: self.by_rate.map(|block| r_wb * block),
            by_force: self.by_force.map(|block| r_wb * block),
        }
    }
}

/// `hat(a) block`.
fn crossed(a: &Vector3<f64>, block: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, column| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * block[(k, column)] - a[k] * block[(j, column)]
    })
}

/// `pose` after free motion for `dt_s`, the increments `world` (world axes) and `body` (body axes at the
/// start), each of velocity and position, and the rotation `turn`.
#[inline]
pub(super) fn moved(
    pose: &SE23,
    dt_s: f64,
    turn: &SO3,
    body: &[Vector3<f64>; 2],
    world: &[Vector3<f64>; 2],
) -> SE23 {
    let velocity = pose.rotation.rotate(&body[0]);
    let position = pose.rotation.rotate(&body[1]);
    SE23 {
        rotation: pose.rotation.compose(turn),
        velocity: pose.velocity + world[0] + velocity,
        position: pose.position + pose.velocity * dt_s + world[1] + position,
    }
}
