//! Zero-velocity detection: a vehicle that stands is told by its IMU **and** by the estimated speed.
//!
//! An IMU alone cannot tell rest from smooth driving: it feels neither. So there are two parts.
//!
//! 1. [`Standstill`] watches the samples, block by block. A block is quiet if by axis `std(gyro)` and `std(force)` are
//!    small, and even if its means are those of the quiet blocks before it, for at rest neither the weight nor the biases
//!    turn. After so many quiet and even blocks on end each further one *proposes* a velocity of zero, at the stamp of its
//!    last sample; one that is not ends it, and the count begins anew. What is proposed depends on the samples alone.
//! 2. [`Standstill::is_believable`] holds a proposal against the estimate at its stamp: the speed, and how well it is
//!    known, have to be small. It is a function of the state, so that a replay decides as it would have on time. Then the
//!    gate of any velocity fix follows.
//!
//! Body axes forward-left-up; rad/s, m/s^2, m/s, nanoseconds. Nothing here allocates.

use inekf::filter::{Belief, Side};
use inekf::model::{ImuInput, InertialState};
use nalgebra::Vector3;

/// A block with fewer samples says nothing about how much they vary.
const MIN_SAMPLES: u32 = 5;

/// When a vehicle stands, and what is made of it.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::settings::Settings;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[zero_velocity]\nafter_s = 1.0\nperiod_s = 0.25\n";
/// let standstill = Settings::new(&Config::from_toml_str(text, "example")?).imu.standstill;
/// let standstill = standstill.expect("it is asked for");
/// assert_eq!((standstill.block_ns, standstill.blocks), (250_000_000, 4));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandstillSettings {
    /// Length of a block, and so the time between two proposals, nanoseconds.
    pub block_ns: u64,
    /// Quiet and even blocks before the first proposal.
    pub blocks: u32,
    /// Largest standard deviation of the angular rate in a block, by axis, rad/s.
    pub gyro_std: f64,
    /// Largest standard deviation of the specific force in a block, by axis, m/s^2.
    pub accel_std: f64,
    /// Farthest that the mean angular rate of a block may be from that of the blocks before it, by axis, rad/s.
    pub gyro_change: f64,
    /// Likewise the mean specific force, m/s^2.
    pub accel_change: f64,
    /// Largest estimated speed that may be rest, and largest standard deviation of it by axis, m/s.
    pub speed: f64,
    /// Standard deviation of the zero that is proposed, by axis, m/s.
    pub sigma: f64,
    /// Samples farther apart than this are no neighbours, nanoseconds.
    pub max_gap_ns: u64,
}

/// Number, mean and sum of squared deviations of the angular rate and the specific force (Welford).
#[derive(Clone, Copy, Debug, Default)]
struct Statistics {
    count: u32,
    mean: [Vector3<f64>; 2],
    squares: [Vector3<f64>; 2],
}

impl Statistics {
    fn push(&mut self, input: &ImuInput) {
        self.count += 1;
        for (index, value) in [input.omega_b, input.force_b].into_iter().enumerate() {
            let before = value - self.mean[index];
            self.mean[index] += before / f64::from(self.count);
            self.squares[index] += before.component_mul(&(value - self.mean[index]));
        }
    }

    /// Adds the mean of a block, as one value.
    fn push_mean(&mut self, block: &Self) {
        self.push(&ImuInput {
            omega_b: block.mean[0],
            force_b: block.mean[1],
        });
    }

    fn is_quiet(&self, largest_std: [f64; 2]) -> bool {
        let largest = |limit: f64| limit * limit * f64::from(self.count);
        self.count >= MIN_SAMPLES
            && (0..2).all(|index| self.squares[index].max() <= largest(largest_std[index]))
    }

    fn is_near(&self, other: &Self, largest_change: [f64; 2]) -> bool {
        (0..2).all(|i| (self.mean[i] - other.mean[i]).amax() <= largest_change[i])
    }
}

/// Watches the samples of one IMU.
#[derive(Clone, Copy, Debug)]
pub struct Standstill {
    settings: StandstillSettings,
    /// The block that is being filled.
    block: Statistics,
    /// When it began.
    begun_ns: u64,
    /// Means of the quiet and even blocks on end.
    rest: Statistics,
    last_ns: Option<u64>,
}

impl Standstill {
    /// A watch that has seen nothing yet.
    pub fn new(settings: StandstillSettings) -> Self {
        Self {
            settings,
            block: Statistics::default(),
            begun_ns: 0,
            rest: Statistics::default(),
            last_ns: None,
        }
    }

    /// Takes the next sample; true if its stamp is one at which the vehicle may stand.
    pub fn push(&mut self, stamp_ns: u64, input: &ImuInput) -> bool {
        let settings = &self.settings;
        let is_next = self
            .last_ns
            .is_some_and(|last_ns| stamp_ns > last_ns && stamp_ns - last_ns <= settings.max_gap_ns);
        self.last_ns = Some(stamp_ns);
        if !is_next {
            (self.block, self.rest) = Default::default();
            self.begun_ns = stamp_ns;
        }
        self.block.push(input);
        if stamp_ns - self.begun_ns < settings.block_ns {
            return false;
        }
        let block = core::mem::take(&mut self.block);
        self.begun_ns = stamp_ns;
        let is_quiet = block.is_quiet([settings.gyro_std, settings.accel_std]);
        let changes = [settings.gyro_change, settings.accel_change];
        if !is_quiet || (self.rest.count > 0 && !block.is_near(&self.rest, changes)) {
            self.rest = Statistics::default();
            return false;
        }
        self.rest.push_mean(&block);
        self.rest.count > settings.blocks
    }

    /// Whether a state may be one of rest.
    pub fn is_believable<G: InertialState<D>, S: Side, const D: usize>(
        settings: &StandstillSettings,
        belief: &Belief<G, S, D>,
    ) -> bool {
        let limit = settings.speed * settings.speed;
        let p = belief.left_covariance();
        // The deviations of the velocity, in body axes: their sum is the same in any.
        let variance: f64 = (3..6).map(|i| p.matrix()[(i, i)]).sum();
        belief.mean.pose().velocity.norm_squared() <= limit && variance <= 3.0 * limit
    }
}
