//! What the engine needs of the configuration, in SI units and radians.

use inekf::filter::{BiasPrior, Gate, Transport, UpdateOptions};
use inekf::model::{Discretisation, ImuNoise};
use inekf_shared::message::MAX_SOURCES;
use nalgebra::Vector3;

use super::fix::FixKind;
use crate::config::{self, Config, GapPolicy, Hold, Level, WhiteNoise};

/// The IMU: what it may say, how its samples are held, its noise.
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
}

impl ImuSettings {
    /// The noise over an interval of `interval_ns`.
    pub fn noise(&self, interval_ns: u64) -> ImuNoise {
        let dt_s = seconds(interval_ns);
        let (mut gyro_psd, mut accel_psd) = match self.white {
            WhiteNoise::Density { gyro, accel } => (gyro * gyro, accel * accel),
            WhiteNoise::PerSample { gyro, accel } => (gyro * gyro * dt_s, accel * accel * dt_s),
        };
        if interval_ns > self.max_gap_ns {
            gyro_psd += self.gap_gyro_sigma * self.gap_gyro_sigma * dt_s;
            accel_psd += self.gap_accel_sigma * self.gap_accel_sigma * dt_s;
        }
        ImuNoise {
            gyro_psd,
            accel_psd,
            gyro_bias_psd: self.gyro_bias_walk * self.gyro_bias_walk,
            accel_bias_psd: self.accel_bias_walk * self.accel_bias_walk,
        }
    }
}

/// Where the attitude comes from at the start.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSettings {
    /// From the IMU to the antenna, m, body frame.
    pub lever_arm_b: Vector3<f64>,
    /// Multiplies the standard deviations of its fixes.
    pub sigma_scale: f64,
}

/// The configured sources by kind and id.
pub type Sources = [[Option<SourceSettings>; MAX_SOURCES]; FixKind::COUNT];

/// How fixes are fused.
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
    /// No accepted fix for this long is degraded.
    pub degraded_after_ns: u64,
}

/// Everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The IMU.
    pub imu: ImuSettings,
    /// The first belief.
    pub initial: InitialSettings,
    /// How fixes are fused.
    pub fusion: FusionSettings,
}

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
    pub fn new(config: &Config) -> Self {
        Self {
            imu: imu(config),
            initial: initial(config),
            fusion: fusion(config),
        }
    }
}

fn imu(config: &Config) -> ImuSettings {
    let max_gap_ns = config.imu.max_gap_ns();
    ImuSettings {
        g_w: Vector3::new(0.0, 0.0, -config.gravity_mps2),
        discretisation: match config.discretisation {
            config::Discretisation::Zoh => Discretisation::ZeroOrderHold,
            config::Discretisation::Euler => Discretisation::Euler,
        },
        hold: config.hold,
        white: config.noise.white,
        gyro_bias_walk: config.noise.gyro_bias_walk,
        accel_bias_walk: config.noise.accel_bias_walk,
        max_gyro: config.imu.max_gyro_rps,
        max_accel: config.imu.max_accel_mps2,
        max_gap_ns,
        restart_gap_ns: match config.imu.on_gap {
            GapPolicy::Inflate => max_gap_ns.saturating_mul(RESTART_GAPS),
            GapPolicy::Reinitialise => max_gap_ns,
        },
        gap_gyro_sigma: GAP_GYRO_SIGMA,
        gap_accel_sigma: GAP_ACCEL_SIGMA,
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
    let mut place = |kind: FixKind, id: u32, lever_arm_m: [f64; 3], sigma_scale: f64| {
        if let Some(slot) = sources[kind as usize].get_mut(id as usize) {
            *slot = Some(SourceSettings {
                lever_arm_b: lever_arm_m.into(),
                sigma_scale,
            });
        }
    };
    for source in &config.position_sources {
        place(
            FixKind::Position,
            source.id,
            source.lever_arm_m,
            source.sigma_scale,
        );
    }
    for source in &config.velocity_sources {
        place(FixKind::Velocity, source.id, [0.0; 3], source.sigma_scale);
    }
    for source in &config.heading_sources {
        place(FixKind::Heading, source.id, [0.0; 3], source.sigma_scale);
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
        degraded_after_ns: config.health.degraded_after_ns(),
    }
}

/// Nanoseconds as seconds.
pub fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
