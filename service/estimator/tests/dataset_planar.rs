//! InEKF and LC-InEKF over the simulated runs of [LC] section VII at 10 Hz, `planar_mismatch` and `planar_clean`,
//! against the oracle's own estimates (`oracle_*.csv`): state and covariance after every update, to 1e-6.
//!
//! The recordings are found through `INEKF_DATASETS`; without it these tests say so and pass.

mod common;

use common::dataset::{folder, table};
use inekf::filter::{
    Belief, Constrained, Covariance, Left, UpdateOptions, propagate_odometry, update, update_with,
};
use inekf::lie::{SE2, SO2};
use inekf::model::{
    Declared, OdometryStep, OutputMismatch, PlanarPair, PointFix, ProcessColumns, ProcessMismatch,
};
use nalgebra::{SMatrix, Vector2, Vector3};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

const TOLERANCE: f64 = 1e-6;

/// The runs of a set, or nothing if the data are not here.
fn runs(set: &str) -> Vec<PathBuf> {
    let Some(folder) = folder(set) else {
        return Vec::new();
    };
    let entries = fs::read_dir(folder).expect("the set");
    let mut runs: Vec<PathBuf> = entries.map(|entry| entry.expect("a run").path()).collect();
    runs.sort();
    assert!(!runs.is_empty(), "{set} has runs");
    runs
}

struct Run {
    start: Belief<SE2, Left, 3>,
    q: SMatrix<f64, 3, 3>,
    steps: Vec<OdometryStep<SE2>>,
    pairs: Vec<PlanarPair>,
}

impl Run {
    fn read(folder: &Path) -> Self {
        let meta = fs::read_to_string(folder.join("meta.json")).expect("meta.json");
        let meta: Value = serde_json::from_str(&meta).expect("valid JSON");
        let diagonal =
            |key: &str| Vector3::from_fn(|i, _| meta[key][i].as_f64().expect("a number"));
        let initial = |key: &str| meta["initial"][key].as_f64().expect("a number");
        let mean = SE2 {
            rotation: SO2::from_angle(initial("theta")),
            position: Vector2::new(initial("x"), initial("y")),
        };
        let odometry = table(&folder.join("odometry.csv"), ["t_ns", "dtheta", "dx", "dy"]);
        let fixes = table(
            &folder.join("position.csv"),
            ["t_ns", "source", "x", "y", "sx", "sy"],
        );
        let step =
            |[_, theta, x, y]: &[f64; 4]| OdometryStep::new(&Vector3::new(*theta, *x, *y), 0.1);
        let pair = |(rows, [stamp, ..]): (&[[f64; 6]], &[f64; 4])| {
            PlanarPair::new([0, 1].map(|source| {
                let [t_ns, number, x, y, sx, sy] = rows[source];
                assert_eq!((t_ns, number), (*stamp, source as f64), "in step, in order");
                PointFix {
                    position_w: Vector2::new(x, y),
                    covariance_w: SMatrix::from_diagonal(&Vector2::new(sx * sx, sy * sy)),
                    lever_arm_b: Vector2::zeros(),
                    scale_error: 0.0,
                }
            }))
        };
        Self {
            start: Belief::new(mean, Covariance::from_variances(&diagonal("P0_diag"))),
            q: SMatrix::from_diagonal(&diagonal("Q_diag_per_step")),
            steps: odometry.iter().map(step).collect(),
            pairs: fixes.chunks(2).zip(&odometry).map(pair).collect(),
        }
    }
}

const ORACLE: [&str; 9] = [
    "theta", "x", "y", "p_0_0", "p_0_1", "p_0_2", "p_1_1", "p_1_2", "p_2_2",
];

fn assert_agrees(belief: &Belief<SE2, Left, 3>, oracle: &[f64; 9], when: &str) {
    let (mean, p) = (belief.mean, belief.covariance);
    let state = [mean.rotation.angle_rad(), mean.position.x, mean.position.y];
    let actual = state.into_iter().chain(p.upper_triangle());
    for ((actual, expected), name) in actual.zip(oracle).zip(ORACLE) {
        let off = (actual - expected).abs();
        assert!(off < TOLERANCE, "{when}: {name} off by {off:e}");
    }
}

fn assert_inekf(set: &str) {
    for folder in runs(set) {
        let run = Run::read(&folder);
        let oracle = table(&folder.join("oracle_inekf.csv"), ORACLE);
        assert_eq!(
            (run.steps.len(), run.pairs.len(), oracle.len()),
            (330, 330, 330)
        );
        let mut belief = run.start;
        for (k, (step, pair)) in run.steps.iter().zip(&run.pairs).enumerate() {
            belief = propagate_odometry(&belief, step, &run.q);
            update(&mut belief, pair, &UpdateOptions::PLAIN).expect("an update");
            assert_agrees(
                &belief,
                &oracle[k],
                &format!("{}, row {k}", folder.display()),
            );
        }
    }
}

fn assert_lc_inekf(set: &str) {
    let outputs = [
        OutputMismatch::MeasurementScale { source: 1 },
        OutputMismatch::MeasurementRotation {
            source: 0,
            axis_w: None,
        },
    ]
    .map(Declared::hard);
    let scale = [Declared::hard(ProcessMismatch::OdometryScale)];
    for folder in runs(set) {
        let run = Run::read(&folder);
        let oracle = table(&folder.join("oracle_lc-inekf.csv"), ORACLE);
        assert_eq!(oracle.len(), run.steps.len());
        let mut way = ProcessColumns::new(&scale).expect("room");
        let mut belief = run.start;
        for (k, (step, pair)) in run.steps.iter().zip(&run.pairs).enumerate() {
            belief = propagate_odometry(&belief, step, &run.q);
            way.advance(step, &run.q);
            let rule = Constrained::new(&belief, &way, &outputs, pair);
            update_with(&mut belief, pair, &rule, &UpdateOptions::PLAIN).expect("an update");
            way.reset();
            assert_agrees(
                &belief,
                &oracle[k],
                &format!("{}, row {k}", folder.display()),
            );
        }
    }
}

#[test]
fn inekf_with_mismatch() {
    assert_inekf("planar_mismatch");
}

#[test]
fn inekf_without_mismatch() {
    assert_inekf("planar_clean");
}

#[test]
fn lc_inekf_with_mismatch() {
    assert_lc_inekf("planar_mismatch");
}

#[test]
fn lc_inekf_without_mismatch() {
    assert_lc_inekf("planar_clean");
}
