//! Zero-velocity detection on a simulated car that stands and drives off, and at its edges.

use inekf_client::dataset::{ImuRow, Truth};
use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
use inekf_client::standstill::{Standstill, StandstillOptions};

#[test]
fn the_fixes_lie_where_the_car_stands_and_nowhere_else() {
    let options = SimulationOptions {
        seed: 4,
        duration_s: 40.0,
        ..SimulationOptions::default()
    };
    let mut dataset = simulate(Scenario::StandThenDrive, &options).unwrap();
    let added = dataset.add_standstill(&StandstillOptions::default());
    assert_eq!(added, dataset.velocity.len());
    // It stands for 15 s; the window is full after half a second, and a fix comes every fifth of one.
    assert!((70..=75).contains(&added), "{added}");
    let Truth::Spatial(truth) = &dataset.truth else {
        panic!("a truth in space");
    };
    for fix in &dataset.velocity {
        let at = truth.partition_point(|row| row.stamp_ns < fix.stamp_ns);
        let speed = truth[at].v_w_mps.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!(speed < 0.02, "{speed} m/s at {} ns", fix.stamp_ns);
    }
    assert!(
        dataset
            .velocity
            .windows(2)
            .all(|pair| pair[0].stamp_ns < pair[1].stamp_ns)
    );
}

/// A hundred samples a second; the first `still` of them at rest with a bias, then `then`.
fn fixes(still: u64, then: impl Fn(u64) -> ([f64; 3], [f64; 3])) -> Vec<u64> {
    let mut standstill = Standstill::new(StandstillOptions::default());
    let rest = ([0.02, -0.02, 0.01], [0.3, 0.0, 9.8]);
    (0..still + 200)
        .filter_map(|i| {
            let (gyro_rps, accel_mps2) = if i < still { rest } else { then(i) };
            standstill.push(&ImuRow {
                stamp_ns: i * 10_000_000,
                gyro_rps,
                accel_mps2,
            })
        })
        .map(|fix| fix.stamp_ns / 10_000_000)
        .collect()
}

#[test]
fn turning_shaking_and_gaps_are_no_standstill() {
    let ends = |fixes: Vec<u64>| (fixes.first().copied(), fixes.last().copied());
    // The window of half a second is full at sample 50; the last fix before sample 100 is at 90.
    let turning = |_: u64| ([0.0, 0.0, 0.2], [0.3, 0.0, 9.8]);
    assert_eq!(ends(fixes(100, turning)), (Some(50), Some(90)));
    let shaking = |i: u64| {
        let push = if i.is_multiple_of(2) { 0.5 } else { -0.5 };
        ([0.0; 3], [0.3 + push, 0.0, 9.8])
    };
    assert_eq!(ends(fixes(100, shaking)), (Some(50), Some(90)));
    // Two samples far apart are no window.
    let mut standstill = Standstill::new(StandstillOptions::default());
    for stamp_ns in [0, 10_000_000_000, 20_000_000_000] {
        let row = ImuRow {
            stamp_ns,
            gyro_rps: [0.0; 3],
            accel_mps2: [0.0, 0.0, 9.8],
        };
        assert_eq!(standstill.push(&row), None);
    }
}
