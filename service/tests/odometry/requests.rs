//! States by request: what is refused, the configured covariance, and the way of a snapshot there and back.

use inekf_shared::message::{
    ESTIMATE_RESUMED, MODEL_IMU, MODEL_ODOMETRY_3D, StateVector, triangle_index,
};

use super::harness::{
    CHOICES, Input, PERIOD, START, named, planar_state, plane, run, space, spatial_state,
};

const PLANE: [f64; 3] = [0.02, 1.0, 2.0];
const SPACE: [f64; 6] = [0.01, 0.01, 0.02, 1.0, 2.0, 1.5];

#[test]
fn states_that_are_none_are_refused_and_change_nothing() {
    let good = [
        Input::Set(planar_state(START, PLANE)),
        plane(START + PERIOD, 1, [0.1, 0.5, 0.0]),
    ];
    let text = named("left").text(2, "");
    let before = run(&text, &good).state_bits();
    let changed = |change: &dyn Fn(&mut StateVector)| {
        let mut state = planar_state(START + PERIOD, PLANE);
        change(&mut state);
        let outcome = run(&text, &[&good[..], &[Input::Set(state)]].concat());
        assert_eq!(outcome.state_bits(), before);
        assert_eq!(outcome.refusals.len(), 1, "{state:?}");
        outcome.refusals[0]
    };
    let says = |words: &str, change: &dyn Fn(&mut StateVector)| {
        let said = changed(change);
        assert!(said.contains(words), "{said}");
    };
    says("another model", &|s| s.model = MODEL_IMU);
    says("another model", &|s| s.model = MODEL_ODOMETRY_3D);
    says("unknown", &|s| s.model = 77);
    says("vertical", &|s| s.q_wb = [0.1, 0.0, 0.0, 0.99f64.sqrt()]);
    // Head down it does not lean, but the plane lies the other way up.
    says("vertical", &|s| s.q_wb = [1.0, 0.0, 0.0, 0.0]);
    says("quaternion", &|s| s.q_wb = [0.0, 0.0, 0.0, 1.2]);
    says("dimension", &|s| s.dimension = 6);
    says("positive semidefinite", &|s| s.covariance[0] = -1.0);
    says("positive semidefinite", &|s| {
        s.covariance[triangle_index(1, 2, 3).unwrap()] = 1.5;
    });
    says("not finite", &|s| s.p_w_m[0] = f64::NAN);
    says("beyond belief", &|s| s.p_w_m[1] = 1e12);
    says("older", &|s| s.stamp_ns = START);
    says("ahead", &|s| s.stamp_ns = START + 10_000 * PERIOD);
}

#[test]
fn dimension_zero_takes_the_configured_covariance() {
    let mut state = planar_state(START, PLANE);
    state.dimension = 0;
    let outcome = run(&named("left").text(2, ""), &[Input::Set(state)]);
    let snapshot = outcome.snapshot.unwrap();
    let heading = 5.0_f64.to_radians().powi(2);
    for (i, variance) in [heading, 4.0, 4.0].into_iter().enumerate() {
        let ours = snapshot.covariance[triangle_index(i, i, 3).unwrap()];
        assert!((ours - variance).abs() < 1e-12, "{i}: {ours}");
    }
    let mut state = spatial_state(START, SPACE);
    state.dimension = 0;
    let outcome = run(&named("left").text(3, ""), &[Input::Set(state)]);
    let snapshot = outcome.snapshot.unwrap();
    assert_eq!(snapshot.dimension, 6);
    for i in 3..6 {
        let ours = snapshot.covariance[triangle_index(i, i, 6).unwrap()];
        assert!((ours - 4.0).abs() < 1e-12, "{i}: {ours}");
    }
}

#[test]
fn a_snapshot_sets_the_same_state() {
    for dimension in [2, 3] {
        for choice in CHOICES {
            let text = choice.text(dimension, "");
            let (state, row) = if dimension == 2 {
                (
                    planar_state(START, PLANE),
                    plane(START + PERIOD, 1, [0.1, 0.5, 0.0]),
                )
            } else {
                let row = space(START + PERIOD, 1, [0.1, -0.05, 0.2, 0.5, 0.0, 0.1]);
                (spatial_state(START, SPACE), row)
            };
            let first = run(&text, &[Input::Set(state), row]).snapshot.unwrap();
            let second = run(&text, &[Input::Set(first)]).snapshot.unwrap();
            let numbers = |s: &StateVector| {
                let all = s.q_wb.iter().chain(&s.p_w_m).chain(&s.covariance);
                let learned = s.parameters.iter().chain(&s.parameter_covariance);
                all.chain(learned)
                    .chain(&s.mode_weights)
                    .copied()
                    .collect::<Vec<f64>>()
            };
            for (a, b) in numbers(&first).iter().zip(numbers(&second)) {
                assert!((a - b).abs() < 1e-12, "{}: {a} {b}", choice.name);
            }
            assert_eq!(
                (first.stamp_ns, first.dimension),
                (second.stamp_ns, second.dimension)
            );
        }
    }
}

/// With odometry nobody knows the speed: the pose stays where it was, doubted by how fast it may have turned and moved.
#[test]
fn a_pose_of_an_earlier_life_stays_and_is_doubted_by_the_time_since() {
    // 3 s before the first row, which speaks for 0.1 s of them.
    let t = 2.9_f64;
    let first_ns = START + 30 * PERIOD;
    for choice in CHOICES {
        let earlier = planar_state(START, PLANE);
        let inputs = [Input::Resume(earlier), plane(first_ns, 1, [0.0, 0.0, 0.0])];
        let outcome = run(&choice.text(2, ""), &inputs);
        let found = &outcome.estimates[0];
        assert_eq!(found.head.flags & ESTIMATE_RESUMED, ESTIMATE_RESUMED);
        assert_eq!(found.head.stamp_ns, first_ns);
        for (found, expected) in found.mean.iter().zip([0.3, 4.0, -3.0]) {
            assert!((found - expected).abs() < 1e-9, "{}: {found}", choice.name);
        }
        // What the row adds is noise of 0.1 s, as for the silence: 0.01 rad and 0.02 m by the root of a second.
        let turned = PLANE[0] + (0.2 * t).powi(2) + 0.01_f64.powi(2) * 3.0;
        let found = outcome.snapshot.unwrap().covariance[0];
        assert!(
            (found / turned - 1.0).abs() < 0.01,
            "{}: {found}",
            choice.name
        );
    }

    let earlier = planar_state(START, [0.0, 1.0, 2.0]);
    let outcome = run(
        &named("left").text(2, ""),
        &[Input::Resume(earlier), plane(first_ns, 1, [0.0, 0.0, 0.0])],
    );
    let found = outcome.snapshot.unwrap();
    for (axis, before) in [(1, 1.0), (2, 2.0)] {
        let found = found.covariance[triangle_index(axis, axis, 3).unwrap()];
        let expected = before + (2.0 * t).powi(2) + 0.02_f64.powi(2) * 3.0;
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn a_row_that_reaches_back_to_the_earlier_state_speaks_for_all_the_time_since() {
    // 0.05 s, while the first row speaks for 0.1 s: no silence at all.
    let earlier = planar_state(START, PLANE);
    let first = plane(START + PERIOD / 2, 1, [0.1, 0.4, 0.0]);
    let outcome = run(&named("left").text(2, ""), &[Input::Resume(earlier), first]);
    let [theta, x, y] = outcome.estimates[0].mean[..] else {
        panic!("three numbers")
    };
    // Half of the row.
    assert!((theta - 0.35).abs() < 1e-12, "{theta}");
    assert!(((x - 4.0).hypot(y + 3.0) - 0.2).abs() < 1e-3);
    let found = outcome.snapshot.unwrap().covariance[0];
    assert!(
        (found - PLANE[0] - 0.01_f64.powi(2) * 0.05).abs() < 1e-12,
        "{found}"
    );

    let late = planar_state(START, PLANE);
    let first = space(START + 200 * PERIOD, 1, [0.0; 6]);
    let outcome = run(
        &named("left").text(3, ""),
        &[Input::Resume(spatial_state(START, SPACE)), first],
    );
    assert_eq!(
        outcome.estimates[0].head.flags & ESTIMATE_RESUMED,
        0,
        "too old"
    );
    let outcome = run(&named("left").text(3, ""), &[Input::Resume(late)]);
    assert!(outcome.refusals[0].contains("another model"));
}
