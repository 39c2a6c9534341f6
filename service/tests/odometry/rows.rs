//! Rows: what the first one says, lost and refused ones, gaps, and rows that are not believed.

use inekf::lie::{LieGroup, SE2, SO2};
use inekf_shared::message::{
    REASON_GAP, REASON_NOT_FINITE, REASON_OUT_OF_RANGE, REASON_STAMP_NOT_AFTER,
};
use nalgebra::{Matrix3, Vector2, Vector3};

use super::harness::{Input, Outcome, PERIOD, START, fix, named, planar_state, plane, run};

const VARIANCES: [f64; 3] = [0.02, 1.0, 2.0];
const TURN: [f64; 3] = [0.3, 0.5, 0.1];

fn origin() -> SE2 {
    SE2 {
        rotation: SO2::from_angle(0.3),
        position: Vector2::new(4.0, -3.0),
    }
}

/// The motion of a row, times `share`.
fn motion(share: f64) -> SE2 {
    let [angle, x, y] = TURN;
    let whole = SE2 {
        rotation: SO2::from_angle(angle),
        position: Vector2::new(x, y),
    };
    SE2::exp(&(whole.log() * share))
}

fn simple(inputs: &[Input]) -> Outcome {
    run(&named("left").text(2, ""), inputs)
}

fn assert_at(outcome: &Outcome, pose: &SE2) {
    let expected = [pose.rotation.angle_rad(), pose.position.x, pose.position.y];
    for (a, b) in outcome.last().mean.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{:?} {pose:?}", outcome.last());
    }
}

/// `F P F^T + q`, by hand.
fn moved(p: Matrix3<f64>, motion: &SE2, q: [f64; 3]) -> Matrix3<f64> {
    let f = motion.inverse().adjoint();
    f * p * f.transpose() + Matrix3::from_diagonal(&Vector3::from(q))
}

fn assert_covariance(outcome: &Outcome, p: &Matrix3<f64>) {
    let upper = [p.m11, p.m12, p.m13, p.m22, p.m23, p.m33];
    for (a, b) in outcome.last().covariance.iter().zip(upper) {
        assert!((a - b).abs() < 1e-12, "{:?} {p}", outcome.last());
    }
}

#[test]
fn a_state_without_a_time_holds_where_the_first_row_begins() {
    let first = plane(START, 0, TURN);
    let outcome = simple(&[Input::Set(planar_state(0, VARIANCES)), first]);
    assert_at(&outcome, &origin().compose(&motion(1.0)));
    let p = Matrix3::from_diagonal(&VARIANCES.into());
    let white = [0.01 * 0.01 * 0.1, 0.02 * 0.02 * 0.1, 0.02 * 0.02 * 0.1];
    assert_covariance(&outcome, &moved(p, &motion(1.0), white));

    // A time within the row: only the rest of it moves the state.
    let later = planar_state(START - 40_000_000, VARIANCES);
    assert_at(
        &simple(&[Input::Set(later), first]),
        &origin().compose(&motion(0.4)),
    );
    // Where time has only begun the row began no earlier.
    let soon = [
        Input::Set(planar_state(0, VARIANCES)),
        plane(20_000_000, 0, TURN),
    ];
    assert_at(&simple(&soon), &origin().compose(&motion(1.0)));
}

#[test]
fn the_first_fix_starts_the_estimate_within_its_row() {
    let text = "model = \"odometry2d\"\nestimator = \"inekf\"\n[noise]\nrotation_density = 0.01\n\
                translation_density = 0.02\n[initial]\nheading_deg = 0.0\nheading_sigma_deg = 5.0\n\
                [[position_source]]\nid = 0\n";
    let inputs = [
        plane(START, 0, TURN),
        fix(START + 25_000_000, 0, 0, &[7.0, 8.0]),
        plane(START + PERIOD, 1, TURN),
    ];
    let outcome = run(text, &inputs);
    let there = SE2 {
        rotation: SO2::from_angle(0.0),
        position: Vector2::new(7.0, 8.0),
    };
    assert_at(&outcome, &there.compose(&motion(0.75)));
    assert_eq!(outcome.counters.accepted, 1);
}

/// The state, one row, and the row after a hole in which one is missing.
fn with_hole(refused: Option<Input>) -> Vec<Input> {
    let mut inputs = vec![
        Input::Set(planar_state(START, VARIANCES)),
        plane(START + PERIOD, 1, TURN),
    ];
    inputs.extend(refused);
    inputs.push(plane(START + 3 * PERIOD, 3, TURN));
    inputs
}

#[test]
fn a_lost_row_is_taken_to_be_like_the_next_and_doubted() {
    let outcome = simple(&with_hole(None));
    assert_eq!(outcome.counters.lost, 1);
    assert_at(
        &outcome,
        &origin().compose(&motion(1.0)).compose(&motion(2.0)),
    );
    let white = [0.01 * 0.01 * 0.1, 0.02 * 0.02 * 0.1, 0.02 * 0.02 * 0.1];
    let p = moved(
        Matrix3::from_diagonal(&VARIANCES.into()),
        &motion(1.0),
        white,
    );
    // A rate wrong by 0.2 rad/s and 1 m/s over 0.2 s.
    let doubt = [0.04 * 0.04, 0.2 * 0.2, 0.2 * 0.2];
    let q = [0, 1, 2].map(|i| 2.0 * white[i] + doubt[i]);
    assert_covariance(&outcome, &moved(p, &motion(2.0), q));
}

#[test]
fn a_refused_row_is_missed_like_a_lost_one() {
    let lost = simple(&with_hole(None));
    for bad in [[f64::NAN, 0.5, 0.0], [0.0, 11.0, 0.0], [3.05, 0.0, 0.0]] {
        let refused = simple(&with_hole(Some(plane(START + 2 * PERIOD, 2, bad))));
        assert_eq!(refused.counters.rejected, 1);
        assert_eq!(refused.counters.lost, 0);
        assert_eq!(refused.last().bits(), lost.last().bits());
    }
    // Its stamp may be what is wrong with it: too early, by a slip of the clock.
    for early in [START, START + PERIOD] {
        let refused = simple(&with_hole(Some(plane(early, 2, TURN))));
        assert_eq!(refused.reasons[REASON_STAMP_NOT_AFTER as usize], 1);
        assert_eq!(refused.counters.lost, 0);
        assert_eq!(refused.last().bits(), lost.last().bits());
    }
    // A row that is repeated is not missed.
    let again = simple(&with_hole(Some(plane(START + PERIOD, 1, TURN))));
    assert_eq!(again.reasons[REASON_STAMP_NOT_AFTER as usize], 1);
    assert_eq!(again.last().bits(), lost.last().bits());
}

#[test]
fn a_number_that_leaps_does_not_throw_the_state_away() {
    for leap in [1000, 1 << 40, u64::MAX / 2] {
        let outcome = simple(&[
            Input::Set(planar_state(START, VARIANCES)),
            plane(START + PERIOD, 1, TURN),
            plane(START + 2 * PERIOD, leap, TURN),
        ]);
        let step = Vector2::new(TURN[1], TURN[2]).norm();
        let way = Vector2::from_column_slice(outcome.last().position()) - Vector2::new(4.0, -3.0);
        assert!(way.norm() <= 3.0 * step + 1e-9, "{way}");
    }
}

#[test]
fn refused_rows_leave_every_bit_of_the_state() {
    let good = [
        Input::Set(planar_state(START, VARIANCES)),
        plane(START + PERIOD, 1, TURN),
    ];
    let before = simple(&good).state_bits();
    let cases = [
        (
            plane(START + 2 * PERIOD, 2, [0.0, f64::INFINITY, 0.0]),
            REASON_NOT_FINITE,
        ),
        (
            plane(START + 2 * PERIOD, 2, [1e300, 0.0, 0.0]),
            REASON_OUT_OF_RANGE,
        ),
        (
            plane(START + 2 * PERIOD, 2, [0.0, 0.0, -10.5]),
            REASON_OUT_OF_RANGE,
        ),
        (plane(START, 2, TURN), REASON_STAMP_NOT_AFTER),
        (plane(START + 1000 * PERIOD, 2, TURN), REASON_GAP),
        (plane(u64::MAX, 2, TURN), REASON_GAP),
    ];
    for (bad, reason) in cases {
        let outcome = simple(&[&good[..], &[bad]].concat());
        assert_eq!(outcome.state_bits(), before, "{bad:?}");
        assert_eq!(outcome.reasons[reason as usize], 1, "{bad:?}");
    }
}

#[test]
fn a_gap_is_doubted_and_a_long_one_starts_anew() {
    let after = |gap: u64, extra: &str| {
        let mut inputs = vec![Input::Set(planar_state(START, VARIANCES))];
        inputs.push(plane(START + PERIOD, 1, TURN));
        for k in 0..12 {
            inputs.push(plane(START + gap + k * PERIOD, 2 + k, TURN));
        }
        run(&named("left").text(2, extra), &inputs)
    };
    let inflated = after(40 * PERIOD, "");
    assert_eq!(
        (inflated.counters.rejected, inflated.last().head.reset_count),
        (0, 0)
    );
    // Whatever was not seen: 1 m/s over 3.9 s.
    let variance = inflated.last().covariance[3];
    assert!(variance > 3.9 * 3.9, "{variance}");
    let anew = after(40 * PERIOD, "[odometry]\non_gap = \"reinitialise\"\n");
    assert_eq!(anew.reasons[REASON_GAP as usize], 9);
    assert_eq!(anew.last().head.reset_count, 1);
    let jumped = after(1_000_000 * PERIOD, "");
    assert_eq!(jumped.reasons[REASON_GAP as usize], 9);
    assert_eq!(jumped.last().head.reset_count, 1);
}
