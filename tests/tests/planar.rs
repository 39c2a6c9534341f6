//! \[LC\] section VII through the real daemon: planar odometry, two position sources of ten fixes a second, InEKF and
//! LC-InEKF. The oracle is an independent implementation, whose estimates the recordings hold. Needs the folder that
//! `INEKF_DATASETS` names, and says that it skips without.

use std::fs;
use std::path::{Path, PathBuf};

use inekf_client::evaluate::wrap_angle;
use inekf_client::table::{EstimateRow, EstimateState};
use inekf_tests::folder::recording;
use inekf_tests::process::project_config;
use inekf_tests::replay::replay;
use inekf_tests::score::estimates;

/// How far every number may be from the oracle's: rad, m, and their products.
const TOLERANCE: f64 = 1e-6;

/// The runs of a recording, in order.
fn runs(recording: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(recording).expect("the recording");
    let mut runs: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.join("meta.json").is_file())
        .collect();
    runs.sort();
    runs
}

fn plane(row: &EstimateRow) -> [f64; 3] {
    match row.state {
        EstimateState::Plane {
            theta_rad,
            p_w_m: [x, y],
        } => [theta_rad, x, y],
        _ => panic!("{row:?} is not of the plane"),
    }
}

/// The worst disagreement of two rows, in mean and covariance.
fn worst(ours: &EstimateRow, oracle: &EstimateRow) -> f64 {
    assert_eq!(ours.stamp_ns, oracle.stamp_ns);
    assert_eq!((ours.covariance.len(), oracle.covariance.len()), (6, 6));
    let [theta, x, y] = plane(ours);
    let [oracle_theta, oracle_x, oracle_y] = plane(oracle);
    let pairs = [
        (wrap_angle(theta - oracle_theta), 0.0),
        (x, oracle_x),
        (y, oracle_y),
    ];
    let covariances = ours.covariance.iter().copied();
    let covariances = covariances.zip(oracle.covariance.iter().copied());
    pairs
        .into_iter()
        .chain(covariances)
        .map(|(ours, oracle)| (ours - oracle).abs())
        .fold(0.0, f64::max)
}

fn assert_as_the_oracle(estimator: &str) {
    for name in ["planar_mismatch", "planar_clean"] {
        let Some(recording) = recording(name) else {
            return;
        };
        let config = project_config(&format!("planar_mismatch_{estimator}"));
        let runs = runs(&recording);
        assert!(!runs.is_empty(), "{name} has no run");
        for run in runs {
            let replayed = replay(&run, &config, &["--covariance"]);
            let oracle = estimates(&run.join(format!("oracle_{estimator}.csv")));
            assert_eq!(replayed.rows.len(), oracle.len(), "{}", run.display());
            let worst = replayed
                .rows
                .iter()
                .zip(&oracle)
                .map(|(ours, oracle)| worst(ours, oracle))
                .fold(0.0, f64::max);
            println!("{estimator}, {}: {worst:e} apart at worst", run.display());
            assert!(worst <= TOLERANCE, "{estimator}, {}", run.display());
            assert!(
                replayed.ended.stdout.contains("; 0 lost\n"),
                "{:?}",
                replayed.ended
            );
        }
    }
}

#[test]
fn the_inekf_on_planar_odometry_is_the_oracles() {
    assert_as_the_oracle("inekf");
}

#[test]
fn the_lc_inekf_on_planar_odometry_with_two_stacked_sources_is_the_oracles() {
    assert_as_the_oracle("lc-inekf");
}
