//! What `inekf-client simulate` simulates: a drive or flight with an IMU, or planar odometry.

use std::str::FromStr;

use super::planar::{PLANAR_MISMATCH, PlanarOptions, simulate_planar};
use super::{Scenario, SimulationError, SimulationOptions, simulate};
use crate::dataset::Dataset;

/// One of the simulations.
///
/// ```
/// use inekf_client::simulate::{Scenario, Simulation};
///
/// // Names as on the command line.
/// assert_eq!("drone-loops".parse(), Ok(Simulation::Inertial(Scenario::DroneLoops)));
/// assert_eq!("planar-mismatch".parse(), Ok(Simulation::PlanarMismatch));
/// assert!("submarine".parse::<Simulation>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simulation {
    /// An IMU on a trajectory, with position fixes.
    Inertial(Scenario),
    /// Planar odometry and two position sources, all of them with a mismatch.
    PlanarMismatch,
}

impl Simulation {
    /// The dataset of this seed; rate (of the samples that move the state, Hz) and duration (s) are the simulation's
    /// own if not given: 200 Hz and 60 s with an IMU, 10 Hz and 33 s in the plane.
    ///
    /// # Errors
    /// [`SimulationError`] if rate or duration cannot be.
    ///
    /// ```
    /// use inekf_client::simulate::{Scenario, Simulation};
    ///
    /// let drive = Simulation::Inertial(Scenario::RoadCircuit).dataset(1, Some(100.0), Some(2.0))?;
    /// assert_eq!(drive.imu.len(), 201);
    /// // In the plane the rate is that of the odometry.
    /// let drive = Simulation::PlanarMismatch.dataset(1, None, Some(2.0))?;
    /// assert_eq!(drive.events().filter(|event| event.is_motion()).count(), 20);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn dataset(
        self,
        seed: u64,
        rate_hz: Option<f64>,
        duration_s: Option<f64>,
    ) -> Result<Dataset, SimulationError> {
        match self {
            Self::Inertial(scenario) => {
                let usual = SimulationOptions::default();
                let options = SimulationOptions {
                    seed,
                    imu_rate_hz: rate_hz.unwrap_or(usual.imu_rate_hz),
                    duration_s: duration_s.unwrap_or(usual.duration_s),
                    ..usual
                };
                simulate(scenario, &options)
            }
            Self::PlanarMismatch => {
                let usual = PlanarOptions::default();
                simulate_planar(&PlanarOptions {
                    seed,
                    rate_hz: rate_hz.unwrap_or(usual.rate_hz),
                    duration_s: duration_s.unwrap_or(usual.duration_s),
                })
            }
        }
    }
}

impl FromStr for Simulation {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        if name == PLANAR_MISMATCH {
            return Ok(Self::PlanarMismatch);
        }
        name.parse()
            .map(Self::Inertial)
            .map_err(|error| format!("{error}, and {PLANAR_MISMATCH}"))
    }
}
