//! Zero-velocity detection: rest holds the estimate in its place, and even motion is not taken for it.

use super::common::{
    GRAVITY, Input, SIGMA, all_bits, circle, engine_at, feed, header, imu_at_rest, isotropic, run,
    settings, stamp, state_bits, state_of, state_on_circle,
};
use inekf_service::config::Config;
use inekf_service::engine::Settings;
use inekf_shared::message::{
    EstimateSe23, ImuSample, PositionFix, StateVector, ZERO_VELOCITY_SOURCE,
};
use nalgebra::Vector3;

const SECOND_NS: u64 = 1_000_000_000;

/// The settings of these tests, with detection as it is configured by default.
fn watching() -> Settings {
    let text =
        "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[zero_velocity]\n";
    let mut watching = settings();
    watching.imu.standstill = Settings::new(&Config::from_toml_str(text, "test").unwrap())
        .imu
        .standstill;
    assert!(watching.imu.standstill.is_some());
    watching
}

/// At the origin, at rest within 0.1 m/s, with the biases unknown.
fn at_rest() -> StateVector {
    StateVector {
        q_wb: [0.0, 0.0, 0.0, 1.0],
        v_w_mps: [0.0; 3],
        p_w_m: [0.0; 3],
        ..state_on_circle(stamp(0), 0.1)
    }
}

/// Sample `k` of a body that stands until `start`, and then gains 1 m/s each second; its accelerometer is 0.05 m/s^2 off.
fn stand_then_go(k: u64, start: u64) -> Input {
    let pushed = if k > start { 1.0 } else { 0.0 };
    Input::Imu(ImuSample {
        accel_mps2: [pushed + 0.05, 0.0, GRAVITY],
        ..imu_at_rest(k)
    })
}

fn of_rest(estimates: &[EstimateSe23]) -> Vec<u64> {
    let own = |estimate: &&EstimateSe23| estimate.head.source == ZERO_VELOCITY_SOURCE;
    let stamps = estimates.iter().filter(own);
    stamps.map(|estimate| estimate.head.stamp_ns).collect()
}

/// A minute at rest without any fix; the estimates, and how far they have gone.
fn minute_at_rest(settings: Settings) -> (Vec<EstimateSe23>, f64) {
    let mut engine = engine_at(settings, &at_rest());
    let mut estimates = Vec::new();
    for k in 0..6000 {
        feed(&mut engine, &stand_then_go(k, 6000), &mut estimates);
    }
    assert_eq!(engine.tally().counters.accepted, 0);
    let last = state_of(estimates.last().unwrap());
    (estimates, Vector3::from(last.p_w_m).norm())
}

#[test]
fn at_rest_without_fixes_the_estimate_stays_in_its_place() {
    let (drifting, far) = minute_at_rest(settings());
    let (held, near) = minute_at_rest(watching());
    assert!(of_rest(&drifting).is_empty());
    // Four a second, from two seconds on.
    assert!((225..=235).contains(&of_rest(&held).len()));
    // A bias of 0.05 m/s^2 over two seconds, before it counts, is 0.1 m; over a minute 90 m.
    assert!(far > 10.0 && near < 0.3, "{far} m, {near} m");
    let speed = Vector3::from(held.last().unwrap().v_w_mps).norm();
    assert!(speed < 0.02, "{speed} m/s");
}

#[test]
fn a_start_ends_it_within_a_block() {
    let start = 1000;
    let mut engine = engine_at(watching(), &at_rest());
    let mut estimates = Vec::new();
    for k in 0..1500 {
        feed(&mut engine, &stand_then_go(k, start), &mut estimates);
    }
    let last_ns = *of_rest(&estimates).last().unwrap();
    assert!(last_ns > stamp(start) - SECOND_NS && last_ns <= stamp(start) + SECOND_NS / 4);
    let speed = estimates.last().unwrap().v_w_mps[0];
    assert!((speed - 5.0).abs() < 0.3, "{speed} m/s");
}

#[test]
fn even_motion_that_an_imu_cannot_tell_from_rest_is_not_taken_for_it() {
    // A circle at constant speed: turn rate and specific force never change.
    let inputs = circle(10);
    let (_, without) = run(settings(), &inputs);
    let (_, with) = run(watching(), &inputs);
    assert!(of_rest(&with).is_empty());
    assert!(all_bits(&with) == all_bits(&without));
    // The estimated speed is what makes the difference.
    let mut blind = watching();
    blind.imu.standstill.as_mut().unwrap().speed = 100.0;
    blind.fusion.update.gate = inekf::filter::Gate::OPEN;
    let (_, fooled) = run(blind, &inputs);
    assert!(!of_rest(&fooled).is_empty());
}

#[test]
fn any_order_of_arrival_gives_the_same_bits() {
    // Fixes that say it moves at first, and stands then: a late one turns a proposal down, or lets it through.
    let fix = |k: u64| {
        let x = 1.5 * (3.0 - k as f64 * 1e-2).max(0.0);
        Input::Position(PositionFix {
            header: header(stamp(k) - 1, k),
            source: 0,
            dimension: 3,
            position_w_m: [-x * x / 2.0, 0.0, 0.0],
            covariance_w_m2: isotropic(SIGMA),
        })
    };
    let drive = |late: u64| {
        let mut engine = engine_at(watching(), &at_rest());
        let mut estimates = Vec::new();
        for k in 0..1000 + late {
            let due = k.checked_sub(late).filter(|due| due % 20 == 7);
            if let Some(due) = due {
                feed(&mut engine, &fix(due), &mut estimates);
            }
            if k < 1000 {
                feed(&mut engine, &stand_then_go(k, 1000), &mut estimates);
            }
        }
        assert!(!of_rest(&estimates).is_empty());
        state_bits(&engine.snapshot().unwrap())
    };
    let on_time = drive(0);
    for late in [1, 30, 90] {
        assert!(drive(late) == on_time, "{late} samples late");
    }
}
