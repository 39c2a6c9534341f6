//! `[[mismatched]]`: what may be wrong with the models of odometry and measurement, and by how much.
//!
//! A mismatch is one unknown parameter, or three for a rotation about any axis, zero in the assumed model. Estimates
//! report on those of the odometry first, then on those of the sources, both in the order of the tables.

use inekf_shared::message::MAX_MISMATCHES;

use super::choice::{Axis, Mismatch, MismatchKind, Model};
use super::estimator::Filter;
use super::interval::Interval;
use super::section::Section;

/// The burst of an odometry mismatch, in sigmas, where the file does not say.
const ODOMETRY_BURST_SIGMAS: f64 = 3.0;

/// One declared mismatch.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("mismatch = 'consider'\n{ODOMETRY}[[position_source]]\nid = 3\n[[mismatched]]\nwhat = 'odometry_scale'\nsigma = 0.05\n");
/// let mismatched = read(text)?.mismatched;
/// assert_eq!((mismatched[0].what, mismatched[0].sigma), (Wrong::OdometryScale, 0.05));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatched {
    /// What is wrong.
    pub what: Wrong,
    /// Standard deviation of each of its parameters, in the unit of [`Wrong`]; infinity with [`Mismatch::Hard`].
    pub sigma: f64,
    /// The same while it comes in bursts; used with [`Mismatch::Adaptive`].
    pub burst_sigma: f64,
    /// Random walk of its parameters, in their unit per sqrt(s); used with [`Mismatch::Augmented`].
    pub walk: f64,
}

/// What a mismatch is about.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!("mismatch = 'consider'\n{ODOMETRY}[[position_source]]\nid = 3\n[[mismatched]]\nwhat = 'measurement_scale'\nsource = 3\nsigma = 0.05\n");
/// assert_eq!(read(text)?.mismatched[0].what, Wrong::MeasurementScale { source: 3 });
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// The translation of a row is `(1 + m) u`.
    OdometryScale,
    /// The rotation of a row is `(1 + m)` times what it says.
    OdometryTurnScale,
    /// The rotation of a row gains `m dt` about one body axis, m in rad/s.
    OdometryRotationBias {
        /// The body axis; z in the plane.
        axis: Axis,
    },
    /// A source of position sees `(1 + eps + m) x + R b`.
    MeasurementScale {
        /// The id of the source.
        source: u32,
    },
    /// A source of position sees the world turned by m, rad.
    MeasurementRotation {
        /// The id of the source.
        source: u32,
        /// The world axis; z in the plane. None: any axis, three parameters.
        axis: Option<Axis>,
    },
}

/// What the parameters are that a filter learns beside the pose; empty if it learns none.
pub(crate) fn learned_in_words(mismatch: Mismatch, mismatched: &[Mismatched]) -> String {
    match mismatch {
        Mismatch::Consider | Mismatch::Augmented | Mismatch::Adaptive => {
            let whats: Vec<String> = mismatched.iter().map(|one| one.what.in_words()).collect();
            format!("{mismatch}: {}", whats.join(", "))
        }
        Mismatch::None | Mismatch::Hard | Mismatch::Soft => String::new(),
    }
}

impl Wrong {
    fn in_words(self) -> String {
        match self {
            Self::OdometryScale => "scale of the odometry".to_owned(),
            Self::OdometryTurnScale => "scale of the odometry's turns".to_owned(),
            Self::OdometryRotationBias { axis } => {
                format!("bias of the odometry's turns about {axis}")
            }
            Self::MeasurementScale { source } => format!("scale of source {source}"),
            Self::MeasurementRotation { source, axis: None } => {
                format!("rotation of source {source}")
            }
            Self::MeasurementRotation {
                source,
                axis: Some(axis),
            } => format!("rotation of source {source} about {axis}"),
        }
    }

    /// How many parameters it has.
    ///
    /// ```
    /// use inekf_service::config::{Axis, Wrong};
    ///
    /// assert_eq!(Wrong::OdometryScale.parameters(), 1);
    /// // About one axis, or about any.
    /// assert_eq!(Wrong::MeasurementRotation { source: 0, axis: Some(Axis::Z) }.parameters(), 1);
    /// assert_eq!(Wrong::MeasurementRotation { source: 0, axis: None }.parameters(), 3);
    /// ```
    pub const fn parameters(self) -> usize {
        match self {
            Self::MeasurementRotation { axis: None, .. } => 3,
            _ => 1,
        }
    }

    /// The id of the source of position that it is about; None if it is about the odometry.
    ///
    /// ```
    /// use inekf_service::config::Wrong;
    ///
    /// assert_eq!(Wrong::MeasurementScale { source: 3 }.source(), Some(3));
    /// assert_eq!(Wrong::OdometryScale.source(), None);
    /// ```
    pub const fn source(self) -> Option<u32> {
        match self {
            Self::MeasurementScale { source } | Self::MeasurementRotation { source, .. } => {
                Some(source)
            }
            _ => None,
        }
    }

    /// Whether both have a parameter in common.
    fn overlaps(self, other: Self) -> bool {
        match (self, other) {
            (
                Self::MeasurementRotation { source: a, axis: i },
                Self::MeasurementRotation { source: b, axis: j },
            ) => a == b && (i == j || i.is_none() || j.is_none()),
            _ => self == other,
        }
    }
}

/// What the tables are read against.
struct Context<'c> {
    /// None if it is not known.
    model: Option<Model>,
    /// None if it is not known.
    mismatch: Option<Mismatch>,
    /// The ids of the sources of position. None if they are not known for certain.
    source_ids: Option<&'c [u32]>,
}

impl Mismatched {
    /// Reads the tables: at least one if and only if the filter does something about mismatches.
    pub(super) fn read_all(
        root: &mut Section<'_, '_>,
        model: Option<Model>,
        filter: Filter,
        source_ids: Option<&[u32]>,
    ) -> Vec<Self> {
        const NAME: &str = "mismatched";
        let certain = root.is_sound("estimator") && root.is_sound("mismatch");
        let mismatch = certain.then_some(filter.mismatch);
        let context = Context {
            model,
            mismatch,
            source_ids,
        };
        let mut above: Vec<Wrong> = Vec::new();
        let read = root.tables(NAME, MAX_MISMATCHES, |table| {
            let mismatched = Self::read(table, &context);
            if let Some(Self { what, .. }) = mismatched {
                if above.iter().any(|&other| what.overlaps(other)) {
                    table.contradict("what", "a table above declares the same mismatch");
                }
                above.push(what);
            }
            mismatched
        });
        let all: Vec<Self> = read.into_iter().flatten().collect();

        match mismatch {
            Some(Mismatch::None) => root.refuse(
                NAME,
                "mismatch = \"none\" does nothing about it: choose another, or remove these tables",
            ),
            Some(other) if !root.has(NAME) || (all.is_empty() && root.is_sound(NAME)) => {
                let problem =
                    format!("mismatch = \"{other}\" needs at least one [[mismatched]] table");
                root.contradict(NAME, &problem);
            }
            _ => {}
        }
        let parameters: usize = all.iter().map(|one| one.what.parameters()).sum();
        if parameters > MAX_MISMATCHES {
            let problem = format!(
                "{parameters} parameters, but at most {MAX_MISMATCHES} are possible (a rotation about any axis has 3)"
            );
            root.refuse(NAME, &problem);
        }
        all
    }

    /// None only if a fault was noted.
    fn read(table: &mut Section<'_, '_>, context: &Context<'_>) -> Option<Self> {
        let kind: Option<MismatchKind> = table.required_choice("what");
        let source =
            table.optional_integer("source", 0..=inekf_shared::message::MAX_SOURCES as u32 - 1);
        let axis: Option<Axis> = table.optional_choice("axis");
        let size = Interval::above(0.0, 10.0);
        let sigma = table.optional_float("sigma", None, size);
        let burst_sigma = table.varying_float("burst_sigma", None, size);
        let walk = table.ratio("walk", Interval::closed(0.0, 10.0), 0.0);

        check_treatment(table, context.mismatch);
        let kind = kind?;
        check_axis(table, kind, context.model);
        check_source(table, kind, source, context.source_ids);

        let axis = match context.model {
            Some(Model::Odometry2d) => Some(Axis::Z),
            _ => axis,
        };
        let what = match kind {
            MismatchKind::OdometryScale => Wrong::OdometryScale,
            MismatchKind::OdometryTurnScale => Wrong::OdometryTurnScale,
            MismatchKind::OdometryRotationBias => Wrong::OdometryRotationBias {
                axis: axis.unwrap_or(Axis::Z),
            },
            MismatchKind::MeasurementScale => Wrong::MeasurementScale { source: source? },
            MismatchKind::MeasurementRotation => Wrong::MeasurementRotation {
                source: source?,
                axis,
            },
        };
        let sigma = sigma.unwrap_or(f64::INFINITY);
        let usual_burst = match what.source() {
            Some(_) => sigma,
            None => ODOMETRY_BURST_SIGMAS * sigma,
        };
        Some(Self {
            what,
            sigma,
            burst_sigma: burst_sigma.unwrap_or(usual_burst),
            walk,
        })
    }
}

/// The sigmas are given if and only if what is done about the mismatch uses them.
fn check_treatment(table: &mut Section<'_, '_>, mismatch: Option<Mismatch>) {
    match mismatch {
        None | Some(Mismatch::None) => return,
        Some(Mismatch::Hard) => table.refuse(
            "sigma",
            "mismatch = \"hard\" holds for any size: remove it, or say \"soft\"",
        ),
        Some(other) if !table.has("sigma") => {
            let reason = format!("required with mismatch = \"{other}\", but missing");
            table.demand("sigma", &reason);
        }
        Some(_) => {}
    }
    if mismatch != Some(Mismatch::Adaptive) {
        table.refuse("burst_sigma", "only with mismatch = \"adaptive\"");
    }
    if mismatch != Some(Mismatch::Augmented) {
        table.refuse("walk", "only with mismatch = \"augmented\"");
    }
}

/// An axis is given only where there is a choice of axes.
fn check_axis(table: &mut Section<'_, '_>, kind: MismatchKind, model: Option<Model>) {
    let turns_about_one = matches!(
        kind,
        MismatchKind::OdometryRotationBias | MismatchKind::MeasurementRotation
    );
    if !turns_about_one {
        let reason = format!("\"{kind}\" has no axis: remove it");
        table.refuse("axis", &reason);
    } else if model == Some(Model::Odometry2d) {
        table.refuse("axis", "in the plane it is z: remove it");
    }
}

/// A source is given if and only if the mismatch is one of a measurement, and it is one of the configured.
fn check_source(
    table: &mut Section<'_, '_>,
    kind: MismatchKind,
    source: Option<u32>,
    known_ids: Option<&[u32]>,
) {
    let of_measurement = matches!(
        kind,
        MismatchKind::MeasurementScale | MismatchKind::MeasurementRotation
    );
    if !of_measurement {
        let reason = format!("\"{kind}\" is about the odometry: remove it");
        table.refuse("source", &reason);
    } else if !table.has("source") {
        let reason = format!("required with \"{kind}\", but missing: the id of a position source");
        table.demand("source", &reason);
    } else if let (Some(id), Some(known)) = (source, known_ids)
        && !known.contains(&id)
    {
        let reason = format!("there is no [[position_source]] with id {id}");
        table.refuse("source", &reason);
    }
}
