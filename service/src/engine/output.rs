//! From beliefs to messages: what is published, with its stamps, flags and counters.

use inekf::filter::{Belief, Side, Verdict};
use inekf::model::InertialState;
use inekf_shared::message::{
    ESTIMATE_DEGRADED, ESTIMATE_PROPAGATED, ESTIMATE_REPLAYED, ESTIMATE_RESET, ESTIMATE_UPDATED,
    EstimateHead, EstimateSe23, MODEL_IMU, NO_SOURCE, REASON_INTERNAL, STATE_DEGRADED,
    STATE_RUNNING, StateVector, Zero,
};
use nalgebra::Vector3;

use super::fix::FixKind;
use super::tally::{Refusal, Tally};
use super::timeline::Event;

/// Where estimates go. The daemon's publishes them; a test's collects them.
pub trait Outbox {
    /// Takes one estimate. Must neither block nor allocate in the daemon.
    fn publish(&mut self, estimate: &EstimateSe23);
}

impl Outbox for Vec<EstimateSe23> {
    fn publish(&mut self, estimate: &EstimateSe23) {
        self.push(*estimate);
    }
}

/// Everything that is said about the estimate beside the estimate itself.
#[derive(Debug)]
pub struct Output {
    /// The counters.
    pub tally: Tally,
    /// The message under construction; its head carries what lasts from one to the next.
    message: EstimateSe23,
    degraded_after_ns: u64,
    /// Stamp of the last accepted fix, or of the start.
    last_aided_ns: u64,
    has_started: bool,
    /// Set at a restart, until the next estimate has said so.
    announce_reset: bool,
}

impl Output {
    /// Nothing published yet.
    pub fn new(degraded_after_ns: u64) -> Self {
        Self {
            tally: Tally::default(),
            message: EstimateSe23 {
                head: EstimateHead::UNSTARTED,
                ..EstimateSe23::ZERO
            },
            degraded_after_ns,
            last_aided_ns: 0,
            has_started: false,
            announce_reset: false,
        }
    }

    /// The sample that the next estimates answer.
    pub fn answer(&mut self, seq: u64, sent_ns: u64, received_ns: u64) {
        let head = &mut self.message.head;
        (head.seq, head.sent_ns, head.received_ns) = (seq, sent_ns, received_ns);
    }

    /// Notes that the state was set to `position_w` at `stamp_ns`.
    pub fn started(&mut self, stamp_ns: u64, position_w: &Vector3<f64>) {
        if self.has_started {
            let before_w = Vector3::from(self.message.p_w_m);
            let head = &mut self.message.head;
            head.reset_count += 1;
            head.reset_jump_m = (position_w - before_w).norm();
            self.announce_reset = true;
        }
        self.has_started = true;
        self.last_aided_ns = stamp_ns;
        self.message.p_w_m = (*position_w).into();
    }

    /// `STATE_RUNNING` or `STATE_DEGRADED` at `stamp_ns`.
    pub fn running_state(&self, stamp_ns: u64) -> u32 {
        if stamp_ns.saturating_sub(self.last_aided_ns) > self.degraded_after_ns {
            STATE_DEGRADED
        } else {
            STATE_RUNNING
        }
    }

    /// Counts and publishes what happened on the timeline.
    pub fn record<G: InertialState<D>, S: Side, const D: usize>(
        &mut self,
        event: &Event<'_, G, S, D>,
        outbox: &mut impl Outbox,
    ) {
        match event {
            Event::Propagated { stamp_ns, belief } => {
                self.publish(*stamp_ns, belief, ESTIMATE_PROPAGATED, NO_SOURCE, outbox);
            }
            Event::Judged {
                stamp_ns,
                belief,
                fix,
                outcome,
                replayed,
            } => {
                let Ok(correction) = outcome else {
                    self.tally.refuse(Refusal(REASON_INTERNAL));
                    return;
                };
                if fix.kind() == FixKind::Position
                    && let Some(nis) = self.message.head.nis.get_mut(fix.source as usize)
                {
                    *nis = correction.nis;
                }
                if correction.verdict == Verdict::Gated {
                    self.tally.counters.gated += 1;
                    return;
                }
                self.tally.counters.accepted += 1;
                self.last_aided_ns = self.last_aided_ns.max(fix.stamp_ns);
                let flags = if *replayed {
                    ESTIMATE_UPDATED | ESTIMATE_REPLAYED
                } else {
                    ESTIMATE_UPDATED
                };
                self.publish(*stamp_ns, belief, flags, fix.source, outbox);
            }
        }
    }

    fn publish<G: InertialState<D>, S: Side, const D: usize>(
        &mut self,
        stamp_ns: u64,
        belief: &Belief<G, S, D>,
        mut flags: u32,
        source: u32,
        outbox: &mut impl Outbox,
    ) {
        let state = self.running_state(stamp_ns);
        if state == STATE_DEGRADED {
            flags |= ESTIMATE_DEGRADED;
        }
        if core::mem::take(&mut self.announce_reset) {
            flags |= ESTIMATE_RESET;
        }
        let message = &mut self.message;
        let head = &mut message.head;
        head.stamp_ns = stamp_ns;
        head.estimate_seq += 1;
        (head.flags, head.state, head.source) = (flags, state, source);
        head.dimension = D as u32;
        head.counters = self.tally.counters;
        let pose = belief.mean.pose();
        message.q_wb = pose.rotation.quaternion_xyzw();
        message.v_w_mps = pose.velocity.into();
        message.p_w_m = pose.position.into();
        message.gyro_bias_rps = belief.mean.gyro_bias().into();
        message.accel_bias_mps2 = belief.mean.accel_bias().into();
        write_triangle(&mut message.covariance, belief);
        outbox.publish(message);
    }
}

/// Writes the upper triangle of the left-invariant covariance to the front of `triangle`.
fn write_triangle<G: InertialState<D>, S: Side, const D: usize>(
    triangle: &mut [f64],
    belief: &Belief<G, S, D>,
) {
    for (slot, entry) in triangle
        .iter_mut()
        .zip(belief.left_covariance().upper_triangle())
    {
        *slot = entry;
    }
}

/// The belief as a snapshot answers it.
pub fn state_vector<G: InertialState<D>, S: Side, const D: usize>(
    stamp_ns: u64,
    belief: &Belief<G, S, D>,
) -> StateVector {
    let pose = belief.mean.pose();
    let mut state = StateVector {
        model: MODEL_IMU,
        dimension: D as u32,
        stamp_ns,
        q_wb: pose.rotation.quaternion_xyzw(),
        v_w_mps: pose.velocity.into(),
        p_w_m: pose.position.into(),
        gyro_bias_rps: belief.mean.gyro_bias().into(),
        accel_bias_mps2: belief.mean.accel_bias().into(),
        ..StateVector::ZERO
    };
    write_triangle(&mut state.covariance, belief);
    state
}
