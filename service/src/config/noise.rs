//! `[noise]`: process noise, in the keys of the model; those of another model are refused.

mod inertial;
mod numbers;
mod odometry;

pub use inertial::{InertialNoise, WhiteNoise};
pub use odometry::{IncrementNoise, OdometryNoise, RowSigmas};

use super::choice::Model;
use super::motion::{ONLY_IMU, ONLY_ODOMETRY};
use super::section::Section;

/// Whether the keys of one kind of motion belong into this file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Relevance {
    /// They are those of the model.
    Required,
    /// They are those of another model.
    Foreign,
    /// The model is not known: what is given is checked, and nothing is asked for.
    Unknown,
}

/// How white noise is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// As continuous densities.
    Density,
    /// As the standard deviation of each sample or row.
    Each,
}

/// Reads the table for both kinds of motion; only what belongs to `model` means anything then.
pub(super) fn read(
    noise: &mut Section<'_, '_>,
    model: Option<Model>,
) -> (InertialNoise, OdometryNoise) {
    let (of_imu, of_odometry) = match model.map(Model::is_odometry) {
        None => (Relevance::Unknown, Relevance::Unknown),
        Some(false) => (Relevance::Required, Relevance::Foreign),
        Some(true) => (Relevance::Foreign, Relevance::Required),
    };
    let read = (
        InertialNoise::read(noise, of_imu),
        OdometryNoise::read(noise, of_odometry),
    );
    if of_imu == Relevance::Foreign {
        noise.refuse_all(&inertial::KEYS, ONLY_IMU);
    }
    if of_odometry == Relevance::Foreign {
        noise.refuse_all(&odometry::KEYS, ONLY_ODOMETRY);
    }
    read
}

/// Which of two pairs of keys is given. Both, a pair without its other half and, if they are required, neither, are
/// faults. `each` is what one sigma is for: a sample, a row.
fn form_of(
    noise: &mut Section<'_, '_>,
    density: [&'static str; 2],
    sigma: [&'static str; 2],
    each: &str,
    relevance: Relevance,
) -> Form {
    let density_given = density.iter().find(|key| noise.has(key));
    let sigma_given = sigma.iter().find(|key| noise.has(key));
    match (density_given, sigma_given) {
        _ if relevance == Relevance::Foreign => {}
        (Some(given), Some(_)) => {
            let reason =
                format!("contradicts {given}: give densities or sigmas per {each}, not both");
            noise.refuse_all(&sigma, &reason);
        }
        (Some(_), None) => demand(
            noise,
            density,
            "required beside the other density, but missing",
        ),
        (None, Some(_)) => {
            let reason = format!("required beside the other sigma per {each}, but missing");
            demand(noise, sigma, &reason);
        }
        (None, None) if relevance == Relevance::Required => {
            let reason = format!("required, but missing (or give both sigmas per {each})");
            demand(noise, density, &reason);
        }
        (None, None) => {}
    }
    if sigma_given.is_some() {
        Form::Each
    } else {
        Form::Density
    }
}

/// Notes each of `keys` that is missing.
fn demand(noise: &mut Section<'_, '_>, keys: [&'static str; 2], reason: &str) {
    for key in keys {
        if !noise.has(key) {
            noise.demand(key, reason);
        }
    }
}
