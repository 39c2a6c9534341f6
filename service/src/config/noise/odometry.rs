//! The noise of odometry: white noise of each row's increment, and what grows with the way or the turn of the row.
//!
//! White noise is given either as a continuous density `n` (the increment of a row that stands for `dt` seconds then
//! has the standard deviation `n sqrt(dt)`) or as the standard deviation of each row, whatever its interval. To it
//! comes, in variances, what slip adds: proportional to the length of the row's way, or to its turn.

use super::super::interval::Interval;
use super::super::section::Section;
use super::{Form, Relevance, form_of};

/// Process noise of odometry.
///
/// ```
#[doc = include_str!("../example.txt")]
/// let noise = odometry(format!("{ODOMETRY}rotation_per_sqrt_m = 1e-3\n"))?.noise;
/// assert_eq!((noise.rotation_per_sqrt_m, noise.translation_per_sqrt_m), (1e-3, 0.0));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryNoise {
    /// White noise of the increments.
    pub white: IncrementNoise,
    /// Rotation, by the root of the way, rad/sqrt(m).
    pub rotation_per_sqrt_m: f64,
    /// Rotation, by the root of the turn, rad/sqrt(rad).
    pub rotation_per_sqrt_rad: f64,
    /// Translation on every axis, by the root of the way, m/sqrt(m).
    pub translation_per_sqrt_m: f64,
}

/// White noise of a row's rotation and translation, both in the same form. Lateral is across the direction of
/// travel: body y, and in space body z too; if the file does not say, it is as the translation.
///
/// ```
#[doc = include_str!("../example.txt")]
/// // Across the direction of travel as along it, if the file does not say.
/// let densities = IncrementNoise::Density { rotation: 3e-3, translation: 1e-2, lateral: 1e-2 };
/// assert_eq!(odometry(ODOMETRY.to_owned())?.noise.white, densities);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IncrementNoise {
    /// Continuous densities.
    Density {
        /// Rotation on every axis, rad/sqrt(s).
        rotation: f64,
        /// Translation along body x, m/sqrt(s).
        translation: f64,
        /// Translation across it, m/sqrt(s).
        lateral: f64,
    },
    /// Standard deviations of one row.
    PerRow {
        /// Rotation on every axis, rad.
        rotation: f64,
        /// Translation along body x, m.
        translation: f64,
        /// Translation across it, m.
        lateral: f64,
    },
}

/// Standard deviations of one row's increment.
///
/// ```
#[doc = include_str!("../example.txt")]
/// let noise = odometry(format!("{ODOMETRY}lateral_density = 2e-2\n"))?.noise;
/// let RowSigmas { translation, lateral, .. } = noise.row_sigmas(0.01, 0.0, 0.0);
/// assert!((lateral - 2.0 * translation).abs() < 1e-12);
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSigmas {
    /// Rotation on every axis, rad.
    pub rotation: f64,
    /// Translation along body x, m.
    pub translation: f64,
    /// Translation across it, m.
    pub lateral: f64,
}

impl OdometryNoise {
    /// The same with every standard deviation multiplied.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            white: self.white.scaled(factor),
            rotation_per_sqrt_m: self.rotation_per_sqrt_m * factor,
            rotation_per_sqrt_rad: self.rotation_per_sqrt_rad * factor,
            translation_per_sqrt_m: self.translation_per_sqrt_m * factor,
        }
    }

    /// The standard deviations of a row that stands for `interval_s` seconds, goes `way_m` metres and turns by
    /// `turn_rad` radians; none of them may be negative.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// let noise = odometry(format!("{ODOMETRY}translation_per_sqrt_m = 0.1\n"))?.noise;
    /// // White noise by the root of the time; with the root of the way comes what slip adds.
    /// let (standing, moving) = (noise.row_sigmas(0.04, 0.0, 0.0), noise.row_sigmas(0.04, 9.0, 0.0));
    /// assert!((standing.translation - 1e-2 * 0.2).abs() < 1e-12);
    /// assert!((moving.translation.powi(2) - standing.translation.powi(2) - 0.01 * 9.0).abs() < 1e-12);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub fn row_sigmas(&self, interval_s: f64, way_m: f64, turn_rad: f64) -> RowSigmas {
        let white = self.white.row_sigmas(interval_s);
        let squared = |sigma: f64| sigma * sigma;
        let of_rotation = squared(self.rotation_per_sqrt_m) * way_m
            + squared(self.rotation_per_sqrt_rad) * turn_rad;
        let of_translation = squared(self.translation_per_sqrt_m) * way_m;
        RowSigmas {
            rotation: (squared(white.rotation) + of_rotation).sqrt(),
            translation: (squared(white.translation) + of_translation).sqrt(),
            lateral: (squared(white.lateral) + of_translation).sqrt(),
        }
    }
}

impl IncrementNoise {
    fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Density {
                rotation,
                translation,
                lateral,
            } => Self::Density {
                rotation: rotation * factor,
                translation: translation * factor,
                lateral: lateral * factor,
            },
            Self::PerRow {
                rotation,
                translation,
                lateral,
            } => Self::PerRow {
                rotation: rotation * factor,
                translation: translation * factor,
                lateral: lateral * factor,
            },
        }
    }

    /// The standard deviations of a row that stands for `interval_s` seconds, which may not be negative.
    fn row_sigmas(self, interval_s: f64) -> RowSigmas {
        match self {
            Self::Density {
                rotation,
                translation,
                lateral,
            } => {
                let root = interval_s.sqrt();
                RowSigmas {
                    rotation: rotation * root,
                    translation: translation * root,
                    lateral: lateral * root,
                }
            }
            Self::PerRow {
                rotation,
                translation,
                lateral,
            } => RowSigmas {
                rotation,
                translation,
                lateral,
            },
        }
    }
}

/// What each number of the rotation may be, in its own unit.
pub(super) const ROTATION_RANGE: Interval = Interval::closed(0.0, 10.0);
/// What each number of the translation may be, in its own unit.
pub(super) const TRANSLATION_RANGE: Interval = Interval::closed(0.0, 100.0);

const DENSITY: [&str; 2] = ["rotation_density", "translation_density"];
const PER_ROW: [&str; 2] = ["rotation_sigma_per_row", "translation_sigma_per_row"];
const LATERAL_DENSITY: &str = "lateral_density";
const LATERAL_PER_ROW: &str = "lateral_sigma_per_row";

/// Every key of odometry in the table.
pub(super) const KEYS: [&str; 9] = [
    DENSITY[0],
    DENSITY[1],
    LATERAL_DENSITY,
    PER_ROW[0],
    PER_ROW[1],
    LATERAL_PER_ROW,
    "rotation_per_sqrt_m",
    "rotation_per_sqrt_rad",
    "translation_per_sqrt_m",
];

impl OdometryNoise {
    pub(super) fn read(noise: &mut Section<'_, '_>, relevance: Relevance) -> Self {
        let rotation = ROTATION_RANGE;
        let translation = TRANSLATION_RANGE;
        Self {
            white: IncrementNoise::read(noise, relevance),
            rotation_per_sqrt_m: noise.float("rotation_per_sqrt_m", "rad/sqrt(m)", rotation, 0.0),
            rotation_per_sqrt_rad: noise.float(
                "rotation_per_sqrt_rad",
                "rad/sqrt(rad)",
                rotation,
                0.0,
            ),
            translation_per_sqrt_m: noise.float(
                "translation_per_sqrt_m",
                "m/sqrt(m)",
                translation,
                0.0,
            ),
        }
    }
}

impl IncrementNoise {
    /// Exactly one of the two pairs must be given, and whole; lateral goes with either.
    fn read(noise: &mut Section<'_, '_>, relevance: Relevance) -> Self {
        let rotation = ROTATION_RANGE;
        let translation = TRANSLATION_RANGE;
        let densities = [
            noise.optional_float(DENSITY[0], Some("rad/sqrt(s)"), rotation),
            noise.optional_float(DENSITY[1], Some("m/sqrt(s)"), translation),
            noise.varying_float(LATERAL_DENSITY, Some("m/sqrt(s)"), translation),
        ];
        let sigmas = [
            noise.optional_float(PER_ROW[0], Some("rad"), rotation),
            noise.optional_float(PER_ROW[1], Some("m"), translation),
            noise.varying_float(LATERAL_PER_ROW, Some("m"), translation),
        ];
        let form = form_of(noise, DENSITY, PER_ROW, "row", relevance);
        let (given, foreign_lateral, pair) = match form {
            Form::Density => (densities, LATERAL_PER_ROW, DENSITY),
            Form::Each => (sigmas, LATERAL_DENSITY, PER_ROW),
        };
        if pair.iter().any(|key| noise.has(key)) {
            let reason = format!(
                "contradicts {}: give densities or sigmas per row, not both",
                pair[1]
            );
            noise.refuse(foreign_lateral, &reason);
        }
        // Zeros stand where a fault has been noted: nobody gets to see them.
        let [rotation, translation, lateral] = given;
        let rotation = rotation.unwrap_or_default();
        let translation = translation.unwrap_or_default();
        let lateral = lateral.unwrap_or(translation);
        match form {
            Form::Density => Self::Density {
                rotation,
                translation,
                lateral,
            },
            Form::Each => Self::PerRow {
                rotation,
                translation,
                lateral,
            },
        }
    }
}
