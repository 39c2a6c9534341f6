//! The odometry models against recorded oracles: the reference filters of the planar data sets.
//!
//! Needs `INEKF_DATASETS`; says so where it is not set.

use std::any::Any;
use std::path::{Path, PathBuf};

use inekf_service::config::Config;
use inekf_service::engine::{Engine, History, Model, Outbox, Use, build};
use inekf_shared::message::{
    EstimateMessage, EstimateSe2, Header, MODEL_ODOMETRY_2D, Odometry2d, PositionFix, StateVector,
    Zero, triangle_index,
};

/// A CSV file as rows of numbers, empty cells as NaN.
pub fn csv(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines();
    let header = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let number = |cell: &str| cell.parse().unwrap_or(f64::NAN);
    (
        header,
        lines
            .map(|line| line.split(',').map(number).collect())
            .collect(),
    )
}

/// Rows and fixes of a planar recording.
pub struct Recording {
    pub rows: Vec<Odometry2d>,
    pub fixes: Vec<PositionFix>,
    pub state: Option<StateVector>,
}

impl Recording {
    pub fn load(dir: &Path) -> Self {
        let header = |seq: usize, stamp: f64| Header {
            stamp_ns: stamp as u64,
            seq: seq as u64,
            sent_ns: 0,
            epoch: 1,
        };
        let (names, rows) = csv(&dir.join("odometry.csv"));
        let column = |name: &str| names.iter().position(|n| n == name).unwrap();
        let [t, dtheta, dx, dy] = ["t_ns", "dtheta", "dx", "dy"].map(column);
        let rows = rows.iter().enumerate().map(|(seq, row)| Odometry2d {
            header: header(seq, row[t]),
            dtheta_rad: row[dtheta],
            translation_m: [row[dx], row[dy]],
        });
        let (names, fixes) = csv(&dir.join("position.csv"));
        let column = |name: &str| names.iter().position(|n| n == name);
        let [t, x, y, sx, sy] = ["t_ns", "x", "y", "sx", "sy"].map(|name| column(name).unwrap());
        let fixes = fixes.iter().enumerate().map(|(seq, row)| PositionFix {
            header: header(seq, row[t]),
            source: column("source").map_or(0, |source| row[source] as u32),
            dimension: 2,
            position_w_m: [row[x], row[y], f64::NAN],
            covariance_w_m2: [
                row[sx] * row[sx],
                0.0,
                0.0,
                0.0,
                row[sy] * row[sy],
                0.0,
                0.0,
                0.0,
                f64::NAN,
            ],
        });
        Self {
            rows: rows.collect(),
            fixes: fixes.collect(),
            state: None,
        }
    }
}

/// Feeds a recording to an engine, and keeps the last estimate of each stamp.
struct Feed<'a>(&'a Recording);

struct LastOfStamp(Vec<EstimateSe2>);

impl<E: EstimateMessage> Outbox<E> for LastOfStamp {
    fn publish(&mut self, estimate: &mut E) {
        let estimate = *(estimate as &dyn Any)
            .downcast_ref::<EstimateSe2>()
            .unwrap();
        if self
            .0
            .last()
            .is_some_and(|last| last.head.stamp_ns == estimate.head.stamp_ns)
        {
            self.0.pop();
        }
        self.0.push(estimate);
    }
}

impl Use for Feed<'_> {
    type Output = Vec<EstimateSe2>;

    fn with<M: Model + 'static, H: History<M> + 'static>(
        self,
        mut engine: Engine<M, H>,
    ) -> Vec<EstimateSe2> {
        let mut outbox = LastOfStamp(Vec::new());
        if let Some(state) = &self.0.state {
            engine.set_state(state).unwrap();
        }
        let mut fixes = self.0.fixes.iter().peekable();
        for row in &self.0.rows {
            while let Some(fix) = fixes.next_if(|fix| fix.header.stamp_ns <= row.header.stamp_ns) {
                engine.position(fix, &mut outbox);
            }
            let sample = (row as &dyn Any).downcast_ref::<M::Sample>().unwrap();
            engine.sample(sample, 0, &mut outbox);
        }
        let counters = engine.tally().counters;
        assert_eq!(counters.rejected, 0, "{:?}", engine.tally());
        assert_eq!(counters.unpaired + counters.late + counters.lost, 0);
        outbox.0
    }
}

pub fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("config/{name}.toml"));
    Config::load(&path).unwrap()
}

fn run(config: &Config, recording: &Recording) -> Vec<EstimateSe2> {
    build(config, Feed(recording)).unwrap()
}

pub fn datasets() -> Option<PathBuf> {
    let folder = std::env::var_os("INEKF_DATASETS").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: INEKF_DATASETS is not set");
    }
    folder
}

/// A planar run with the initial state of its meta.json.
pub fn planar(dir: &Path) -> Recording {
    let text = std::fs::read_to_string(dir.join("meta.json")).unwrap();
    let after = |key: &str| -> f64 {
        let start = text.find(key).unwrap() + key.len();
        let number = text[start..].trim_start_matches([':', ' ', '[', '\n']);
        let end = number.find([',', '\n', ']', '}']).unwrap();
        number[..end].trim().parse().unwrap()
    };
    let theta = after("\"theta\"");
    let mut state = StateVector {
        model: MODEL_ODOMETRY_2D,
        dimension: 3,
        q_wb: [0.0, 0.0, (0.5 * theta).sin(), (0.5 * theta).cos()],
        p_w_m: [after("\"x\""), after("\"y\""), 0.0],
        ..StateVector::ZERO
    };
    for (i, variance) in [9e-4, 9.0, 9.0].into_iter().enumerate() {
        state.covariance[triangle_index(i, i, 3).unwrap()] = variance;
    }
    assert!((after("\"P0_diag\"") - 9e-4).abs() < 1e-15);
    Recording {
        state: Some(state),
        ..Recording::load(dir)
    }
}

#[test]
fn the_plain_filters_equal_the_oracles_on_every_planar_run() {
    let Some(datasets) = datasets() else { return };
    let mut compared = 0;
    for set in ["planar_mismatch", "planar_clean"] {
        for run_dir in std::fs::read_dir(datasets.join(set)).unwrap() {
            let dir = run_dir.unwrap().path();
            if !dir.join("odometry.csv").exists() {
                continue;
            }
            let recording = planar(&dir);
            for filter in ["inekf", "lc-inekf"] {
                let ours = run(&config(&format!("planar_mismatch_{filter}")), &recording);
                let (_, theirs) = csv(&dir.join(format!("oracle_{filter}.csv")));
                assert_eq!(ours.len(), theirs.len());
                for (ours, theirs) in ours.iter().zip(&theirs) {
                    assert_eq!(ours.head.stamp_ns, theirs[0] as u64);
                    let mean = [ours.theta_rad, ours.p_w_m[0], ours.p_w_m[1]];
                    for (a, b) in mean.iter().chain(&ours.covariance).zip(&theirs[1..]) {
                        assert!((a - b).abs() < 1e-6, "{filter} {dir:?} {ours:?} {theirs:?}");
                    }
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 1000, "{compared} rows");
}
