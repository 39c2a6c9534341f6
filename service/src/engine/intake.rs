//! Checks on what comes in: whatever bytes a sender wrote, the answer is a checked value or a
//! refusal by reason.

use inekf::model::{HeadingObservation, ImuInput, PositionObservation, VelocityObservation};
use inekf_shared::message::{
    HeadingFix, ImuSample, PositionFix, REASON_BAD_COVARIANCE, REASON_BAD_DIMENSION,
    REASON_BAD_FLAGS, REASON_NOT_FINITE, REASON_OUT_OF_RANGE, REASON_UNKNOWN_SOURCE, VelocityFix,
};
use nalgebra::{Cholesky, Matrix3, Vector3};

use super::fix::{Fix, FixKind, Measurement};
use super::settings::{ImuSettings, SourceSettings, Sources};
use super::tally::Refusal;

/// Farthest believable coordinate, m: beyond it double precision no longer resolves a micrometre.
const MAX_POSITION_M: f64 = 1e9;
/// Fastest believable velocity, m/s.
const MAX_VELOCITY_MPS: f64 = 1e5;
/// Largest believable standard deviation of a fix, in its own unit.
const MAX_SIGMA: f64 = 1e9;
/// Smallest one: below it the noise is no noise but a mistake (a variance of zero).
const MIN_SIGMA: f64 = 1e-9;
/// How far a covariance may be from symmetric, relative to its largest entry.
const ASYMMETRY: f64 = 1e-6;
/// Largest believable heading, rad: many turns are a running count, not an angle.
const MAX_HEADING_RAD: f64 = 1e4;

/// A checked IMU sample.
///
/// # Errors
/// Not finite, or beyond what `settings` believes.
pub fn imu(sample: &ImuSample, settings: &ImuSettings) -> Result<ImuInput, Refusal> {
    let omega_b = Vector3::from(sample.gyro_rps);
    let force_b = Vector3::from(sample.accel_mps2);
    finite(omega_b.iter().chain(force_b.iter()))?;
    if omega_b.amax() > settings.max_gyro || force_b.amax() > settings.max_accel {
        return Err(Refusal(REASON_OUT_OF_RANGE));
    }
    Ok(ImuInput { omega_b, force_b })
}

/// A checked position fix.
///
/// # Errors
/// By reason; see the constants of `inekf_shared::message`.
pub fn position(message: &PositionFix, sources: &Sources) -> Result<Fix, Refusal> {
    if message.dimension != 3 {
        return Err(Refusal(REASON_BAD_DIMENSION));
    }
    let settings = source(sources, FixKind::Position, message.source)?;
    let position_w = bounded(message.position_w_m, MAX_POSITION_M)?;
    let covariance_w = covariance(&message.covariance_w_m2, settings)?;
    Ok(Fix {
        stamp_ns: message.header.stamp_ns,
        source: message.source,
        seq: message.header.seq,
        measurement: Measurement::Position(PositionObservation {
            position_w,
            covariance_w,
            lever_arm_b: settings.lever_arm_b,
        }),
    })
}

/// A checked velocity fix.
///
/// # Errors
/// By reason; see the constants of `inekf_shared::message`.
pub fn velocity(message: &VelocityFix, sources: &Sources) -> Result<Fix, Refusal> {
    no_flags(message.flags)?;
    let settings = source(sources, FixKind::Velocity, message.source)?;
    let velocity_w = bounded(message.velocity_w_mps, MAX_VELOCITY_MPS)?;
    let covariance_w = covariance(&message.covariance_w, settings)?;
    Ok(Fix {
        stamp_ns: message.header.stamp_ns,
        source: message.source,
        seq: message.header.seq,
        measurement: Measurement::Velocity(VelocityObservation {
            velocity_w,
            covariance_w,
        }),
    })
}

/// A checked heading fix.
///
/// # Errors
/// By reason; see the constants of `inekf_shared::message`.
pub fn heading(message: &HeadingFix, sources: &Sources) -> Result<Fix, Refusal> {
    no_flags(message.flags)?;
    let settings = source(sources, FixKind::Heading, message.source)?;
    finite([message.heading_rad, message.sigma_rad].iter())?;
    if message.heading_rad.abs() > MAX_HEADING_RAD {
        return Err(Refusal(REASON_OUT_OF_RANGE));
    }
    let sigma = message.sigma_rad * settings.sigma_scale;
    if !(MIN_SIGMA..=MAX_SIGMA).contains(&sigma) {
        return Err(Refusal(REASON_BAD_COVARIANCE));
    }
    Ok(Fix {
        stamp_ns: message.header.stamp_ns,
        source: message.source,
        seq: message.header.seq,
        measurement: Measurement::Heading(HeadingObservation {
            heading: message.heading_rad,
            sigma,
        }),
    })
}

fn no_flags(flags: u32) -> Result<(), Refusal> {
    if flags == 0 {
        Ok(())
    } else {
        Err(Refusal(REASON_BAD_FLAGS))
    }
}

fn source(sources: &Sources, kind: FixKind, id: u32) -> Result<SourceSettings, Refusal> {
    sources[kind as usize]
        .get(id as usize)
        .copied()
        .flatten()
        .ok_or(Refusal(REASON_UNKNOWN_SOURCE))
}

fn finite<'a>(mut values: impl Iterator<Item = &'a f64>) -> Result<(), Refusal> {
    if values.all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(Refusal(REASON_NOT_FINITE))
    }
}

fn bounded(values: [f64; 3], limit: f64) -> Result<Vector3<f64>, Refusal> {
    finite(values.iter())?;
    let vector = Vector3::from(values);
    if vector.amax() > limit {
        return Err(Refusal(REASON_OUT_OF_RANGE));
    }
    Ok(vector)
}

/// A 3 x 3 covariance, scaled by its source: finite, symmetric, positive definite, believable.
fn covariance(row_major: &[f64; 9], settings: SourceSettings) -> Result<Matrix3<f64>, Refusal> {
    finite(row_major.iter())?;
    let bad = Err(Refusal(REASON_BAD_COVARIANCE));
    let raw = Matrix3::from_row_slice(row_major);
    let scale = settings.sigma_scale * settings.sigma_scale;
    let symmetric = (raw + raw.transpose()) * (0.5 * scale);
    let variances = MIN_SIGMA * MIN_SIGMA..=MAX_SIGMA * MAX_SIGMA;
    if (raw - raw.transpose()).amax() > ASYMMETRY * raw.amax()
        || !symmetric.diagonal().iter().all(|v| variances.contains(v))
        || Cholesky::new(symmetric).is_none()
    {
        return bad;
    }
    Ok(symmetric)
}
