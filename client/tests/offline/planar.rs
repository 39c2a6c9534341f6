//! The planar drive with wrong models: what is exact is exact, what is random has the deviation that is stated.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use inekf_client::dataset::{Dataset, Initial, Odometry, Odometry2dRow, Truth, Truth2dRow};
use inekf_client::simulate::{PlanarOptions, Simulation, simulate_planar};
use tempfile::TempDir;

fn drive(seed: u64) -> Dataset {
    simulate_planar(&PlanarOptions {
        seed,
        ..PlanarOptions::default()
    })
    .unwrap()
}

fn truth(dataset: &Dataset) -> &[Truth2dRow] {
    match &dataset.truth {
        Truth::Planar(rows) => rows,
        other => panic!("{other:?}"),
    }
}

fn odometry(dataset: &Dataset) -> &[Odometry2dRow] {
    match &dataset.odometry {
        Odometry::Planar(rows) => rows,
        other => panic!("{other:?}"),
    }
}

/// A mismatch that `meta.json` tells of.
fn mismatch(dataset: &Dataset, name: &str) -> f64 {
    dataset.meta.other["mismatch"][name].as_f64().unwrap()
}

/// Asserts that a sum of `count` squares of standard normal numbers is one, within five deviations.
fn assert_normal(what: &str, sum: f64, count: usize) {
    let count = count as f64;
    let off = (sum - count) / (2.0 * count).sqrt();
    assert!(off.abs() < 5.0, "{what}: {sum} for {count}");
}

/// `p` turned by `theta_rad`.
fn turned(theta_rad: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = theta_rad.sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}

#[test]
fn the_drive_is_the_papers() {
    let dataset = drive(3);
    let truth = truth(&dataset);
    assert_eq!(truth.len(), 331);
    assert_eq!(truth[0].p_w_m, [-30.0, 30.0]);
    let scale = 1.0 + mismatch(&dataset, "odometry_scale");
    for pair in truth.windows(2) {
        assert_eq!(pair[1].stamp_ns - pair[0].stamp_ns, 100_000_000);
        let turning = (150..180).contains(&(pair[0].stamp_ns / 100_000_000));
        let turn_rad = if turning { -FRAC_PI_2 / 30.0 } else { 0.0 };
        assert!((pair[1].theta_rad - pair[0].theta_rad - turn_rad).abs() < 1e-12);
        // On an arc of 1 m: from the centre, at radius r = 1 m / turn, the chord is 2 r sin(turn / 2).
        let chord_m = match turn_rad {
            0.0 => 1.0,
            turn_rad => 2.0 / turn_rad * (0.5 * turn_rad).sin(),
        };
        let way = [0, 1].map(|axis| pair[1].p_w_m[axis] - pair[0].p_w_m[axis]);
        assert!((way[0].hypot(way[1]) - scale * chord_m).abs() < 1e-12);
        let heading_rad = pair[0].theta_rad + 0.5 * turn_rad;
        assert!((way[1].atan2(way[0]) - heading_rad).abs() < 1e-9);
    }
    assert_eq!(truth[0].theta_rad, FRAC_PI_6);
    assert!((truth[330].theta_rad - (FRAC_PI_6 - FRAC_PI_2)).abs() < 1e-12);
}

#[test]
fn odometry_and_fixes_are_off_by_their_mismatch_and_noise() {
    let dataset = drive(4);
    let truth = truth(&dataset);
    let scale = 1.0 + mismatch(&dataset, "odometry_scale");
    let mut squares = 0.0;
    for (row, pair) in odometry(&dataset).iter().zip(truth.windows(2)) {
        assert_eq!(row.stamp_ns, pair[1].stamp_ns);
        let way = [0, 1].map(|axis| (pair[1].p_w_m[axis] - pair[0].p_w_m[axis]) / scale);
        let [dx, dy] = turned(-pair[0].theta_rad, way);
        let [x, y] = row.translation_m;
        let turn_rad = pair[1].theta_rad - pair[0].theta_rad;
        // 0.001 rad/s and 0.01 m/s over 0.1 s.
        squares += ((row.dtheta_rad - turn_rad) / 1e-4).powi(2);
        squares += ((x - dx) / 1e-3).powi(2) + ((y - dy) / 1e-3).powi(2);
    }
    assert_normal("odometry", squares, 3 * 330);

    let rotation_rad = mismatch(&dataset, "rotation_source0");
    let scale = 1.0 + mismatch(&dataset, "scale_source1");
    let mut squares = 0.0;
    for (pair, truth) in dataset.position.chunks(2).zip(&truth[1..]) {
        let [x, y] = truth.p_w_m;
        let seen = [turned(-rotation_rad, [x, y]), [scale * x, scale * y]];
        for (fix, seen) in pair.iter().zip(seen) {
            assert_eq!(fix.stamp_ns, truth.stamp_ns);
            assert_eq!((fix.dimension, fix.sigma_m), (2, [3.0, 3.0, 0.0]));
            squares += ((fix.position_w_m[0] - seen[0]) / 3.0).powi(2);
            squares += ((fix.position_w_m[1] - seen[1]) / 3.0).powi(2);
        }
        assert_eq!((pair[0].source, pair[1].source), (0, 1));
    }
    assert_normal("fixes", squares, 4 * 330);
}

#[test]
fn mismatches_are_within_their_bounds_and_the_start_is_off_as_stated() {
    let (mut squares, runs) = (0.0, 200);
    let mut means = [0.0; 3];
    for seed in 0..runs {
        let dataset = drive(seed);
        let bounds = [
            ("odometry_scale", -0.07, 0.15),
            ("scale_source1", -0.1, 0.1),
            ("rotation_source0", -0.05, 0.05),
        ];
        for (mean, (name, low, high)) in means.iter_mut().zip(bounds) {
            let value = mismatch(&dataset, name);
            assert!((low..high).contains(&value), "{name} {value}");
            *mean += (value - 0.5 * (low + high)) / (high - low) / runs as f64;
        }
        let Some(Initial::Planar {
            stamp_ns: 0,
            theta_rad,
            p_w_m: [x, y],
        }) = dataset.meta.initial
        else {
            panic!("{:?}", dataset.meta.initial);
        };
        squares += ((theta_rad - FRAC_PI_6) / 0.03).powi(2);
        squares += ((x + 30.0) / 3.0).powi(2) + ((y - 30.0) / 3.0).powi(2);
        assert_eq!(dataset.meta.p0_diag, Some(vec![0.03 * 0.03, 9.0, 9.0]));
    }
    assert_normal("start", squares, 3 * runs as usize);
    // The mean of 200 uniform numbers of width 1 has a deviation of 0.02.
    assert!(means.iter().all(|mean| mean.abs() < 0.1), "{means:?}");
}

#[test]
fn a_seed_gives_one_dataset_and_it_survives_a_save() {
    let dataset = drive(5);
    assert_eq!(dataset, drive(5));
    assert_ne!(dataset, drive(6));
    let named: Simulation = "planar-mismatch".parse().unwrap();
    assert_eq!(named.dataset(5, None, None), Ok(dataset.clone()));
    let dir = TempDir::new().unwrap();
    dataset.save(dir.path()).unwrap();
    let loaded = Dataset::load(dir.path()).unwrap();
    assert_eq!(format!("{loaded:?}"), format!("{dataset:?}"));
}

#[test]
fn rate_and_duration_are_checked_and_unknown_names_refused() {
    let with = |rate_hz, duration_s| {
        simulate_planar(&PlanarOptions {
            rate_hz,
            duration_s,
            ..PlanarOptions::default()
        })
    };
    for (rate_hz, duration_s, name) in [
        (0.0, 33.0, "rate_hz"),
        (f64::NAN, 33.0, "rate_hz"),
        (10.0, -1.0, "duration_s"),
        (1e6, 1e6, "rate * duration_s"),
    ] {
        assert_eq!(with(rate_hz, duration_s).unwrap_err().name, name);
    }
    assert_eq!(odometry(&with(100.0, 2.0).unwrap()).len(), 200);
    let sentence = "moon-landing".parse::<Simulation>().unwrap_err();
    for word in ["moon-landing", "road-circuit", "planar-mismatch"] {
        assert!(sentence.contains(word), "{sentence}");
    }
}
