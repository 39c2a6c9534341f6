//! What an engine runs: its messages, its motion, its fixes and its filter.
//!
//! The engine knows time, order, losses and restarts; a [model](Workings) knows what a sample says and what moves. There is one
//! for inertial navigation ([`super::inertial`]) and one for odometry ([`super::odometry`]). Nothing in a model
//! allocates or fails silently: what cannot be used is a [`Refusal`] or an [`UpdateError`].

use core::fmt::Debug;

use inekf::filter::{Alignment, UpdateError, Verdict};
use inekf::lie::SO3;
use inekf_shared::message::{
    EstimateMessage, HeadingFix, PositionFix, ProcessNoise, REASON_WRONG_MODEL, StateVector,
    VelocityFix,
};
use inekf_shared::transport::InputMessage;
use nalgebra::Vector3;

use super::fix::{Fix, Measurement};
use super::recovery::Widening;
use super::resume::Doubt;
use super::settings::InitialSettings;
use super::tally::Refusal;

/// What came before a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preceding<I> {
    /// The last accepted sample with its stamp, nanoseconds; `None` at the start.
    pub sample: Option<(u64, I)>,
    /// Samples since then that were lost, by the gap in `seq`, or refused.
    pub missing: u64,
}

/// What a fix did to the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fused {
    /// Whether it was used.
    pub verdict: Verdict,
    /// Its normalised innovation squared.
    pub nis: f64,
}

/// A way to estimate motion, behind the wire messages: `M::Sample` is what moves the state, `M::Estimate` what is
/// published. This crate's models only: inertial navigation, and odometry in the plane and in space.
///
/// ```
/// use inekf::filter::Left;
/// use inekf::model::NavState;
/// use inekf_service::config::Config;
/// use inekf_service::engine::{Engine, History, InertialEngine, Model, Settings};
/// use inekf_shared::message::{MODEL_IMU, EstimateMessage};
///
/// /// What any engine's estimates are of.
/// fn code<M: Model, H: History<M>>(_engine: &Engine<M, H>) -> u32 {
///     M::Estimate::MODEL
/// }
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// let config = Config::from_toml_str(text, "example")?;
/// assert_eq!(code(&InertialEngine::<NavState, Left, 15>::new(Settings::new(&config))), MODEL_IMU);
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
pub trait Model: Workings {}

impl<W: Workings> Model for W {}

/// How a model works: what only the engine asks of it.
pub trait Workings: Debug + Sized {
    /// The message that moves the state.
    type Sample: InputMessage;
    /// The message that says what is estimated.
    type Estimate: EstimateMessage;
    /// A checked sample.
    type Input: Copy + Debug;
    /// What moves the state between two samples.
    type Motion;
    /// What a fix measures.
    type Measurement: Measurement;
    /// What is believed, and what lasts from one update to the next.
    type State: Copy + Debug;
    /// The `INPUT_*` index of the samples.
    const INPUT: usize;

    /// How the first belief is made.
    fn initial(&self) -> &InitialSettings;

    /// A longer time between two samples starts the estimate anew, nanoseconds.
    fn restart_gap_ns(&self) -> u64;

    /// A longer time between two samples is a gap, nanoseconds.
    fn max_gap_ns(&self) -> u64;

    /// Checks a sample.
    ///
    /// # Errors
    /// By reason; see `inekf_shared::message::REASON_*`.
    fn sample(
        &self,
        message: &Self::Sample,
        before: &Preceding<Self::Input>,
    ) -> Result<Self::Input, Refusal>;

    /// Checks a position fix.
    ///
    /// # Errors
    /// By reason.
    fn position(&self, message: &PositionFix) -> Result<Fix<Self::Measurement>, Refusal>;

    /// Checks a velocity fix.
    ///
    /// # Errors
    /// By reason; not an input of this model unless it says so.
    fn velocity(&self, message: &VelocityFix) -> Result<Fix<Self::Measurement>, Refusal> {
        let _ = message;
        Err(Refusal(REASON_WRONG_MODEL))
    }

    /// Checks a heading fix.
    ///
    /// # Errors
    /// By reason; not an input of this model unless it says so.
    fn heading(&self, message: &HeadingFix) -> Result<Fix<Self::Measurement>, Refusal> {
        let _ = message;
        Err(Refusal(REASON_WRONG_MODEL))
    }

    /// Watches a sample, and proposes a fix at its stamp where the model finds one in the samples themselves. Called
    /// once for each accepted sample, in order.
    fn propose(&mut self, stamp_ns: u64, input: &Self::Input) -> Option<Fix<Self::Measurement>> {
        let _ = (stamp_ns, input);
        None
    }

    /// The attitude to start from, once it is known; `input` is the sample at `stamp_ns`.
    fn attitude(&mut self, stamp_ns: u64, input: &Self::Input) -> Option<SO3>;

    /// Forgets what was gathered for the first attitude.
    fn forget_attitude(&mut self) {}

    /// When a state starts that holds at `given_ns`, or that has no time of its own, if the next sample is `input`
    /// at `stamp_ns`.
    fn start_ns(&self, given_ns: Option<u64>, stamp_ns: u64, input: &Self::Input) -> u64;

    /// The first state.
    fn aligned(&self, alignment: &Alignment) -> Self::State;

    /// The state that a request describes.
    ///
    /// # Errors
    /// A sentence that names the fault and the remedy.
    fn requested(&self, state: &StateVector) -> Result<Self::State, &'static str>;

    /// The motion over the `interval_ns` nanoseconds between two samples, of which the first may be unknown.
    fn motion(
        &self,
        before: Option<&Self::Input>,
        after: &Self::Input,
        interval_ns: u64,
    ) -> Self::Motion;

    /// Moves the state along the next `part_ns` nanoseconds of a motion.
    fn advance(&self, state: &mut Self::State, motion: &Self::Motion, part_ns: u64);

    /// Moves the state over `silence_ns` nanoseconds of which nothing is known but `doubt`.
    fn endure(&self, state: &mut Self::State, silence_ns: u64, doubt: &Doubt);

    /// Uses this process noise from now on.
    ///
    /// # Errors
    /// A sentence that names the fault and the range; the noise is then as it was.
    fn reload_noise(&mut self, noise: &ProcessNoise) -> Result<(), &'static str>;

    /// Whether the state has not broken down.
    fn is_sound(&self, state: &Self::State) -> bool;

    /// Corrects the state with a fix, unless it is beyond the gate (or `gated` is false).
    ///
    /// # Errors
    /// [`UpdateError`]; the state is then unchanged, as it is when the fix is gated.
    fn fuse(
        &self,
        state: &mut Self::State,
        fix: &Fix<Self::Measurement>,
        gated: bool,
    ) -> Result<Fused, UpdateError>;

    /// How to doubt the state so that it lets in `fix`, whose normalised innovation squared is `nis`.
    fn widening(&self, state: &Self::State, fix: &Fix<Self::Measurement>, nis: f64) -> Widening;

    /// Corrects the state, doubted by `widening`, with a fix.
    ///
    /// # Errors
    /// [`UpdateError`]; the state is then unchanged.
    fn fuse_widened(
        &self,
        state: &mut Self::State,
        fix: &Fix<Self::Measurement>,
        widening: &Widening,
    ) -> Result<Fused, UpdateError>;

    /// Whether what a fix changes can be [carried](Self::carry) to later states without replaying the samples between.
    fn carries(&self) -> bool {
        false
    }

    /// `now`, to which `elapsed_ns` of samples and no fix have led from `before`, as if they had led to it from `after`;
    /// and the least share of a variance of `now` that remains. Only of models that [carry](Self::carries).
    fn carry(
        &self,
        before: &Self::State,
        after: &Self::State,
        elapsed_ns: u64,
        now: &Self::State,
    ) -> (Self::State, f64) {
        let _ = (before, after, elapsed_ns);
        (*now, 0.0)
    }

    /// Where the body is, m, world frame; z is 0 in the plane.
    fn place_w(&self, state: &Self::State) -> Vector3<f64>;

    /// Writes the state into the message, all but the lasting part of its head.
    fn write(&self, state: &Self::State, message: &mut Self::Estimate);

    /// The state as a snapshot answers it.
    fn snapshot(&self, stamp_ns: u64, state: &Self::State) -> StateVector;
}
