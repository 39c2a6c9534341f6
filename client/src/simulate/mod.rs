//! Simulated datasets: an analytic trajectory, a MEMS IMU on it, and aiding sensors.
//!
//! The simulator shares no code with the filter, so that it can judge it: attitudes are nalgebra's
//! quaternions, and the IMU sample is worked out from the motion ([`ideal_sample`]).
//!
//! IMU model, sample k for the interval from k-1 to k (`hold = "backward"`), per axis:
//! `u_k = ideal_k + b_{k-1} + density / sqrt(dt) * n`, `b_k = b_{k-1} + walk * sqrt(dt) * n`, n
//! standard normal. Fixes carry white noise and are taken at their own stamps.
//!
//! Planar odometry is simulated by [`simulate_planar`].
//!
//! ```
//! use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
//!
//! let options = SimulationOptions { duration_s: 1.0, imu_rate_hz: 100.0, ..SimulationOptions::default() };
//! let drive = simulate(Scenario::DroneLoops, &options)?;
//! assert_eq!(drive.imu.len(), 101);
//! // The same seed gives the same bytes.
//! assert_eq!(drive, simulate(Scenario::DroneLoops, &options)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod choice;
mod imu;
mod jet;
mod options;
mod planar;
mod scenario;

use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Map, json};

pub use choice::Simulation;
pub use imu::{ideal_sample, left_jacobian, left_jacobian_inverse};
pub use jet::{Jet, JetVector};
pub use options::{
    HeadingOptions, InitialOptions, PositionOptions, SimulationOptions, VelocityOptions,
};
pub use planar::{PLANAR_MISMATCH, PlanarOptions, simulate_planar};
pub use scenario::{Kinematics, Scenario, UnknownScenario};

use crate::dataset::{
    Dataset, HeadingRow, ImuBias, ImuNoise, ImuRow, Initial, Meta, PositionRow, Truth, TruthRow,
    VelocityRow,
};

/// Why a simulation was refused.
///
/// ```
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions { imu_rate_hz: -5.0, ..SimulationOptions::default() };
/// let error = simulate(Scenario::RoadCircuit, &options).expect_err("no such rate");
/// assert_eq!((error.name, error.value), ("imu_rate_hz", -5.0));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value:?} is refused: {remedy}")]
pub struct SimulationError {
    /// The option.
    pub name: &'static str,
    /// The value it has.
    pub value: f64,
    /// What it may be.
    pub remedy: &'static str,
}

/// Simulates a scenario.
///
/// The dataset's first IMU sample is at stamp 0 and its last at or before the duration. Each kind of
/// noise has its own random stream, so that switching one sensor on or off leaves the others' noise
/// as it was.
///
/// # Errors
/// [`SimulationError`] if a rate or the duration is not positive, or a deviation is negative.
///
/// ```
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
///
/// let with_fixes = SimulationOptions { duration_s: 1.0, ..SimulationOptions::default() };
/// let without = SimulationOptions { position: None, ..with_fixes.clone() };
/// // A sensor less leaves the noise of the others as it was.
/// let (with_fixes, without) = (
///     simulate(Scenario::RoadCircuit, &with_fixes)?,
///     simulate(Scenario::RoadCircuit, &without)?,
/// );
/// assert_eq!(with_fixes.imu, without.imu);
/// assert!(without.position.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn simulate(
    scenario: Scenario,
    options: &SimulationOptions,
) -> Result<Dataset, SimulationError> {
    check(options)?;
    let (imu, truth) = simulate_imu(scenario, options);
    Ok(Dataset {
        meta: meta(scenario, options, truth.first()),
        imu,
        position: simulate_position(scenario, options),
        velocity: simulate_velocity(scenario, options),
        heading: simulate_heading(scenario, options),
        truth: Truth::Spatial(decimate(&truth, options.truth_every)),
        ..Dataset::default()
    })
}

/// The random streams, one per kind of noise.
#[derive(Clone, Copy)]
enum Stream {
    Imu = 1,
    Bias,
    Position,
    Velocity,
    Heading,
    Initial,
    Odometry,
    Mismatch,
}

/// A source of standard normal vectors.
struct Noise(ChaCha12Rng);

impl Noise {
    fn new(seed: u64, stream: Stream) -> Self {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        rng.set_stream(stream as u64);
        Self(rng)
    }

    fn scalar(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Entries are drawn in the order x, y, z.
    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.scalar())
    }
}

/// Nanoseconds per second.
const NS_PER_S: f64 = 1e9;

fn seconds(stamp_ns: u64) -> f64 {
    stamp_ns as f64 / NS_PER_S
}

/// Stamps of a sensor: `offset + k / rate`, rounded to nanoseconds, up to the duration.
fn stamps(rate_hz: f64, offset_s: f64, duration_s: f64) -> impl Iterator<Item = u64> {
    (0_u64..)
        .map(move |k| offset_s + k as f64 / rate_hz)
        // A stamp that rounding put past the end by less than half a nanosecond still counts.
        .take_while(move |t_s| *t_s <= duration_s + 0.5 / NS_PER_S)
        .map(|t_s| (t_s * NS_PER_S).round() as u64)
}

fn simulate_imu(scenario: Scenario, options: &SimulationOptions) -> (Vec<ImuRow>, Vec<TruthRow>) {
    let mut noise = Noise::new(options.seed, Stream::Imu);
    let mut walk = Noise::new(options.seed, Stream::Bias);
    let mut gyro_bias = walk.vector() * options.gyro_bias_sigma_rps;
    let mut accel_bias = walk.vector() * options.accel_bias_sigma_mps2;
    let mut before: Option<(u64, Kinematics)> = None;
    let (mut samples, mut truth) = (Vec::new(), Vec::new());
    for stamp_ns in stamps(options.imu_rate_hz, 0.0, options.duration_s) {
        let after = scenario.at(seconds(stamp_ns));
        // The first sample speaks for the interval before the start, where the bias stays as drawn.
        let (dt_s, previous) = match before {
            Some((last_ns, previous)) => (seconds(stamp_ns - last_ns), previous),
            None => (
                options.imu_rate_hz.recip(),
                scenario.at(-options.imu_rate_hz.recip()),
            ),
        };
        let (gyro, accel) = ideal_sample(&previous, &after, dt_s, options.gravity_mps2);
        let gyro_noise = noise.vector() * (options.gyro_density / dt_s.sqrt());
        let accel_noise = noise.vector() * (options.accel_density / dt_s.sqrt());
        samples.push(ImuRow {
            stamp_ns,
            gyro_rps: (gyro + gyro_bias + gyro_noise).into(),
            accel_mps2: (accel + accel_bias + accel_noise).into(),
        });
        if before.is_some() {
            gyro_bias += walk.vector() * (options.gyro_bias_walk * dt_s.sqrt());
            accel_bias += walk.vector() * (options.accel_bias_walk * dt_s.sqrt());
        }
        let bias = ImuBias {
            gyro_rps: gyro_bias.into(),
            accel_mps2: accel_bias.into(),
        };
        truth.push(TruthRow {
            stamp_ns,
            q_wb: after.q_wb.coords.into(),
            v_w_mps: after.v_w_mps.into(),
            p_w_m: after.p_w_m.into(),
            bias: Some(bias),
        });
        before = Some((stamp_ns, after));
    }
    (samples, truth)
}

fn simulate_position(scenario: Scenario, options: &SimulationOptions) -> Vec<PositionRow> {
    let Some(fix) = &options.position else {
        return Vec::new();
    };
    let mut noise = Noise::new(options.seed, Stream::Position);
    let (lever_arm_b, sigma) = (Vector3::from(fix.lever_arm_b_m), Vector3::from(fix.sigma_m));
    stamps(fix.rate_hz, fix.offset_s, options.duration_s)
        .map(|stamp_ns| {
            let motion = scenario.at(seconds(stamp_ns));
            let antenna_w = motion.p_w_m + motion.q_wb * lever_arm_b;
            PositionRow {
                stamp_ns,
                source: 0,
                dimension: 3,
                position_w_m: (antenna_w + sigma.component_mul(&noise.vector())).into(),
                sigma_m: fix.sigma_m,
            }
        })
        .collect()
}

fn simulate_velocity(scenario: Scenario, options: &SimulationOptions) -> Vec<VelocityRow> {
    let Some(fix) = &options.velocity else {
        return Vec::new();
    };
    let mut noise = Noise::new(options.seed, Stream::Velocity);
    let sigma = Vector3::from(fix.sigma_mps);
    stamps(fix.rate_hz, fix.offset_s, options.duration_s)
        .map(|stamp_ns| {
            let velocity = scenario.at(seconds(stamp_ns)).v_w_mps;
            let velocity_w_mps = (velocity + sigma.component_mul(&noise.vector())).into();
            VelocityRow {
                stamp_ns,
                source: 0,
                velocity_w_mps,
                sigma_mps: fix.sigma_mps,
            }
        })
        .collect()
}

fn simulate_heading(scenario: Scenario, options: &SimulationOptions) -> Vec<HeadingRow> {
    let Some(fix) = &options.heading else {
        return Vec::new();
    };
    let mut noise = Noise::new(options.seed, Stream::Heading);
    stamps(fix.rate_hz, fix.offset_s, options.duration_s)
        .map(|stamp_ns| {
            let nose_w = scenario.at(seconds(stamp_ns)).q_wb * Vector3::x();
            let heading_rad = nose_w.y.atan2(nose_w.x) + fix.sigma_rad * noise.scalar();
            HeadingRow {
                stamp_ns,
                source: 0,
                heading_rad,
                sigma_rad: fix.sigma_rad,
            }
        })
        .collect()
}

/// Every n-th row, from the first.
fn decimate(truth: &[TruthRow], every: u32) -> Vec<TruthRow> {
    truth
        .iter()
        .step_by(usize::try_from(every).unwrap_or(usize::MAX))
        .copied()
        .collect()
}

fn meta(scenario: Scenario, options: &SimulationOptions, start: Option<&TruthRow>) -> Meta {
    let mut kind = "imu".to_owned();
    let mut other = Map::new();
    other.insert("real".to_owned(), json!(false));
    other.insert("seed".to_owned(), json!(options.seed));
    other.insert("hold".to_owned(), json!("backward"));
    other.insert("imu_rate_hz".to_owned(), json!(options.imu_rate_hz));
    other.insert("duration_s".to_owned(), json!(options.duration_s));
    let truth_rate_hz = options.imu_rate_hz / f64::from(options.truth_every);
    other.insert("truth_rate_hz".to_owned(), json!(truth_rate_hz));
    if let Some(bias) = start.and_then(|row| row.bias) {
        other.insert("gyro_bias_at_start_rps".to_owned(), json!(bias.gyro_rps));
        other.insert(
            "accel_bias_at_start_mps2".to_owned(),
            json!(bias.accel_mps2),
        );
    }
    let rates = [
        ("position", options.position.as_ref().map(|fix| fix.rate_hz)),
        ("velocity", options.velocity.as_ref().map(|fix| fix.rate_hz)),
        ("heading", options.heading.as_ref().map(|fix| fix.rate_hz)),
    ];
    for (sensor, rate_hz) in rates {
        if let Some(rate_hz) = rate_hz {
            kind = format!("{kind}+{sensor}");
            other.insert(format!("{sensor}_rate_hz"), json!(rate_hz));
        }
    }
    let initial = options.initial.as_ref().zip(start);
    Meta {
        name: scenario.name().to_owned(),
        kind,
        gravity_mps2: Some(options.gravity_mps2),
        lever_arms_m: options
            .position
            .iter()
            .map(|fix| fix.lever_arm_b_m)
            .collect(),
        imu_noise: Some(ImuNoise {
            gyro_density: options.gyro_density,
            accel_density: options.accel_density,
            gyro_bias_walk: options.gyro_bias_walk,
            accel_bias_walk: options.accel_bias_walk,
        }),
        initial: initial.map(|(sigmas, start)| draw_initial(options.seed, sigmas, start)),
        p0_diag: options
            .initial
            .as_ref()
            .map(|sigmas| initial_variances(options, sigmas)),
        other,
    }
}

/// An initial state off the truth by a drawn `xi`: `chi_hat = chi * exp(-xi)` on SE_2(3). The
/// believed biases are zero; their error is the bias itself.
fn draw_initial(seed: u64, sigmas: &InitialOptions, start: &TruthRow) -> Initial {
    let mut noise = Noise::new(seed, Stream::Initial);
    let mut draw = |sigma: &[f64; 3]| -noise.vector().component_mul(&Vector3::from(*sigma));
    let rotation = draw(&sigmas.rotation_sigma_rad);
    let velocity = draw(&sigmas.velocity_sigma_mps);
    let position = draw(&sigmas.position_sigma_m);
    let q_wb = UnitQuaternion::new_unchecked(nalgebra::Quaternion::from(start.q_wb));
    let jacobian = left_jacobian(&rotation);
    Initial::Spatial {
        stamp_ns: start.stamp_ns,
        q_wb: (q_wb * UnitQuaternion::from_scaled_axis(rotation))
            .coords
            .into(),
        v_w_mps: (Vector3::from(start.v_w_mps) + q_wb * (jacobian * velocity)).into(),
        p_w_m: (Vector3::from(start.p_w_m) + q_wb * (jacobian * position)).into(),
        gyro_bias_rps: [0.0; 3],
        accel_bias_mps2: [0.0; 3],
    }
}

/// The 15 variances that belong to [`draw_initial`], in the order of the contract.
fn initial_variances(options: &SimulationOptions, sigmas: &InitialOptions) -> Vec<f64> {
    let bias = [
        [options.gyro_bias_sigma_rps; 3],
        [options.accel_bias_sigma_mps2; 3],
    ];
    [
        sigmas.rotation_sigma_rad,
        sigmas.velocity_sigma_mps,
        sigmas.position_sigma_m,
    ]
    .iter()
    .chain(&bias)
    .flatten()
    .map(|sigma| sigma * sigma)
    .collect()
}

/// The most IMU samples of one dataset: about 4 GB with their truth.
const MAX_SAMPLES: f64 = 2e7;

/// Refuses what cannot be simulated.
fn check(options: &SimulationOptions) -> Result<(), SimulationError> {
    check_length("imu_rate_hz", options.imu_rate_hz, options.duration_s)?;
    let mut positive = vec![("truth_every", f64::from(options.truth_every))];
    let mut not_negative = vec![
        ("gravity_mps2", options.gravity_mps2),
        ("gyro_density", options.gyro_density),
        ("accel_density", options.accel_density),
        ("gyro_bias_walk", options.gyro_bias_walk),
        ("accel_bias_walk", options.accel_bias_walk),
        ("gyro_bias_sigma_rps", options.gyro_bias_sigma_rps),
        ("accel_bias_sigma_mps2", options.accel_bias_sigma_mps2),
    ];
    if let Some(fix) = &options.position {
        positive.push(("position.rate_hz", fix.rate_hz));
        not_negative.push(("position.offset_s", fix.offset_s));
        not_negative.extend(fix.sigma_m.map(|sigma| ("position.sigma_m", sigma)));
    }
    if let Some(fix) = &options.velocity {
        positive.push(("velocity.rate_hz", fix.rate_hz));
        not_negative.push(("velocity.offset_s", fix.offset_s));
        not_negative.extend(fix.sigma_mps.map(|sigma| ("velocity.sigma_mps", sigma)));
    }
    if let Some(fix) = &options.heading {
        positive.push(("heading.rate_hz", fix.rate_hz));
        not_negative.push(("heading.offset_s", fix.offset_s));
        not_negative.push(("heading.sigma_rad", fix.sigma_rad));
    }
    for (name, value) in positive {
        check_positive(name, value)?;
    }
    let bad = not_negative
        .into_iter()
        .find(|(_, value)| !(*value >= 0.0 && value.is_finite()));
    bad.map_or(Ok(()), |(name, value)| {
        Err(SimulationError {
            name,
            value,
            remedy: "give a finite number, 0 or more",
        })
    })
}

/// Refuses a rate, named `rate`, and a duration that do not make a dataset.
fn check_length(rate: &'static str, rate_hz: f64, duration_s: f64) -> Result<(), SimulationError> {
    check_positive(rate, rate_hz)?;
    check_positive("duration_s", duration_s)?;
    let samples = rate_hz * duration_s;
    if samples > MAX_SAMPLES {
        return Err(SimulationError {
            name: "rate * duration_s",
            value: samples,
            remedy: "a dataset in memory holds 2e7 samples",
        });
    }
    Ok(())
}

/// Refuses what is not above 0. Above a rate of 1e6 two samples would share a stamp; that refuses infinity too.
fn check_positive(name: &'static str, value: f64) -> Result<(), SimulationError> {
    if value > 0.0 && value <= 1e6 {
        return Ok(());
    }
    Err(SimulationError {
        name,
        value,
        remedy: "give a number above 0, at most 1e6",
    })
}
