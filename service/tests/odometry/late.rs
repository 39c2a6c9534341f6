//! A fix that is late by a few rows is fused by replay, and the result is bit for bit that of the same fix on time, for
//! every filter: the bank and the columns of the constraints are replayed too. One that is later is carried by the filters
//! that have nothing but a belief, and is the same but for rounding.

use super::harness::{
    CHOICES, Choice, Input, PERIOD, START, fix, planar_state, plane, run, space, spatial_state,
};

/// Rows in a bend; fixes of both sources at a third of every fourth row, `delay` rows late.
fn bend(dimension: usize, delay: u64) -> Vec<Input> {
    let mut inputs = vec![Input::Set(planar_state(START, [0.02, 1.0, 2.0]))];
    if dimension == 3 {
        let variances = [0.01, 0.01, 0.02, 1.0, 2.0, 1.5];
        inputs[0] = Input::Set(spatial_state(START, variances));
    }
    for k in 1..=40_u64 {
        let due = k.checked_sub(delay).filter(|due| due % 4 == 2 && *due < 36);
        let fixes = due.map(|due| {
            let at = START + due * PERIOD - 66_000_000;
            let t = due as f64;
            let seen = [4.0 + 0.4 * t, -3.0 + 0.02 * t * t, 1.0 + 0.1 * t.sin()];
            [0, 1].map(|source| fix(at, due, source, &seen[..dimension]))
        });
        inputs.extend(fixes.into_iter().flatten());
        let stamp = START + k * PERIOD;
        inputs.push(if dimension == 2 {
            plane(stamp, k, [0.05, 0.5, 0.01])
        } else {
            space(stamp, k, [0.01, -0.02, 0.05, 0.5, 0.01, -0.02])
        });
    }
    inputs
}

#[test]
fn a_late_pair_is_bit_for_bit_one_on_time() {
    for dimension in [2, 3] {
        for choice in CHOICES {
            let text = choice.text(dimension, "[late]\nwindow_s = 2.0\n");
            let (prompt, late) = (
                run(&text, &bend(dimension, 0)),
                run(&text, &bend(dimension, 3)),
            );
            assert_eq!(prompt.counters.accepted, 18, "{}", choice.name);
            assert_eq!(late.counters.accepted, 18, "{}", choice.name);
            assert_eq!(prompt.last().bits(), late.last().bits(), "{}", choice.name);
            assert_eq!(prompt.state_bits(), late.state_bits());
        }
    }
}

/// Filters that have nothing but a belief.
fn is_carried(choice: &Choice) -> bool {
    ["left", "right", "additive", "hinf"].contains(&choice.name)
}

#[test]
fn a_fix_that_is_much_later_is_that_of_a_replay() {
    for dimension in [2, 3] {
        for choice in CHOICES {
            let with = |method: &str| {
                let late = format!("[late]\nwindow_s = 4.0\nmethod = \"{method}\"\n");
                run(&choice.text(dimension, &late), &bend(dimension, 20))
            };
            let (carried, replayed) = (with("carry"), with("replay"));
            assert_eq!(carried.counters, replayed.counters, "{}", choice.name);
            assert_eq!(carried.estimates.len(), replayed.estimates.len());
            let same_bits = carried.last().bits() == replayed.last().bits();
            if is_carried(&choice) {
                assert!(!same_bits, "{}: it must not be a replay", choice.name);
            } else {
                assert!(same_bits, "{}", choice.name);
            }
            let (a, b) = (carried.snapshot.unwrap(), replayed.snapshot.unwrap());
            for axis in 0..3 {
                let apart = (a.p_w_m[axis] - b.p_w_m[axis]).abs();
                assert!(apart <= 1e-12 * b.p_w_m[axis].abs().max(1.0), "{apart:e}");
            }
            let largest = |s: &inekf_shared::message::StateVector| {
                s.covariance.iter().fold(0.0, |m: f64, p| m.max(p.abs()))
            };
            for (p, q) in a.covariance.iter().zip(&b.covariance) {
                assert!((p - q).abs() <= 1e-12 * largest(&b), "{}", choice.name);
            }
        }
    }
}
