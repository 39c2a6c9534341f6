//! The gate: what is let in, what is not, and how the filter gets out of a lock-out.

mod common;

use common::{
    Direct, Engine, Input, PERIOD_NS, SIGMA, assert_refused, belief_bits, engine_at, feed, heading,
    imu, imu_at_rest, input_of, isotropic, position, run, settings, stamp, state_bits,
    state_on_circle, variance, velocity,
};
use inekf::filter::Covariance;
use inekf_service::config::Config;
use inekf_service::engine::Settings;
use inekf_shared::message::{ESTIMATE_UPDATED, EstimateSe23, PositionFix, StateVector};
use nalgebra::Vector3;

/// Chi-square quantiles of 0.9999 for one and three degrees of freedom, from tables.
const GATE_1: f64 = 15.1367;
const GATE_3: f64 = 21.1075;

/// The angle between two attitudes, rad.
fn angle_between(a: &StateVector, b: &StateVector) -> f64 {
    let dot: f64 = a.q_wb.iter().zip(&b.q_wb).map(|(a, b)| a * b).sum();
    2.0 * dot.abs().min(1.0).acos()
}

/// A position fix at `[x, 0, 0]` of `source`.
fn fix_at(k: u64, x: f64, source: u32) -> PositionFix {
    PositionFix {
        position_w_m: [x, 0.0, 0.0],
        ..position(stamp(k), k, source)
    }
}

/// At rest in the origin for `samples`, with `fixes`, each due by the sample of its stamp.
fn at_rest(settings: Settings, samples: u64, fixes: &[PositionFix]) -> (Engine, Vec<EstimateSe23>) {
    let mut settings = settings;
    settings.initial.velocity_w = Vector3::zeros();
    let mut inputs = Vec::new();
    for k in 0..samples {
        let due = fixes.iter().filter(|fix| fix.header.stamp_ns == stamp(k));
        inputs.extend(due.map(|fix| Input::Position(*fix)));
        inputs.push(Input::Imu(imu_at_rest(k)));
    }
    run(settings, &inputs)
}

/// A fix of source 0 every tenth sample from 10 on, at 0 m and from `jump` on at `x` m.
fn fixes_that_jump(samples: u64, jump: u64, x: f64) -> Vec<PositionFix> {
    (10..samples)
        .step_by(10)
        .map(|k| fix_at(k, if k < jump { 0.0 } else { x }, 0))
        .collect()
}

#[test]
fn the_gate_is_at_the_quantile_of_the_dimension() {
    let sigma = 0.1;
    let state = state_on_circle(stamp(0), sigma);
    let metric = (GATE_3 * (sigma * sigma + SIGMA * SIGMA)).sqrt();
    let angular = (GATE_1 * (sigma * sigma + common::HEADING_SIGMA.powi(2))).sqrt();
    for (factor, gated) in [(0.999, 0), (1.001, 1), (-0.999, 0), (-1.001, 1)] {
        for axis in 0..3 {
            let mut place = position(stamp(0), 0, 0);
            place.position_w_m[axis] += factor * metric;
            let mut speed = velocity(stamp(0), 0);
            speed.velocity_w_mps[axis] += factor * metric;
            for fix in [Input::Position(place), Input::Velocity(speed)] {
                let mut engine = engine_at(settings(), &state);
                feed(&mut engine, &fix, &mut Vec::new());
                let counters = engine.tally().counters;
                assert_eq!((counters.gated, counters.accepted), (gated, 1 - gated));
            }
        }
        let mut course = heading(stamp(0), 0);
        course.heading_rad += factor * angular;
        let mut engine = engine_at(settings(), &state);
        feed(&mut engine, &Input::Heading(course), &mut Vec::new());
        assert_eq!(engine.tally().counters.gated, gated);
    }
}

#[test]
fn an_outlier_is_gated_and_counted_and_changes_no_belief() {
    let fixes = fixes_that_jump(300, 1000, 0.0);
    let (clean_engine, clean) = at_rest(settings(), 300, &fixes);
    for (x, at) in [(50.0, 155), (-1e6, 155), (1e9, 150)] {
        let mut fixes = fixes.clone();
        let mut outlier = fix_at(at, x, 0);
        outlier.header.seq = 10_000;
        fixes.push(outlier);
        let (engine, rows) = at_rest(settings(), 300, &fixes);
        assert_refused(engine.tally(), &[]);
        assert_eq!(engine.tally().counters.gated, 1);
        assert_eq!(
            engine.tally().counters.accepted,
            clean_engine.tally().counters.accepted
        );
        assert_eq!(rows.len(), clean.len(), "a gated fix publishes nothing");
        for (row, clean) in rows.iter().zip(&clean) {
            assert!(belief_bits(row) == belief_bits(clean));
        }
        // Its NIS is published with what comes next.
        let next = rows
            .iter()
            .find(|row| row.head.stamp_ns == stamp(at + 1))
            .unwrap();
        assert!(next.head.nis[0] > GATE_3);
        assert!(next.head.nis[1].is_nan());
        assert_eq!(next.head.counters.gated, 1);
    }
}

#[test]
fn without_a_gate_nothing_is_gated() {
    let plain = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
    let mut open = settings();
    open.fusion = Settings::new(&Config::from_toml_str(plain, "test").unwrap()).fusion;
    let (engine, rows) = at_rest(open, 100, &[fix_at(50, 1000.0, 0)]);
    assert_eq!(engine.tally().counters.gated, 0);
    assert_eq!(engine.tally().counters.accepted, 1);
    assert!(rows.last().unwrap().p_w_m[0] > 500.0);
}

#[test]
fn after_ten_gated_in_a_row_one_is_let_in_and_the_filter_converges() {
    let jump = 500;
    let (engine, rows) = at_rest(settings(), 2000, &fixes_that_jump(2000, jump, 100.0));
    let counters = engine.tally().counters;
    assert_eq!(counters.gated, 10);
    assert_eq!(counters.accepted, 199 - 10);

    let recovery = stamp(jump + 100);
    let row = rows
        .iter()
        .position(|row| row.head.stamp_ns == recovery && row.head.flags == ESTIMATE_UPDATED)
        .unwrap();
    assert!(rows[row - 1].p_w_m[0].abs() < 1.0);
    assert!((rows[row].p_w_m[0] - 100.0).abs() < 3.0 * SIGMA);
    // The attitude was not thrown off by a jump of the position; it is a little less sure.
    let (before, after) = (
        common::state_of(&rows[row - 1]),
        common::state_of(&rows[row]),
    );
    assert!(angle_between(&before, &after) < 0.01);
    for i in 0..6 {
        let growth = variance(&after, i) / variance(&before, i);
        assert!(
            (1.5..=4.0).contains(&growth),
            "component {i} grew by {growth}"
        );
    }
    let last = engine.snapshot().unwrap();
    assert!((last.p_w_m[0] - 100.0).abs() < SIGMA);
    assert!(Vector3::from(last.v_w_mps).norm() < 0.5);
    assert!(variance(&last, 6).sqrt() < SIGMA);
    assert!(angle_between(&before, &last) < 0.01);
}

/// The widening as it should be: everything by four (the contradiction is a great one), and the
/// position by the mean square of what contradicts it.
fn widen(direct: &mut Direct, fix: &PositionFix) {
    let residual = Vector3::from(fix.position_w_m) - direct.belief.mean.pose.position;
    let mut p = direct.belief.covariance.matrix() * 4.0;
    for axis in 6..9 {
        p[(axis, axis)] += residual.norm_squared() / 3.0;
    }
    direct.belief.covariance = Covariance::from_upper(p);
}

#[test]
fn a_recovery_is_the_library_update_against_the_widened_covariance() {
    let mut eager = settings();
    eager.fusion.recover_after = 1;
    let state = state_on_circle(stamp(0), 0.7);
    let mut engine = engine_at(eager, &state);
    let rows = &mut Vec::new();
    let mut fixes = [position(stamp(1), 0, 0), position(stamp(2), 1, 0)];
    for fix in &mut fixes {
        fix.position_w_m[0] += 30.0;
    }
    feed(&mut engine, &Input::Imu(imu(0)), rows);
    for (k, fix) in (1..).zip(&fixes) {
        feed(&mut engine, &Input::Position(*fix), rows);
        feed(&mut engine, &Input::Imu(imu(k)), rows);
    }
    assert_eq!(engine.tally().counters.gated, 1);
    assert_eq!(engine.tally().counters.accepted, 1);
    for k in 3..=10 {
        feed(&mut engine, &Input::Imu(imu(k)), rows);
    }
    let mut direct = Direct::new(&state);
    direct.propagate(&input_of(&imu(1)), PERIOD_NS);
    direct.propagate(&input_of(&imu(2)), PERIOD_NS);
    widen(&mut direct, &fixes[1]);
    direct.position(&fixes[1]);
    for k in 3..=10 {
        direct.propagate(&input_of(&imu(k)), PERIOD_NS);
    }
    assert!(belief_bits(rows.last().unwrap()) == direct.bits());

    // A late heading goes back behind the recovery: the replay lets the same fix in, widened as it
    // was decided then.
    let late = heading(stamp(1) + PERIOD_NS / 2, 0);
    feed(&mut engine, &Input::Heading(late), rows);
    let mut then = Direct::new(&state);
    then.propagate(&input_of(&imu(1)), PERIOD_NS);
    let mut decided = Direct::new(&state);
    decided.propagate(&input_of(&imu(1)), PERIOD_NS);
    decided.propagate(&input_of(&imu(2)), PERIOD_NS);
    then.propagate(&input_of(&imu(2)), PERIOD_NS / 2);
    then.heading(&late);
    then.propagate(&input_of(&imu(2)), PERIOD_NS / 2);
    let residual = Vector3::from(fixes[1].position_w_m) - decided.belief.mean.pose.position;
    let mut p = then.belief.covariance.matrix() * 4.0;
    for axis in 6..9 {
        p[(axis, axis)] += residual.norm_squared() / 3.0;
    }
    then.belief.covariance = Covariance::from_upper(p);
    then.position(&fixes[1]);
    for k in 3..=10 {
        then.propagate(&input_of(&imu(k)), PERIOD_NS);
    }
    assert!(belief_bits(rows.last().unwrap()) == then.bits());
    assert_eq!(engine.tally().counters.gated, 1, "nothing is counted twice");
    assert_eq!(engine.tally().counters.accepted, 2);
}

#[test]
fn every_kind_of_fix_recovers_what_it_measures_and_little_else() {
    for kind in 0..3 {
        let mut engine = engine_at(settings(), &state_on_circle(stamp(0), 0.05));
        let rows = &mut Vec::new();
        for k in 0..100 {
            if k % 5 == 4 {
                let mut place = position(stamp(k), k, 0);
                place.position_w_m[1] += 500.0;
                let mut speed = velocity(stamp(k), k);
                speed.velocity_w_mps[1] += 50.0;
                let mut course = heading(stamp(k), k);
                course.heading_rad += 2.0;
                let fix = [
                    Input::Position(place),
                    Input::Velocity(speed),
                    Input::Heading(course),
                ][kind];
                feed(&mut engine, &fix, rows);
            }
            feed(&mut engine, &Input::Imu(imu(k)), rows);
        }
        let counters = engine.tally().counters;
        assert_eq!((counters.gated, counters.accepted), (10, 10));
        let row = rows
            .iter()
            .position(|row| row.head.flags == ESTIMATE_UPDATED)
            .unwrap();
        let (before, after) = (
            common::state_of(&rows[row - 1]),
            common::state_of(&rows[row]),
        );
        let moved = Vector3::from(after.p_w_m) - Vector3::from(before.p_w_m);
        let faster = Vector3::from(after.v_w_mps) - Vector3::from(before.v_w_mps);
        let turned = angle_between(&before, &after);
        let expected = [[500.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 2.0]][kind];
        assert!((moved.y - expected[0]).abs() < 1.0, "{kind}: {moved}");
        assert!((faster.y - expected[1]).abs() < 1.0, "{kind}: {faster}");
        assert!((turned - expected[2]).abs() < 0.1, "{kind}: {turned}");
    }
}

#[test]
fn a_replay_over_a_recovery_repeats_it_bit_for_bit() {
    let jump = 200;
    let fixes = fixes_that_jump(400, jump, 100.0);
    // Recovery is at sample 300. A gated fix at a sample's stamp changes no bit, but has all that
    // follows replayed.
    let (mut engine, rows) = at_rest(settings(), 341, &fixes);
    let before = state_bits(&engine.snapshot().unwrap());
    let mut outlier = fix_at(260, -5000.0, 1);
    for at_ns in [stamp(255), stamp(299), stamp(300), stamp(301), stamp(340)] {
        outlier.header.stamp_ns = at_ns;
        outlier.header.seq += 1;
        feed(&mut engine, &Input::Position(outlier), &mut Vec::new());
        assert!(
            state_bits(&engine.snapshot().unwrap()) == before,
            "at {at_ns}"
        );
    }
    assert_eq!(engine.tally().counters.gated, 10 + 5);
    assert!(belief_bits(rows.last().unwrap())[..] == before[3..]);
}

#[test]
fn sources_are_counted_apart() {
    // Each of two sources is gated ten times in turn: neither has been eleven times.
    let mut fixes = fixes_that_jump(200, 1000, 0.0);
    for n in 0..10 {
        fixes.push(fix_at(205 + 10 * n, 100.0, 0));
        fixes.push(fix_at(206 + 10 * n, 100.0, 1));
    }
    let (engine, _) = at_rest(settings(), 400, &fixes);
    assert_eq!(engine.tally().counters.gated, 20);
    assert_eq!(engine.tally().counters.accepted, 19);
}

#[test]
fn an_accepted_fix_in_between_starts_the_count_anew() {
    let mut fixes = fixes_that_jump(600, 1000, 0.0);
    for n in 0..30 {
        if n % 10 != 9 {
            fixes.push(fix_at(205 + n, 100.0, 0));
        }
    }
    let (engine, _) = at_rest(settings(), 600, &fixes);
    assert_eq!(engine.tally().counters.gated, 27);
}

#[test]
fn recovery_can_be_switched_off() {
    let mut never = settings();
    never.fusion.recover_after = 0;
    let (engine, rows) = at_rest(never, 1000, &fixes_that_jump(1000, 500, 100.0));
    assert_eq!(engine.tally().counters.gated, 50);
    assert!(rows.last().unwrap().p_w_m[0].abs() < 1.0);
}

#[test]
fn a_source_gone_mad_cannot_break_the_filter() {
    // Wildly wrong and sure of itself: recovered from again and again, finite all the way.
    let fixes: Vec<_> = (10..3000)
        .map(|k| {
            let sign = if (k / 30) % 2 == 0 { 1.0 } else { -1.0 };
            PositionFix {
                covariance_w_m2: isotropic(1e-6),
                ..fix_at(k, sign * 9e8, 0)
            }
        })
        .collect();
    let (mut engine, rows) = at_rest(settings(), 3000, &fixes);
    for row in &rows {
        assert!(common::numbers(&common::state_of(row)).all(f64::is_finite));
    }
    // Sane again, it is back within 20 s.
    let outbox = &mut Vec::new();
    for k in 3000..5000 {
        if k % 10 == 0 {
            feed(&mut engine, &Input::Position(fix_at(k, 0.0, 0)), outbox);
        }
        feed(&mut engine, &Input::Imu(imu_at_rest(k)), outbox);
    }
    let state = engine.snapshot().unwrap();
    assert!(
        Vector3::from(state.p_w_m).norm() < 1.0,
        "{state:?} {:?}",
        engine.tally().counters
    );
}
