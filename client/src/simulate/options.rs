//! What can be chosen in a simulation, with defaults like an automotive MEMS IMU and a code GNSS.

/// Options of a simulation. `SimulationOptions::default()` is a car with a good MEMS IMU at 200 Hz
/// and position fixes of 1 m at 5 Hz.
///
/// ```
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions { seed: 7, duration_s: 1.0, truth_every: 10, ..Default::default() };
/// let drive = simulate(Scenario::RoadCircuit, &options)?;
/// // What the sensors' noise was is written into meta.json for the filter.
/// assert_eq!(drive.meta.imu_noise.map(|noise| noise.gyro_density), Some(2.5e-4));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationOptions {
    /// Seed of all noise; default 1. The same seed and options give the same dataset bit for bit.
    pub seed: u64,
    /// IMU rate, Hz; default 200.
    pub imu_rate_hz: f64,
    /// Duration, s; default 60.
    pub duration_s: f64,
    /// Magnitude of gravity, m/s^2; default 9.80665.
    pub gravity_mps2: f64,
    /// White noise of the gyro, rad/s/sqrt(Hz); default 2.5e-4 (0.014 deg/s/sqrt(Hz)).
    pub gyro_density: f64,
    /// White noise of the accelerometer, m/s^2/sqrt(Hz); default 1.2e-3 (120 ug/sqrt(Hz)).
    pub accel_density: f64,
    /// Random walk of the gyro bias, rad/s^2/sqrt(Hz); default 1e-5.
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer bias, m/s^3/sqrt(Hz); default 1e-4.
    pub accel_bias_walk: f64,
    /// Gyro bias at the start, drawn per axis with this deviation, rad/s; default 2e-3.
    pub gyro_bias_sigma_rps: f64,
    /// Accelerometer bias at the start, drawn per axis with this deviation, m/s^2; default 0.05.
    pub accel_bias_sigma_mps2: f64,
    /// Position fixes; default 5 Hz, 1 m horizontal, 1.5 m vertical, with a lever arm.
    pub position: Option<PositionOptions>,
    /// Velocity fixes; default none.
    pub velocity: Option<VelocityOptions>,
    /// Heading fixes; default none.
    pub heading: Option<HeadingOptions>,
    /// One truth row for so many IMU samples; default 1.
    pub truth_every: u32,
    /// Deviations of the initial state that `meta.json` tells the daemon to start from; default
    /// none, which leaves initialisation to the daemon.
    pub initial: Option<InitialOptions>,
}

/// Position fixes of source 0.
///
/// ```
/// use inekf_client::simulate::{PositionOptions, Scenario, SimulationOptions, simulate};
///
/// let gnss = PositionOptions { rate_hz: 10.0, sigma_m: [0.02; 3], ..PositionOptions::default() };
/// let options = SimulationOptions { duration_s: 1.0, position: Some(gnss), ..Default::default() };
/// let drive = simulate(Scenario::RoadCircuit, &options)?;
/// assert_eq!(drive.position.len(), 10);
/// // The antenna is not the IMU, and meta.json says where it is.
/// assert_eq!(drive.meta.lever_arm_m(0), [-0.3, 0.0, 0.5]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PositionOptions {
    /// Rate, Hz; default 5.
    pub rate_hz: f64,
    /// Time of the first fix after the start, s; default 0.0033, so that no stamp meets an IMU
    /// sample of the common rates.
    pub offset_s: f64,
    /// White noise per axis (east, north, up), m; default 1, 1, 1.5.
    pub sigma_m: [f64; 3],
    /// IMU to antenna, body FLU, m; default -0.3, 0, 0.5.
    pub lever_arm_b_m: [f64; 3],
}

/// Velocity fixes of source 0: of the IMU, in the world frame.
///
/// ```
/// use inekf_client::simulate::{Scenario, SimulationOptions, VelocityOptions, simulate};
///
/// let options = SimulationOptions {
///     duration_s: 1.0,
///     velocity: Some(VelocityOptions { rate_hz: 2.0, ..VelocityOptions::default() }),
///     ..SimulationOptions::default()
/// };
/// assert_eq!(simulate(Scenario::RoadCircuit, &options)?.velocity.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct VelocityOptions {
    /// Rate, Hz; default 5.
    pub rate_hz: f64,
    /// Time of the first fix after the start, s; default 0.0033.
    pub offset_s: f64,
    /// White noise per axis, m/s; default 0.05, 0.05, 0.1.
    pub sigma_mps: [f64; 3],
}

/// Heading fixes of source 0: of the body x axis.
///
/// ```
/// use inekf_client::simulate::{HeadingOptions, Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions {
///     duration_s: 1.0,
///     heading: Some(HeadingOptions { sigma_rad: 0.0, ..HeadingOptions::default() }),
///     ..SimulationOptions::default()
/// };
/// let fix = simulate(Scenario::StandThenDrive, &options)?.heading[0];
/// // Without noise it is where the nose points.
/// let nose_w = Scenario::StandThenDrive.at(0.0033).q_wb * nalgebra::Vector3::x();
/// assert!((fix.heading_rad - nose_w.y.atan2(nose_w.x)).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct HeadingOptions {
    /// Rate, Hz; default 1.
    pub rate_hz: f64,
    /// Time of the first fix after the start, s; default 0.0033.
    pub offset_s: f64,
    /// White noise, rad; default 0.0175 (1 degree).
    pub sigma_rad: f64,
}

/// The initial error of the left-invariant state, `chi = chi_hat * exp(xi)`: each entry of `xi` is
/// drawn with the deviation of its kind, so that the dataset's initial covariance is exact. The
/// deviations of the biases are [`SimulationOptions::gyro_bias_sigma_rps`] and
/// [`SimulationOptions::accel_bias_sigma_mps2`], around a believed bias of zero.
///
/// ```
/// use inekf_client::simulate::{InitialOptions, Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions {
///     duration_s: 0.1,
///     initial: Some(InitialOptions::default()),
///     ..SimulationOptions::default()
/// };
/// let meta = simulate(Scenario::RoadCircuit, &options)?.meta;
/// // Variances in the order rotation, velocity, position, and the biases.
/// let p0_diag = meta.p0_diag.expect("with the state");
/// assert!((p0_diag[2] - 0.1 * 0.1).abs() < 1e-15 && (p0_diag[6] - 1.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct InitialOptions {
    /// Rotation about body x, y, z, rad; default 0.02, 0.02, 0.1.
    pub rotation_sigma_rad: [f64; 3],
    /// Velocity along body x, y, z, m/s; default 0.1.
    pub velocity_sigma_mps: [f64; 3],
    /// Position along body x, y, z, m; default 1.
    pub position_sigma_m: [f64; 3],
}

impl Default for SimulationOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            imu_rate_hz: 200.0,
            duration_s: 60.0,
            gravity_mps2: 9.80665,
            gyro_density: 2.5e-4,
            accel_density: 1.2e-3,
            gyro_bias_walk: 1e-5,
            accel_bias_walk: 1e-4,
            gyro_bias_sigma_rps: 2e-3,
            accel_bias_sigma_mps2: 0.05,
            position: Some(PositionOptions::default()),
            velocity: None,
            heading: None,
            truth_every: 1,
            initial: None,
        }
    }
}

impl SimulationOptions {
    /// Without any noise or bias, fixes included; for checks of the equations alone.
    ///
    /// ```
    /// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
    ///
    /// let options = SimulationOptions { duration_s: 1.0, ..SimulationOptions::default() }.noise_free();
    /// let again = SimulationOptions { seed: 99, ..options.clone() };
    /// // Nothing is left for a seed to change.
    /// let drive = |options| simulate(Scenario::DroneLoops, options).map(|drive| (drive.imu, drive.position));
    /// assert_eq!(drive(&options)?, drive(&again)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn noise_free(mut self) -> Self {
        for noise in [
            &mut self.gyro_density,
            &mut self.accel_density,
            &mut self.gyro_bias_walk,
            &mut self.accel_bias_walk,
            &mut self.gyro_bias_sigma_rps,
            &mut self.accel_bias_sigma_mps2,
        ] {
            *noise = 0.0;
        }
        self.position
            .iter_mut()
            .for_each(|fix| fix.sigma_m = [0.0; 3]);
        self.velocity
            .iter_mut()
            .for_each(|fix| fix.sigma_mps = [0.0; 3]);
        self.heading.iter_mut().for_each(|fix| fix.sigma_rad = 0.0);
        self
    }
}

impl Default for PositionOptions {
    fn default() -> Self {
        Self {
            rate_hz: 5.0,
            offset_s: 0.0033,
            sigma_m: [1.0, 1.0, 1.5],
            lever_arm_b_m: [-0.3, 0.0, 0.5],
        }
    }
}

impl Default for VelocityOptions {
    fn default() -> Self {
        Self {
            rate_hz: 5.0,
            offset_s: 0.0033,
            sigma_mps: [0.05, 0.05, 0.1],
        }
    }
}

impl Default for HeadingOptions {
    fn default() -> Self {
        Self {
            rate_hz: 1.0,
            offset_s: 0.0033,
            sigma_rad: 1.0_f64.to_radians(),
        }
    }
}

impl Default for InitialOptions {
    fn default() -> Self {
        Self {
            rotation_sigma_rad: [0.02, 0.02, 0.1],
            velocity_sigma_mps: [0.1; 3],
            position_sigma_m: [1.0; 3],
        }
    }
}
