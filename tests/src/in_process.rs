//! The daemon's engine in this process, fed in the daemon's order: an oracle for everything between two processes.
//!
//! Order: before each sample the fixes with a stamp up to its own: positions, then velocities, then headings; what is
//! left at the end and lies ahead of the last sample is not fed.

use inekf::filter::Left;
use inekf::lie::SE23;
use inekf::model::NavState;
use inekf_client::dataset::{Dataset, Initial, Meta};
use inekf_client::feed::{Input, Numbering};
use inekf_client::rows::{RowBuilder, state, triangle};
use inekf_client::table::{EstimateWriter, Layout};
use inekf_service::config::{Config, Motion};
use inekf_service::engine::smoothing::SmoothingEngine;
use inekf_service::engine::tally::Tally;
use inekf_service::engine::{Engine, History, InertialEngine, Model, Outbox, Settings};
use inekf_shared::message::{
    EstimateSe23, ImuSample, MODEL_IMU, NAV_DIM, StateVector, Zero, triangle_index,
};

/// Feeds a dataset to an engine with this configuration; every estimate goes to `outbox`.
pub fn run(dataset: &Dataset, config: &str, outbox: &mut impl Outbox<EstimateSe23>) -> Tally {
    let config = Config::from_toml_str(config, "the test's").unwrap_or_else(|e| panic!("{e}"));
    let Motion::Inertial(inertial) = &config.motion else {
        panic!("the configuration is not one of the model imu");
    };
    let settings = Settings::new(&config);
    match (inertial.biases, &settings.smoother) {
        (true, None) => {
            let engine = InertialEngine::<NavState, Left, 15>::new(settings);
            feed(dataset, engine, outbox)
        }
        (false, None) => feed(
            dataset,
            InertialEngine::<SE23, Left, 9>::new(settings),
            outbox,
        ),
        (true, Some(smoother)) => {
            let engine = SmoothingEngine::<NavState, 15>::smoothing(settings, smoother);
            feed(dataset, engine, outbox)
        }
        (false, Some(smoother)) => {
            let engine = SmoothingEngine::<SE23, 9>::smoothing(settings, smoother);
            feed(dataset, engine, outbox)
        }
    }
}

/// The estimate CSV that `replay` is to write: its bytes.
pub fn csv(dataset: &Dataset, config: &str, covariance: bool) -> Vec<u8> {
    let mut estimates = Vec::new();
    run(dataset, config, &mut estimates);
    csv_of(&estimates, covariance)
}

/// The estimate CSV of these estimates.
pub fn csv_of(estimates: &[EstimateSe23], covariance: bool) -> Vec<u8> {
    let first = estimates.first().expect("an estimate");
    let dimension = covariance.then_some(first.head.dimension as usize);
    let mut writer =
        EstimateWriter::new(Vec::new(), Layout::Navigation, dimension).expect("a header");
    let mut write = |row: &EstimateSe23| {
        let triangle = if covariance { triangle(row) } else { &[] };
        writer
            .write(row.head.stamp_ns, &state(row), triangle)
            .expect("a row");
    };
    let mut builder = RowBuilder::default();
    for estimate in estimates {
        builder.push(*estimate).iter().for_each(&mut write);
    }
    builder.finish().iter().for_each(write);
    writer.finish().expect("a table")
}

/// The set-state request for a dataset's initial state, if it has one.
pub fn initial_state(meta: &Meta) -> Option<StateVector> {
    let Some(Initial::Spatial {
        stamp_ns,
        q_wb,
        v_w_mps,
        p_w_m,
        gyro_bias_rps,
        accel_bias_mps2,
    }) = meta.initial
    else {
        return None;
    };
    let variances = meta.p0_diag.as_ref()?;
    let mut state = StateVector {
        model: MODEL_IMU,
        dimension: variances.len() as u32,
        stamp_ns,
        q_wb,
        v_w_mps,
        p_w_m,
        gyro_bias_rps,
        accel_bias_mps2,
        ..StateVector::ZERO
    };
    for (i, variance) in variances.iter().enumerate() {
        let index = triangle_index(i, i, variances.len()).expect("an entry of the triangle");
        state.covariance[index] = *variance;
    }
    assert!(variances.len() <= NAV_DIM);
    Some(state)
}

/// Feeds everything that is due.
fn feed<M, H>(
    dataset: &Dataset,
    mut engine: Engine<M, H>,
    outbox: &mut impl Outbox<EstimateSe23>,
) -> Tally
where
    M: Model<Sample = ImuSample, Estimate = EstimateSe23>,
    H: History<M>,
{
    if let Some(state) = initial_state(&dataset.meta) {
        engine.set_state(&state).expect("the initial state is good");
    }
    let mut numbering = Numbering::new(1);
    let (mut position, mut velocity, mut heading) = (vec![], vec![], vec![]);
    let mut samples = vec![];
    for event in dataset.events() {
        match numbering.message(&event, 0) {
            Input::Imu(sample) => samples.push(sample),
            Input::Position(fix) => position.push(fix),
            Input::Velocity(fix) => velocity.push(fix),
            Input::Heading(fix) => heading.push(fix),
            Input::Odometry2d(_) | Input::Odometry3d(_) => {}
        }
    }
    let (mut position, mut velocity, mut heading) = (
        position.into_iter().peekable(),
        velocity.into_iter().peekable(),
        heading.into_iter().peekable(),
    );
    for sample in samples {
        let now_ns = sample.header.stamp_ns;
        while let Some(fix) = position.next_if(|fix| fix.header.stamp_ns <= now_ns) {
            engine.position(&fix, outbox);
        }
        while let Some(fix) = velocity.next_if(|fix| fix.header.stamp_ns <= now_ns) {
            engine.velocity(&fix, outbox);
        }
        while let Some(fix) = heading.next_if(|fix| fix.header.stamp_ns <= now_ns) {
            engine.heading(&fix, outbox);
        }
        engine.sample(&sample, 0, outbox);
    }
    *engine.tally()
}

/// The same dataset, later: every stamp moved by `by_ns`.
pub fn shifted(dataset: &Dataset, by_ns: u64) -> Dataset {
    let mut moved = dataset.clone();
    let stamps = moved.imu.iter_mut().map(|row| &mut row.stamp_ns);
    let stamps = stamps.chain(moved.position.iter_mut().map(|row| &mut row.stamp_ns));
    let stamps = stamps.chain(moved.velocity.iter_mut().map(|row| &mut row.stamp_ns));
    let stamps = stamps.chain(moved.heading.iter_mut().map(|row| &mut row.stamp_ns));
    stamps.for_each(|stamp_ns| *stamp_ns += by_ns);
    moved
}
