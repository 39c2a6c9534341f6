//! The smoother behind the engine: what it publishes and when, against the library called by hand, against the filter
//! and against the golden vectors.

#[path = "../common/mod.rs"]
mod common;

mod against_filter;
mod against_library;
mod allocation;
#[path = "../../estimator/tests/common/counting.rs"]
mod counting;
mod effort;
mod golden;
mod hand_over;
mod late;
mod lockout;
mod window;

use inekf::lie::SE23;
use inekf::model::NavState;
use inekf_service::config::Config;
use inekf_service::engine::smoothing::SmoothingEngine;
use inekf_service::engine::{History, Model, Outbox, Settings};
use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23};

use common::Input;

/// With biases.
pub type Full = SmoothingEngine<NavState, 15>;
/// Without.
pub type Plain = SmoothingEngine<SE23, 9>;

/// What the smoother's tests have in common: a known start, a gate, and no heading source.
const CONFIG: &str = r#"
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
[[position_source]]
id = 0
[[position_source]]
id = 1
lever_arm_m = [0.8, -0.3, 1.2]
[update]
gate_probability = 0.9999
"#;

/// The settings of `top`, the above, and `more`.
pub fn settings(top: &str, more: &str) -> Settings {
    let text = format!("model = 'imu'\n{top}\n{CONFIG}\n{more}");
    let config = Config::from_toml_str(&text, "test").unwrap_or_else(|faults| panic!("{faults}"));
    Settings::new(&config)
}

/// The settings of a smoother over `window` fixes, with `more` in its table.
pub fn smoothing(top: &str, window: usize, more: &str) -> Settings {
    let top = format!("estimator = 'smoother'\n{top}");
    settings(&top, &format!("[smoother]\nwindow = {window}\n{more}"))
}

/// A smoother with biases.
pub fn full(settings: Settings) -> Full {
    Full::smoothing(settings, &settings.smoother.expect("a smoother"))
}

/// A smoother without biases.
pub fn plain(settings: Settings) -> Plain {
    Plain::smoothing(settings, &settings.smoother.expect("a smoother"))
}

/// An engine of the model `imu`, whatever estimates.
pub trait Fed {
    /// Gives it `input`, and what was put off for it.
    fn feed(&mut self, input: &Input, outbox: &mut impl Outbox<EstimateSe23>);

    /// What it publishes for `inputs`.
    fn run(&mut self, inputs: &[Input]) -> Vec<EstimateSe23> {
        let mut outbox = Vec::new();
        for input in inputs {
            self.feed(input, &mut outbox);
        }
        outbox
    }
}

impl<M, H> Fed for inekf_service::engine::Engine<M, H>
where
    M: Model<Sample = inekf_shared::message::ImuSample, Estimate = EstimateSe23>,
    H: History<M>,
{
    fn feed(&mut self, input: &Input, outbox: &mut impl Outbox<EstimateSe23>) {
        match input {
            Input::Imu(message) => self.sample(message, message.header.sent_ns + 1, outbox),
            Input::Position(message) => self.position(message, outbox),
            Input::Velocity(message) => self.velocity(message, outbox),
            Input::Heading(message) => self.heading(message, outbox),
        }
        self.settle(outbox);
    }
}

/// The estimate of each sample after the updates of its stamp.
pub fn rows(estimates: &[EstimateSe23]) -> Vec<EstimateSe23> {
    let mut rows: Vec<EstimateSe23> = Vec::new();
    for estimate in estimates {
        match rows.last_mut() {
            Some(last) if last.head.stamp_ns == estimate.head.stamp_ns => *last = *estimate,
            _ if estimate.head.flags & ESTIMATE_PROPAGATED != 0 => rows.push(*estimate),
            _ => {}
        }
    }
    rows
}

/// The circle without its headings.
pub fn circle(seconds: u64) -> Vec<Input> {
    let mut inputs = common::circle(seconds);
    inputs.retain(|input| !matches!(input, Input::Heading(_)));
    inputs
}
