//! What a late fix costs: carried to now in one step, against the replay of the samples since, in one run.
//!
//! Both fuse the same fix into the same belief at its own time, a left-invariant one on SE_2(3), which is part of the
//! time; then one carries what it changed over the delay ([`LateCorrection`]), and the other moves the corrected belief
//! with every sample again. They take turns, and what is reported are medians and their ratio. The results are compared
//! too: a figure for something that is not the same would be worth nothing.

use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, ensure};
use inekf::filter::{
    Belief, Covariance, LateCorrection, Left, UpdateOptions, propagate_in_place, update,
};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{Discretisation, Drift, ImuInput, ImuNoise, PositionObservation};
use inekf_client::plot::palette;
use nalgebra::{SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::experiment::figures::{self, Mark, Panel, Scale, Series};

/// Samples between a fix and now.
pub const DELAYS: [usize; 4] = [1, 10, 100, 1000];
/// 200 samples a second.
const DT_S: f64 = 0.005;
/// World frame ENU, m/s^2.
const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);
/// Densities of a MEMS IMU.
const NOISE: ImuNoise = ImuNoise {
    gyro_psd: 4e-6,
    accel_psd: 1e-4,
    gyro_bias_psd: 0.0,
    accel_bias_psd: 0.0,
};
/// Samples that are propagated for one figure, at least: a chunk then takes long beside a look at the clock.
const CHUNK: usize = 2000;

type State = Belief<SE23, Left, 9>;

/// What one delay costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Samples between the fix and now.
    pub delay: usize,
    /// Time of a fix that is carried, median, ns.
    pub carried_ns: f64,
    /// Time of a fix that is replayed, median, ns.
    pub replayed_ns: f64,
    /// How far apart the results are: the largest entry of the covariances in standard deviations of its row and
    /// column, or of the means in standard deviations.
    pub apart: f64,
}

/// A belief, the samples since, and a fix of its time.
struct Case {
    then: State,
    now: State,
    samples: Vec<ImuInput>,
    fix: PositionObservation,
}

impl Case {
    fn new(delay: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || Vector3::from_fn(|_, _| rng.sample(StandardNormal));
        let samples: Vec<_> = (0..delay)
            .map(|_| ImuInput {
                omega_b: Vector3::new(0.0, 0.0, 0.3) + 0.2 * normal(),
                force_b: Vector3::new(0.0, 1.5, 9.8) + normal(),
            })
            .collect();
        let mean = SE23 {
            rotation: SO3::from_roll_pitch_heading(0.04, -0.03, 1.1),
            velocity: Vector3::new(9.0, 4.0, 0.2),
            position: Vector3::new(120.0, -45.0, 3.0),
        };
        let sigmas = SVector::<f64, 9>::from_fn(|i, _| [0.02, 0.2, 0.5][i / 3]);
        let mut then = State::new(
            mean,
            Covariance::from_variances(&sigmas.component_mul(&sigmas)),
        );
        // Until no entry of the covariance is zero.
        for sample in samples.iter().cycle().take(100) {
            moved(&mut then, sample);
        }
        let lever_arm_b = Vector3::new(0.8, -0.3, 1.2);
        let fix = PositionObservation {
            position_w: then.mean.position
                + then.mean.rotation.rotate(&lever_arm_b)
                + 0.3 * normal(),
            covariance_w: SMatrix::identity() * 0.25,
            lever_arm_b,
        };
        let mut now = then;
        for sample in &samples {
            moved(&mut now, sample);
        }
        Self {
            then,
            now,
            samples,
            fix,
        }
    }

    fn corrected(&self) -> anyhow::Result<State> {
        let mut belief = *black_box(&self.then);
        update(&mut belief, black_box(&self.fix), &UpdateOptions::ITERATED)?;
        Ok(belief)
    }

    fn replayed(&self) -> anyhow::Result<State> {
        let mut belief = self.corrected()?;
        for sample in black_box(&self.samples) {
            moved(&mut belief, sample);
        }
        Ok(belief)
    }

    fn carried(&self) -> anyhow::Result<State> {
        let after = self.corrected()?;
        let drift = Drift::free_fall(&GRAVITY_W, DT_S * self.samples.len() as f64);
        LateCorrection::between(&self.then, &after)
            .carried(&drift, black_box(&self.now))
            .context("too little of the covariance remains")
    }
}

fn moved(belief: &mut State, sample: &ImuInput) {
    let held = Discretisation::ZeroOrderHold;
    propagate_in_place(belief, sample, &GRAVITY_W, DT_S, held, &NOISE);
}

/// Time of one call, ns, over `count` of them.
fn timed(count: usize, routine: impl Fn() -> anyhow::Result<State>) -> anyhow::Result<f64> {
    let begun = Instant::now();
    for _ in 0..count {
        black_box(routine()?);
    }
    Ok(begun.elapsed().as_nanos() as f64 / count as f64)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn apart(a: &State, b: &State) -> f64 {
    let (p, q) = (a.covariance.matrix(), b.covariance.matrix());
    let sigma = |i: usize| q[(i, i)].sqrt();
    let xi = b.mean.between(&a.mean).log();
    (0..9).fold(0.0, |most: f64, i| {
        let row = (0..9).fold(xi[i].abs() / sigma(i), |most, j| {
            most.max((p[(i, j)] - q[(i, j)]).abs() / (sigma(i) * sigma(j)))
        });
        most.max(row)
    })
}

/// Times every delay, `turns` times each way in turns.
///
/// # Errors
/// No turns, or a filter that fails.
pub fn measure(turns: usize) -> anyhow::Result<Vec<Row>> {
    ensure!(turns > 0, "no turns: --turns must be at least 1");
    let row = |delay: usize| {
        let case = Case::new(delay);
        let apart = apart(&case.carried()?, &case.replayed()?);
        let count = (CHUNK / delay).max(1);
        let (mut carried, mut replayed) = (Vec::new(), Vec::new());
        for _ in 0..turns {
            replayed.push(timed(count, || case.replayed())?);
            carried.push(timed(count.max(CHUNK / 10), || case.carried())?);
        }
        Ok(Row {
            delay,
            carried_ns: median(carried),
            replayed_ns: median(replayed),
            apart,
        })
    };
    DELAYS.into_iter().map(row).collect()
}

/// Measures, writes `late.csv` and `late.svg` to `out` (made if need be), and returns the table as text.
///
/// # Errors
/// As [`measure`], and a file that cannot be written.
pub fn run(turns: usize, out: &Path) -> anyhow::Result<String> {
    let rows = measure(turns)?;
    std::fs::create_dir_all(out).with_context(|| format!("making the folder {}", out.display()))?;
    let mut csv = "delay_samples,carried_ns,replayed_ns,ratio,apart\n".to_owned();
    let mut text = format!(
        "A late fix on SE_2(3), medians of {turns} turns\n{:>8} {:>12} {:>12} {:>8} {:>9}\n",
        "samples", "carried ns", "replayed ns", "ratio", "apart"
    );
    for Row {
        delay,
        carried_ns,
        replayed_ns,
        apart,
    } in &rows
    {
        let ratio = replayed_ns / carried_ns;
        writeln!(
            csv,
            "{delay},{carried_ns:.1},{replayed_ns:.1},{ratio:.3},{apart:e}"
        )?;
        writeln!(
            text,
            "{delay:>8} {carried_ns:>12.0} {replayed_ns:>12.0} {ratio:>8.2} {apart:>9.1e}"
        )?;
    }
    for (name, content) in [("late.csv", &csv), ("late.svg", &drawn(&rows)?)] {
        let file = out.join(name);
        std::fs::write(&file, content).with_context(|| format!("writing {}", file.display()))?;
    }
    Ok(text)
}

fn drawn(rows: &[Row]) -> anyhow::Result<String> {
    let series = |name: &str, colour, of: fn(&Row) -> f64| Series {
        name: name.to_owned(),
        colour,
        mark: Mark::Line(2),
        points: rows
            .iter()
            .map(|row| ((row.delay as f64).log10(), of(row)))
            .collect(),
    };
    let panel = Panel {
        name: "Time of a fix (ns)".to_owned(),
        scale: Scale::Logarithmic,
        series: vec![
            series("carried", palette::SERIES[0].into(), |row| row.carried_ns),
            series("replayed", palette::SERIES[1].into(), |row| row.replayed_ns),
        ],
    };
    figures::panels("A late fix", "Samples of delay (power of ten)", &[panel])
}
