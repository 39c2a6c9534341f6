//! Answers to control requests: reset, set state, snapshot, barrier, smoothed window, pause, noise, configuration; and
//! an entry of a journal, in a daemon that is fed by requests.

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_REFUSED,
    CONTROL_RELOAD_NOISE, CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED,
    CONTROL_SNAPSHOT, CONTROL_TAKE, ControlRequest, ControlResponse, Header, JOURNAL_HEADING,
    JOURNAL_IMU, JOURNAL_ODOMETRY_2D, JOURNAL_ODOMETRY_3D, JOURNAL_POSITION, JOURNAL_RESUME,
    JOURNAL_SETTLE, JOURNAL_VELOCITY, Message, REASON_WRONG_MODEL, StateVector, Zero,
};

use super::smoothed::SmoothedPort;
use super::vehicle::Terms;
use crate::engine::resume::ResumeSettings;
use crate::engine::tally::Refusal;
use crate::engine::{Engine, History, Model, Outbox};

/// Does what `request` asks, and answers. Whatever its bytes are, a refusal says why.
///
/// Every input that was sent before the request must have been given to `engine` already.
///
/// ```
#[doc = include_str!("../engine/example.txt")]
/// use inekf_service::daemon::{SmoothedPort, Terms, answer};
///
/// # let config = Config::from_toml_str(CONFIG, "example")?;
/// let terms = Terms { config: &config, config_text: CONFIG, stepped: false, unused_checkpoint: false };
/// let mut ask = |kind| {
///     let request = ControlRequest { kind, request_id: 7, ..ControlRequest::ZERO };
///     answer(&mut engine, &request, &terms, &mut estimates, &mut SmoothedPort::closed())
/// };
/// let refused = ask(CONTROL_SNAPSHOT);
/// assert_eq!((refused.status, refused.request_id), (CONTROL_REFUSED, 7));
/// assert!(refused.reason().contains("not initialised"));
/// assert_eq!(ask(CONTROL_PAUSE).state_code, STATE_PAUSED);
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
pub fn answer<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    request: &ControlRequest,
    terms: &Terms<'_>,
    estimates: &mut impl Outbox<M::Estimate>,
    smoothed: &mut SmoothedPort,
) -> ControlResponse {
    let mut published = 0;
    let nothing = StateVector::ZERO;
    let outcome = match request.kind {
        CONTROL_RESET => {
            engine.reset();
            Ok(nothing)
        }
        CONTROL_SET_STATE => engine.set_state(&request.state).map(|()| nothing),
        CONTROL_SNAPSHOT => engine
            .snapshot()
            .ok_or("there is no state yet: the daemon is not initialised"),
        CONTROL_BARRIER | CONTROL_CONFIG => Ok(nothing),
        CONTROL_SMOOTHED => smoothed.answer(engine, request.request_id).map(|count| {
            published = count;
            nothing
        }),
        CONTROL_PAUSE => {
            engine.pause();
            Ok(nothing)
        }
        CONTROL_RESUME => {
            engine.unpause();
            Ok(nothing)
        }
        CONTROL_RELOAD_NOISE => engine.reload_noise(&request.noise).map(|()| nothing),
        CONTROL_TAKE if terms.stepped => {
            let message = match request.argument {
                JOURNAL_RESUME => request.state.as_bytes(),
                _ => &request.input,
            };
            take(engine, request.argument, message, terms, estimates).map(|()| nothing)
        }
        CONTROL_TAKE => Err(
            "this daemon takes its inputs from their topics: start one with --stepped to feed it by requests",
        ),
        _ => Err("the kind of request is unknown to this version"),
    };
    let (state_code, waiting_for) = engine.state();
    let tally = engine.tally();
    let mut response = ControlResponse {
        request_id: request.request_id,
        status: CONTROL_OK,
        state_code,
        waiting_for,
        counters: tally.counters,
        received: tally.received,
        rejected_by_reason: tally.rejected_by_reason,
        smoothed: published,
        ..ControlResponse::ZERO
    };
    match outcome {
        Ok(state) => response.state = state,
        Err(reason) => {
            response.status = CONTROL_REFUSED;
            response.set_reason(reason);
        }
    }
    if request.kind == CONTROL_CONFIG {
        response.set_page(terms.config_text, request.argument as usize);
    }
    response
}

/// Gives the engine an entry of a journal: its kind, and the bytes that its message is at the front of.
///
/// # Errors
/// A sentence that says why it is no entry; the engine has then not taken it.
pub(super) fn take<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    kind: u32,
    message: &[u8],
    terms: &Terms<'_>,
    estimates: &mut impl Outbox<M::Estimate>,
) -> Result<(), &'static str> {
    match kind {
        JOURNAL_IMU | JOURNAL_ODOMETRY_2D | JOURNAL_ODOMETRY_3D => {
            let input = kind as usize - 1;
            if input == M::INPUT {
                engine.sample(&front(message)?, monotonic_ns(), estimates);
            } else {
                let header: Header = front(message)?;
                engine.refuse(input, &header, Refusal(REASON_WRONG_MODEL));
            }
        }
        JOURNAL_POSITION => engine.position(&front(message)?, estimates),
        JOURNAL_VELOCITY => engine.velocity(&front(message)?, estimates),
        JOURNAL_HEADING => engine.heading(&front(message)?, estimates),
        JOURNAL_SETTLE => engine.settle(estimates),
        JOURNAL_RESUME => {
            let settings = ResumeSettings::new(&terms.config.checkpoint);
            engine.resume_from(&front(message)?, settings)?;
        }
        _ => return Err("the kind of the entry is unknown to this version"),
    }
    Ok(())
}

/// The message at the front of `bytes`.
fn front<T: Message>(bytes: &[u8]) -> Result<T, &'static str> {
    let front = bytes.get(..size_of::<T>());
    front
        .and_then(T::from_bytes)
        .ok_or("the entry is shorter than its message")
}
