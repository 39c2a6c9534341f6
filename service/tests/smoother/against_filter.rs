//! A window of one state, with one iteration and a frozen covariance, is the plain InEKF: the same sums in another order.

use inekf::filter::{Left, Transport};
use inekf::lie::SE23;
use inekf::model::NavState;
use inekf_service::config::WhiteNoise;
use inekf_service::engine::{InertialEngine, Settings};
use inekf_shared::message::EstimateSe23;

use crate::common::{Input, numbers, state_of};
use crate::{Fed, circle, full, plain, rows, settings, smoothing};

/// What the sums may differ by: of each number above 1, relative to it.
const ROUNDING: f64 = 1e-10;

/// The largest difference of any number of any row.
fn difference(smoothed: &[EstimateSe23], filtered: &[EstimateSe23]) -> f64 {
    let (smoothed, filtered) = (rows(smoothed), rows(filtered));
    assert_eq!(smoothed.len(), filtered.len());
    assert_eq!(smoothed.len(), 999, "the first sample is the start");
    let mut largest = 0.0;
    for (ours, theirs) in smoothed.iter().zip(&filtered) {
        assert_eq!(ours.head.stamp_ns, theirs.head.stamp_ns);
        let (ours, theirs) = (state_of(ours), state_of(theirs));
        for (our, their) in numbers(&ours).zip(numbers(&theirs)) {
            largest = f64::max(largest, (our - their).abs() / their.abs().max(1.0));
        }
    }
    largest
}

/// The filter of the papers: one iteration, no transport.
fn plain_filter(top: &str) -> Settings {
    let mut settings = settings(top, "");
    settings.fusion.update.iterations = 1;
    settings.fusion.update.transport = Transport::None;
    settings
}

/// With an attitude that is known for certain, the problem is linear: then the two are the same whatever the fixes say.
/// (Else the window's prior has seen each fix linearised a second time, where the first correction led.)
fn linear(mut settings: Settings) -> Settings {
    let Settings { imu, initial, .. } = &mut settings;
    imu.white = WhiteNoise::Density {
        gyro: 0.0,
        accel: 2e-2,
    };
    imu.gyro_bias_walk = 0.0;
    initial.heading_sigma = 0.0;
    initial.level_sigma = 0.0;
    initial.biases.gyro_sigma = 0.0;
    settings
}

/// The circle with fixes that are off by decimetres.
fn noisy() -> Vec<Input> {
    let mut inputs = circle(10);
    let off = |seq: u64, axis: usize| 0.4 * (seq as f64 * 1.7 + axis as f64).sin();
    for input in &mut inputs {
        let (seq, values) = match input {
            Input::Position(fix) => (fix.header.seq, &mut fix.position_w_m),
            Input::Velocity(fix) => (fix.header.seq, &mut fix.velocity_w_mps),
            Input::Imu(_) | Input::Heading(_) => continue,
        };
        for (axis, value) in values.iter_mut().enumerate() {
            *value += off(seq, axis);
        }
    }
    inputs
}

#[test]
fn a_window_of_one_state_is_the_plain_filter() {
    let inputs = noisy();
    let mut filter = InertialEngine::<NavState, Left, 15>::new(linear(plain_filter("")));
    let mut smoother = full(linear(smoothing("", 1, "")));
    let (filtered, smoothed) = (filter.run(&inputs), smoother.run(&inputs));
    assert!(difference(&smoothed, &filtered) < ROUNDING);
    assert_eq!(smoother.tally().counters, filter.tally().counters);
    assert!(smoother.tally().counters.accepted > 100);
    // The fixes have a say: without those of the second half the estimate is another one.
    let fewer: Vec<Input> = inputs
        .into_iter()
        .filter(|input| {
            matches!(input, Input::Imu(_)) || input.header().stamp_ns < crate::common::stamp(500)
        })
        .collect();
    assert!(difference(&full(linear(smoothing("", 1, ""))).run(&fewer), &filtered) > 0.01);
}

#[test]
fn a_window_of_one_state_without_biases_is_the_plain_filter() {
    let (inputs, top) = (noisy(), "biases = false");
    let filtered = InertialEngine::<SE23, Left, 9>::new(linear(plain_filter(top))).run(&inputs);
    let smoothed = plain(linear(smoothing(top, 1, ""))).run(&inputs);
    assert!(difference(&smoothed, &filtered) < ROUNDING);
}

#[test]
fn the_covariance_of_a_window_of_one_state_is_that_of_the_plain_filter() {
    // With all uncertainties, and fixes on the path, so that the corrections are small.
    let inputs = circle(10);
    let filtered = InertialEngine::<NavState, Left, 15>::new(plain_filter("")).run(&inputs);
    let smoothed = full(smoothing("", 1, "")).run(&inputs);
    assert!(difference(&smoothed, &filtered) < ROUNDING);
}

#[test]
fn headings_are_taken_as_the_plain_filter_takes_them() {
    let sources = "[[heading_source]]\nid = 0\n";
    let inputs = crate::common::circle(10);
    let mut plain = settings("", sources);
    plain.fusion.update.iterations = 1;
    plain.fusion.update.transport = Transport::None;
    let mut filter = InertialEngine::<NavState, Left, 15>::new(plain);
    let mut smoother = full(smoothing("", 1, sources));
    let (filtered, smoothed) = (filter.run(&inputs), smoother.run(&inputs));
    assert!(difference(&smoothed, &filtered) < ROUNDING);
    assert_eq!(smoother.tally().counters, filter.tally().counters);
    let without = full(smoothing("", 1, "")).run(&circle(10));
    assert!(
        difference(&without, &filtered) > 1e-6,
        "the headings have a say"
    );
}
