//! Class 1 of \[LC\] III for states that an IMU drives: what may be wrong with the gyroscope and the accelerometer.
//!
//! The rate and the force that act are those of the sample (the biases of the state removed) and a little more, in
//! proportion to one unknown parameter m. A change of the input over one interval enters the error as minus a bias
//! would, so that its column follows from the [`Transition`] that the covariance takes anyway:
//!
//! ```text
//! d_kappa / m = B (domega/dm, dforce/dm)        B the input Jacobian of ImuStep
//! ```
//!
//! **What a hard constraint asks for.** Positions see a force through two integrations and a rate through three. A
//! gain that takes back at each update whatever a bias has done since the last one differentiates the fixes as often,
//! and their noise with them: with one source of 2 cm at the body's origin, five times a second, an unknown bias of
//! the accelerometer leaves the velocity known to some 2 m/s, and one of the gyroscope the attitude not at all. Two
//! sources two metres apart see the rotation itself and keep it to 0.01 to 0.03 rad, and less frequent fixes help the
//! velocity (0.2 to 0.4 m/s at 1 Hz). Where m is small or lasts, [`soft`](super::Declared::soft) or a state serves better.

use nalgebra::{SVector, Vector3};

use super::imu::{Discretisation, ImuInput, ImuNoise};
use super::increment::ImuIncrement;
use super::nav_state::NavState;
use super::process::{MeanMismatch, Motion, Part, PathNoise};
use super::transition::Transition;
use crate::lie::SE23;

/// A sensor whose scale is wrong, on every axis alike. All that can be declared of a state that carries biases
/// ([`NavState`]): there the mean of a bias is what the state estimates, and declaring it unknown would take from the
/// state every fix that it learns from.
///
/// ```
/// use inekf::model::{ImuInput, InertialScale};
/// use nalgebra::Vector3;
///
/// let input = ImuInput { omega_b: Vector3::new(0.0, 0.0, 0.5), force_b: Vector3::new(0.0, 0.0, 9.8) };
/// // A hundred per cent more is as much again; the force stays.
/// let more = InertialScale::Gyro.disturbance(&input);
/// assert_eq!((more.omega_b, more.force_b), (input.omega_b, Vector3::zeros()));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InertialScale {
    /// The angular rate is `(1 + m) omega`.
    Gyro,
    /// The specific force is `(1 + m) a`, gravity's share included: at rest, too.
    Accel,
}

/// What may be wrong with the IMU of a state without biases. Axes are unit vectors in body axes; one that is zero
/// says nothing.
///
/// ```
/// use inekf::model::{ImuInput, InertialMismatch};
/// use nalgebra::Vector3;
///
/// let input = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.8) };
/// let drag = InertialMismatch::AccelBias { axis_b: Vector3::x() };
/// // In m/s^2 along the axis, whatever the sample.
/// assert_eq!(drag.disturbance(&input).force_b, Vector3::x());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InertialMismatch {
    /// The angular rate is `omega + m axis_b`, m in rad/s.
    GyroBias {
        /// The axis that the body is turned about.
        axis_b: Vector3<f64>,
    },
    /// The specific force is `a + m axis_b`, m in m/s^2.
    AccelBias {
        /// The axis that the body is pushed along.
        axis_b: Vector3<f64>,
    },
    /// The scale of one sensor.
    Scale(InertialScale),
}

impl InertialScale {
    /// What a unit of m adds to `input`.
    ///
    /// ```
    /// use inekf::model::{ImuInput, InertialScale};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    ///
    /// // Gravity's share is scaled too: at rest a wrong scale pushes upwards.
    /// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: -g_w };
    /// assert_eq!(InertialScale::Accel.disturbance(&at_rest).force_b, -g_w);
    /// ```
    pub fn disturbance(&self, input: &ImuInput) -> ImuInput {
        match self {
            Self::Gyro => rate(input.omega_b),
            Self::Accel => force(input.force_b),
        }
    }
}

impl InertialMismatch {
    /// What a unit of m adds to `input`, whose biases have been removed.
    ///
    /// ```
    /// use inekf::model::{ImuInput, InertialMismatch};
    /// use nalgebra::Vector3;
    ///
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    ///
    /// // A bias is the same whatever the sample, a scale is not.
    /// let bias = InertialMismatch::GyroBias { axis_b: Vector3::z() };
    /// assert_eq!(bias.disturbance(&push).omega_b, Vector3::z());
    /// ```
    pub fn disturbance(&self, input: &ImuInput) -> ImuInput {
        match self {
            Self::GyroBias { axis_b } => rate(*axis_b),
            Self::AccelBias { axis_b } => force(*axis_b),
            Self::Scale(scale) => scale.disturbance(input),
        }
    }
}

fn rate(omega_b: Vector3<f64>) -> ImuInput {
    ImuInput {
        omega_b,
        force_b: Vector3::zeros(),
    }
}

fn force(force_b: Vector3<f64>) -> ImuInput {
    ImuInput {
        omega_b: Vector3::zeros(),
        force_b,
    }
}

impl MeanMismatch for InertialScale {
    fn part(&self) -> Part {
        match self {
            Self::Gyro => Part::Turn,
            Self::Accel => Part::Velocity,
        }
    }

    fn is_scale(&self) -> bool {
        true
    }

    fn can_wait(&self) -> bool {
        true
    }
}

impl MeanMismatch for InertialMismatch {
    fn part(&self) -> Part {
        match self {
            Self::GyroBias { .. } => Part::Turn,
            Self::AccelBias { .. } => Part::Velocity,
            Self::Scale(scale) => scale.part(),
        }
    }

    fn is_scale(&self) -> bool {
        matches!(self, Self::Scale(_))
    }

    fn can_wait(&self) -> bool {
        true
    }
}

/// What white noise of the input adds over `dt_s`: it is integrated once to rotation and velocity, twice to position.
fn lengthen(path: &mut PathNoise, dt_s: f64, noise: &ImuNoise) {
    let gained = noise.accel_psd * dt_s;
    path.way += dt_s * (2.0 * path.velocity_way + dt_s * (path.velocity + gained / 3.0));
    path.velocity_way += dt_s * (path.velocity + 0.5 * gained);
    path.velocity += gained;
    path.turn += noise.gyro_psd * dt_s;
}

/// Two intervals in which nothing vanishes and nothing is parallel.
fn in_general_position() -> [ImuIncrement; 2] {
    let increment = |[a, b, c]: [f64; 3], [d, e, f]: [f64; 3]| {
        let input = ImuInput {
            omega_b: Vector3::new(a, b, c),
            force_b: Vector3::new(d, e, f),
        };
        let scheme = Discretisation::ZeroOrderHold;
        // What gravity adds does not depend on the input, and the left-invariant error does not see it.
        ImuIncrement::new(&input, &Vector3::zeros(), 1.0, scheme)
    };
    [
        increment([0.3, -0.5, 0.8], [2.0, -1.1, 9.0]),
        increment([-0.6, 0.4, 0.2], [-0.7, 3.1, 8.0]),
    ]
}

/// Implements [`Motion`] of an IMU for a state of the given dimension.
macro_rules! inertial_motion {
    ($state:ty, $dimension:literal, $mismatch:ty) => {
        /// An interval of the IMU that moves this state.
        impl Motion<$dimension, 3> for ImuIncrement {
            type State = $state;
            type Mismatch = $mismatch;
            type Noise = ImuNoise;

            fn carry(
                &self,
            ) -> impl Fn(&SVector<f64, $dimension>, &$mismatch) -> SVector<f64, $dimension> {
                let transition: Transition = self.left_transition();
                move |column, mismatch| transition.moved(column, &mismatch.disturbance(&self.input))
            }

            fn lengthen(&self, path: &mut PathNoise, noise: &ImuNoise) {
                lengthen(path, self.dt_s, noise);
            }

            fn in_general_position() -> [Self; 2] {
                in_general_position()
            }
        }
    };
}

inertial_motion!(SE23, 9, InertialMismatch);
inertial_motion!(NavState, 15, InertialScale);
