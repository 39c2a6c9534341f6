//! What the engine needs of the configuration, in SI units and radians.
//!
//! ```
//! use inekf_service::config::Config;
//! use inekf_service::engine::Settings;
//!
//! let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[initial]\nheading_deg = 180.0\n";
//! let settings = Settings::new(&Config::from_toml_str(text, "example")?);
//! assert_eq!(settings.initial.heading, std::f64::consts::PI);
//! # Ok::<(), inekf_service::config::ConfigFaults>(())
//! ```

use inekf::filter::{Alignment, BiasPrior, Gate, Transport, UpdateOptions};
use inekf::lie::SO3;
use inekf::model::{Discretisation, ImuNoise};
use inekf::smoother::{Jacobians, PriorForm, WindowOptions};
use inekf_shared::message::MAX_SOURCES;
use nalgebra::{Matrix3, Vector3};

use super::fix::{Antenna, FixKind};
use super::resume::Doubt;
use crate::config::{
    self, Config, GapPolicy, Hold, Inertial, LateMethod, Level, MissingPartner, Motion,
    Parametrisation, WhiteNoise,
};

pub use super::inertial::standstill::StandstillSettings;
pub use super::stack::{Missing, StackSettings};

/// The IMU: what it may say, how its samples are held, its noise.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[imu]\nmax_gap_s = 0.05\n";
/// let imu = Settings::new(&Config::from_toml_str(text, "example")?).imu;
/// assert_eq!((imu.max_gap_ns, imu.g_w.z), (50_000_000, -9.80665));
/// // After a far longer one nothing is guessed any more.
/// assert!(imu.restart_gap_ns > imu.max_gap_ns);
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSettings {
    /// Gravity, m/s^2, world frame.
    pub g_w: Vector3<f64>,
    /// How an interval becomes a step.
    pub discretisation: Discretisation,
    /// Which sample speaks for an interval.
    pub hold: Hold,
    /// White noise.
    pub white: WhiteNoise,
    /// Gyroscope bias random walk, rad/s^2/sqrt(Hz).
    pub gyro_bias_walk: f64,
    /// Accelerometer bias random walk, m/s^3/sqrt(Hz).
    pub accel_bias_walk: f64,
    /// Largest believable angular rate per axis, rad/s.
    pub max_gyro: f64,
    /// Largest believable specific force per axis, m/s^2.
    pub max_accel: f64,
    /// A longer interval is a gap: the samples around it are averaged and doubted.
    pub max_gap_ns: u64,
    /// After a gap longer than this the state starts anew.
    pub restart_gap_ns: u64,
    /// Doubt about the mean angular rate over a gap, rad/s.
    pub gap_gyro_sigma: f64,
    /// Doubt about the mean specific force over a gap, m/s^2.
    pub gap_accel_sigma: f64,
    /// When a vehicle stands, if that is looked for.
    pub standstill: Option<StandstillSettings>,
}

impl InitialSettings {
    /// Whether the start waits for a position fix.
    pub(super) fn needs_fix(&self) -> bool {
        self.position == PositionSource::FirstFix
    }

    /// The parts of the first belief, from an attitude and a position.
    pub(super) fn alignment(&self, r_wb: SO3, antenna: &Antenna) -> Alignment {
        Alignment {
            r_wb,
            tilt_sigma: self.level_sigma,
            heading_sigma: self.heading_sigma,
            velocity_w: self.velocity_w,
            velocity_sigma: self.velocity_sigma,
            position_w: antenna.position_w,
            position_covariance_w: antenna.covariance_w,
            lever_arm_b: antenna.lever_arm_b,
            biases: self.biases,
        }
    }

    /// The same for a pose that is set rather than measured, without a covariance of its own.
    pub(super) fn alignment_at(&self, r_wb: SO3, position_w: Vector3<f64>) -> Alignment {
        let sigma = match self.position {
            PositionSource::Given { sigma, .. } => sigma,
            PositionSource::FirstFix => UNSTATED_POSITION_SIGMA,
        };
        let here = Antenna {
            position_w,
            covariance_w: Matrix3::identity() * (sigma * sigma),
            lever_arm_b: Vector3::zeros(),
        };
        self.alignment(r_wb, &here)
    }
}

impl ImuSettings {
    /// The noise over an interval of `interval_ns`.
    pub(super) fn noise(&self, interval_ns: u64) -> ImuNoise {
        if interval_ns > self.max_gap_ns {
            self.noise_with(interval_ns, self.gap_gyro_sigma, self.gap_accel_sigma)
        } else {
            self.noise_with(interval_ns, 0.0, 0.0)
        }
    }

    /// The noise over `silence_ns` in which nothing was heard.
    pub(super) fn noise_of_silence(&self, silence_ns: u64, doubt: &Doubt) -> ImuNoise {
        self.noise_with(silence_ns, doubt.turn_sigma, doubt.accel_sigma)
    }

    /// The noise over an interval whose mean angular rate (rad/s) and specific force (m/s^2) are doubted as well.
    fn noise_with(&self, interval_ns: u64, gyro_sigma: f64, accel_sigma: f64) -> ImuNoise {
        let dt_s = seconds(interval_ns);
        let (gyro_psd, accel_psd) = match self.white {
            WhiteNoise::Density { gyro, accel } => (gyro * gyro, accel * accel),
            WhiteNoise::PerSample { gyro, accel } => (gyro * gyro * dt_s, accel * accel * dt_s),
        };
        ImuNoise {
            gyro_psd: gyro_psd + gyro_sigma * gyro_sigma * dt_s,
            accel_psd: accel_psd + accel_sigma * accel_sigma * dt_s,
            gyro_bias_psd: self.gyro_bias_walk * self.gyro_bias_walk,
            accel_bias_psd: self.accel_bias_walk * self.accel_bias_walk,
        }
    }
}

/// Where the attitude comes from at the start.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::{LevelSource, Settings};
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[initial]\nlevel = 'given'\nroll_deg = 180.0\n";
/// let initial = Settings::new(&Config::from_toml_str(text, "example")?).initial;
/// assert_eq!(initial.level, LevelSource::Given { roll: std::f64::consts::PI, pitch: 0.0 });
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelSource {
    /// The mean accelerometer reading over this long, nanoseconds.
    Accelerometer {
        /// Length of the averaging window.
        window_ns: u64,
    },
    /// Roll and pitch as configured, rad.
    Given {
        /// About the body's x axis.
        roll: f64,
        /// About the body's y axis.
        pitch: f64,
    },
}

/// Where the position comes from at the start.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::{PositionSource, Settings};
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// // What is not given comes from the first fix.
/// let initial = Settings::new(&Config::from_toml_str(text, "example")?).initial;
/// assert_eq!(initial.position, PositionSource::FirstFix);
/// let text = format!("{text}[initial]\nposition_m = [1.0, 2.0, 3.0]\n");
/// let initial = Settings::new(&Config::from_toml_str(&text, "example")?).initial;
/// assert!(matches!(initial.position, PositionSource::Given { sigma, .. } if sigma == 10.0));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PositionSource {
    /// The first fix, with its covariance and lever arm.
    FirstFix,
    /// As configured: m, world frame, and a standard deviation per axis.
    Given {
        /// Position of the IMU.
        position_w: Vector3<f64>,
        /// Standard deviation per axis, m.
        sigma: f64,
    },
}

/// The first belief.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[initial]\nvelocity_mps = [5.0, 0.0, 0.0]\n";
/// let initial = Settings::new(&Config::from_toml_str(text, "example")?).initial;
/// assert_eq!((initial.velocity_w.x, initial.wait_for_request), (5.0, false));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialSettings {
    /// Heading, rad, counter-clockwise from east.
    pub heading: f64,
    /// Its standard deviation, rad.
    pub heading_sigma: f64,
    /// Where roll and pitch come from.
    pub level: LevelSource,
    /// Standard deviation of the tilt about each horizontal axis, rad.
    pub level_sigma: f64,
    /// Where the position comes from.
    pub position: PositionSource,
    /// Velocity, m/s, world frame.
    pub velocity_w: Vector3<f64>,
    /// Its standard deviation per axis, m/s.
    pub velocity_sigma: f64,
    /// The biases.
    pub biases: BiasPrior,
    /// Whether only a set-state request initialises.
    pub wait_for_request: bool,
}

/// One aiding source.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[[position_source]]\nid = 2\nlever_arm_m = [0.5, 0.0, 1.2]\n";
/// let fusion = Settings::new(&Config::from_toml_str(text, "example")?).fusion;
/// // Positions come first, each at the place of its id.
/// let antenna = fusion.sources[0][2].expect("it is configured");
/// assert_eq!((antenna.lever_arm_b.z, antenna.sigma_scale), (1.2, 1.0));
/// assert!(fusion.sources[0][1].is_none());
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSettings {
    /// From the IMU to the antenna, m, body frame.
    pub lever_arm_b: Vector3<f64>,
    /// Multiplies the standard deviations of its fixes.
    pub sigma_scale: f64,
    /// The scale error that it is assumed to have.
    pub scale_error: f64,
}

/// The configured sources by kind and id.
pub type Sources = [[Option<SourceSettings>; MAX_SOURCES]; FixKind::COUNT];

/// How fixes are fused.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[late]\nwindow_s = 0.5\n";
/// let fusion = Settings::new(&Config::from_toml_str(text, "example")?).fusion;
/// assert_eq!(fusion.late_window_ns, 500_000_000);
/// assert!(fusion.stack.is_none());
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// Iterations, transport and gate.
    pub update: UpdateOptions,
    /// After this many gated fixes of a source in a row one is accepted; 0 never.
    pub recover_after: u32,
    /// The configured sources.
    pub sources: Sources,
    /// A fix this late is still fused.
    pub late_window_ns: u64,
    /// Samples kept for fusing late fixes.
    pub late_capacity: usize,
    /// How late fixes are fused.
    pub late_method: LateMethod,
    /// No accepted fix for this long is degraded.
    pub degraded_after_ns: u64,
    /// Two position sources that are taken together.
    pub stack: Option<StackSettings>,
}

impl FusionSettings {
    /// How a measurement is fused, gated or not.
    pub(super) fn options(&self, gated: bool) -> UpdateOptions {
        if gated {
            return self.update;
        }
        UpdateOptions {
            gate: Gate::OPEN,
            ..self.update
        }
    }
}

/// The smoother.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "estimator = 'smoother'\nmodel = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[smoother]\nwindow = 7\n";
/// let settings = Settings::new(&Config::from_toml_str(text, "example")?);
/// assert_eq!(settings.smoother.map(|smoother| smoother.window.capacity), Some(7));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmootherSettings {
    /// How a correction is attached to a state.
    pub parametrisation: Parametrisation,
    /// The rest. Its gate is open: fixes are judged before they enter.
    pub window: WindowOptions,
    /// The filter takes over once the standard deviation of the heading is below this, rad.
    pub hand_over_sigma: Option<f64>,
}

/// Everything.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// let settings = Settings::new(&Config::from_toml_str(text, "example")?);
/// // Plain data, to be changed where an engine is built without a file.
/// let patient = Settings {
///     initial: inekf_service::engine::settings::InitialSettings {
///         wait_for_request: true,
///         ..settings.initial
///     },
///     ..settings
/// };
/// assert_ne!(patient, settings);
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The IMU.
    pub imu: ImuSettings,
    /// The first belief.
    pub initial: InitialSettings,
    /// How fixes are fused.
    pub fusion: FusionSettings,
    /// The smoother, if that is the estimator.
    pub smoother: Option<SmootherSettings>,
}

/// Standard deviation per axis of a position that comes without one, m: the configuration's default.
const UNSTATED_POSITION_SIGMA: f64 = 10.0;
/// A restart is certain after a gap this many times `max_gap_s`: no guess about the motion in
/// between is worth anything then.
const RESTART_GAPS: u64 = 20;
/// Doubt about the mean angular rate over a gap, rad/s: a car in a turn, a drone in a manoeuvre.
const GAP_GYRO_SIGMA: f64 = 0.2;
/// Doubt about the mean specific force over a gap, m/s^2.
const GAP_ACCEL_SIGMA: f64 = 2.0;
/// Gauss-Newton stops below this fraction of a standard deviation.
const ITERATION_TOLERANCE: f64 = 1e-6;

impl Settings {
    /// The settings that `config` asks for.
    ///
    /// ```
    /// use inekf_service::config::Config;
    /// use inekf_service::engine::settings::Settings;
    ///
    /// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
    /// let settings = Settings::new(&Config::from_toml_str(text, "example")?);
    /// assert!(settings.smoother.is_none() && settings.imu.standstill.is_none());
    /// # Ok::<(), inekf_service::config::ConfigFaults>(())
    /// ```
    pub fn new(config: &Config) -> Self {
        Self {
            imu: match &config.motion {
                Motion::Inertial(inertial) => imu(inertial),
                // An engine of odometry does not read this.
                Motion::Odometry(_) => imu(&Inertial::default()),
            },
            initial: initial(config),
            fusion: fusion(config),
            smoother: config.smoother.as_ref().map(smoother),
        }
    }
}

fn imu(inertial: &Inertial) -> ImuSettings {
    let max_gap_ns = inertial.imu.max_gap_ns();
    ImuSettings {
        g_w: Vector3::new(0.0, 0.0, -inertial.gravity_mps2),
        discretisation: match inertial.discretisation {
            config::Discretisation::Zoh => Discretisation::ZeroOrderHold,
            config::Discretisation::Euler => Discretisation::Euler,
        },
        hold: inertial.hold,
        white: inertial.noise.white,
        gyro_bias_walk: inertial.noise.gyro_bias_walk,
        accel_bias_walk: inertial.noise.accel_bias_walk,
        max_gyro: inertial.imu.max_gyro_rps,
        max_accel: inertial.imu.max_accel_mps2,
        max_gap_ns,
        restart_gap_ns: match inertial.imu.on_gap {
            GapPolicy::Inflate => max_gap_ns.saturating_mul(RESTART_GAPS),
            GapPolicy::Reinitialise => max_gap_ns,
        },
        gap_gyro_sigma: GAP_GYRO_SIGMA,
        gap_accel_sigma: GAP_ACCEL_SIGMA,
        standstill: inertial
            .zero_velocity
            .as_ref()
            .map(|zero_velocity| standstill(zero_velocity, max_gap_ns)),
    }
}

fn standstill(zero_velocity: &config::ZeroVelocity, max_gap_ns: u64) -> StandstillSettings {
    StandstillSettings {
        block_ns: zero_velocity.period_ns(),
        blocks: (zero_velocity.after_s / zero_velocity.period_s).ceil() as u32,
        gyro_std: zero_velocity.gyro_std_rps,
        accel_std: zero_velocity.accel_std_mps2,
        gyro_change: zero_velocity.gyro_change_rps,
        accel_change: zero_velocity.accel_change_mps2,
        speed: zero_velocity.speed_mps,
        sigma: zero_velocity.sigma_mps,
        max_gap_ns,
    }
}

fn smoother(smoother: &config::Smoother) -> SmootherSettings {
    let (first_prior, jacobians) = match smoother.jacobians {
        config::Jacobians::Frozen => (PriorForm::GroupMean, Jacobians::Frozen),
        config::Jacobians::Exact => (PriorForm::Recentred, Jacobians::Exact),
    };
    SmootherSettings {
        parametrisation: smoother.parametrisation,
        window: WindowOptions {
            iterations: smoother.iterations as usize,
            first_prior,
            prior: match smoother.prior {
                config::Prior::Group => PriorForm::GroupMean,
                config::Prior::Linear => PriorForm::Linear,
                config::Prior::Recentred => PriorForm::Recentred,
            },
            jacobians,
            ..WindowOptions::new(smoother.window)
        },
        hand_over_sigma: smoother.hand_over_deg.map(f64::to_radians),
    }
}

fn initial(config: &Config) -> InitialSettings {
    let initial = &config.initial;
    InitialSettings {
        heading: initial.heading_deg.to_radians(),
        heading_sigma: initial.heading_sigma_deg.to_radians(),
        level: match initial.level {
            Level::Accelerometer => LevelSource::Accelerometer {
                window_ns: (initial.level_window_s * 1e9) as u64,
            },
            Level::Given => LevelSource::Given {
                roll: initial.roll_deg.to_radians(),
                pitch: initial.pitch_deg.to_radians(),
            },
        },
        level_sigma: initial.level_sigma_deg.to_radians(),
        position: match initial.position_m {
            None => PositionSource::FirstFix,
            Some(position_m) => PositionSource::Given {
                position_w: position_m.into(),
                sigma: initial.position_sigma_m,
            },
        },
        velocity_w: initial.velocity_mps.into(),
        velocity_sigma: initial.velocity_sigma_mps,
        biases: BiasPrior {
            gyro_bias: initial.gyro_bias_rps.into(),
            gyro_sigma: initial.gyro_bias_sigma_rps,
            accel_bias: initial.accel_bias_mps2.into(),
            accel_sigma: initial.accel_bias_sigma_mps2,
        },
        wait_for_request: initial.wait_for_request,
    }
}

fn fusion(config: &Config) -> FusionSettings {
    let mut sources = Sources::default();
    let mut place = |kind: FixKind, id: u32, settings: SourceSettings| {
        if let Some(slot) = sources[kind as usize].get_mut(id as usize) {
            *slot = Some(settings);
        }
    };
    for source in &config.position_sources {
        let settings = SourceSettings {
            lever_arm_b: source.lever_arm_m.into(),
            sigma_scale: source.sigma_scale,
            scale_error: source.scale_error,
        };
        place(FixKind::Position, source.id, settings);
    }
    if let Motion::Inertial(inertial) = &config.motion {
        let scaled = |sigma_scale| SourceSettings {
            lever_arm_b: Vector3::zeros(),
            sigma_scale,
            scale_error: 0.0,
        };
        for source in &inertial.velocity_sources {
            place(FixKind::Velocity, source.id, scaled(source.sigma_scale));
        }
        for source in &inertial.heading_sources {
            place(FixKind::Heading, source.id, scaled(source.sigma_scale));
        }
    }
    FusionSettings {
        update: UpdateOptions {
            iterations: config.update.iterations as usize,
            tolerance: ITERATION_TOLERANCE,
            transport: match config.update.transport {
                config::Transport::Jacobian => Transport::Jacobian,
                config::Transport::None => Transport::None,
            },
            gate: match config.update.gate_probability {
                Some(probability) => Gate::of_probability(probability),
                None => Gate::OPEN,
            },
        },
        recover_after: config.update.recover_after,
        sources,
        late_window_ns: config.late.window_ns(),
        late_capacity: config.late.capacity,
        late_method: config.late.method,
        degraded_after_ns: config.health.degraded_after_ns(),
        stack: config.stacking.as_ref().map(|stacking| StackSettings {
            sources: stacking.sources,
            tolerance_ns: stacking.tolerance_ns(),
            wait_ns: stacking.wait_ns(),
            missing: match stacking.missing {
                MissingPartner::Unconstrained => Missing::Unconstrained,
                MissingPartner::Skip => Missing::Skip,
            },
        }),
    }
}

/// Nanoseconds as seconds.
pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
