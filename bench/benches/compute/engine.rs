//! A sample from the wire to its estimate, ready for the wire: the daemon without its transport.

use core::hint::black_box;

use inekf::filter::Left;
use inekf::lie::SE23;
use inekf::model::NavState;
use inekf_service::config::Config;
use inekf_service::engine::{Engine, InertialEngine, Model, Outbox, Settings};
use inekf_shared::message::{
    EstimateSe23, ImuSample, MODEL_IMU, StateVector, Zero, triangle_index,
};

use crate::suite::Suite;

const PERIOD_NS: u64 = 1_000_000;

const CONFIG: &str = "model = \"imu\"\nbiases = BIASES\n\
    [noise]\ngyro_density = 1e-3\naccel_density = 1e-2\n\
    [initial]\nlevel_window_s = 0.01\n";

/// What a port does, as far as memory is concerned.
struct Slot(Box<EstimateSe23>);

impl Outbox<EstimateSe23> for Slot {
    fn publish(&mut self, estimate: &mut EstimateSe23) {
        *self.0 = *estimate;
        black_box(&self.0);
    }
}

fn settings(biases: bool) -> Settings {
    let text = CONFIG.replace("BIASES", &biases.to_string());
    let config = Config::from_toml_str(&text, "of the benchmark");
    Settings::new(&config.unwrap_or_else(|fault| panic!("{fault}")))
}

fn samples<M>(suite: &mut impl Suite, name: &str, mut engine: Engine<M>, dimension: usize)
where
    M: Model<Sample = ImuSample, Estimate = EstimateSe23>,
{
    let mut state = StateVector {
        model: MODEL_IMU,
        dimension: dimension as u32,
        stamp_ns: PERIOD_NS,
        q_wb: [0.0, 0.0, 0.0, 1.0],
        ..StateVector::ZERO
    };
    for i in 0..dimension {
        let index = triangle_index(i, i, dimension).unwrap_or_else(|| panic!("no entry {i}"));
        state.covariance[index] = 0.01;
    }
    engine
        .set_state(&state)
        .unwrap_or_else(|fault| panic!("{fault}"));
    let mut slot = Slot(Box::new(EstimateSe23::ZERO));
    let mut sample = ImuSample {
        gyro_rps: [0.01, 0.02, 0.3],
        accel_mps2: [0.1, 0.2, 9.8],
        ..ImuSample::ZERO
    };
    sample.header.epoch = 1;
    suite.call(name, || {
        sample.header.seq += 1;
        sample.header.stamp_ns += PERIOD_NS;
        engine.sample(black_box(&sample), 0, &mut slot);
    });
}

/// Registers the routines.
pub fn routines(suite: &mut impl Suite) {
    let engine = InertialEngine::<SE23, Left, 9>::new(settings(false));
    samples(suite, "engine/9_left", engine, 9);
    let engine = InertialEngine::<NavState, Left, 15>::new(settings(true));
    samples(suite, "engine/15_left", engine, 15);
}
