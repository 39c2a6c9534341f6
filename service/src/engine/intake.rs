//! Checks that every model's inputs go through: whatever bytes a sender wrote, the answer is a checked value or a
//! refusal by reason.

use inekf_shared::message::{
    REASON_BAD_COVARIANCE, REASON_BAD_FLAGS, REASON_NOT_FINITE, REASON_OUT_OF_RANGE,
    REASON_UNKNOWN_SOURCE,
};
use nalgebra::{Cholesky, Matrix3, Vector3};

use super::fix::FixKind;
use super::settings::{SourceSettings, Sources};
use super::tally::Refusal;

/// Farthest believable coordinate, m: beyond it double precision no longer resolves a micrometre.
pub const MAX_POSITION_M: f64 = 1e9;
/// Fastest believable velocity, m/s.
pub const MAX_VELOCITY_MPS: f64 = 1e5;
/// Largest believable standard deviation of a fix, in its own unit.
pub const MAX_SIGMA: f64 = 1e9;
/// Smallest one: below it the noise is no noise but a mistake (a variance of zero).
pub const MIN_SIGMA: f64 = 1e-9;
/// How far a covariance may be from symmetric, relative to its largest entry.
pub const ASYMMETRY: f64 = 1e-6;
/// Largest believable heading, rad: many turns are a running count, not an angle.
pub const MAX_HEADING_RAD: f64 = 1e4;

/// No flag is defined for this message.
///
/// # Errors
/// One is set.
pub fn no_flags(flags: u32) -> Result<(), Refusal> {
    if flags == 0 {
        Ok(())
    } else {
        Err(Refusal(REASON_BAD_FLAGS))
    }
}

/// The settings of a source.
///
/// # Errors
/// It is not configured.
pub fn source(sources: &Sources, kind: FixKind, id: u32) -> Result<SourceSettings, Refusal> {
    sources[kind as usize]
        .get(id as usize)
        .copied()
        .flatten()
        .ok_or(Refusal(REASON_UNKNOWN_SOURCE))
}

/// Every value is finite.
///
/// # Errors
/// One is not.
pub fn finite<'a>(mut values: impl Iterator<Item = &'a f64>) -> Result<(), Refusal> {
    if values.all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(Refusal(REASON_NOT_FINITE))
    }
}

/// A vector whose entries are finite and at most `limit` in size.
///
/// # Errors
/// One is not.
pub fn bounded(values: [f64; 3], limit: f64) -> Result<Vector3<f64>, Refusal> {
    finite(values.iter())?;
    let vector = Vector3::from(values);
    if vector.amax() > limit {
        return Err(Refusal(REASON_OUT_OF_RANGE));
    }
    Ok(vector)
}

/// A 3 x 3 covariance, scaled by its source: finite, symmetric, positive definite, believable.
///
/// # Errors
/// It is not.
pub fn covariance(row_major: &[f64; 9], settings: SourceSettings) -> Result<Matrix3<f64>, Refusal> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_no_flag_or_beyond_belief_is_refused_by_its_reason() {
        assert_eq!(no_flags(0), Ok(()));
        assert_eq!(no_flags(4), Err(Refusal(REASON_BAD_FLAGS)));
        assert_eq!(finite([1.0, 2.0].iter()), Ok(()));
        assert_eq!(
            finite([1.0, f64::NAN].iter()),
            Err(Refusal(REASON_NOT_FINITE))
        );
        assert!(bounded([300.0, 0.0, -20.0], MAX_VELOCITY_MPS).is_ok());
        // Finite, and nothing that a vehicle does.
        assert_eq!(
            bounded([1e7, 0.0, 0.0], MAX_VELOCITY_MPS),
            Err(Refusal(REASON_OUT_OF_RANGE))
        );
    }
}
