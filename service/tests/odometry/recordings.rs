//! The recordings of real robots, and the simulated runs with mismatches. Needs `INEKF_DATASETS`.

use std::path::Path;

use inekf_service::config::{Config, IncrementNoise, Mismatch, Motion};
use nalgebra::Vector2;

use super::harness::{Estimate, Input, Outcome, run_config};
use super::oracle::{Recording, config, csv, datasets, planar};

fn inputs(recording: &Recording) -> Vec<Input> {
    let mut inputs: Vec<Input> = recording.state.map(Input::Set).into_iter().collect();
    let mut fixes = recording.fixes.iter().peekable();
    for row in &recording.rows {
        while let Some(fix) = fixes.next_if(|fix| fix.header.stamp_ns <= row.header.stamp_ns) {
            inputs.push(Input::Fix(*fix));
        }
        inputs.push(Input::Plane(*row));
    }
    inputs
}

/// Stamps and positions of the truth.
fn truth(dir: &Path) -> Vec<(u64, Vector2<f64>)> {
    let (names, rows) = csv(&dir.join("truth.csv"));
    let column = |name: &str| names.iter().position(|n| n == name).unwrap();
    let [t, x, y] = ["t_ns", "x", "y"].map(column);
    let point = |row: &Vec<f64>| (row[t] as u64, Vector2::new(row[x], row[y]));
    rows.iter().map(point).collect()
}

/// Root mean square of the position's error after `share` of the recording, m.
fn rmse(estimates: &[Estimate], truth: &[(u64, Vector2<f64>)], share: f64) -> f64 {
    let (first, last) = (truth[0].0, truth[truth.len() - 1].0);
    let from = first + ((last - first) as f64 * share) as u64;
    let (mut sum, mut count) = (0.0, 0);
    let mut at = 0;
    for (k, estimate) in estimates.iter().enumerate() {
        let stamp = estimate.head.stamp_ns;
        // The last of its stamp.
        if stamp < from
            || estimates
                .get(k + 1)
                .is_some_and(|next| next.head.stamp_ns == stamp)
        {
            continue;
        }
        while at < truth.len() && truth[at].0 < stamp {
            at += 1;
        }
        let Some((_, p)) = truth.get(at).filter(|(t, _)| *t == stamp) else {
            continue;
        };
        sum += (Vector2::from_column_slice(estimate.position()) - p).norm_squared();
        count += 1;
    }
    assert!(count > 50, "{count} rows have a truth");
    (sum / f64::from(count)).sqrt()
}

/// The configuration as an InEKF without mismatches, with these densities.
fn plain(config: &Config, rotation: f64, translation: f64) -> Config {
    let mut config = config.clone();
    config.mismatch = Mismatch::None;
    config.mismatched.clear();
    if let Motion::Odometry(odometry) = &mut config.motion {
        odometry.noise.white = IncrementNoise::Density {
            rotation,
            translation,
            lateral: translation,
        };
    }
    config
}

#[test]
fn on_real_robots_the_bank_beats_the_best_of_the_tuned_filters() {
    let Some(datasets) = datasets() else { return };
    for name in ["wifibot_3", "plaza2_mower"] {
        let dir = datasets.join(name);
        let (inputs, truth) = (inputs(&Recording::load(&dir)), truth(&dir));
        let adaptive = config(name);
        assert_eq!(adaptive.mismatch, Mismatch::Adaptive);
        let ours = rmse(&run_config(&adaptive, &inputs).estimates, &truth, 0.25);
        let mut best = (f64::INFINITY, 0.0, 0.0);
        for rotation in [0.003, 0.01, 0.02, 0.04, 0.08, 0.16] {
            for translation in [0.01, 0.03, 0.06, 0.1, 0.2] {
                let tuned = plain(&adaptive, rotation, translation);
                let theirs = rmse(&run_config(&tuned, &inputs).estimates, &truth, 0.25);
                if theirs < best.0 {
                    best = (theirs, rotation, translation);
                }
            }
        }
        println!("{name}: adaptive {ours:.4} m, best InEKF {best:?}");
        assert!(ours < best.0, "{name}: {ours} {best:?}");
    }
}

#[test]
fn on_simulated_mismatches_the_bank_beats_the_plain_filter() {
    let Some(datasets) = datasets() else { return };
    let (mut ours, mut theirs, mut runs) = (0.0, 0.0, 0);
    for run_dir in std::fs::read_dir(datasets.join("planar_mismatch")).unwrap() {
        let dir = run_dir.unwrap().path();
        if !dir.join("odometry.csv").exists() {
            continue;
        }
        let (inputs, truth) = (inputs(&planar(&dir)), truth(&dir));
        let error = |filter: &str| {
            let config = config(&format!("planar_mismatch_{filter}"));
            rmse(&run_config(&config, &inputs).estimates, &truth, 0.5).powi(2)
        };
        ours += error("adaptive");
        theirs += error("inekf");
        runs += 1;
    }
    let mean = |sum: f64| (sum / f64::from(runs)).sqrt();
    println!(
        "planar_mismatch, {runs} runs: adaptive {:.4} m, InEKF {:.4} m",
        mean(ours),
        mean(theirs)
    );
    assert!(runs > 0 && ours < theirs, "{ours} {theirs}");
}

#[test]
fn outdoors_the_fixes_that_were_left_out_are_foretold_to_what_gps_is_worth() {
    let Some(datasets) = datasets() else { return };
    let recording = Recording::load(&datasets.join("husky_outdoor"));
    let mut fed = Recording::load(&datasets.join("husky_outdoor"));
    let left_out = |index: usize| index % 5 == 4;
    let mut index = 0;
    fed.fixes.retain(|_| {
        index += 1;
        !left_out(index - 1)
    });
    let config = config("husky_outdoor");
    let outcome: Outcome = run_config(&config, &inputs(&fed));
    let finite = |e: &Estimate| e.mean.iter().chain(&e.covariance).all(|x| x.is_finite());
    assert!(outcome.estimates.iter().all(finite));
    let (mut sum, mut count, mut variance) = (0.0, 0, 0.0);
    let mut later = 0;
    for (_, fix) in recording
        .fixes
        .iter()
        .enumerate()
        .filter(|(i, _)| left_out(*i))
    {
        let stamp = fix.header.stamp_ns;
        while later < outcome.estimates.len() && outcome.estimates[later].head.stamp_ns < stamp {
            later += 1;
        }
        if later == 0 || later == outcome.estimates.len() {
            continue;
        }
        let [one, other] = [&outcome.estimates[later - 1], &outcome.estimates[later]];
        let [a, b] = [one, other].map(|e| e.head.stamp_ns as f64);
        let share = (stamp as f64 - a) / (b - a);
        let point = |e: &Estimate| Vector2::from_column_slice(e.position());
        let here = point(one) * (1.0 - share) + point(other) * share;
        let there = Vector2::new(fix.position_w_m[0], fix.position_w_m[1]);
        sum += (here - there).norm_squared();
        variance += fix.covariance_w_m2[0] + fix.covariance_w_m2[4];
        count += 1;
    }
    let (residual, stated) = (
        (sum / f64::from(count)).sqrt(),
        (variance / f64::from(count)).sqrt(),
    );
    println!("husky_outdoor: {count} fixes left out, {residual:.2} m, stated {stated:.2} m");
    // Between the fixes the estimate is at most as far off as a fix: twice the configured sigma in all.
    let scale = config.position_sources[0].sigma_scale;
    assert!(
        count > 100 && residual < 2.0 * scale * stated,
        "{residual} {stated}"
    );
}
