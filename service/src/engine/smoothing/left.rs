//! The states that have left the window, until they are published.

use std::collections::VecDeque;

use inekf::filter::{Belief, Covariance, Left as Side};
use inekf::model::InertialState;
use inekf_shared::message::{SMOOTHED_CUT, SmoothedState, Zero};

/// A bounded queue: if nobody takes the states, the oldest give way, as they do for a slow reader.
#[derive(Debug)]
pub(super) struct Left {
    states: VecDeque<SmoothedState>,
    capacity: usize,
    /// How many have left so far.
    count: u64,
}

/// The state `chi` at `stamp_ns`, with its covariance.
pub(super) fn message<G: InertialState<D>, const D: usize>(
    stamp_ns: u64,
    chi: &G,
    covariance: &Covariance<D>,
) -> SmoothedState {
    let pose = chi.pose();
    let mut state = SmoothedState {
        stamp_ns,
        dimension: D as u32,
        q_wb: pose.rotation.quaternion_xyzw(),
        v_w_mps: pose.velocity.into(),
        p_w_m: pose.position.into(),
        gyro_bias_rps: chi.gyro_bias().into(),
        accel_bias_mps2: chi.accel_bias().into(),
        ..SmoothedState::ZERO
    };
    covariance.write_upper_triangle(&mut state.covariance);
    state
}

impl Left {
    pub(super) fn new(capacity: usize) -> Self {
        Self {
            states: VecDeque::with_capacity(capacity),
            capacity,
            count: 0,
        }
    }

    /// A state whose time has come.
    pub(super) fn push<G: InertialState<D>, const D: usize>(
        &mut self,
        stamp_ns: u64,
        state: &Belief<G, Side, D>,
    ) {
        self.add(message(stamp_ns, &state.mean, &state.covariance));
    }

    /// A state that leaves before its time.
    pub(super) fn cut<G: InertialState<D>, const D: usize>(
        &mut self,
        stamp_ns: u64,
        chi: &G,
        covariance: &Covariance<D>,
    ) {
        self.add(SmoothedState {
            flags: SMOOTHED_CUT,
            ..message(stamp_ns, chi, covariance)
        });
    }

    fn add(&mut self, state: SmoothedState) {
        if self.states.len() >= self.capacity {
            self.states.pop_front();
        }
        self.states.push_back(SmoothedState {
            index: self.count,
            ..state
        });
        self.count += 1;
    }

    /// The next one.
    pub(super) fn take(&mut self) -> Option<SmoothedState> {
        self.states.pop_front()
    }
}
