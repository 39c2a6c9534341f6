//! The library called by hand, one call per step: the engine gives the same bits.

use inekf::filter::{Belief, Left, propagate};
use inekf::model::{Discretisation, NavState, PositionObservation};
use inekf::smoother::{Preintegration, Window, WindowOptions};
use inekf_service::engine::Settings;
use inekf_shared::message::{ESTIMATE_PROPAGATED, ESTIMATE_UPDATED, EstimateSe23, SmoothedState};
use nalgebra::{Matrix3, Vector3};

use crate::common::{
    Direct, GRAVITY, Input, SIGMA, belief_bits, input_of, lively_imu, position, stamp,
    state_on_circle, true_position,
};
use crate::{Fed, full, smoothing};

const WINDOW: usize = 4;
const G_W: Vector3<f64> = Vector3::new(0.0, 0.0, -GRAVITY);

/// A smoother that starts on the circle, and the library's belief of the same start.
fn start(settings: Settings) -> (crate::Full, Belief<NavState, Left, 15>) {
    let state = state_on_circle(stamp(0), 0.3);
    let mut engine = full(settings);
    engine.set_state(&state).unwrap();
    (engine, Direct::new(&state).belief)
}

fn bits(belief: Belief<NavState, Left, 15>) -> Vec<u64> {
    let mut direct = Direct::new(&state_on_circle(stamp(0), 0.3));
    direct.belief = belief;
    direct.bits()
}

/// A fix every 30 samples, a third of a period before the sample that it is due by.
fn fix_before(k: u64) -> Option<inekf_shared::message::PositionFix> {
    (k > 0 && k.is_multiple_of(30)).then(|| position(stamp(k) - 3_333_333, k, 0))
}

fn drive(samples: u64) -> Vec<Input> {
    (0..=samples)
        .flat_map(|k| {
            let fix = fix_before(k).map(Input::Position);
            fix.into_iter().chain([Input::Imu(lively_imu(k))])
        })
        .collect()
}

#[test]
fn the_estimate_of_a_sample_is_the_newest_state_composed_with_the_motion_since() {
    let (mut engine, mut belief) = start(smoothing("", WINDOW, ""));
    let mut window = Window::<NavState, Left, 15>::new(&belief, &WindowOptions::new(WINDOW));
    let mut motion = Preintegration::new(&belief.mean);
    let (noise, zoh) = (Direct::noise(), Discretisation::ZeroOrderHold);
    let mut left = Vec::new();
    for k in 0..=400 {
        let sample = lively_imu(k);
        let mut published: Vec<EstimateSe23> = Vec::new();
        if let Some(fix) = fix_before(k) {
            engine.feed(&Input::Position(fix), &mut published);
        }
        engine.feed(&Input::Imu(sample), &mut published);
        if k == 0 {
            assert!(published.is_empty());
            continue;
        }
        let input = input_of(&sample);
        let before = belief;
        belief = propagate(&belief, &input, &G_W, 10_000_000.0 * 1e-9, zoh, &noise);
        let flags: Vec<u32> = published.iter().map(|row| row.head.flags).collect();
        assert!(belief_bits(&published[0]) == bits(belief), "sample {k}");
        let Some(fix) = fix_before(k) else {
            assert_eq!(flags, [ESTIMATE_PROPAGATED]);
            motion.push(&input, &G_W, 10_000_000.0 * 1e-9, zoh, &noise);
            continue;
        };
        // The sample is out before the window is solved, and again after.
        assert_eq!(flags, [ESTIMATE_PROPAGATED, ESTIMATE_UPDATED]);
        motion.push(&input, &G_W, 6_666_667.0 * 1e-9, zoh, &noise);
        let oldest = window.smoothed(0).unwrap();
        left.extend(window.push(&motion).map(|_| oldest));
        window
            .update(PositionObservation {
                position_w: fix.position_w_m.into(),
                covariance_w: Matrix3::identity() * (SIGMA * SIGMA),
                lever_arm_b: Vector3::zeros(),
            })
            .unwrap();
        assert_ne!(before, window.newest());
        let newest = window.newest();
        belief = propagate(&newest, &input, &G_W, 3_333_333.0 * 1e-9, zoh, &noise);
        assert!(belief_bits(&published[1]) == bits(belief), "fix {k}");
        assert_eq!(published[1].head.stamp_ns, stamp(k));
        motion = Preintegration::new(&newest.mean);
        motion.push(&input, &G_W, 3_333_333.0 * 1e-9, zoh, &noise);
    }

    // What has left the window, and what is in it.
    let taken: Vec<SmoothedState> = std::iter::from_fn(|| engine.take_left()).collect();
    assert_eq!(taken.len(), left.len());
    assert_eq!(
        taken.len(),
        1 + 13 - WINDOW,
        "the start, and of 13 fixes all but four"
    );
    let as_message = |state: &Belief<NavState, Left, 15>| {
        (
            <[f64; 3]>::from(state.mean.pose.position),
            <[f64; 3]>::from(state.mean.gyro_bias),
            state.covariance.upper_triangle().collect::<Vec<_>>(),
        )
    };
    let of = |state: &SmoothedState| (state.p_w_m, state.gyro_bias_rps, state.covariance.to_vec());
    for (index, (state, expected)) in taken.iter().zip(&left).enumerate() {
        assert_eq!((state.index, state.flags), (index as u64, 0));
        assert_eq!(of(state), as_message(expected));
    }
    let mut inside = Vec::new();
    assert_eq!(
        engine.smoothed(&mut |state| inside.push(*state)),
        Ok(WINDOW)
    );
    for (index, state) in inside.iter().enumerate() {
        assert_eq!((state.index, state.count), (index as u64, WINDOW as u64));
        let expected = window.smoothed(index).unwrap();
        let (actual, wanted) = (of(state), as_message(&expected));
        assert_eq!((actual.0, actual.1), (wanted.0, wanted.1));
        // Linearised where the states are now, for the next fix: not where they were before their last step.
        let sigma = expected.covariance.matrix().diagonal().map(f64::sqrt);
        let mut entries = actual.2.iter().zip(&wanted.2);
        for row in 0..15 {
            for column in row..15 {
                let (actual, wanted) = entries.next().expect("an entry of the triangle");
                let off = (actual - wanted).abs() / (sigma[row] * sigma[column]);
                assert!(off < 1e-3, "state {index}, {row}, {column}: off by {off}");
            }
        }
    }
    assert_eq!(inside.len(), WINDOW);
    let stamps: Vec<u64> = taken
        .iter()
        .chain(&inside)
        .map(|state| state.stamp_ns)
        .collect();
    let of_fixes = (1..=13).map(|fix| stamp(30 * fix) - 3_333_333);
    assert_eq!(
        stamps,
        [stamp(0)].into_iter().chain(of_fixes).collect::<Vec<_>>()
    );
}

#[test]
fn how_many_samples_are_kept_for_late_fixes_changes_no_bit() {
    let inputs = drive(400);
    let all: Vec<_> = [
        (1_000_000_000, 2048),
        (25_000_000, 2048),
        (1_000_000_000, 2),
        (0, 1),
    ]
    .into_iter()
    .map(|(window_ns, capacity)| {
        let mut settings = smoothing("", WINDOW, "");
        settings.fusion.late_window_ns = window_ns;
        settings.fusion.late_capacity = capacity;
        let (mut engine, _) = start(settings);
        let rows = engine.run(&inputs);
        assert_eq!(engine.tally().counters.late, 0);
        rows.iter().map(belief_bits).collect::<Vec<_>>()
    })
    .collect();
    assert!(all.iter().all(|bits| *bits == all[0]));
}

#[test]
fn fixes_that_say_the_truth_keep_the_estimate_there() {
    let mut engine = full(smoothing("", 20, ""));
    let last = engine.run(&crate::circle(20)).pop().unwrap();
    let off = Vector3::from(last.p_w_m) - true_position(last.head.stamp_ns);
    assert!(off.norm() < 0.1, "{off}");
}
