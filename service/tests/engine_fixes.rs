//! Fixes at their own stamps: the engine against the library called step by step, bit for bit.

mod common;
#[path = "engine_fixes/standstill.rs"]
mod standstill;

use common::{
    Direct, Engine, Input, PERIOD_NS, belief_bits, engine_at, feed, heading, input_of, lively_imu,
    position, settings, stamp, state_on_circle, velocity,
};
use inekf::filter::Gate;
use inekf::model::ImuInput;
use inekf_service::config::Hold;
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, ESTIMATE_UPDATED, EstimateSe23, NO_SOURCE, StateVector,
};

/// Without a gate, so that the library's plain call is the whole truth.
fn engine(hold: Hold, state: &StateVector) -> Engine {
    let mut settings = settings();
    settings.imu.hold = hold;
    settings.fusion.update.gate = Gate::OPEN;
    engine_at(settings, state)
}

/// A little off the truth, so that every fix has something to say.
fn start_state() -> StateVector {
    let mut state = state_on_circle(stamp(0), 0.7);
    state.p_w_m = [0.3, -0.2, 0.1];
    state
}

/// Gives the engine samples 0 and 1 with `fixes` between; what it published.
fn one_interval(hold: Hold, fixes: &[Input]) -> Vec<EstimateSe23> {
    let mut engine = engine(hold, &start_state());
    let mut estimates = Vec::new();
    feed(&mut engine, &Input::Imu(lively_imu(0)), &mut estimates);
    assert!(estimates.is_empty(), "the set state was not propagated");
    for fix in fixes {
        feed(&mut engine, fix, &mut estimates);
    }
    assert!(estimates.is_empty(), "a fix ahead of the samples waits");
    feed(&mut engine, &Input::Imu(lively_imu(1)), &mut estimates);
    estimates
}

/// The input that speaks for the interval between samples 0 and 1.
fn speaking(hold: Hold) -> ImuInput {
    let (before, after) = (input_of(&lively_imu(0)), input_of(&lively_imu(1)));
    match hold {
        Hold::Backward => after,
        Hold::Forward => before,
        Hold::Midpoint => ImuInput {
            omega_b: 0.5 * (before.omega_b + after.omega_b),
            force_b: 0.5 * (before.force_b + after.force_b),
        },
    }
}

const HOLDS: [Hold; 3] = [Hold::Backward, Hold::Forward, Hold::Midpoint];

/// Asserts what an estimate is about, and that its belief is `direct`'s.
fn assert_row(row: &EstimateSe23, stamp_ns: u64, flags: u32, source: u32, direct: &Direct) {
    assert_eq!(row.head.stamp_ns, stamp_ns);
    assert_eq!(row.head.flags, flags);
    assert_eq!(row.head.source, source);
    assert!(belief_bits(row) == direct.bits());
}

#[test]
fn a_sample_is_held_as_configured() {
    for hold in HOLDS {
        let rows = one_interval(hold, &[]);
        let mut direct = Direct::new(&start_state());
        direct.propagate(&speaking(hold), PERIOD_NS);
        assert_eq!(rows.len(), 1);
        assert_row(&rows[0], stamp(1), ESTIMATE_PROPAGATED, NO_SOURCE, &direct);
    }
    let beliefs = HOLDS.map(|hold| belief_bits(&one_interval(hold, &[])[0]));
    assert!(beliefs[0] != beliefs[1] && beliefs[1] != beliefs[2] && beliefs[0] != beliefs[2]);
}

#[test]
fn a_fix_between_two_samples_splits_the_interval() {
    let part_ns = 3_700_001;
    let fix_ns = stamp(0) + part_ns;
    for hold in HOLDS {
        let fix = position(fix_ns, 0, 1);
        let rows = one_interval(hold, &[Input::Position(fix)]);
        assert_eq!(rows.len(), 2);
        let input = speaking(hold);
        let mut direct = Direct::new(&start_state());
        direct.propagate(&input, part_ns);
        direct.position(&fix);
        assert_row(&rows[0], fix_ns, ESTIMATE_UPDATED, 1, &direct);
        direct.propagate(&input, PERIOD_NS - part_ns);
        assert_row(&rows[1], stamp(1), ESTIMATE_PROPAGATED, NO_SOURCE, &direct);
    }
}

#[test]
fn a_fix_at_a_samples_stamp_comes_after_the_propagated_row() {
    let fix = velocity(stamp(1), 0);
    let rows = one_interval(Hold::Backward, &[Input::Velocity(fix)]);
    assert_eq!(rows.len(), 2);
    let mut direct = Direct::new(&start_state());
    direct.propagate(&speaking(Hold::Backward), PERIOD_NS);
    assert_row(&rows[0], stamp(1), ESTIMATE_PROPAGATED, NO_SOURCE, &direct);
    direct.velocity(&fix);
    assert_row(&rows[1], stamp(1), ESTIMATE_UPDATED, 0, &direct);
    assert_eq!(rows[1].head.estimate_seq, rows[0].head.estimate_seq + 1);
    assert_eq!(rows[1].head.seq, 1, "it answers the same sample");
}

#[test]
fn a_fix_at_a_samples_stamp_may_come_after_the_sample() {
    let fix = velocity(stamp(1), 0);
    let before = one_interval(Hold::Backward, &[Input::Velocity(fix)]);
    let mut engine = engine(Hold::Backward, &start_state());
    let mut after = Vec::new();
    for input in [
        Input::Imu(lively_imu(0)),
        Input::Imu(lively_imu(1)),
        Input::Velocity(fix),
    ] {
        feed(&mut engine, &input, &mut after);
    }
    assert!(common::all_bits(&after) == common::all_bits(&before));
}

#[test]
fn every_kind_of_fix_in_one_interval_is_fused_in_order_of_time() {
    let at = |part_ns| stamp(0) + part_ns;
    let (first, second, third) = (
        heading(at(1_000_000), 0),
        position(at(4_000_000), 0, 0),
        velocity(at(8_000_000), 0),
    );
    // Equal stamps: position before velocity before heading, and by source.
    let end = stamp(1);
    let together = [position(end, 1, 0), position(end, 1, 1)];
    let (velocity_too, heading_too) = (velocity(end, 1), heading(end, 1));

    let input = speaking(Hold::Backward);
    let mut direct = Direct::new(&start_state());
    let mut expected = Vec::new();
    direct.propagate(&input, 1_000_000);
    direct.heading(&first);
    expected.push(direct.bits());
    direct.propagate(&input, 3_000_000);
    direct.position(&second);
    expected.push(direct.bits());
    direct.propagate(&input, 4_000_000);
    direct.velocity(&third);
    expected.push(direct.bits());
    direct.propagate(&input, 2_000_000);
    expected.push(direct.bits());
    direct.position(&together[0]);
    expected.push(direct.bits());
    direct.position(&together[1]);
    expected.push(direct.bits());
    direct.velocity(&velocity_too);
    expected.push(direct.bits());
    direct.heading(&heading_too);
    expected.push(direct.bits());

    let rows = one_interval(
        Hold::Backward,
        &[
            Input::Heading(heading_too),
            Input::Velocity(third),
            Input::Position(together[1]),
            Input::Velocity(velocity_too),
            Input::Position(second),
            Input::Position(together[0]),
            Input::Heading(first),
        ],
    );
    let published: Vec<_> = rows.iter().map(belief_bits).collect();
    assert!(published == expected);
    let sequence: Vec<_> = rows.iter().map(|row| row.head.estimate_seq).collect();
    assert_eq!(sequence, (1..=8).collect::<Vec<_>>());
}

#[test]
fn a_fix_at_the_stamp_of_the_set_state_corrects_it() {
    let fix = position(stamp(0), 0, 0);
    let mut engine = engine(Hold::Forward, &start_state());
    let mut rows = Vec::new();
    feed(&mut engine, &Input::Position(fix), &mut rows);
    let mut direct = Direct::new(&start_state());
    direct.position(&fix);
    assert_eq!(rows.len(), 1);
    assert_row(&rows[0], stamp(0), ESTIMATE_UPDATED, 0, &direct);

    feed(&mut engine, &Input::Imu(lively_imu(0)), &mut rows);
    feed(&mut engine, &Input::Imu(lively_imu(1)), &mut rows);
    direct.propagate(&input_of(&lively_imu(0)), PERIOD_NS);
    assert_eq!(rows.len(), 2);
    assert_row(&rows[1], stamp(1), ESTIMATE_PROPAGATED, NO_SOURCE, &direct);
}

#[test]
fn the_scale_of_a_source_widens_its_fixes() {
    let mut scaled = settings();
    scaled.fusion.update.gate = Gate::OPEN;
    for kind in &mut scaled.fusion.sources {
        kind[0].as_mut().unwrap().sigma_scale = 2.0;
    }
    let mut engine = engine_at(scaled, &start_state());
    let mut rows = Vec::new();
    let end = stamp(1);
    let (mut fix, mut speed, mut course) = (position(end, 0, 0), velocity(end, 0), heading(end, 0));
    for input in [
        Input::Imu(lively_imu(0)),
        Input::Position(fix),
        Input::Velocity(speed),
        Input::Heading(course),
        Input::Imu(lively_imu(1)),
    ] {
        feed(&mut engine, &input, &mut rows);
    }
    fix.covariance_w_m2 = common::isotropic(2.0 * common::SIGMA);
    speed.covariance_w = common::isotropic(2.0 * common::SIGMA);
    course.sigma_rad *= 2.0;
    let mut direct = Direct::new(&start_state());
    direct.propagate(&input_of(&lively_imu(1)), PERIOD_NS);
    direct.position(&fix);
    direct.velocity(&speed);
    direct.heading(&course);
    assert!(belief_bits(rows.last().unwrap()) == direct.bits());
}

#[test]
fn the_euler_scheme_is_used_where_configured() {
    let mut euler = settings();
    euler.imu.discretisation = inekf::model::Discretisation::Euler;
    let mut engine = engine_at(euler, &start_state());
    let mut rows = Vec::new();
    for k in 0..2 {
        feed(&mut engine, &Input::Imu(lively_imu(k)), &mut rows);
    }
    // p+ = p + v dt, without the half square of the interval.
    let state = start_state();
    let dt_s = PERIOD_NS as f64 * 1e-9;
    for axis in 0..3 {
        let expected = state.p_w_m[axis] + state.v_w_mps[axis] * dt_s;
        assert!((rows[0].p_w_m[axis] - expected).abs() < 1e-15);
    }
}
