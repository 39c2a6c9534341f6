//! The daemon's configuration: a TOML file, read whole, refused whole if anything in it is wrong.
//!
//! [`Config`] is plain data in SI units (angles in degrees where a name ends in `_deg`).
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
mod estimator;
mod fault;
mod fleet;
mod hinf;
mod imu;
mod initial;
mod interval;
mod keeping;
mod load;
mod mismatched;
mod motion;
mod noise;
mod odometry;
mod operation;
mod section;
mod smoother;
mod solvable;
mod sources;
mod stacking;
mod suggest;
mod update;
mod walk;
mod zero_velocity;

pub use choice::{
    Axis, Discretisation, Estimator, GapPolicy, HinfGain, Hold, Invariance, Jacobians, LateMethod,
    Level, Mismatch, MismatchKind, MissingPartner, Model, Parametrisation, Prior, Transport,
    WaitMode,
};
pub use fault::{ConfigFaults, Fault};
pub use fleet::{Fleet, expand};
pub use hinf::Hinf;
pub use imu::Imu;
pub use initial::Initial;
pub use keeping::{Checkpoint, Journal};
pub use load::MAX_FILE_BYTES;
pub(crate) use mismatched::learned_in_words;
pub use mismatched::{Mismatched, Wrong};
pub use motion::{Inertial, Motion, Odometry};
pub use noise::{IncrementNoise, InertialNoise, OdometryNoise, RowSigmas, WhiteNoise};
pub use odometry::Rows;
pub use operation::{Health, Late, Runtime};
pub use smoother::Smoother;
pub use sources::{HeadingSource, PositionSource, VelocitySource};
pub use stacking::Stacking;
pub use update::Update;
pub use walk::KeySpec;
pub use zero_velocity::ZeroVelocity;

use estimator::Filter;
use motion::{InertialTop, Tables};
use section::Section;
use walk::Walk;

/// Everything a daemon is told before it starts.
///
/// ```
/// use inekf_service::config::{Config, Model};
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[[position_source]]\nid = 0\n";
/// let config = Config::from_toml_str(text, "example")?;
/// assert_eq!((config.model, config.position_sources.len()), (Model::Imu, 1));
/// // What is not given has its default.
/// assert!(config.smoother.is_none() && config.fleet.instances.is_empty());
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Which motion is estimated, and from what.
    pub model: Model,
    /// Which estimator runs.
    pub estimator: Estimator,
    /// On which side the error is invariant. None: it is additive, as the estimator asks for.
    pub invariance: Option<Invariance>,
    /// What is done about the declared mismatches.
    pub mismatch: Mismatch,
    /// The sensor of motion, with all that only it has: an IMU if and only if the model is [`Model::Imu`].
    pub motion: Motion,
    /// The initial state and its standard deviations.
    pub initial: Initial,
    /// The measurement update.
    pub update: Update,
    /// The sensors of position, each with its own id.
    pub position_sources: Vec<PositionSource>,
    /// The declared mismatches, in the order in which estimates report on them; none with [`Mismatch::None`].
    pub mismatched: Vec<Mismatched>,
    /// Two sources of position that are fused together, if any are.
    pub stacking: Option<Stacking>,
    /// The H-infinity filter; there if and only if it is the estimator.
    pub hinf: Option<Hinf>,
    /// The smoother; there if and only if it is the estimator.
    pub smoother: Option<Smoother>,
    /// Measurements that arrive late.
    pub late: Late,
    /// When the estimate is called degraded or stale.
    pub health: Health,
    /// The estimation thread.
    pub runtime: Runtime,
    /// The newest state on disk.
    pub checkpoint: Checkpoint,
    /// The inputs in their order, for a recording.
    pub journal: Journal,
    /// The vehicles, if they are many.
    pub fleet: Fleet,
}

impl Config {
    /// The dimension of the error of the estimated motion, without parameters of mismatches.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// // Rotation, velocity, position and two biases; without them; heading and position.
    /// assert_eq!(read(IMU.to_owned())?.error_states(), 15);
    /// assert_eq!(read(format!("biases = false\n{IMU}"))?.error_states(), 9);
    /// assert_eq!(read(ODOMETRY.to_owned())?.error_states(), 3);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub fn error_states(&self) -> usize {
        match (&self.motion, self.model) {
            (Motion::Inertial(inertial), _) if inertial.biases => 15,
            (Motion::Inertial(_), _) => 9,
            (Motion::Odometry(_), Model::Odometry2d) => 3,
            (Motion::Odometry(_), _) => 6,
        }
    }

    fn read(root: &mut Section<'_, '_>) -> Self {
        // None only where a fault has been noted: then nothing is refused for the sake of the model.
        let model: Option<Model> = root.required_choice("model");
        let filter = Filter::read(root, model);
        let top = InertialTop::read(root, model);
        let tables = Tables::read(root, model);
        let initial = root.section("initial", |initial| {
            Initial::read(initial, model, top.biases)
        });
        let smooths = filter.estimator == Estimator::Smoother && root.is_sound("estimator");
        let update = root.section("update", |update| Update::read(update, smooths));
        let position_sources = PositionSource::read_all(root, model);
        let estimator = root.is_sound("estimator").then_some(filter.estimator);
        let motion = Motion::read(root, model, estimator, top, tables);

        let ids: Vec<u32> = position_sources.iter().map(|source| source.id).collect();
        let known_ids = root.is_sound("position_source").then_some(&*ids);
        let mismatched = Mismatched::read_all(root, model, filter, known_ids);
        let stacking = Stacking::read_if_given(root, model, known_ids);
        if let Some(model) = model
            && filter.mismatch == Mismatch::Hard
            && root.is_sound("mismatched")
            && root.is_sound("stacking")
            && known_ids.is_some()
        {
            solvable::check(
                root,
                model,
                &mismatched,
                &position_sources,
                stacking.as_ref(),
            );
        }
        Self {
            model: model.unwrap_or(Model::Imu),
            estimator: filter.estimator,
            invariance: filter.invariance,
            mismatch: filter.mismatch,
            motion,
            initial,
            update,
            position_sources,
            mismatched,
            stacking,
            hinf: Hinf::read_if_wanted(root, estimator),
            smoother: Smoother::read_if_wanted(root, estimator),
            late: root.section("late", Late::read),
            health: root.section("health", Health::read),
            runtime: root.section("runtime", Runtime::read),
            checkpoint: root.section("checkpoint", |checkpoint| {
                Checkpoint::read(checkpoint, model)
            }),
            journal: root.section("journal", Journal::read),
            fleet: root.section("fleet", Fleet::read),
        }
    }
}

/// Every key the reader knows, in the order it asks for them.
///
/// ```
/// use inekf_service::config::schema;
///
/// let gyro = schema().into_iter().find(|key| key.name == "gyro_density").expect("it is a key");
/// assert_eq!((gyro.header.as_str(), gyro.unit), ("[noise]", Some("rad/s/sqrt(Hz)")));
/// ```
pub fn schema() -> Vec<KeySpec> {
    let mut walk = Walk::new("");
    Section::document(&mut walk, None, Config::read);
    walk.keys
}
