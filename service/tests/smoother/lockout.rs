//! The gate, and the way out of a lock-out.

use inekf_shared::message::{SMOOTHED_CUT, SmoothedState};

use crate::common::{Input, lively_imu, position, stamp, state_on_circle};
use crate::{Fed, Full, full, smoothing};

/// A smoother whose receiver jumps by 100 m at sample 300; a fix every 20 samples until `samples`.
fn jumped(samples: u64) -> Full {
    let mut settings = smoothing("", 10, "");
    settings.fusion.recover_after = 4;
    let mut engine = full(settings);
    engine.set_state(&state_on_circle(stamp(0), 0.3)).unwrap();
    let mut outbox = Vec::new();
    for k in 0..=samples {
        if k > 0 && k.is_multiple_of(20) {
            let mut fix = position(stamp(k), k, 0);
            // The samples are not those of the circle: the truth is where the start is.
            fix.position_w_m = [0.0, 0.0, 0.0];
            fix.covariance_w_m2 = crate::common::isotropic(20.0);
            if k >= 300 {
                fix.position_w_m[0] = 1000.0;
            }
            engine.feed(&Input::Position(fix), &mut outbox);
        }
        engine.feed(&Input::Imu(lively_imu(k)), &mut outbox);
    }
    engine
}

fn left(engine: &mut Full) -> Vec<SmoothedState> {
    std::iter::from_fn(|| engine.take_left()).collect()
}

#[test]
fn a_gated_fix_makes_no_state_of_the_window() {
    let mut engine = jumped(300 + 3 * 20);
    assert_eq!(engine.tally().counters.gated, 4);
    assert_eq!(engine.tally().counters.accepted, 14);
    // The start and fourteen fixes, ten of them in the window.
    assert_eq!(left(&mut engine).len(), 5);
    assert_eq!(engine.smoothed(&mut |_| ()), Ok(10));
}

#[test]
fn a_lock_out_ends_with_a_new_window() {
    let mut engine = jumped(300 + 4 * 20);
    assert_eq!(engine.tally().counters.gated, 4);
    assert_eq!(engine.tally().counters.accepted, 15);
    let left = left(&mut engine);
    let cut = |state: &&SmoothedState| state.flags == SMOOTHED_CUT;
    assert_eq!(left.iter().filter(cut).count(), 10);
    assert_eq!(left.len(), 15);
    let indices: Vec<u64> = left.iter().map(|state| state.index).collect();
    assert_eq!(indices, (0..15).collect::<Vec<u64>>());
    assert_eq!(engine.smoothed(&mut |_| ()), Ok(1));
    let snapshot = engine.snapshot().unwrap();
    assert!(
        (snapshot.p_w_m[0] - 1000.0).abs() < 100.0,
        "{:?}",
        snapshot.p_w_m
    );
}
