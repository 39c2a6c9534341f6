//! Whatever comes, nothing panics, the state stays finite and its covariance positive semidefinite, and every message is
//! accounted for.

use inekf_shared::message::{INPUT_ODOMETRY_2D, INPUT_ODOMETRY_3D, INPUT_POSITION, StateVector};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::harness::{
    CHOICES, Input, Outcome, PERIOD, START, fix, planar_state, plane, run, space, spatial_state,
};

/// A number that is rarely sane.
fn hostile(random: &mut ChaCha8Rng, sane: f64) -> f64 {
    match random.random_range(0..40) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => -1e308,
        3 => f64::MIN_POSITIVE,
        4 => f64::from_bits(random.random()),
        _ => sane,
    }
}

fn hostile_stamp(random: &mut ChaCha8Rng, sane: u64) -> u64 {
    match random.random_range(0..60) {
        0 => random.random(),
        1 => u64::MAX,
        2 => 0,
        3 => sane.saturating_sub(random.random_range(0..30) * PERIOD),
        4 => sane + random.random_range(0..30) * PERIOD,
        _ => sane,
    }
}

fn inputs(dimension: usize, seed: u64) -> Vec<Input> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let random = &mut random;
    let mut inputs = Vec::new();
    for k in 1..400_u64 {
        let now = START + k * PERIOD;
        let stamp = hostile_stamp(random, now);
        let seq = if random.random_bool(0.02) {
            random.random()
        } else {
            k
        };
        let spread = |random: &mut ChaCha8Rng, size: f64| size * (random.random::<f64>() - 0.5);
        let mut u = [0.0; 6];
        for (i, part) in u.iter_mut().enumerate() {
            let sane = spread(random, if i < 3 { 0.4 } else { 1.0 });
            *part = hostile(random, sane);
        }
        inputs.push(if dimension == 2 {
            plane(stamp, seq, [u[0], u[3], u[4]])
        } else {
            space(stamp, seq, u)
        });
        if random.random_bool(0.5) {
            let back = random.random_range(0..3 * PERIOD);
            let at = hostile_stamp(random, now - back);
            let mut here = [0.0; 3];
            for part in &mut here {
                let sane = spread(random, 20.0);
                *part = hostile(random, sane);
            }
            for source in 0..random.random_range(1..4) {
                let mut message = fix(at, k, source, &here[..dimension]);
                if let Input::Fix(message) = &mut message {
                    let index = random.random_range(0..9);
                    message.covariance_w_m2[index] =
                        hostile(random, message.covariance_w_m2[index]);
                }
                inputs.push(message);
            }
        }
        if random.random_bool(0.02) {
            let stamp = if random.random_bool(0.5) {
                0
            } else {
                hostile_stamp(random, now)
            };
            let mut state = if dimension == 2 {
                planar_state(stamp, [0.1, 1.0, 1.0])
            } else {
                spatial_state(stamp, [0.1; 6])
            };
            let index = random.random_range(0..6);
            state.covariance[index] = hostile(random, state.covariance[index]);
            state.p_w_m[0] = hostile(random, state.p_w_m[0]);
            inputs.push(Input::Set(state));
        }
        if random.random_bool(0.005) {
            inputs.push(Input::Reset);
        }
    }
    inputs.push(Input::Reset);
    inputs
}

fn assert_sound(outcome: &Outcome, name: &str) {
    for estimate in &outcome.estimates {
        assert!(
            estimate.mean.iter().all(|x| x.is_finite()),
            "{name}: {estimate:?}"
        );
        let dimension = if estimate.mean.len() == 3 { 3 } else { 6 };
        let mut p = DMatrix::<f64>::zeros(dimension, dimension);
        let mut entries = estimate.covariance.iter();
        for i in 0..dimension {
            for j in i..dimension {
                p[(i, j)] = *entries.next().unwrap();
                p[(j, i)] = p[(i, j)];
            }
        }
        assert!(p.iter().all(|x| x.is_finite()), "{name}: {p}");
        // Scaled to unit variances: the units differ.
        let scale = p
            .diagonal()
            .map(|v| if v > 0.0 { 1.0 / v.sqrt() } else { 1.0 });
        let scaled = DMatrix::from_diagonal(&scale) * p * DMatrix::from_diagonal(&scale);
        let least = scaled.symmetric_eigenvalues().min();
        assert!(least > -1e-6, "{name}: {least} {estimate:?}");
    }
}

#[test]
fn nothing_breaks_and_every_message_is_counted() {
    let mut accepted = 0;
    for dimension in [2, 3] {
        for (n, choice) in CHOICES.iter().enumerate() {
            for skip in [false, true] {
                let text = choice.text(dimension, "").replace(
                    "sources = [0, 1]\n",
                    if skip {
                        "sources = [0, 1]\nmissing = \"skip\"\n"
                    } else {
                        "sources = [0, 1]\n"
                    },
                );
                let inputs = inputs(dimension, 100 * n as u64 + dimension as u64);
                let outcome = run(&text, &inputs);
                assert_sound(&outcome, choice.name);
                let fixes = inputs.iter().filter(|i| matches!(i, Input::Fix(_))).count() as u64;
                let rows = inputs
                    .iter()
                    .filter(|i| matches!(i, Input::Plane(_) | Input::Space(_)))
                    .count() as u64;
                let topic = if dimension == 2 {
                    INPUT_ODOMETRY_2D
                } else {
                    INPUT_ODOMETRY_3D
                };
                assert_eq!(outcome.received[topic], rows);
                assert_eq!(outcome.received[INPUT_POSITION], fixes);
                let counters = outcome.counters;
                assert_eq!(counters.rejected, outcome.reasons.iter().sum::<u64>());
                // What is published for a row was not refused; every refusal that is no row's is a fix's.
                let dropped = if skip { counters.unpaired } else { 0 };
                let of_fixes = counters.accepted + counters.gated + counters.late + dropped;
                assert!(of_fixes <= fixes, "{} {counters:?} {fixes}", choice.name);
                assert!(
                    of_fixes + counters.rejected >= fixes,
                    "{} {counters:?} {fixes}",
                    choice.name
                );
                accepted += counters.accepted;
                let last: Option<StateVector> = outcome.snapshot;
                assert!(last.is_none(), "the last input is a reset");
            }
        }
    }
    assert!(accepted > 1000, "{accepted}");
}

#[test]
fn without_bad_rows_every_fix_is_accounted_for_exactly() {
    for choice in CHOICES {
        let mut inputs = vec![Input::Set(planar_state(START, [0.02, 1.0, 2.0]))];
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut fixes = 0;
        for k in 1..300_u64 {
            for source in 0..3 {
                if random.random_bool(0.3) {
                    let at = START + k * PERIOD
                        - random.random_range(0..15 * PERIOD).min(k * PERIOD)
                        + random.random_range(0..3 * PERIOD);
                    let x = 4.0 + 0.3 * random.random::<f64>();
                    inputs.push(fix(at, k, source, &[x, -3.0]));
                    fixes += 1;
                }
            }
            inputs.push(plane(START + k * PERIOD, k, [0.02, 0.0, 0.0]));
        }
        inputs.push(Input::Reset);
        let counters = run(
            &choice.text(2, "[update]\ngate_probability = 0.99\n"),
            &inputs,
        )
        .counters;
        let sum = counters.accepted + counters.gated + counters.late + counters.rejected;
        assert_eq!(sum, fixes, "{} {counters:?}", choice.name);
        assert!(counters.accepted > 0 && counters.unpaired > 0 && counters.late > 0);
    }
}
