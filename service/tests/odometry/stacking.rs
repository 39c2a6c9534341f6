//! Fixes of two sources that belong together: partners early, late and missing.

use inekf::filter::{
    Belief, Covariance, Left, Transport, UpdateOptions, propagate_odometry, update,
};
use inekf::lie::{LieGroup, SE2, SO2};
use inekf::model::{Observation, OdometryStep, PointFix, Points, ProcessColumns};
use inekf_shared::message::REASON_NOT_READY;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::filters::{Gain, Oracle, Single, outputs, process};
use super::harness::{Input, Outcome, PERIOD, START, fix, named, planar_state, plane, run};

const VARIANCES: [f64; 3] = [0.02, 1.0, 2.0];
const ROW: [f64; 3] = [0.05, 0.5, 0.02];

/// Rows from `from` to `to`.
fn rows(from: u64, to: u64) -> Vec<Input> {
    (from..=to)
        .map(|k| plane(START + k * PERIOD, k, ROW))
        .collect()
}

fn state() -> Input {
    Input::Set(planar_state(START, VARIANCES))
}

fn hard(inputs: &[&[Input]], extra: &str) -> Outcome {
    let text = named("hard left").text(2, "");
    run(
        &text.replace("sources = [0, 1]\n", &format!("sources = [0, 1]\n{extra}")),
        &inputs.concat(),
    )
}

fn pair(one_ns: u64, other_ns: u64) -> [Input; 2] {
    [
        fix(one_ns, 1, 0, &[6.2, -2.0]),
        fix(other_ns, 1, 1, &[6.0, -2.2]),
    ]
}

#[test]
fn a_pair_within_the_tolerance_is_one_update_at_the_later_stamp() {
    let at = START + 5 * PERIOD;
    let both = hard(&[&[state()], &rows(1, 5), &pair(at, at), &rows(6, 9)], "");
    let apart = hard(
        &[
            &[state()],
            &rows(1, 5),
            &pair(at - 900_000, at),
            &rows(6, 9),
        ],
        "",
    );
    assert_eq!(both.last().bits(), apart.last().bits());
    assert_eq!((apart.counters.accepted, apart.counters.unpaired), (2, 0));
    // The order in which they come is nothing to them, nor is one that comes late.
    let [one, other] = pair(at - 900_000, at);
    let late = hard(
        &[
            &[state()],
            &rows(1, 5),
            &[other],
            &rows(6, 6),
            &[one],
            &rows(7, 9),
        ],
        "",
    );
    assert_eq!(both.last().bits(), late.last().bits());
    // Beyond the tolerance they are two.
    let strangers = hard(
        &[
            &[state()],
            &rows(1, 5),
            &pair(at - 1_100_000, at),
            &rows(6, 9),
        ],
        "",
    );
    assert_eq!(
        (strangers.counters.accepted, strangers.counters.unpaired),
        (2, 2)
    );
    assert_ne!(both.last().bits(), strangers.last().bits());
}

#[test]
fn the_nearest_partner_is_taken() {
    let at = START + 5 * PERIOD;
    let tolerance = "tolerance_s = 0.05\n";
    let decoy = fix(at - 40_000_000, 0, 0, &[90.0, 90.0]);
    let with = hard(
        &[
            &[state()],
            &rows(1, 5),
            &[decoy],
            &pair(at, at),
            &rows(6, 6),
        ],
        tolerance,
    );
    let alone = hard(
        &[&[state()], &rows(1, 5), &pair(at, at), &rows(6, 6)],
        tolerance,
    );
    assert_eq!(with.last().bits(), alone.last().bits());
}

fn white() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(0.0001, 0.0004, 0.0004)) * 0.1
}

fn seen(x: f64, y: f64) -> PointFix<2> {
    PointFix {
        position_w: Vector2::new(x, y),
        covariance_w: Matrix2::new(0.04, 0.0, 0.0, 0.09),
        lever_arm_b: Vector2::zeros(),
        scale_error: 0.0,
    }
}

/// The library's constrained filter at the start of the drive.
fn direct() -> Single<SE2, Left, 3> {
    Single {
        belief: Belief::new(
            SE2 {
                rotation: SO2::from_angle(0.3),
                position: Vector2::new(4.0, -3.0),
            },
            Covariance::from_variances(&VARIANCES.into()),
        ),
        gain: Gain::Constrained,
        way: ProcessColumns::new(&process(f64::INFINITY)).unwrap(),
        outputs: outputs([f64::INFINITY; 2]),
    }
}

fn steps(filter: &mut Single<SE2, Left, 3>, count: usize) {
    let step = OdometryStep::<SE2>::new(&SVector::from(ROW), 0.1);
    for _ in 0..count {
        Oracle::<SE2, 3, 2, 4>::step(filter, &step, &white());
    }
}

fn assert_same(outcome: &Outcome, filter: &Single<SE2, Left, 3>) {
    let mean = filter.belief.mean;
    let last = outcome.last();
    let expected = [mean.rotation.angle_rad(), mean.position.x, mean.position.y];
    for (a, b) in last.mean.iter().zip(expected) {
        assert!((a - b).abs() < 1e-9, "{last:?} {mean:?}");
    }
    for (a, b) in last
        .covariance
        .iter()
        .zip(filter.belief.covariance.upper_triangle())
    {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn a_fix_alone_is_fused_without_constraints_and_leaves_the_way_what_it_does_not_explain() {
    let at = |k: u64| START + k * PERIOD;
    let inputs = [
        &[state()][..],
        &rows(1, 4),
        &[fix(at(4), 0, 0, &[5.9, -2.4])],
        &rows(5, 10),
        &pair(at(10), at(10)),
    ];
    let outcome = hard(&inputs, "");
    assert_eq!(
        (outcome.counters.accepted, outcome.counters.unpaired),
        (3, 1)
    );

    let mut filter = direct();
    steps(&mut filter, 4);
    // By hand: K = P H^T S^-1 and d <- (I - K H) d.
    let alone = Points::<1, 2, 2>::new([seen(5.9, -2.4)]);
    let h: SMatrix<f64, 2, 3> =
        Observation::<SE2, 3, 2>::left_jacobian(&alone, &filter.belief.mean);
    let p = *filter.belief.covariance.matrix();
    let s = h * p * h.transpose() + alone.fixes[0].covariance_w;
    let k = p * h.transpose() * s.try_inverse().unwrap();
    filter.way.transform(&(Matrix3::identity() - k * h));
    update(&mut filter.belief, &alone, &UpdateOptions::ITERATED).unwrap();
    steps(&mut filter, 6);
    filter.pair(&Points::<2, 2, 4>::new([seen(6.2, -2.0), seen(6.0, -2.2)]));
    assert_same(&outcome, &filter);
    assert_eq!(outcome.last().head.active_mismatches, 0b111);
}

#[test]
fn a_fix_alone_is_dropped_where_that_is_asked_for() {
    let lone = fix(START + 4 * PERIOD, 0, 0, &[5.9, -2.4]);
    let skip = "missing = \"skip\"\n";
    let with = hard(&[&[state()], &rows(1, 4), &[lone], &rows(5, 10)], skip);
    let without = hard(&[&[state()], &rows(1, 10)], skip);
    assert_eq!(with.last().bits(), without.last().bits());
    assert_eq!((with.counters.accepted, with.counters.unpaired), (0, 1));
}

#[test]
fn a_source_that_is_not_stacked_does_not_wait() {
    let at = START + 5 * PERIOD;
    let text = named("hard left")
        .text(2, "")
        .replace("[stacking]", "[[position_source]]\nid = 2\n[stacking]");
    let third = fix(at, 9, 2, &[6.3, -2.0]);
    let inputs = [&[state()][..], &rows(1, 5), &[third], &pair(at, at)].concat();
    let outcome = run(&text, &inputs);
    assert_eq!(
        (outcome.counters.accepted, outcome.counters.unpaired),
        (3, 0)
    );
    // It is constrained by itself: the odometry's scale takes one of its two outputs. Source 0 goes first.
    let mut filter = direct();
    steps(&mut filter, 5);
    filter.pair(&Points::<2, 2, 4>::new([seen(6.2, -2.0), seen(6.0, -2.2)]));
    let alone = Points::<1, 2, 2>::new([seen(6.3, -2.0)]);
    update(&mut filter.belief, &alone, &UpdateOptions::ITERATED).unwrap();
    assert_same(&outcome, &filter);
}

#[test]
fn too_many_that_wait_make_room_oldest_first() {
    let at = START + 2 * PERIOD;
    let many: Vec<Input> = (0..40)
        .map(|k| fix(at + k * 2_000_000, k, 0, &[5.0, -2.5]))
        .collect();
    let outcome = hard(&[&[state()], &rows(1, 2), &many], "wait_s = 10.0\n");
    // 32 wait; the others lie ahead of the last row.
    assert_eq!(outcome.counters.unpaired, 8);
    let later = hard(
        &[&[state()], &rows(1, 2), &many, &rows(3, 4)],
        "wait_s = 10.0\n",
    );
    assert_eq!(later.counters.accepted, 8);
    let reset = hard(
        &[&[state()], &rows(1, 2), &many, &rows(3, 4), &[Input::Reset]],
        "wait_s = 10.0\n",
    );
    assert_eq!(reset.reasons[REASON_NOT_READY as usize], 32);
}

#[test]
fn every_message_that_a_restart_forgets_is_counted() {
    let ahead = pair(START + 5 * PERIOD, START + 5 * PERIOD);
    for end in [Input::Reset, Input::Set(planar_state(0, VARIANCES))] {
        let outcome = hard(&[&[state()], &rows(1, 3), &ahead, &[end]], "");
        assert_eq!(outcome.reasons[REASON_NOT_READY as usize], 2);
        let outcome = hard(&[&[state()], &rows(1, 3), &ahead[..1], &[end]], "");
        assert_eq!(outcome.reasons[REASON_NOT_READY as usize], 1);
    }
}

#[test]
fn fixes_before_the_first_row_of_a_requested_state_are_kept_for_it() {
    let unstamped = Input::Set(planar_state(0, VARIANCES));
    let within = START + 60_000_000;
    let early = hard(&[&[unstamped], &pair(within, within), &rows(1, 6)], "");
    let stamped = hard(&[&[state()], &pair(within, within), &rows(1, 6)], "");
    assert_eq!(early.counters.accepted, 2);
    assert_eq!(early.last().bits(), stamped.last().bits());
    // A second request, with a time, takes over: the fixes stay.
    let twice = hard(
        &[&[unstamped], &pair(within, within), &[state()], &rows(1, 6)],
        "",
    );
    assert_eq!(twice.counters.accepted, 2);
    assert_eq!(twice.last().bits(), stamped.last().bits());
    // Before the row began they come too late.
    let before = hard(
        &[&[unstamped], &pair(START - 1, START - 1), &rows(1, 6)],
        "",
    );
    assert_eq!((before.counters.accepted, before.counters.late), (0, 2));
}

#[test]
fn a_bias_at_rest_waits_for_an_update_that_sees_it() {
    let text = "model = \"odometry2d\"\nestimator = \"lc-inekf\"\nmismatch = \"hard\"\n[noise]\n\
                rotation_density = 0.01\ntranslation_density = 0.02\n[[position_source]]\nid = 0\n\
                [[mismatched]]\nwhat = \"odometry_rotation_bias\"\n";
    let at = |k: u64| START + k * PERIOD;
    let mut inputs = vec![state()];
    for k in 1..=20 {
        let way = if k <= 10 { 0.0 } else { 0.5 };
        inputs.push(plane(at(k), k, [0.0, way, 0.0]));
        if k == 10 {
            inputs.push(fix(at(k), 0, 0, &[4.1, -3.1]));
        }
    }
    let resting = run(text, &inputs);
    assert_eq!(
        (resting.counters.accepted, resting.counters.rejected),
        (1, 0)
    );
    assert_eq!(resting.last().head.active_mismatches, 0);
    // At rest it is the plain update; d goes on: 1 s at rest and 1 s of way, in all.
    inputs.push(fix(at(20), 1, 0, &[8.6, -1.2]));
    let outcome = run(text, &inputs);
    assert_eq!(
        (
            outcome.counters.accepted,
            outcome.last().head.active_mismatches
        ),
        (2, 1)
    );

    let step = |way: f64| OdometryStep::<SE2>::new(&Vector3::new(0.0, way, 0.0), 0.1);
    let once = UpdateOptions {
        iterations: 1,
        transport: Transport::None,
        ..UpdateOptions::ITERATED
    };
    let mut belief = direct().belief;
    let mut d = Vector3::zeros();
    for k in 1..=20 {
        let step = step(if k <= 10 { 0.0 } else { 0.5 });
        belief = propagate_odometry(&belief, &step, &white());
        d = step.kappa.inverse().adjoint() * d + Vector3::new(0.1, 0.0, 0.0);
        if k == 10 {
            let points = Points::<1, 2, 2>::new([seen(4.1, -3.1)]);
            update(&mut belief, &points, &once).unwrap();
        }
    }
    // [LC] (22) by hand, in one step: L = K + (d - K H d) (H d)^T S^-1 / psi.
    let points = Points::<1, 2, 2>::new([seen(8.6, -1.2)]);
    let h: SMatrix<f64, 2, 3> = Observation::<SE2, 3, 2>::left_jacobian(&points, &belief.mean);
    let p = *belief.covariance.matrix();
    let s = h * p * h.transpose() + points.fixes[0].covariance_w;
    let inverse = s.try_inverse().unwrap();
    let k = p * h.transpose() * inverse;
    let delta = h * d;
    let psi = (delta.transpose() * inverse * delta)[(0, 0)];
    let l = k + (d - k * delta) * (delta.transpose() * inverse) / psi;
    let z = Vector2::new(8.6, -1.2) - belief.mean.position;
    let one_step = run(
        &format!("{text}[update]\niterations = 1\ntransport = \"none\"\n"),
        &inputs,
    );
    let expected = belief.mean.compose(&SE2::exp(&(l * z)));
    for (a, b) in one_step
        .last()
        .position()
        .iter()
        .zip(expected.position.iter())
    {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let resting_again = Matrix3::identity() - l * h;
    assert!((resting_again * d).norm() < 1e-9);
}
