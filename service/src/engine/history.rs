//! What lies behind the newest estimate: how samples move it on and where fixes are kept until they are due.
//!
//! The engine knows time, order, losses and restarts, and asks a [history](Past) for everything else.
//! [`super::timeline`] is that of a filter, [`super::smoothing`] that of a smoother.

use core::fmt::Debug;

use inekf::filter::UpdateError;
use inekf_shared::message::SmoothedState;

use super::fix::Fix;
use super::model::{Fused, Model};

/// Fixes that may wait or be remembered at one time.
pub const MAX_FIXES: usize = 1024;

/// Something worth publishing.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a, X, Z> {
    /// The state was propagated to `stamp_ns`.
    Propagated {
        /// Time of the state.
        stamp_ns: u64,
        /// After the sample.
        state: &'a X,
    },
    /// A fix was judged.
    Judged {
        /// Time of the state: the fix's own stamp, or the newest one after a replay.
        stamp_ns: u64,
        /// After the fix.
        state: &'a X,
        /// The fix.
        fix: &'a Fix<Z>,
        /// What it did.
        outcome: Result<Fused, UpdateError>,
        /// Whether samples were replayed.
        replayed: bool,
    },
    /// The estimate is the smoothed one now: what the window makes of all fixes so far.
    Smoothed {
        /// Time of the state: the newest one.
        stamp_ns: u64,
        /// From now on.
        state: &'a X,
        /// Source of the last fix.
        source: u32,
    },
}

/// What became of a fix that was handed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Insertion {
    /// It lies ahead and waits for the next sample.
    Waiting,
    /// It was judged; an event was emitted.
    Judged,
    /// It is older than the window.
    TooLate,
    /// No room for more fixes.
    Full,
}

/// The state broke down (not finite, or diverged); the history must be started anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Breakdown;

/// The estimate along time: what an engine of the model M keeps of the past, a filter one thing and a smoother another.
/// This crate's only.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::{Engine, History, Model, Use, build};
///
/// /// Whether there is a window of smoothed states.
/// struct Smooths;
///
/// impl Use for Smooths {
///     type Output = bool;
///
///     fn with<M: Model, H: History<M>>(self, mut engine: Engine<M, H>) -> bool {
///         engine.smoothed(&mut |_| {}).is_err_and(|reason| !reason.contains("no smoother"))
///     }
/// }
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// assert!(!build(&Config::from_toml_str(text, "example")?, Smooths)?);
/// let text = format!("estimator = 'smoother'\n{text}");
/// assert!(build(&Config::from_toml_str(&text, "example")?, Smooths)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait History<M: Model>: Past<M> {}

impl<M: Model, P: Past<M>> History<M> for P {}

/// How the past is kept: what only the engine asks of it. Nothing here allocates after construction.
pub trait Past<M: Model>: Debug {
    /// Forgets everything and starts from `state` at `stamp_ns`; `input` is the sample of that
    /// stamp if there is one.
    fn start(&mut self, model: &M, stamp_ns: u64, input: Option<M::Input>, state: M::State);

    /// Forgets everything.
    fn clear(&mut self, model: &M);

    /// Number of messages whose fixes have not been judged.
    fn waiting(&self) -> u64;

    /// The newest stamp and state, if started.
    fn newest(&self) -> Option<(u64, &M::State)>;

    /// Whether the state was set at `stamp_ns` and the sample of that stamp has not come yet.
    fn awaits_input_at(&self, stamp_ns: u64) -> bool;

    /// Gives the newest state its sample.
    fn set_input(&mut self, input: M::Input);

    /// Moves on to a sample at `stamp_ns`, which must be later than the newest state, and takes in the fixes that
    /// are due. Emits an event for the sample and for each fix.
    ///
    /// # Errors
    /// [`Breakdown`] if the state is no longer sound.
    fn advance(
        &mut self,
        model: &M,
        stamp_ns: u64,
        input: M::Input,
        emit: impl FnMut(Event<'_, M::State, M::Measurement>),
    ) -> Result<(), Breakdown>;

    /// Takes a fix: it waits until it is due, or is judged at once.
    fn insert(
        &mut self,
        model: &M,
        fix: Fix<M::Measurement>,
        emit: impl FnMut(Event<'_, M::State, M::Measurement>),
    ) -> Insertion;

    /// Judges what is due and was put off so as not to hold up a sample. Called when no sample waits.
    fn settle(&mut self, model: &M, emit: impl FnMut(Event<'_, M::State, M::Measurement>)) {
        let _ = (model, emit);
    }

    /// Takes one of the states that have left the window, in order; `None` if no more have, or if there is no window.
    fn take_left(&mut self) -> Option<SmoothedState> {
        None
    }

    /// Hands over the states of the window, oldest first, and says how many they are; `None` if there is no window.
    fn smoothed(&mut self, model: &M, give: &mut dyn FnMut(&SmoothedState)) -> Option<usize> {
        let _ = (model, give);
        None
    }
}
