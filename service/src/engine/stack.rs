//! Fixes of two sources taken together: each waits for its partner, for a bounded time.
//!
//! A constraint on the gain needs more outputs than one source has (\[LC\] VII), so the fixes of two sources that
//! speak of one moment become one measurement, at the later of their stamps. A fix whose partner does not come is
//! counted, and used alone or dropped, as configured. Times are of the sensor clock: what happens does not depend
//! on how fast a recording is replayed.

use super::fix::{Fix, FixKind, Measurement};

/// Fixes that may wait for their partners at one time.
const CAPACITY: usize = 32;

/// What happens to a fix without its partner.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::{Missing, Settings};
///
/// let text = "\
/// model = 'odometry2d'
/// estimator = 'lc-inekf'
/// [noise]
/// rotation_density = 3e-3
/// translation_density = 1e-2
/// [[position_source]]
/// id = 0
/// [[position_source]]
/// id = 1
/// [[mismatched]]
/// what = 'odometry_scale'
/// [stacking]
/// sources = [0, 1]
/// tolerance_s = 0.01
/// missing = 'skip'
/// ";
/// let stack = Settings::new(&Config::from_toml_str(text, "example")?).fusion.stack;
/// assert_eq!(stack.map(|stack| stack.missing), Some(Missing::Skip));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// It is used alone, without constraints.
    Unconstrained,
    /// It is dropped.
    Skip,
}

/// Which sources belong together.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "\
/// model = 'odometry2d'
/// estimator = 'lc-inekf'
/// [noise]
/// rotation_density = 3e-3
/// translation_density = 1e-2
/// [[position_source]]
/// id = 0
/// [[position_source]]
/// id = 1
/// [[mismatched]]
/// what = 'odometry_scale'
/// [stacking]
/// sources = [0, 1]
/// tolerance_s = 0.01
/// missing = 'skip'
/// ";
/// let stack = Settings::new(&Config::from_toml_str(text, "example")?).fusion.stack;
/// assert_eq!(stack.map(|stack| (stack.sources, stack.tolerance_ns)), Some(([0, 1], 10_000_000)));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StackSettings {
    /// The two position sources.
    pub sources: [u32; 2],
    /// Stamps that differ by no more are one moment, nanoseconds.
    pub tolerance_ns: u64,
    /// How long a fix waits for its partner, nanoseconds.
    pub wait_ns: u64,
    /// What happens to a fix without its partner.
    pub missing: Missing,
}

/// What to do with a fix now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Offered<Z> {
    /// Fuse this one: it has found its partner, or needs none.
    Ready(Fix<Z>),
    /// It waits.
    Waits,
    /// It waits, and this one has to make room.
    Displaced(Fix<Z>),
}

/// The fixes that wait, oldest first.
#[derive(Debug)]
pub struct Stack<Z> {
    settings: Option<StackSettings>,
    waiting: Vec<Fix<Z>>,
}

impl<Z: Measurement> Stack<Z> {
    /// Nothing waits. Without settings nothing ever will.
    pub fn new(settings: Option<StackSettings>) -> Self {
        Self {
            settings,
            waiting: Vec::with_capacity(CAPACITY),
        }
    }

    /// Takes a fix.
    pub fn offer(&mut self, fix: Fix<Z>) -> Offered<Z> {
        let Some(settings) = self.settings else {
            return Offered::Ready(fix);
        };
        if fix.kind() != FixKind::Position || !settings.sources.contains(&fix.source) {
            return Offered::Ready(fix);
        }
        let apart_ns = |other: &Fix<Z>| other.stamp_ns.abs_diff(fix.stamp_ns);
        let others = self.waiting.iter().enumerate().filter(|(_, other)| {
            other.source != fix.source && apart_ns(other) <= settings.tolerance_ns
        });
        let nearest = others.min_by_key(|(_, other)| apart_ns(other));
        let pair = nearest.and_then(|(index, other)| Some((index, settings.pair(other, &fix)?)));
        if let Some((index, pair)) = pair {
            self.waiting.remove(index);
            return Offered::Ready(pair);
        }
        let displaced = (self.waiting.len() >= CAPACITY).then(|| self.waiting.remove(0));
        self.waiting.push(fix);
        displaced.map_or(Offered::Waits, Offered::Displaced)
    }

    /// The next fix that has waited for too long at `now_ns`.
    pub fn overdue(&mut self, now_ns: u64) -> Option<Fix<Z>> {
        let patience_ns = self.settings?.patience_ns();
        let index = self
            .waiting
            .iter()
            .position(|fix| now_ns > fix.stamp_ns.saturating_add(patience_ns))?;
        Some(self.waiting.remove(index))
    }

    /// What happens to a fix without its partner.
    pub fn missing(&self) -> Missing {
        self.settings
            .map_or(Missing::Unconstrained, |settings| settings.missing)
    }

    /// Forgets what waits, and says how many that were.
    pub fn clear(&mut self) -> usize {
        let count = self.waiting.len();
        self.waiting.clear();
        count
    }
}

impl StackSettings {
    /// A partner may lie `tolerance_ns` ahead, however long it is waited for.
    fn patience_ns(&self) -> u64 {
        self.tolerance_ns.max(self.wait_ns)
    }

    /// The two as one, in the order of the sources, at the later stamp.
    fn pair<Z: Measurement>(&self, one: &Fix<Z>, other: &Fix<Z>) -> Option<Fix<Z>> {
        let (first, second) = if one.source == self.sources[0] {
            (one, other)
        } else {
            (other, one)
        };
        Some(Fix {
            stamp_ns: first.stamp_ns.max(second.stamp_ns),
            partner: Some(second.source),
            measurement: first.measurement.paired_with(&second.measurement)?,
            ..*first
        })
    }
}
