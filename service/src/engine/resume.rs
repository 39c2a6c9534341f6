//! Continuing from the state of an earlier life, once the first sample says how long ago that was.
//!
//! Over the time T between the checkpoint and the first sample nothing was heard. With an IMU the body is taken to have
//! coasted, at constant velocity and attitude, with a rate of turn and an acceleration that are unknown but constant;
//! one step of the filter's own propagation over T with the noise
//!
//! ```text
//! gyroscope      n_g^2 + turn_sigma^2 T       rotation  gains (turn_sigma T)^2  + n_g^2 T          per axis
//! accelerometer  n_a^2 + accel_sigma^2 T      velocity  gains (accel_sigma T)^2 + n_a^2 T
//!                                             position  gains (sigma_v T)^2 + (accel_sigma T^2 / 2)^2 + ...
//! ```
//!
//! does that, with every correlation that follows; biases gain their random walk. With odometry there is no velocity to
//! coast at: the pose stays where it was, and gains `(turn_sigma T)^2` and `(speed_sigma T)^2` and the noise of a row
//! that stands still for T.
//!
//! What is too old, or ahead of the first sample, is not used: the estimate then starts as configured.
//!
//! ```
//! use inekf_service::config::Checkpoint;
//! use inekf_service::engine::resume::ResumeSettings;
//!
//! // As `[checkpoint]` has it, if it says nothing.
//! assert!(ResumeSettings::new(&Checkpoint::default()).max_age_ns > 0);
//! ```

use crate::config::Checkpoint;

/// How much a body may move while nobody hears of it.
///
/// ```
/// use inekf_service::config::Checkpoint;
/// use inekf_service::engine::resume::{Doubt, ResumeSettings};
///
/// // A vehicle that is known to stand while its daemon is updated.
/// let parked = Doubt { turn_sigma: 0.0, accel_sigma: 0.0, speed_sigma: 0.0 };
/// assert_ne!(ResumeSettings::new(&Checkpoint::default()).doubt, parked);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubt {
    /// Standard deviation of its mean angular rate, each axis, rad/s.
    pub turn_sigma: f64,
    /// Of its mean acceleration, each axis, m/s^2; with an IMU.
    pub accel_sigma: f64,
    /// Of its mean velocity, each axis, m/s; with odometry.
    pub speed_sigma: f64,
}

/// When an earlier state is continued, and how it is doubted.
///
/// ```
/// use inekf_service::config::Checkpoint;
/// use inekf_service::engine::resume::ResumeSettings;
///
/// let usual = ResumeSettings::new(&Checkpoint::default());
/// // Whatever its age.
/// let always = ResumeSettings { max_age_ns: u64::MAX, ..usual };
/// assert_eq!(always.doubt, usual.doubt);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResumeSettings {
    /// An older state is not continued, nanoseconds of sensor time.
    pub max_age_ns: u64,
    /// How the rest is doubted.
    pub doubt: Doubt,
}

impl ResumeSettings {
    /// What a configuration asks for.
    ///
    /// ```
    /// use inekf_service::config::Checkpoint;
    /// use inekf_service::engine::resume::ResumeSettings;
    ///
    /// let checkpoint = Checkpoint { max_age_s: 2.0, ..Checkpoint::default() };
    /// assert_eq!(ResumeSettings::new(&checkpoint).max_age_ns, 2_000_000_000);
    /// ```
    pub fn new(checkpoint: &Checkpoint) -> Self {
        Self {
            max_age_ns: checkpoint.max_age_ns(),
            doubt: Doubt {
                turn_sigma: checkpoint.turn_sigma_rps,
                accel_sigma: checkpoint.accel_sigma_mps2,
                speed_sigma: checkpoint.speed_sigma_mps,
            },
        }
    }
}

/// A state that waits for the first sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Earlier<X> {
    /// Time it holds at, nanoseconds of the sensor clock.
    pub(super) stamp_ns: u64,
    /// The state.
    pub(super) state: X,
    /// What is done with it.
    pub(super) settings: ResumeSettings,
}

/// What became of an earlier state.
///
/// ```
#[doc = include_str!("example.txt")]
/// use inekf_service::config::Checkpoint;
/// use inekf_service::engine::resume::{ResumeSettings, Resumption};
///
/// engine.sample(&at_rest(500), 0, &mut estimates);
/// let state = engine.snapshot().expect("it has started");
///
/// let mut next_life = InertialEngine::<NavState, Left, 15>::new(settings("inekf"));
/// next_life.resume_from(&state, ResumeSettings::new(&Checkpoint::default()))?;
/// assert_eq!(next_life.resumption(), Resumption::Waiting);
/// // The sensor has started anew, and its clock with it.
/// next_life.sample(&at_rest(10), 0, &mut estimates);
/// assert_eq!(next_life.resumption(), Resumption::FromFuture { ahead_ns: 490_000_000 });
/// # Ok::<(), &'static str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Resumption {
    /// There is none.
    #[default]
    None,
    /// It waits for the first sample.
    Waiting,
    /// It is continued.
    Resumed {
        /// How old it was, nanoseconds of sensor time.
        age_ns: u64,
    },
    /// It was too old.
    TooOld {
        /// How old it was, nanoseconds of sensor time.
        age_ns: u64,
    },
    /// It lay ahead of the first sample: the sensor's clock has started anew.
    FromFuture {
        /// By how much, nanoseconds of sensor time.
        ahead_ns: u64,
    },
    /// The doubt broke it: no number of it is to be trusted.
    Unsound,
}

impl<X> Earlier<X> {
    /// Whether it is used at the first sample, of `stamp_ns`.
    pub(super) fn judge(&self, stamp_ns: u64) -> Resumption {
        if self.stamp_ns > stamp_ns {
            let ahead_ns = self.stamp_ns - stamp_ns;
            return Resumption::FromFuture { ahead_ns };
        }
        let age_ns = stamp_ns - self.stamp_ns;
        if age_ns > self.settings.max_age_ns {
            Resumption::TooOld { age_ns }
        } else {
            Resumption::Resumed { age_ns }
        }
    }
}
