//! What is learned beside the pose: it outlives the daemon, and hours of standing still do not spoil its covariance.

use inekf_shared::message::{StateVector, triangle_index};
use nalgebra::DMatrix;

use super::harness::{
    Estimate, Input, PERIOD, START, fix, named, planar_state, plane, run, space, spatial_state,
};

/// The filters that learn.
const LEARNING: [&str; 3] = ["consider", "augmented", "adaptive"];
/// The odometry tells so much more than the way.
const SCALE: f64 = 0.06;

/// A round drive of `count` rows, each on its way over-reported by [`SCALE`], with a fix of each source every second.
fn drive(dimension: usize, count: u64) -> Vec<Input> {
    let (turn, way) = (0.05, 0.5);
    let mut inputs = match dimension {
        2 => vec![Input::Set(planar_state(START, [0.01, 1.0, 1.0]))],
        _ => {
            let mut state = spatial_state(START, [1e-4, 1e-4, 0.01, 1.0, 1.0, 1.0]);
            state.q_wb = planar_state(START, [0.0; 3]).q_wb;
            vec![Input::Set(state)]
        }
    };
    let (mut heading, mut at) = (0.3_f64, [4.0, -3.0, 1.0]);
    for k in 1..=count {
        let stamp_ns = START + k * PERIOD;
        let told = way / (1.0 + SCALE);
        inputs.push(match dimension {
            2 => plane(stamp_ns, k, [turn, told, 0.0]),
            _ => space(stamp_ns, k, [0.0, 0.0, turn, told, 0.0, 0.0]),
        });
        at[0] += way * heading.cos();
        at[1] += way * heading.sin();
        heading += turn;
        if k % 10 == 0 {
            for source in [0, 1] {
                inputs.push(fix(stamp_ns, k, source, &at[..dimension]));
            }
        }
    }
    inputs
}

fn stamp_ns(input: &Input) -> u64 {
    match input {
        Input::Plane(row) => row.header.stamp_ns,
        Input::Space(row) => row.header.stamp_ns,
        Input::Fix(fix) => fix.header.stamp_ns,
        Input::Set(_) | Input::Resume(_) | Input::Reset => START,
    }
}

/// Two lives: the state that the first one left after `rows` rows, and what the second one makes of the rest.
fn two_lives(
    text: &str,
    inputs: &[Input],
    rows: u64,
    change: impl Fn(&mut StateVector),
) -> (StateVector, Vec<Estimate>) {
    let end_ns = START + rows * PERIOD;
    let (before, after): (Vec<Input>, Vec<Input>) =
        inputs.iter().partition(|input| stamp_ns(input) <= end_ns);
    let mut left = run(text, &before).snapshot.unwrap();
    assert_eq!(left.stamp_ns, end_ns);
    change(&mut left);
    let next = run(text, &[vec![Input::Resume(left)], after].concat());
    assert!(next.refusals.is_empty(), "{:?}", next.refusals);
    (left, next.estimates)
}

#[test]
fn an_interruption_costs_a_filter_nothing_of_what_it_learned() {
    for dimension in [2, 3] {
        let inputs = drive(dimension, 400);
        for name in ["consider", "augmented"] {
            let text = named(name).text(dimension, "");
            let whole = run(&text, &inputs).estimates;
            let (left, second) = two_lives(&text, &inputs, 205, |_| {});
            assert_eq!(left.parameter_count, 3);
            if name == "augmented" {
                assert!((left.parameters[0] - SCALE).abs() < 0.01, "{left:?}");
            }
            let rest = &whole[whole.len() - second.len()..];
            for (one, other) in rest.iter().zip(&second) {
                assert_eq!(one.head.stamp_ns, other.head.stamp_ns);
                let numbers = |estimate: &Estimate| {
                    let all = estimate.mean.iter().chain(&estimate.covariance);
                    let learned = estimate.mismatch.iter().chain(&estimate.sigma);
                    all.chain(learned).copied().collect::<Vec<f64>>()
                };
                for (a, b) in numbers(one).iter().zip(numbers(other)) {
                    let same = (a - b).abs() < 1e-9 || (a.is_nan() && b.is_nan());
                    assert!(same, "{name} in {dimension}: {a} {b}");
                }
            }
        }
    }
}

#[test]
fn a_bank_goes_on_with_its_parameters_and_its_weights() {
    for dimension in [2, 3] {
        let inputs = drive(dimension, 400);
        let text = named("adaptive").text(dimension, "");
        let (left, second) = two_lives(&text, &inputs, 205, |_| {});
        assert_eq!((left.parameter_count, left.mode_count), (3, 9));
        assert!((left.mode_weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((left.parameters[0] - SCALE).abs() < 0.02, "{left:?}");
        // The first row moves the pose, and nothing of the parameters.
        for (parameter, mismatch) in left.parameters.iter().zip(&second[0].mismatch).take(3) {
            assert!(
                (parameter - mismatch).abs() < 1e-9,
                "{parameter} {mismatch}"
            );
        }
        // And it is no worse for the interruption in the end.
        let last = second.last().unwrap();
        assert!((last.mismatch[0] - SCALE).abs() < 0.02, "{last:?}");
        // Without what was learned the next life begins as configured.
        let (_, second) = two_lives(&text, &inputs, 205, |state| state.parameter_count = 0);
        assert!(second[0].mismatch[0].abs() < 1e-9, "{:?}", second[0]);
    }
}

#[test]
fn what_was_not_learned_by_the_same_filter_is_refused() {
    let inputs = drive(2, 50);
    for name in LEARNING {
        let text = named(name).text(2, "");
        let good = run(&text, &inputs).snapshot.unwrap();
        let refused = |change: &dyn Fn(&mut StateVector)| {
            let mut state = good;
            change(&mut state);
            let outcome = run(&text, &[&inputs[..], &[Input::Set(state)]].concat());
            assert_eq!(outcome.refusals.len(), 1, "{name}");
            outcome.refusals[0]
        };
        assert!(
            run(&text, &[Input::Set(good)]).refusals.is_empty(),
            "{name}"
        );
        assert!(refused(&|s| s.parameter_count = 2).contains("other mismatches"));
        assert!(refused(&|s| s.dimension = 0).contains("other mismatches"));
        assert!(refused(&|s| s.parameters[1] = f64::NAN).contains("not finite"));
        assert!(refused(&|s| s.parameter_covariance[3] = -1.0).contains("positive semidefinite"));
        assert!(refused(&|s| s.parameter_covariance[0] = 1e3).contains("positive semidefinite"));
        if name == "adaptive" {
            assert!(refused(&|s| s.mode_weights = [0.0; 9]).contains("weights"));
            assert!(refused(&|s| s.mode_weights[4] = f64::NAN).contains("weights"));
            assert!(refused(&|s| s.mode_count = 8).contains("weights"));
        }
    }
    let learned = run(&named("augmented").text(2, ""), &inputs)
        .snapshot
        .unwrap();
    let left = run(&named("left").text(2, ""), &[Input::Set(learned)]);
    assert!(
        left.refusals[0].contains("estimates none"),
        "{:?}",
        left.refusals
    );
}

/// The smallest eigenvalue of the covariance of pose and parameters, scaled to unit variances.
fn smallest_eigenvalue(state: &StateVector) -> f64 {
    let (d, count) = (state.dimension as usize, state.parameter_count as usize);
    let mut p = DMatrix::<f64>::zeros(d + count, d + count);
    for row in 0..d {
        for column in row..d {
            p[(row, column)] = state.covariance[triangle_index(row, column, d).unwrap()];
        }
    }
    let mut entries = state.parameter_covariance.iter();
    for k in 0..count {
        for (row, entry) in (0..=d + k).zip(entries.by_ref()) {
            p[(row, d + k)] = *entry;
        }
    }
    let scaled = DMatrix::from_fn(d + count, d + count, |row, column| {
        let of = p[(row.min(column), row.max(column))];
        of / (p[(row, row)] * p[(column, column)]).sqrt()
    });
    scaled.symmetric_eigenvalues().min()
}

/// A body that stands, with odometry free of noise, seen to a micrometre by the one source whose scale is in doubt: only
/// the product of its distance and that scale is learned, and the two become as correlated as numbers can be. The numbers
/// of the fixes say which of them the covariance is mended after.
fn in_one_place(dimension: usize, name: &str, number: fn(u64) -> u64) -> StateVector {
    let text = named(name)
        .text(dimension, "")
        .replace("rotation_density = 0.01", "rotation_density = 0.0")
        .replace("translation_density = 0.02", "translation_density = 0.0")
        .replace("[stacking]\nsources = [0, 1]\n", "");
    let mut inputs = drive(dimension, 0);
    let at = [4.0, -3.0, 1.0];
    for k in 1..=4000 {
        let stamp_ns = START + k * PERIOD;
        inputs.push(match dimension {
            2 => plane(stamp_ns, k, [0.0; 3]),
            _ => space(stamp_ns, k, [0.0; 6]),
        });
        let Input::Fix(mut seen) = fix(stamp_ns, number(k), 1, &at[..dimension]) else {
            unreachable!("it is a fix");
        };
        for entry in &mut seen.covariance_w_m2 {
            *entry *= 1e-10;
        }
        inputs.push(Input::Fix(seen));
    }
    let outcome = run(&text, &inputs);
    assert_eq!(outcome.counters.accepted, 4000);
    outcome.snapshot.unwrap()
}

/// A share of a variance that double numbers hold well, and one that rounding is about to turn negative.
const HELD: f64 = 1e-12;
const AT_THE_EDGE: f64 = 1e-13;

#[test]
fn what_cannot_be_told_apart_leaves_the_covariance_definite() {
    for (dimension, name) in [(2, "augmented"), (3, "augmented"), (2, "adaptive")] {
        // Every sixteenth, and none: a multiple of sixteen is never reached, and what lies between is taken for lost.
        let numbers: [fn(u64) -> u64; 2] = [|k| k, |k| 16 * k + 1];
        let [mended, left_alone] =
            numbers.map(|number| smallest_eigenvalue(&in_one_place(dimension, name, number)));
        assert!(mended > HELD, "{name} in {dimension}: {mended:e}");
        assert!(left_alone < AT_THE_EDGE, "{name}: {left_alone:e}");
    }
}
