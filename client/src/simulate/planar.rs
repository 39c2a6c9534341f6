//! The drive of \[LC\] section VII: planar odometry and two position sources whose models are wrong.
//!
//! A robot starts at (-30, 30) m with a heading of pi/6 rad, drives at 10 m/s, turns right by a right angle from 15 s
//! to 18 s, and drives on. With mismatches `e_u, e_y, psi`, drawn once for a run, that no filter is told:
//!
//! ```text
//! chi_k = chi_{k-1} (Omega, (1 + e_u) u)      y0 = R(psi)^T x + 3 m      y1 = (1 + e_y) x + 3 m
//! ```
//!
//! Odometry noise 0.001 rad/s and 0.01 m/s, constant over a step; the start is off by 0.03 rad and 3 m, and
//! `meta.json` says so. World axes east and north; order `(theta, x, y)`, rad and m. A fix of each source at the end
//! of every step.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use nalgebra::{Rotation2, Vector2, Vector3};
use rand_distr::{Distribution, StandardUniform};
use serde_json::{Map, json};

use super::{NS_PER_S, Noise, SimulationError, Stream, check_length, seconds, stamps};
use crate::dataset::{
    Dataset, Initial, Meta, Odometry, Odometry2dRow, PositionRow, Truth, Truth2dRow,
};

/// The name on the command line.
pub const PLANAR_MISMATCH: &str = "planar-mismatch";

const START: Pose = Pose {
    theta_rad: FRAC_PI_6,
    p_w_m: Vector2::new(-30.0, 30.0),
};
const SPEED_MPS: f64 = 10.0;
/// The turn begins and ends, s.
const TURN_S: [f64; 2] = [15.0, 18.0];
/// Standard deviation of a fix on each axis, m.
const SIGMA_FIX_M: f64 = 3.0;
/// Standard deviations of the odometry, rad/s and m/s.
const SIGMAS_ODOMETRY: Vector3<f64> = Vector3::new(1e-3, 1e-2, 1e-2);
/// Standard deviations of the start, rad and m.
const SIGMAS_START: Vector3<f64> = Vector3::new(0.03, 3.0, 3.0);

/// Options of the planar drive.
///
/// ```
/// use inekf_client::simulate::{PlanarOptions, simulate_planar};
///
/// let options = PlanarOptions { rate_hz: 20.0, duration_s: 2.0, ..PlanarOptions::default() };
/// // Two sources, a fix of each at the end of every step.
/// assert_eq!(simulate_planar(&options)?.position.len(), 2 * 40);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarOptions {
    /// Seed of mismatches and noise; default 1. The same options give the same dataset bit for bit.
    pub seed: u64,
    /// Rate of the odometry and of each position source, Hz; default 10.
    pub rate_hz: f64,
    /// Duration, s; default 33.
    pub duration_s: f64,
}

impl Default for PlanarOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            rate_hz: 10.0,
            duration_s: 33.0,
        }
    }
}

/// How the models are wrong, for a whole run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mismatch {
    odometry_scale: f64,
    scale_source1: f64,
    rotation_source0_rad: f64,
}

impl Mismatch {
    /// Uniform, within the paper's bounds.
    fn draw(seed: u64) -> Self {
        let mut noise = Noise::new(seed, Stream::Mismatch);
        let mut between = |low: f64, high: f64| {
            let share: f64 = StandardUniform.sample(&mut noise.0);
            low + share * (high - low)
        };
        Self {
            odometry_scale: between(-0.07, 0.15),
            scale_source1: between(-0.1, 0.1),
            rotation_source0_rad: between(-0.05, 0.05),
        }
    }
}

/// A pose in the plane, or a motion in the body frame.
#[derive(Clone, Copy, Debug)]
struct Pose {
    theta_rad: f64,
    p_w_m: Vector2<f64>,
}

impl Pose {
    /// The exponential of `(theta, x, y)`: a turn and a way at constant rates.
    fn exp(twist: &Vector3<f64>) -> Self {
        let half = 0.5 * twist.x;
        // The mean direction on an arc is that of its chord, which is shorter by sin(half) / half.
        let shrink = if half == 0.0 { 1.0 } else { half.sin() / half };
        Self {
            theta_rad: twist.x,
            p_w_m: Rotation2::new(half) * twist.yz() * shrink,
        }
    }

    /// The pose after the motion `step`.
    fn then(&self, step: &Self) -> Self {
        Self {
            theta_rad: self.theta_rad + step.theta_rad,
            p_w_m: self.p_w_m + Rotation2::new(self.theta_rad) * step.p_w_m,
        }
    }
}

/// Simulates the drive: odometry, two position sources, truth, and the state to start from.
///
/// # Errors
/// [`SimulationError`] if rate or duration is not positive, or there would be too many rows.
///
/// ```
/// use inekf_client::dataset::Truth;
/// use inekf_client::simulate::{PlanarOptions, simulate_planar};
///
/// let drive = simulate_planar(&PlanarOptions { duration_s: 1.0, ..PlanarOptions::default() })?;
/// let Truth::Planar(truth) = &drive.truth else { unreachable!() };
/// assert_eq!(truth[0].p_w_m, [-30.0, 30.0]);
/// // It starts from a state that is off, with the variances that say by how much.
/// assert!(drive.meta.initial.is_some());
/// assert_eq!(drive.meta.p0_diag.as_deref().map(<[f64]>::len), Some(3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simulate_planar(options: &PlanarOptions) -> Result<Dataset, SimulationError> {
    check_length("rate_hz", options.rate_hz, options.duration_s)?;
    let mismatch = Mismatch::draw(options.seed);
    let mut odometry_noise = Noise::new(options.seed, Stream::Odometry);
    let mut fix_noise = Noise::new(options.seed, Stream::Position);
    let (mut odometry, mut position) = (Vec::new(), Vec::new());
    let mut pose = START;
    let mut truth = vec![truth_row(0, &pose)];
    let mut before_ns = 0;
    for stamp_ns in stamps(options.rate_hz, 0.0, options.duration_s).skip(1) {
        let (begin_s, end_s) = (seconds(before_ns), seconds(stamp_ns));
        let dt_s = seconds(stamp_ns - before_ns);
        let motion = Pose::exp(&Vector3::new(
            turn_rad(begin_s, end_s),
            SPEED_MPS * dt_s,
            0.0,
        ));
        pose = pose.then(&Pose {
            p_w_m: motion.p_w_m * (1.0 + mismatch.odometry_scale),
            ..motion
        });
        let disturbance = SIGMAS_ODOMETRY.component_mul(&odometry_noise.vector()) * dt_s;
        let seen = motion.then(&Pose::exp(&disturbance));
        odometry.push(Odometry2dRow {
            stamp_ns,
            dtheta_rad: seen.theta_rad,
            translation_m: seen.p_w_m.into(),
        });
        position.extend(fixes(stamp_ns, &pose, &mismatch, &mut fix_noise));
        truth.push(truth_row(stamp_ns, &pose));
        before_ns = stamp_ns;
    }
    Ok(Dataset {
        meta: meta(options, &mismatch),
        odometry: Odometry::Planar(odometry),
        position,
        truth: Truth::Planar(truth),
        ..Dataset::default()
    })
}

/// What the two sources say of a pose.
fn fixes(stamp_ns: u64, pose: &Pose, mismatch: &Mismatch, noise: &mut Noise) -> [PositionRow; 2] {
    let rotated = Rotation2::new(-mismatch.rotation_source0_rad) * pose.p_w_m;
    let scaled = pose.p_w_m * (1.0 + mismatch.scale_source1);
    [(0, rotated), (1, scaled)].map(|(source, seen)| {
        let noise = Vector2::from_fn(|_, _| noise.scalar());
        let position = seen + SIGMA_FIX_M * noise;
        PositionRow {
            stamp_ns,
            source,
            dimension: 2,
            position_w_m: [position.x, position.y, 0.0],
            sigma_m: [SIGMA_FIX_M, SIGMA_FIX_M, 0.0],
        }
    })
}

fn truth_row(stamp_ns: u64, pose: &Pose) -> Truth2dRow {
    Truth2dRow {
        stamp_ns,
        theta_rad: pose.theta_rad,
        p_w_m: pose.p_w_m.into(),
    }
}

/// How far the robot turns between two times, rad.
fn turn_rad(begin_s: f64, end_s: f64) -> f64 {
    let [from_s, to_s] = TURN_S;
    let within_s = (end_s.min(to_s) - begin_s.max(from_s)).max(0.0);
    -FRAC_PI_2 * within_s / (to_s - from_s)
}

fn meta(options: &PlanarOptions, mismatch: &Mismatch) -> Meta {
    let mut noise = Noise::new(options.seed, Stream::Initial);
    let off = SIGMAS_START.component_mul(&noise.vector());
    let variances = |sigmas: Vector3<f64>| -> Vec<f64> {
        sigmas.component_mul(&sigmas).iter().copied().collect()
    };
    let mut other = Map::new();
    let mut say = |key: &str, value| other.insert(key.to_owned(), value);
    say("real", json!(false));
    say("seed", json!(options.seed));
    say("dt_ns", json!((NS_PER_S / options.rate_hz).round() as u64));
    say("duration_s", json!(options.duration_s));
    say("odometry_rate_hz", json!(options.rate_hz));
    say("position_rate_hz", json!(options.rate_hz));
    say("position_sigma", json!(SIGMA_FIX_M));
    let per_step = variances(SIGMAS_ODOMETRY / options.rate_hz);
    say("Q_diag_per_step", json!(per_step));
    say(
        "mismatch",
        json!({
            "odometry_scale": mismatch.odometry_scale,
            "scale_source1": mismatch.scale_source1,
            "rotation_source0": mismatch.rotation_source0_rad,
        }),
    );
    Meta {
        name: PLANAR_MISMATCH.to_owned(),
        kind: "odometry2d+position".to_owned(),
        lever_arms_m: vec![[0.0; 3]; 2],
        initial: Some(Initial::Planar {
            stamp_ns: 0,
            theta_rad: START.theta_rad + off.x,
            p_w_m: (START.p_w_m + off.yz()).into(),
        }),
        p0_diag: Some(variances(SIGMAS_START)),
        other,
        ..Meta::default()
    }
}
