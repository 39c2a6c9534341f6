//! Answers to control requests: reset, set state, snapshot, barrier, smoothed window.

use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_OK, CONTROL_REFUSED, CONTROL_RESET, CONTROL_SET_STATE,
    CONTROL_SMOOTHED, CONTROL_SNAPSHOT, ControlRequest, ControlResponse, StateVector, Zero,
};

use super::smoothed::SmoothedPort;
use crate::engine::{Engine, History, Model};

/// Does what `request` asks, and answers. Whatever its bytes are, a refusal says why.
///
/// Every input that was sent before the request must have been given to `engine` already.
pub fn answer<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    request: &ControlRequest,
    smoothed: &mut SmoothedPort,
) -> ControlResponse {
    let mut published = 0;
    let outcome = match request.kind {
        CONTROL_RESET => {
            engine.reset();
            Ok(StateVector::ZERO)
        }
        CONTROL_SET_STATE => engine.set_state(&request.state).map(|()| StateVector::ZERO),
        CONTROL_SNAPSHOT => engine
            .snapshot()
            .ok_or("there is no state yet: the daemon is not initialised"),
        CONTROL_BARRIER => Ok(StateVector::ZERO),
        CONTROL_SMOOTHED => smoothed.answer(engine, request.request_id).map(|count| {
            published = count;
            StateVector::ZERO
        }),
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
    response
}
