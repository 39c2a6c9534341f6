//! From the smoother to the filter, once the heading is known.

use inekf::filter::Left;
use inekf::model::NavState;
use inekf_service::engine::InertialEngine;
use inekf_shared::message::{SMOOTHED_CUT, SmoothedState};

use crate::common::{Input, imu, numbers, position, stamp, state_of, state_on_circle};
use crate::{Fed, full, rows, settings, smoothing};

/// What two ways of starting from one state may differ by: its attitude is normalised once more.
const ROUNDING: f64 = 1e-11;

#[test]
fn the_filter_goes_on_from_the_newest_state_and_its_covariance() {
    // The circle shows the heading, of which 17 deg are unknown at first, as far as the biases allow: to 11 deg.
    let mut engine = full(smoothing("", 6, "hand_over_deg = 12.0"));
    engine.set_state(&state_on_circle(stamp(0), 0.3)).unwrap();
    let mut filter = InertialEngine::<NavState, Left, 15>::new(settings("", ""));
    let (mut smoothed, mut filtered) = (Vec::new(), Vec::new());
    let mut handed_over = None;
    for k in 0..=3000_u64 {
        if k > 0 && k.is_multiple_of(20) {
            let fix = Input::Position(position(stamp(k) - 5_000_000, k, 0));
            engine.feed(&fix, &mut smoothed);
        }
        let before = engine.snapshot();
        engine.feed(&Input::Imu(imu(k)), &mut smoothed);
        if k == 0 {
            continue;
        }
        if handed_over.is_none() && engine.smoothed(&mut |_| ()) == Ok(0) {
            handed_over = Some(k);
            filter.set_state(&before.expect("a state")).unwrap();
            smoothed.drain(..smoothed.len() - 2);
        }
        if let Some(first) = handed_over {
            // The filter hears of the first fix too, and of all after it.
            if k.is_multiple_of(20) {
                let fix = Input::Position(position(stamp(k) - 5_000_000, k, 0));
                filter.feed(&fix, &mut filtered);
            }
            assert!(k >= first);
            filter.feed(&Input::Imu(imu(k)), &mut filtered);
        }
    }
    let first = handed_over.expect("the heading is found");
    assert!(
        first.is_multiple_of(20) && (40..2500).contains(&first),
        "{first}"
    );
    let (ours, theirs) = (rows(&smoothed), rows(&filtered));
    assert_eq!(ours.len(), theirs.len());
    assert_eq!(ours.len() as u64, 3000 - first + 1);
    for (our, their) in ours.iter().zip(&theirs) {
        assert_eq!(our.head.stamp_ns, their.head.stamp_ns);
        for (our, their) in numbers(&state_of(our)).zip(numbers(&state_of(their))) {
            let off = (our - their).abs() / their.abs().max(1.0);
            assert!(off < ROUNDING, "{our}, {their}");
        }
    }

    let left: Vec<SmoothedState> = std::iter::from_fn(|| engine.take_left()).collect();
    let cut = left.iter().filter(|state| state.flags == SMOOTHED_CUT);
    assert_eq!(cut.count(), 6.min(first as usize / 20));
    // A start anew begins to smooth again.
    engine
        .set_state(&state_on_circle(stamp(3000), 0.3))
        .unwrap();
    assert_eq!(engine.smoothed(&mut |_| ()), Ok(1));
}

#[test]
fn it_stays_a_smoother_unless_told_otherwise() {
    let mut engine = full(smoothing("", 6, ""));
    engine.run(&crate::circle(20));
    assert_eq!(engine.smoothed(&mut |_| ()), Ok(6));
}
