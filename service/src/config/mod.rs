//! The daemon's configuration: a TOML file, read whole, refused whole if anything in it is wrong.
//!
//! [`Config`] is plain data in SI units (angles in degrees where a name ends in `_deg`, with accessors in radians).
//! `CONFIG.md` in this crate documents every key; a test holds it, the example file and this reader together.
//!
//! A file is never half understood: unknown keys, wrong types, values out of range or not finite, missing keys and
//! contradictions are all gathered, and reported together as [`ConfigFaults`]. Only faults of TOML's own syntax
//! come first and alone, for behind them nothing can be told for certain.
//!
//! * [`Config::load`], [`Config::from_toml_str`]: from a file or a text to a configuration or its faults
//! * [`schema`]: every key the reader knows, with unit, default and range
//!
//! ```
//! use inekf_service::config::Config;
//!
//! let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
//! let config = Config::from_toml_str(text, "example")?;
//! assert_eq!(config.initial.heading_sigma_deg, 180.0);
//!
//! let faults = Config::from_toml_str(&text.replace("3e-4", "-1"), "example").unwrap_err();
//! assert_eq!(
//!     faults.to_string(),
//!     "example: 1 fault\n  \
//!      line 3: noise.gyro_density = -1: out of range (allowed: 0 to 10 rad/s/sqrt(Hz))"
//! );
//! # Ok::<(), inekf_service::config::ConfigFaults>(())
//! ```

mod choice;
mod fault;
mod imu;
mod initial;
mod interval;
mod load;
mod noise;
mod operation;
mod section;
mod sources;
mod suggest;
mod update;
mod walk;

pub use choice::{
    Discretisation, Estimator, GapPolicy, Hold, Invariance, Level, Model, Transport, WaitMode,
};
pub use fault::{ConfigFaults, Fault};
pub use imu::Imu;
pub use initial::Initial;
pub use load::MAX_FILE_BYTES;
pub use noise::{Noise, WhiteNoise};
pub use operation::{Health, Late, Runtime};
pub use sources::{HeadingSource, PositionSource, VelocitySource};
pub use update::Update;
pub use walk::KeySpec;

use interval::Interval;
use section::Section;
use walk::Walk;

/// Everything a daemon is told before it starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Which motion is estimated, and from what.
    pub model: Model,
    /// Which estimator runs.
    pub estimator: Estimator,
    /// On which side the error is invariant.
    pub invariance: Invariance,
    /// Whether the IMU's biases are part of the state: 15 error states with them, 9 without.
    pub biases: bool,
    /// How the motion is stepped over one sample.
    pub discretisation: Discretisation,
    /// Which interval an IMU sample speaks for.
    pub hold: Hold,
    /// Gravity, m/s^2, pointing down: `g_w = (0, 0, -gravity_mps2)`.
    pub gravity_mps2: f64,
    /// Checks on the IMU's samples.
    pub imu: Imu,
    /// Process noise.
    pub noise: Noise,
    /// The initial state and its standard deviations.
    pub initial: Initial,
    /// The measurement update.
    pub update: Update,
    /// The sensors of position, each with its own id.
    pub position_sources: Vec<PositionSource>,
    /// The sensors of velocity, each with its own id.
    pub velocity_sources: Vec<VelocitySource>,
    /// The sensors of heading, each with its own id.
    pub heading_sources: Vec<HeadingSource>,
    /// Measurements that arrive late.
    pub late: Late,
    /// When the estimate is called degraded or stale.
    pub health: Health,
    /// The estimation thread.
    pub runtime: Runtime,
}

impl Config {
    fn read(root: &mut Section<'_, '_>) -> Self {
        // The fallback is taken only where a fault has been noted: no configuration comes of it.
        let model = root.required_choice("model").unwrap_or(Model::Imu);
        let estimator = root.choice("estimator", Estimator::Inekf);
        let invariance = root.choice("invariance", Invariance::Left);
        let biases = root.boolean("biases", true);
        Self {
            model,
            estimator,
            invariance,
            biases,
            discretisation: root.choice("discretisation", Discretisation::Zoh),
            hold: root.choice("hold", Hold::Backward),
            gravity_mps2: root.float(
                "gravity_mps2",
                "m/s^2",
                Interval::closed(0.0, 30.0),
                9.80665,
            ),
            imu: root.section("imu", Imu::read),
            noise: root.required_section("noise", Noise::read),
            initial: root.section("initial", |initial| Initial::read(initial, biases)),
            update: root.section("update", Update::read),
            position_sources: PositionSource::read_all(root),
            velocity_sources: VelocitySource::read_all(root),
            heading_sources: HeadingSource::read_all(root),
            late: root.section("late", Late::read),
            health: root.section("health", Health::read),
            runtime: root.section("runtime", Runtime::read),
        }
    }
}

/// Every key the reader knows, in the order it asks for them.
pub fn schema() -> Vec<KeySpec> {
    let mut walk = Walk::new("");
    Section::document(&mut walk, None, Config::read);
    walk.keys
}
