//! The golden alignment of \[IS\] section V through configuration and engine: a vehicle at rest for 15 s, driving off with
//! a heading that is 80 deg wrong. The vectors were computed independently; the engine integrates sample by sample.

use std::path::Path;

use inekf_service::config::Config;
use inekf_service::engine::Settings;
use inekf_shared::message::{ESTIMATE_SMOOTHED, ESTIMATE_UPDATED, Header, ImuSample, PositionFix};

use crate::{Fed, Plain, common::Input, common::isotropic, plain, rows};

const PERIOD_NS: u64 = 5_000_000;
const SECOND_NS: u64 = 1_000_000_000;
/// What two ways of adding up 200 samples may differ by, rad and m.
const HEADING: f64 = 1e-9;
const POSITION: f64 = 1e-7;

fn table(name: &str) -> Vec<Vec<f64>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("estimator/tests/data/align_straight");
    let text = std::fs::read_to_string(folder.join(name)).expect("a file of the set");
    let number = |cell: &str| cell.parse().expect("a number");
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(number).collect())
        .collect()
}

/// The set's own rules: forward hold, noise per sample, exact Jacobians.
fn engine(discretisation: &str, window: usize, iterations: u32) -> Plain {
    let gyro_sigma = 2.7e-4_f64.to_radians();
    let text = format!(
        "model = 'imu'
estimator = 'smoother'
biases = false
hold = 'forward'
discretisation = '{discretisation}'
gravity_mps2 = 9.81
[noise]
gyro_sigma_per_sample = {gyro_sigma:e}
accel_sigma_per_sample = 1.5e-3
[initial]
heading_deg = 110.0
heading_sigma_deg = 100.0
level = 'given'
level_sigma_deg = 100.0
position_m = [0.0, 0.0, 0.0]
position_sigma_m = 0.0
velocity_sigma_mps = 10.0
[smoother]
window = {window}
iterations = {iterations}
jacobians = 'exact'
"
    );
    let config = Config::from_toml_str(&text, "golden").unwrap_or_else(|faults| panic!("{faults}"));
    plain(Settings::new(&config))
}

fn inputs() -> Vec<Input> {
    let header = |stamp_ns, seq| Header {
        stamp_ns,
        seq,
        sent_ns: 1,
        epoch: 1,
    };
    let mut samples = table("imu.csv");
    let fixes = table("gps.csv");
    assert_eq!((samples.len(), fixes.len()), (8000, 40));
    // Only its stamp matters: forward, it speaks for what comes after.
    samples.push(samples[7999].clone());
    let mut inputs = Vec::new();
    for (row, k) in samples.iter().zip(0..) {
        let stamp_ns = k * PERIOD_NS;
        if k > 0 && stamp_ns.is_multiple_of(SECOND_NS) {
            let fix = &fixes[k as usize / 200 - 1];
            inputs.push(Input::Position(PositionFix {
                header: header(stamp_ns, k / 200),
                source: 0,
                dimension: 3,
                position_w_m: [fix[0], fix[1], fix[2]],
                covariance_w_m2: isotropic(3.0),
            }));
        }
        inputs.push(Input::Imu(ImuSample {
            header: header(stamp_ns, k),
            gyro_rps: [row[0], row[1], row[2]],
            accel_mps2: [row[3], row[4], row[5]],
        }));
    }
    inputs
}

/// atan2(R10, R00) of the body-to-world rotation.
fn heading_of([x, y, z, w]: [f64; 4]) -> f64 {
    (2.0 * (x * y + w * z)).atan2(1.0 - 2.0 * (y * y + z * z))
}

/// Attitude and position at a fix are those of the `row`.
fn assert_fix(name: &str, k: usize, row: &[f64], (q_wb, p_w_m): ([f64; 4], [f64; 3])) -> f64 {
    let heading = row[3].atan2(row[0]);
    let off = (heading_of(q_wb) - heading).abs();
    assert!(off < HEADING, "{name}, fix {}: {off} rad", k + 1);
    for axis in 0..3 {
        let off = (p_w_m[axis] - row[12 + axis]).abs();
        assert!(off < POSITION, "{name}, fix {}: {off} m", k + 1);
    }
    (heading - 110_f64.to_radians()).abs()
}

/// With one iteration the estimate that is published with a fix is the newest smoothed state already.
fn assert_golden(name: &str, mut engine: Plain) {
    let expected = table(name);
    let estimates = rows(&engine.run(&inputs()));
    assert_eq!(engine.tally().counters.accepted, 40);
    assert_eq!((engine.effort().early, engine.effort().forced), (0, 0));
    let mut turned = 0.0_f64;
    for (k, row) in expected.iter().enumerate() {
        let stamp_ns = (k as u64 + 1) * SECOND_NS;
        let estimate = estimates
            .iter()
            .find(|estimate| estimate.head.stamp_ns == stamp_ns)
            .expect("a row for the fix");
        turned = turned.max(assert_fix(name, k, row, (estimate.q_wb, estimate.p_w_m)));
    }
    assert!(turned > 1.0, "the heading is found");
}

/// With more iterations the estimate is taken over before the next fix: the newest state of the window is looked at then.
fn assert_golden_before_the_next_fix(name: &str, mut engine: Plain) {
    let mut expected = table(name).into_iter().enumerate();
    let mut published = Vec::new();
    let mut assert_newest = |engine: &mut Plain| {
        let (k, row) = expected.next().expect("a row for the fix");
        let mut newest = None;
        engine.smoothed(&mut |state| newest = Some(*state)).unwrap();
        let newest = newest.expect("a state");
        assert_eq!(newest.stamp_ns, (k as u64 + 1) * SECOND_NS);
        assert_fix(name, k, &row, (newest.q_wb, newest.p_w_m));
    };
    let mut fixes = 0;
    for input in inputs() {
        if let Input::Position(_) = input {
            if fixes > 0 {
                assert_newest(&mut engine);
            }
            fixes += 1;
        }
        engine.feed(&input, &mut published);
    }
    assert_newest(&mut engine);
    let with = |flag| {
        published
            .iter()
            .filter(move |row| row.head.flags & flag != 0)
    };
    assert_eq!(with(ESTIMATE_UPDATED).count(), 40);
    assert_eq!(
        with(ESTIMATE_SMOOTHED).count(),
        39,
        "the last one has no time left"
    );
    assert_eq!((engine.effort().early, engine.effort().forced), (0, 0));
}

#[test]
fn a_window_of_ten() {
    assert_golden("est_W10_IS.csv", engine("zoh", 10, 1));
}

#[test]
fn a_window_of_ten_in_the_papers_discretisation() {
    assert_golden("est_W10_IS_euler.csv", engine("euler", 10, 1));
}

#[test]
fn a_window_of_fifty_with_three_iterations() {
    assert_golden_before_the_next_fix("est_W50_IS_3iter.csv", engine("zoh", 50, 3));
}
