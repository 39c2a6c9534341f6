//! Checks on what comes in for the model `imu`.

use inekf::model::{HeadingObservation, ImuInput, PositionObservation, VelocityObservation};
use inekf_shared::message::{
    HeadingFix, ImuSample, PositionFix, REASON_BAD_COVARIANCE, REASON_BAD_DIMENSION,
    REASON_OUT_OF_RANGE, VelocityFix,
};
use nalgebra::Vector3;

use super::super::fix::{Fix, FixKind};
use super::super::intake::{
    MAX_HEADING_RAD, MAX_POSITION_M, MAX_SIGMA, MAX_VELOCITY_MPS, MIN_SIGMA, bounded, covariance,
    finite, no_flags, source,
};
use super::super::settings::{ImuSettings, Sources};
use super::super::tally::Refusal;
use super::aiding::Aiding;

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
pub fn position(message: &PositionFix, sources: &Sources) -> Result<Fix<Aiding>, Refusal> {
    if message.dimension != 3 {
        return Err(Refusal(REASON_BAD_DIMENSION));
    }
    let settings = source(sources, FixKind::Position, message.source)?;
    let position_w = bounded(message.position_w_m, MAX_POSITION_M)?;
    let covariance_w = covariance(&message.covariance_w_m2, settings)?;
    Ok(Fix {
        stamp_ns: message.header.stamp_ns,
        source: message.source,
        partner: None,
        seq: message.header.seq,
        measurement: Aiding::Position(PositionObservation {
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
pub fn velocity(message: &VelocityFix, sources: &Sources) -> Result<Fix<Aiding>, Refusal> {
    no_flags(message.flags)?;
    let settings = source(sources, FixKind::Velocity, message.source)?;
    let velocity_w = bounded(message.velocity_w_mps, MAX_VELOCITY_MPS)?;
    let covariance_w = covariance(&message.covariance_w, settings)?;
    Ok(Fix {
        stamp_ns: message.header.stamp_ns,
        source: message.source,
        partner: None,
        seq: message.header.seq,
        measurement: Aiding::Velocity(VelocityObservation {
            velocity_w,
            covariance_w,
        }),
    })
}

/// A checked heading fix.
///
/// # Errors
/// By reason; see the constants of `inekf_shared::message`.
pub fn heading(message: &HeadingFix, sources: &Sources) -> Result<Fix<Aiding>, Refusal> {
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
        partner: None,
        seq: message.header.seq,
        measurement: Aiding::Heading(HeadingObservation {
            heading: message.heading_rad,
            sigma,
        }),
    })
}
