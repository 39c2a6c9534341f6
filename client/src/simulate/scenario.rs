//! The scenarios: smooth trajectories given by formulas.
//!
//! Each is a closed curve of a few harmonics run through with a smooth progress `u(t)`, so that
//! position, velocity, acceleration, attitude and body rate are exact at any time, also before zero.
//! World ENU, body FLU, SI units, radians.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};

use super::jet::{Jet, JetVector, constant, cross, dot, scale, sum, unit};

/// Gravity that shapes the drone's attitude, m/s^2 (its thrust balances it).
const GRAVITY_MPS2: f64 = 9.80665;

/// What is driven or flown.
///
/// ```
/// use inekf_client::simulate::Scenario;
///
/// for scenario in Scenario::ALL {
///     assert_eq!(scenario.name().parse(), Ok(scenario));
///     assert!(!scenario.description().is_empty());
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scenario {
    /// A car on a circuit of 0.7 km with left and right bends, slopes, and changing speed.
    RoadCircuit,
    /// A drone flying figures of eight, banked by up to 48 degrees.
    DroneLoops,
    /// The car of the circuit, standing for 15 s and then driving off.
    StandThenDrive,
}

/// Motion at one time.
///
/// ```
/// use inekf_client::simulate::Scenario;
///
/// // Exact derivatives: position against velocity by a central difference.
/// let (before, now, after) =
///     (Scenario::DroneLoops.at(3.0 - 1e-4), Scenario::DroneLoops.at(3.0), Scenario::DroneLoops.at(3.0 + 1e-4));
/// let slope = (after.p_w_m - before.p_w_m) / 2e-4;
/// assert!((slope - now.v_w_mps).norm() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    /// Attitude, body to world.
    pub q_wb: UnitQuaternion<f64>,
    /// Velocity, m/s, world frame.
    pub v_w_mps: Vector3<f64>,
    /// Position, m, world frame.
    pub p_w_m: Vector3<f64>,
    /// Acceleration, m/s^2, world frame, without gravity.
    pub a_w_mps2: Vector3<f64>,
    /// Angular rate of the body against the world, rad/s, body frame.
    pub omega_b_rps: Vector3<f64>,
}

impl Scenario {
    /// Every scenario, in the order of the help text.
    pub const ALL: [Self; 3] = [Self::RoadCircuit, Self::DroneLoops, Self::StandThenDrive];

    /// The name on the command line.
    ///
    /// ```
    /// use inekf_client::simulate::Scenario;
    ///
    /// assert_eq!(Scenario::RoadCircuit.name(), "road-circuit");
    /// ```
    pub fn name(self) -> &'static str {
        match self {
            Self::RoadCircuit => "road-circuit",
            Self::DroneLoops => "drone-loops",
            Self::StandThenDrive => "stand-then-drive",
        }
    }

    /// One line for the help text.
    ///
    /// ```
    /// use inekf_client::simulate::Scenario;
    ///
    /// // One line each.
    /// assert!(Scenario::ALL.iter().all(|scenario| scenario.description().lines().count() == 1));
    /// ```
    pub fn description(self) -> &'static str {
        match self {
            Self::RoadCircuit => {
                "a car on a 0.7 km circuit: left and right bends, slopes, 17 to 54 km/h"
            }
            Self::DroneLoops => "a drone in figures of eight, banked by up to 48 degrees",
            Self::StandThenDrive => "the same car, standing for 15 s before it drives off",
        }
    }

    /// The motion at time `t_s`, seconds from the start of the simulation.
    ///
    /// ```
    /// use inekf_client::simulate::Scenario;
    ///
    /// // It stands for fifteen seconds before it drives off.
    /// let car = Scenario::StandThenDrive;
    /// assert_eq!(car.at(3.0).p_w_m, car.at(10.0).p_w_m);
    /// ```
    pub fn at(self, t_s: f64) -> Kinematics {
        let time = Jet::time(t_s);
        match self {
            Self::RoadCircuit => drive(time),
            Self::StandThenDrive => drive(clock_after_standing(time)),
            Self::DroneLoops => fly(time),
        }
    }
}

impl fmt::Display for Scenario {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Scenario {
    type Err = UnknownScenario;

    fn from_str(name: &str) -> Result<Self, UnknownScenario> {
        let found = Self::ALL
            .into_iter()
            .find(|scenario| scenario.name() == name);
        found.ok_or_else(|| UnknownScenario {
            name: name.to_owned(),
        })
    }
}

/// No scenario has this name.
///
/// ```
/// use inekf_client::simulate::Scenario;
///
/// let error = "moon-landing".parse::<Scenario>().expect_err("none of ours");
/// // It names those there are.
/// assert!(error.to_string().contains("road-circuit"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no scenario is called `{name}`; there are road-circuit, drone-loops and stand-then-drive")]
pub struct UnknownScenario {
    /// The name that was given.
    pub name: String,
}

/// A periodic curve in one coordinate: the sum of `cos_m * cos(k u) + sin_m * sin(k u)`.
struct Harmonics(&'static [(f64, f64, f64)]);

impl Harmonics {
    /// The derivative of the given order with respect to `u`: each derivative turns the phase by a
    /// quarter and multiplies by `k`.
    fn derivative(&self, order: i32, u: Jet) -> Jet {
        let quarter = Jet::constant(f64::from(order) * std::f64::consts::FRAC_PI_2);
        self.0
            .iter()
            .fold(Jet::constant(0.0), |total, &(k, cos_m, sin_m)| {
                let phase = u * k + quarter;
                total + (phase.cos() * cos_m + phase.sin() * sin_m) * k.powi(order)
            })
    }
}

/// A closed curve in space.
struct Curve([Harmonics; 3]);

impl Curve {
    fn derivative(&self, order: i32, u: Jet) -> JetVector {
        [0, 1, 2].map(|axis: usize| self.0[axis].derivative(order, u))
    }
}

/// The circuit: a circle of 95 m with three lobes, drawn out eastwards, with 3 m of hill.
const ROAD: Curve = Curve([
    Harmonics(&[(1.0, 114.0, 0.0), (2.0, 10.8, 0.0), (4.0, 10.8, 0.0)]),
    Harmonics(&[(1.0, 0.0, 95.0), (2.0, 0.0, -9.0), (4.0, 0.0, 9.0)]),
    Harmonics(&[(1.0, 0.0, 3.0), (2.0, 1.2, 0.0)]),
]);

/// Outward roll of the car's body per lateral acceleration, rad per m/s^2.
const LEAN_RAD_PER_MPS2: f64 = 0.01;
/// The speed at which the lean is reckoned, m/s: a lean that follows the bends alone stays smooth.
const LEAN_SPEED_MPS: f64 = 10.0;

/// The car: x along the road, rolled outwards in bends. `clock` is the time since it was on its way.
fn drive(clock: Jet) -> Kinematics {
    // u' = 0.085 (1 + 0.3 cos 0.31 t): one lap in 74 s, faster and slower twice in between.
    let u = (clock + (clock * 0.31).sin() * (0.3 / 0.31)) * 0.085;
    let (position, tangent, bend) = (
        ROAD.derivative(0, u),
        ROAD.derivative(1, u),
        ROAD.derivative(2, u),
    );
    let forward = unit(&tangent);
    let level_left = unit(&cross(&constant([0.0, 0.0, 1.0]), &forward));
    let road_up = cross(&forward, &level_left);

    // Curvature to the left: (C'' . left) / |C'|^2.
    let inverse_speed = dot(&tangent, &tangent).inverse_sqrt();
    let curvature = dot(&bend, &level_left) * inverse_speed * inverse_speed;
    let lean = curvature * (LEAN_RAD_PER_MPS2 * LEAN_SPEED_MPS * LEAN_SPEED_MPS);
    let left = sum(
        &scale(&level_left, lean.cos()),
        &scale(&road_up, lean.sin()),
    );
    let up = cross(&forward, &left);
    kinematics(&position, [forward, left, up])
}

/// How long the car of `stand-then-drive` stands, s.
const STANDING_S: f64 = 15.0;
/// How long it takes to reach the circuit's speed, s.
const DRIVING_OFF_S: f64 = 8.0;

/// The circuit's clock for a car that stands first: it rests until 15 s and then gains speed.
///
/// Its rate is the step `35 x^4 - 84 x^5 + 70 x^6 - 20 x^7`, whose first three derivatives vanish
/// at both ends, so acceleration and jerk are continuous.
fn clock_after_standing(time: Jet) -> Jet {
    let x = (time.value - STANDING_S) / DRIVING_OFF_S;
    let (clock, rate, second) = if x <= 0.0 {
        (0.0, 0.0, 0.0)
    } else if x >= 1.0 {
        (x - 0.5, 1.0, 0.0)
    } else {
        (
            x.powi(5) * (7.0 + x * (-14.0 + x * (10.0 - 2.5 * x))),
            x.powi(4) * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x))),
            x.powi(3) * 140.0 * (1.0 - x).powi(3),
        )
    };
    time.chain(clock * DRIVING_OFF_S, rate, second / DRIVING_OFF_S)
}

/// The drone's figure of eight, with a wave in height.
const AIR: Curve = Curve([
    Harmonics(&[(1.0, 0.0, 12.0)]),
    Harmonics(&[(2.0, 0.0, 7.0)]),
    Harmonics(&[(0.0, 6.0, 0.0), (3.0, 0.7, 1.3)]),
]);

/// Progress of the drone along its figure, rad/s.
const AIR_RATE_RPS: f64 = 0.5;

/// The drone: its thrust, along body z, balances gravity and makes the acceleration (no drag); its
/// nose points along the flight as far as the thrust allows.
fn fly(time: Jet) -> Kinematics {
    let u = time * AIR_RATE_RPS;
    let acceleration = scale(
        &AIR.derivative(2, u),
        Jet::constant(AIR_RATE_RPS * AIR_RATE_RPS),
    );
    let up = unit(&sum(&acceleration, &constant([0.0, 0.0, GRAVITY_MPS2])));
    let left = unit(&cross(&up, &AIR.derivative(1, u)));
    let forward = cross(&left, &up);
    kinematics(&AIR.derivative(0, u), [forward, left, up])
}

/// Reads velocity, acceleration and body rate off the jets. `axes` are body x, y, z in the world.
fn kinematics(position: &JetVector, axes: [JetVector; 3]) -> Kinematics {
    let [forward, left, up] = &axes;
    // R^T R' is the skew matrix of the body rate; `along` is one entry of it.
    let along = |a: &JetVector, b: &JetVector| -> f64 {
        (0..3).map(|axis| a[axis].value * b[axis].rate).sum()
    };
    let omega_b_rps = Vector3::new(along(up, left), along(forward, up), along(left, forward));
    let columns = axes.map(|axis| vector(&axis, |jet| jet.value));
    let rotation = Rotation3::from_basis_unchecked(&columns);
    Kinematics {
        q_wb: UnitQuaternion::from_rotation_matrix(&rotation),
        v_w_mps: vector(position, |jet| jet.rate),
        p_w_m: vector(position, |jet| jet.value),
        a_w_mps2: vector(position, |jet| jet.second),
        omega_b_rps,
    }
}

fn vector(jets: &JetVector, part: impl Fn(&Jet) -> f64) -> Vector3<f64> {
    Vector3::new(part(&jets[0]), part(&jets[1]), part(&jets[2]))
}
