//! `[stacking]`: two sources of position whose fixes of one moment make one update.
//!
//! A constrained gain needs as many outputs as there are mismatches: two sources in the plane have four.

use inekf_shared::message::MAX_SOURCES;

use super::choice::{MissingPartner, Model};
use super::interval::Interval;
use super::motion::ONLY_ODOMETRY;
use super::operation::nanoseconds;
use super::section::Section;

/// Two sources of position that are fused together.
///
/// ```
#[doc = include_str!("example.txt")]
/// let text = format!(
///     "estimator = 'lc-inekf'\n{ODOMETRY}[[position_source]]\nid = 0\n[[position_source]]\nid = 1\n\
///      [[mismatched]]\nwhat = 'odometry_scale'\n[stacking]\nsources = [0, 1]\n"
/// );
/// let stacking = read(text)?.stacking.expect("it is given");
/// assert_eq!((stacking.sources, stacking.missing), ([0, 1], MissingPartner::Unconstrained));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Stacking {
    /// The ids of the two sources, in the order in which they are stacked.
    pub sources: [u32; 2],
    /// Stamps that differ by no more than this are one moment, s.
    pub tolerance_s: f64,
    /// How much sensor time a fix waits for its partner, s.
    pub wait_s: f64,
    /// What happens to it if none comes.
    pub missing: MissingPartner,
}

impl Stacking {
    /// Reads the table, if there is one. `model` and `known_ids`, the ids of the sources of position, are None if they
    /// are not known for certain.
    pub(super) fn read_if_given(
        root: &mut Section<'_, '_>,
        model: Option<Model>,
        known_ids: Option<&[u32]>,
    ) -> Option<Self> {
        let given = root.has("stacking");
        let stacking = root.section("stacking", |stacking| {
            if model == Some(Model::Imu) {
                stacking.refuse_whole(ONLY_ODOMETRY);
            }
            Self::read(stacking, known_ids)
        });
        given.then_some(stacking)
    }

    fn read(stacking: &mut Section<'_, '_>, known_ids: Option<&[u32]>) -> Self {
        let ids = stacking.required_pair("sources", 0..=MAX_SOURCES as u32 - 1);
        for id in ids.into_iter().flatten() {
            if known_ids.is_some_and(|known| !known.contains(&id)) {
                let reason = format!("there is no [[position_source]] with id {id}");
                stacking.refuse("sources", &reason);
            }
        }
        Self {
            // The fallback is taken only where a fault has been noted.
            sources: ids.unwrap_or_default(),
            tolerance_s: stacking.float("tolerance_s", "s", Interval::closed(0.0, 10.0), 0.001),
            wait_s: stacking.float("wait_s", "s", Interval::closed(0.0, 60.0), 0.2),
            missing: stacking.choice("missing", MissingPartner::Unconstrained),
        }
    }

    /// [`tolerance_s`](Self::tolerance_s) in nanoseconds of sensor time.
    pub(crate) fn tolerance_ns(&self) -> u64 {
        nanoseconds(self.tolerance_s)
    }

    /// [`wait_s`](Self::wait_s) in nanoseconds of sensor time.
    pub(crate) fn wait_ns(&self) -> u64 {
        nanoseconds(self.wait_s)
    }
}
