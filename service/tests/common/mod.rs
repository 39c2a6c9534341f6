//! What the engine's tests share: a configuration, feeding, and comparison bit by bit; [`motion`]
//! is a motion whose truth is known, with its messages; [`direct`] is the filter without the engine.

// Each test file compiles this module for itself and uses its own part of it.
#![allow(dead_code, unused_imports)]

mod direct;
mod motion;

pub use direct::*;
pub use motion::*;

use inekf::filter::{InertialSide, Left};
use inekf::model::{InertialState, NavState};
use inekf_service::config::Config;
use inekf_service::engine::tally::Tally;
use inekf_service::engine::{InertialEngine, Outbox, Settings};
use inekf_shared::message::{
    EstimateSe23, Header, HeadingFix, ImuSample, MODEL_IMU, PositionFix, REASONS, StateVector,
    VelocityFix, triangle_index,
};
use nalgebra::DMatrix;

/// The engine under test, unless a test says otherwise.
pub type Engine = InertialEngine<NavState, Left, 15>;

/// A vehicle that knows where it starts; position sources 0 and 1 (the latter with a lever arm),
/// velocity source 0, heading source 0; a gate, and everything else as by default.
const CONFIG: &str = r#"
model = "imu"
[noise]
gyro_density = 3e-4
accel_density = 2e-2
gyro_bias_walk = 1e-5
accel_bias_walk = 1e-4
[initial]
level = "given"
level_sigma_deg = 1.0
heading_sigma_deg = 10.0
position_m = [0.0, 0.0, 0.0]
position_sigma_m = 1.0
velocity_mps = [5.0, 0.0, 0.0]
velocity_sigma_mps = 1.0
[update]
gate_probability = 0.9999
[[position_source]]
id = 0
[[position_source]]
id = 1
lever_arm_m = [0.8, -0.3, 1.2]
[[velocity_source]]
id = 0
[[heading_source]]
id = 0
"#;

/// The settings of that configuration; a test changes what it is about.
pub fn settings() -> Settings {
    Settings::new(&Config::from_toml_str(CONFIG, "test").unwrap())
}

/// Any input of the engine.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    Imu(ImuSample),
    Position(PositionFix),
    Velocity(VelocityFix),
    Heading(HeadingFix),
}

impl Input {
    /// Its header.
    pub fn header(&self) -> &Header {
        match self {
            Input::Imu(message) => &message.header,
            Input::Position(message) => &message.header,
            Input::Velocity(message) => &message.header,
            Input::Heading(message) => &message.header,
        }
    }
}

/// Gives `input` to `engine`.
pub fn feed<G: InertialState<D>, S: InertialSide, const D: usize>(
    engine: &mut InertialEngine<G, S, D>,
    input: &Input,
    outbox: &mut impl Outbox<EstimateSe23>,
) {
    match input {
        Input::Imu(message) => engine.sample(message, message.header.sent_ns + 1, outbox),
        Input::Position(message) => engine.position(message, outbox),
        Input::Velocity(message) => engine.velocity(message, outbox),
        Input::Heading(message) => engine.heading(message, outbox),
    }
}

/// Gives all `inputs` to a new engine; the engine and what it published.
pub fn run(settings: Settings, inputs: &[Input]) -> (Engine, Vec<EstimateSe23>) {
    let mut engine = Engine::new(settings);
    let mut outbox = Vec::new();
    for input in inputs {
        feed(&mut engine, input, &mut outbox);
    }
    (engine, outbox)
}

/// Every bit of an estimate except the counters.
pub fn bits(estimate: &EstimateSe23) -> Vec<u64> {
    let head = &estimate.head;
    let mut bits = vec![
        head.stamp_ns,
        head.seq,
        head.sent_ns,
        head.received_ns,
        head.published_ns,
        head.estimate_seq,
        head.reset_count,
        head.reset_jump_m.to_bits(),
        u64::from(head.flags),
        u64::from(head.state),
        u64::from(head.source),
        u64::from(head.dimension),
    ];
    bits.extend(head.nis.iter().map(|value| value.to_bits()));
    bits.extend(state_bits(&state_of(estimate)));
    bits
}

/// Every bit of each estimate except the counters.
pub fn all_bits(estimates: &[EstimateSe23]) -> Vec<Vec<u64>> {
    estimates.iter().map(bits).collect()
}

/// The mean and covariance of an estimate.
pub fn state_of(estimate: &EstimateSe23) -> StateVector {
    StateVector {
        model: MODEL_IMU,
        dimension: estimate.head.dimension,
        stamp_ns: estimate.head.stamp_ns,
        q_wb: estimate.q_wb,
        v_w_mps: estimate.v_w_mps,
        p_w_m: estimate.p_w_m,
        gyro_bias_rps: estimate.gyro_bias_rps,
        accel_bias_mps2: estimate.accel_bias_mps2,
        covariance: estimate.covariance,
        ..StateVector::default()
    }
}

/// Every bit of a state.
pub fn state_bits(state: &StateVector) -> Vec<u64> {
    let mut bits = vec![
        state.stamp_ns,
        u64::from(state.model),
        u64::from(state.dimension),
    ];
    bits.extend(numbers(state).map(f64::to_bits));
    bits
}

/// All numbers of a state.
pub fn numbers(state: &StateVector) -> impl Iterator<Item = f64> + '_ {
    state
        .q_wb
        .iter()
        .chain(&state.v_w_mps)
        .chain(&state.p_w_m)
        .chain(&state.gyro_bias_rps)
        .chain(&state.accel_bias_mps2)
        .chain(&state.covariance)
        .copied()
}

/// The variance of error component `i`.
pub fn variance(state: &StateVector, i: usize) -> f64 {
    state.covariance[triangle_index(i, i, state.dimension as usize).unwrap()]
}

/// Smallest eigenvalue of the covariance after scaling to unit variances.
pub fn smallest_eigenvalue(state: &StateVector) -> f64 {
    let dim = state.dimension as usize;
    let scaled = DMatrix::from_fn(dim, dim, |row, column| {
        let p = state.covariance[triangle_index(row, column, dim).unwrap()];
        p / (variance(state, row) * variance(state, column)).sqrt()
    });
    scaled.symmetric_eigenvalues().min()
}

/// Asserts that exactly these refusals were counted, and as many in total.
pub fn assert_refused(tally: &Tally, expected: &[(u32, u64)]) {
    let mut by_reason = [0; REASONS];
    for (reason, count) in expected {
        by_reason[*reason as usize] += count;
    }
    assert_eq!(tally.rejected_by_reason, by_reason);
    assert_eq!(tally.counters.rejected, by_reason.iter().sum::<u64>());
}

/// Every bit of the mean and covariance of an estimate.
pub fn belief_bits(estimate: &EstimateSe23) -> Vec<u64> {
    numbers(&state_of(estimate)).map(f64::to_bits).collect()
}

/// An engine that only a request initialises, given `state`.
pub fn engine_at(mut settings: Settings, state: &StateVector) -> Engine {
    settings.initial.wait_for_request = true;
    let mut engine = Engine::new(settings);
    engine.set_state(state).unwrap();
    engine
}
