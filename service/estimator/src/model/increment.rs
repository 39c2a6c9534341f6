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

use nalgebra::Vector3;

use super::imu::{Discretisation, ImuInput};
use super::transition::Transition;
use crate::lanes::{Block, Quad};
use crate::lie::series::RotationSeries;
use crate::lie::{LieGroup, SE23, SO3};

/// The motion over one interval; SI units, radians.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuIncrement, ImuInput, ImuStep};
/// use nalgebra::Vector3;
///
/// let input = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.3), force_b: Vector3::new(1.0, 0.0, 9.8) };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// let increment = ImuIncrement::new(&input, &g_w, 0.01, Discretisation::ZeroOrderHold);
/// // The same motion as the step that is made of it.
/// let start = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
/// let moved = increment.apply(&start);
/// assert!(moved.between(&ImuStep::from(&increment).apply(&start)).log().norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuIncrement {
    /// Rate and force over the interval, biases removed.
    pub input: ImuInput,
    /// Length of the interval, s.
    pub dt_s: f64,
    /// Orientation of the body at the end, seen from the start.
    pub turn: SO3,
    /// `turn` as a matrix.
    pub(crate) turn_matrix: Block,
    /// Velocity and position gained by the specific force, body axes at the start: m/s, m.
    pub body: [Vector3<f64>; 2],
    /// Velocity and position gained by gravity, world axes: m/s, m.
    pub world: [Vector3<f64>; 2],
    /// What a change of the angular rate (rad/s) adds to rotation, velocity and position, axes of the start.
    pub(crate) by_rate: [Block; 3],
    /// What a change of the specific force (m/s^2) adds to velocity and position, axes of the start.
    pub(crate) by_force: [Block; 2],
    /// The products of these, axes of the start or of the end, between which the turn is about `phi`.
    squares: Squares,
}

/// `N_0 N_0^T`, `A_1 A_1^T`, `A_2 A_1^T` and `A_2 A_2^T`, where N and A are what a change of the input adds (\[PAR\]
/// (14), for noise that is equal on all axes): each is `a I + b hat(phi) + c phi phi^T`, since all are series in
/// `hat(phi)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Squares {
    /// The turn over the interval, rad, in the axes of the products.
    phi: Vector3<f64>,
    /// `(a, b, c)` of each.
    coefficients: [[f64; 3]; 4],
}

impl Squares {
    #[inline(always)]
    fn new(series: &RotationSeries, dt_s: f64, discretisation: Discretisation) -> Self {
        let [_, s_1, s_2, s_3, s_4, ..] = *series.values();
        let phi = series.phi();
        let t = phi.norm_squared();
        let (dt_2, dt_3, dt_4) = (dt_s * dt_s, dt_s * dt_s * dt_s, dt_s * dt_s * dt_s * dt_s);
        // Along phi Gamma_1 is 1 and Gamma_2 1/2; across it they are S_1 + i theta S_2 and S_2 + i theta S_3; of
        // these the products with conjugates, without the differences of nearly equal numbers.
        let rate = [2.0 * s_2 * dt_2, 0.0, 2.0 * s_4 * dt_2];
        let by_force = match discretisation {
            Discretisation::Euler => [[dt_2, 0.0, 0.0], [0.0; 3], [0.0; 3]],
            Discretisation::ZeroOrderHold => [
                rate,
                [
                    (s_1 * s_2 + t * s_2 * s_3) * dt_3,
                    (s_1 * s_3 - s_2 * s_2) * dt_3,
                    (s_4 + 0.5 * s_3 - s_3 * (t * s_4 + s_2)) * dt_3,
                ],
                [
                    (s_2 * s_2 + t * s_3 * s_3) * dt_4,
                    0.0,
                    (s_4 - t * s_4 * s_4 - s_3 * s_3) * dt_4,
                ],
            ],
        };
        let [first, both, second] = by_force;
        Self {
            phi: *phi,
            coefficients: [rate, first, both, second],
        }
    }

    /// The same in other axes, to which `r_wb` leads.
    #[inline(always)]
    fn turned(&self, r_wb: Block) -> Self {
        Self {
            phi: r_wb.apply(&self.phi),
            ..*self
        }
    }

    /// The four products.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> [Block; 4] {
        let [rate, first, both, second] = self.coefficients;
        [
            self.block(rate),
            self.block(first),
            self.block(both),
            self.block(second),
        ]
    }

    #[inline(always)]
    fn block(&self, [a, b, c]: [f64; 3]) -> Block {
        let [x, y, z] = [self.phi.x, self.phi.y, self.phi.z];
        let [cx, cy, cz] = [c * x, c * y, c * z];
        let [bx, by, bz] = [b * x, b * y, b * z];
        let (xy, xz, yz) = (cx * y, cx * z, cy * z);
        Block::from_columns([
            [a + cx * x, xy + bz, xz - by],
            [xy - bz, a + cy * y, yz + bx],
            [xz + by, yz - bx, a + cz * z],
        ])
    }
}

impl ImuIncrement {
    /// The motion over `dt_s` seconds with the bias-free `input` under gravity `g_w`, m/s^2.
    ///
    /// ```
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// // Half a second of 1 rad/s about the vertical turns by half a radian.
    /// let turning = ImuInput { omega_b: Vector3::z(), force_b: -g_w };
    /// let increment = ImuIncrement::new(&turning, &g_w, 0.5, Discretisation::ZeroOrderHold);
    /// assert!((increment.turn.heading_rad() - 0.5).abs() < 1e-12);
    /// // Along the axis the force adds as if there were no turn.
    /// assert!((increment.body[0] + g_w * 0.5).norm() < 1e-12);
    /// ```
    #[inline(always)]
    pub fn new(
        input: &ImuInput,
        g_w: &Vector3<f64>,
        dt_s: f64,
        discretisation: Discretisation,
    ) -> Self {
        let phi = input.omega_b * dt_s;
        let force_b = &input.force_b;
        let series = RotationSeries::at(&phi);
        let nothing = Vector3::zeros();
        let by_rate_rotation = Block::from_columns(series.gamma_columns::<1>()).scaled(dt_s);
        let (body, world, by_rate, by_force) = match discretisation {
            Discretisation::Euler => (
                [force_b * dt_s, nothing],
                [g_w * dt_s, nothing],
                [by_rate_rotation, Block::zeros(), Block::zeros()],
                [Block::diagonal(dt_s), Block::zeros()],
            ),
            Discretisation::ZeroOrderHold => {
                // Gamma_m(omega dt) a dt^m in its two arguments; one more dt from phi = omega dt.
                let (first, second) = (dt_s, dt_s * dt_s);
                let velocity = series.gamma_times_derivative_columns::<1>(force_b);
                let position = series.gamma_times_derivative_columns::<2>(force_b);
                (
                    [
                        series.gamma_times::<1>(force_b) * first,
                        series.gamma_times::<2>(force_b) * second,
                    ],
                    [g_w * first, g_w * (0.5 * second)],
                    [
                        by_rate_rotation,
                        Block::from_columns(velocity).scaled(first * dt_s),
                        Block::from_columns(position).scaled(second * dt_s),
                    ],
                    [
                        by_rate_rotation,
                        Block::from_columns(series.gamma_columns::<2>()).scaled(second),
                    ],
                )
            }
        };
        Self {
            input: *input,
            dt_s,
            turn: SO3::exp(&phi),
            turn_matrix: Block::from_columns(series.gamma_columns::<0>()),
            body,
            world,
            by_rate,
            by_force,
            squares: Squares::new(&series, dt_s, discretisation),
        }
    }

    /// Where the motion takes `pose`: `W phi(pose) U`, without the products by what is known to be neutral.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// // Nothing is felt in free fall: gravity alone acts.
    /// let falling = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::zeros() };
    /// let increment = ImuIncrement::new(&falling, &g_w, 2.0, Discretisation::ZeroOrderHold);
    /// let fallen = increment.apply(&pose);
    /// assert!((fallen.velocity - (pose.velocity + g_w * 2.0)).norm() < 1e-12);
    /// ```
    #[inline(always)]
    pub fn apply(&self, pose: &SE23) -> SE23 {
        moved(pose, self.dt_s, &self.turn, &self.body, &self.world)
    }

    /// How the left-invariant error moves, `chi = chi_hat exp(xi)`: seen from the body, which turns.
    ///
    /// ```
    /// use inekf::lie::LieGroup;
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput, ImuStep};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let increment = ImuIncrement::new(&push, &g_w, 0.1, Discretisation::ZeroOrderHold);
    /// let xi = SVector::<f64, 9>::from_fn(|i, _| 0.01 * i as f64);
    /// let right_input = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::zeros() };
    /// // F xi, F as the group-affine step has it.
    /// let f = ImuStep::from(&increment).step.left_jacobian();
    /// assert!((increment.left_transition().moved(&xi, &right_input) - f * xi).norm() < 1e-12);
    /// ```
    #[inline(always)]
    pub fn left_transition(&self) -> Transition {
        let back = self.turn_matrix.transpose();
        let [rotation, velocity, position] = self.by_rate;
        let [by_velocity, by_position] = self.by_force;
        Transition {
            dt_s: self.dt_s,
            turn: Some(back),
            couplings: [-self.body[0], -self.body[1]],
            by_rate: [
                // Exp(-phi) Gamma_1(phi) = Gamma_1(-phi)
                rotation.transpose(),
                back.times(velocity),
                back.times(position),
            ],
            by_force: [back.times(by_velocity), back.times(by_position)],
            squares: self.squares,
        }
    }

    /// How the right-invariant error moves, `chi = exp(xi) chi_hat`: gravity alone couples it, and the noise
    /// enters as \[PAR\] (14) has it, by the adjoint of `after`, the pose at the end; `before` is that at the
    /// start.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput, ImuStep};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let increment = ImuIncrement::new(&push, &g_w, 0.1, Discretisation::ZeroOrderHold);
    /// let xi = SVector::<f64, 9>::from_fn(|i, _| 0.01 * i as f64);
    /// let right_input = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::zeros() };
    /// // F xi with an F that does not depend on the sample.
    /// let f = ImuStep::from(&increment).step.right_jacobian();
    /// let transition = increment.right_transition(&pose, &increment.apply(&pose));
    /// assert!((transition.moved(&xi, &right_input) - f * xi).norm() < 1e-12);
    /// ```
    #[inline(always)]
    pub fn right_transition(&self, before: &SE23, after: &SE23) -> Transition {
        let r_wb = Block::rotation(&before.rotation);
        let [rotation, velocity, position] = self.by_rate;
        let [by_velocity, by_position] = self.by_force;
        let rotation = r_wb.times(rotation);
        Transition {
            dt_s: self.dt_s,
            turn: None,
            couplings: self.world,
            by_rate: [
                rotation,
                r_wb.times(velocity) + rotation.crossed_by(Quad::from(&after.velocity)),
                r_wb.times(position) + rotation.crossed_by(Quad::from(&after.position)),
            ],
            by_force: [r_wb.times(by_velocity), r_wb.times(by_position)],
            squares: self.squares.turned(r_wb),
        }
    }

    /// How the additive error of the EKF moves, every part of it in world axes; `before` is the pose at the
    /// start.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// // A wrong heading sends the velocity gained the wrong way: across, by the error.
    /// let ahead = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let increment = ImuIncrement::new(&ahead, &g_w, 1.0, Discretisation::ZeroOrderHold);
    /// let mut xi = SVector::<f64, 9>::zeros();
    /// xi[2] = 0.01;
    /// let right_input = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::zeros() };
    /// let moved = increment.additive_transition(&pose).moved(&xi, &right_input);
    /// assert!((moved[4] - 0.01 * 2.0).abs() < 1e-12);
    /// ```
    #[inline(always)]
    pub fn additive_transition(&self, before: &SE23) -> Transition {
        let r_wb = Block::rotation(&before.rotation);
        Transition {
            dt_s: self.dt_s,
            turn: None,
            couplings: self.body.map(|part| -r_wb.apply(&part)),
            by_rate: self.by_rate.map(|block| r_wb.times(block)),
            by_force: self.by_force.map(|block| r_wb.times(block)),
            squares: self.squares.turned(r_wb),
        }
    }
}

/// `pose` after free motion for `dt_s`, the increments `world` (world axes) and `body` (body axes at the
/// start), each of velocity and position, and the rotation `turn`.
#[inline(always)]
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
