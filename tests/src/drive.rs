//! A simulated drive as most tests need it: short, with every kind of fix, and a configuration that fits.

use inekf_client::dataset::Dataset;
use inekf_client::simulate::{
    HeadingOptions, Scenario, SimulationOptions, VelocityOptions, simulate,
};

/// The configuration that fits a simulation with its default options: it knows neither heading nor speed at the start.
pub const CONFIG: &str = "\
model = 'imu'
[noise]
gyro_density = 2.5e-4
accel_density = 1.2e-3
gyro_bias_walk = 1e-5
accel_bias_walk = 1e-4
[initial]
heading_deg = 0.0
heading_sigma_deg = 180.0
level_sigma_deg = 10.0
gyro_bias_sigma_rps = 2e-3
accel_bias_sigma_mps2 = 0.05
[update]
gate_probability = 0.9999
[[position_source]]
id = 0
lever_arm_m = [-0.3, 0.0, 0.5]
[[velocity_source]]
id = 0
[[heading_source]]
id = 0
";

/// The configuration with `more` before its tables, and the way of waiting.
pub fn config(more: &str, wait: &str) -> String {
    format!("{more}\n{CONFIG}\n[runtime]\nwait = '{wait}'\n")
}

/// Options of a short simulation at 100 Hz: positions, velocities and headings.
pub fn options(seed: u64, duration_s: f64) -> SimulationOptions {
    SimulationOptions {
        seed,
        imu_rate_hz: 100.0,
        duration_s,
        velocity: Some(VelocityOptions::default()),
        heading: Some(HeadingOptions::default()),
        ..SimulationOptions::default()
    }
}

/// A dataset of that kind: a car on a road.
pub fn drive(seed: u64, duration_s: f64) -> Dataset {
    simulated(&options(seed, duration_s))
}

/// A car on a road with these options.
pub fn simulated(options: &SimulationOptions) -> Dataset {
    simulate(Scenario::RoadCircuit, options).expect("it can be simulated")
}
