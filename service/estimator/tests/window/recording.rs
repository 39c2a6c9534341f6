//! A car in Karlsruhe (KITTI odometry 00, first part) with fixes of 1 m at 1 Hz: what leaves a window of fifty states
//! with biases, and its newest state, against the truth.
//!
//! The recording is found through `INEKF_DATASETS`; without it this test says so and passes.

use inekf::filter::{
    Alignment, Belief, BiasPrior, Left, Levelled, UpdateOptions, propagate, update,
};
use inekf::lie::SE23;
use inekf::model::{Discretisation, ImuInput, ImuNoise, NavState, PositionObservation};
use inekf::smoother::{Preintegration, Window, WindowOptions};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::{Path, PathBuf};

const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.8098);

/// As in the configuration of this recording: somewhat above the makers' figures.
const NOISE: ImuNoise = ImuNoise {
    gyro_psd: 3e-4 * 3e-4,
    accel_psd: 2e-2 * 2e-2,
    gyro_bias_psd: 3e-6 * 3e-6,
    accel_bias_psd: 2e-4 * 2e-4,
};
const HEADING_DEG: f64 = 59.58;
const HEADING_SIGMA_DEG: f64 = 10.0;

/// The rows of a file as numbers, all columns.
fn table(folder: &Path, name: &str) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(folder.join(name)).expect("a file of the set");
    let number = |cell: &str| cell.parse().expect("a number");
    let lines = text.lines().skip(1);
    lines
        .map(|line| line.split(',').map(number).collect())
        .collect()
}

fn vector(row: &[f64]) -> Vector3<f64> {
    Vector3::from_row_slice(&row[..3])
}

fn seconds(t_ns: f64) -> f64 {
    t_ns * 1e-9
}

/// An angle between -pi and pi.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

struct Recording {
    samples: Vec<(f64, ImuInput)>,
    fixes: Vec<(f64, PositionObservation)>,
    /// Position and heading at the fixes.
    truth: Vec<(Vector3<f64>, f64)>,
}

impl Recording {
    fn find() -> Option<PathBuf> {
        let Some(root) = std::env::var_os("INEKF_DATASETS") else {
            println!("skipped: INEKF_DATASETS is not set");
            return None;
        };
        Some(Path::new(&root).join("kitti00_car_a"))
    }

    fn read(folder: &Path) -> Self {
        let sample = |row: &Vec<f64>| {
            let (omega_b, force_b) = (vector(&row[1..]), vector(&row[4..]));
            (seconds(row[0]), ImuInput { omega_b, force_b })
        };
        let fix = |row: &Vec<f64>| {
            let sigmas = vector(&row[4..]);
            let observation = PositionObservation {
                position_w: vector(&row[1..]),
                covariance_w: Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)),
                lever_arm_b: Vector3::zeros(),
            };
            (seconds(row[0]), observation)
        };
        let fixes: Vec<_> = table(folder, "position_noisy.csv")
            .iter()
            .map(fix)
            .collect();
        let poses = table(folder, "truth.csv");
        let truth = fixes
            .iter()
            .map(|(time_s, _)| truth_at(&poses, *time_s))
            .collect();
        Self {
            samples: table(folder, "imu.csv").iter().map(sample).collect(),
            fixes,
            truth,
        }
    }

    /// The samples between two times with the share of each: a sample speaks for the interval that ends at its stamp.
    fn between(&self, start_s: f64, end_s: f64) -> impl Iterator<Item = (&ImuInput, f64)> {
        self.samples.windows(2).filter_map(move |pair| {
            let (from, to) = (pair[0].0.max(start_s), pair[1].0.min(end_s));
            (from < to).then_some((&pair[1].1, to - from))
        })
    }

    /// Level from the half second before the first fix; the heading `wrong_deg` off; no idea of the velocity.
    fn first(&self, wrong_deg: f64) -> Belief<NavState, Left, 15> {
        let (start_s, fix) = &self.fixes[0];
        let before = self.samples.iter().filter(|(time_s, _)| time_s < start_s);
        let forces: Vec<_> = before.map(|(_, input)| input.force_b).collect();
        let recent = &forces[forces.len() - 50..];
        let force_b = recent.iter().sum::<Vector3<f64>>() / recent.len() as f64;
        let heading = (HEADING_DEG + wrong_deg).to_radians();
        Alignment {
            r_wb: Levelled::from_force(&force_b, heading)
                .expect("gravity")
                .r_wb,
            tilt_sigma: 3_f64.to_radians(),
            heading_sigma: HEADING_SIGMA_DEG.to_radians(),
            velocity_w: Vector3::zeros(),
            velocity_sigma: 10.0,
            position_w: fix.position_w,
            position_covariance_w: fix.covariance_w,
            lever_arm_b: Vector3::zeros(),
            biases: BiasPrior {
                gyro_bias: Vector3::zeros(),
                gyro_sigma: 3e-4,
                accel_bias: Vector3::zeros(),
                accel_sigma: 0.03,
            },
        }
        .belief()
    }
}

/// Position and heading between two rows of the truth, `t_ns,qw,qx,qy,qz,vx,vy,vz,x,y,z`.
fn truth_at(poses: &[Vec<f64>], time_s: f64) -> (Vector3<f64>, f64) {
    let after = poses.partition_point(|row| seconds(row[0]) < time_s);
    let (a, b) = (&poses[after - 1], &poses[after]);
    let share = (time_s - seconds(a[0])) / (seconds(b[0]) - seconds(a[0]));
    let heading = |row: &[f64]| {
        let [w, x, y, z] = [row[1], row[2], row[3], row[4]];
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
    };
    let position = vector(&a[8..]).lerp(&vector(&b[8..]), share);
    let turned = wrapped(heading(b) - heading(a));
    (position, heading(a) + share * turned)
}

/// Root mean squares: east, north, up in metres, heading in degrees.
fn rmse<'a>(
    states: impl Iterator<Item = &'a SE23>,
    truth: &[(Vector3<f64>, f64)],
) -> (Vector3<f64>, f64) {
    let (mut position, mut heading, mut count) = (Vector3::zeros(), 0.0, 0);
    for (chi, (position_w, heading_rad)) in states.zip(truth) {
        let off = chi.position - position_w;
        position += off.component_mul(&off);
        heading += wrapped(chi.rotation.heading_rad() - heading_rad).powi(2);
        count += 1;
    }
    let mean = 1.0 / f64::from(count);
    (
        (position * mean).map(f64::sqrt),
        (heading * mean).sqrt().to_degrees(),
    )
}

struct Outcome {
    smoothed: Vec<SE23>,
    newest: Vec<SE23>,
    filtered: Vec<SE23>,
}

fn run(recording: &Recording, wrong_deg: f64, options: &WindowOptions) -> Outcome {
    let zoh = Discretisation::ZeroOrderHold;
    let mut filter = recording.first(wrong_deg);
    let mut window = Window::<NavState, Left, 15>::new(&filter, options);
    let mut outcome = Outcome {
        smoothed: Vec::new(),
        newest: Vec::new(),
        filtered: Vec::new(),
    };
    for pair in recording.fixes.windows(2) {
        let (start_s, (end_s, fix)) = (pair[0].0, pair[1]);
        let mut motion = Preintegration::new(&window.newest().mean);
        for (input, dt_s) in recording.between(start_s, end_s) {
            motion.push(input, &GRAVITY_W, dt_s, zoh, &NOISE);
            filter = propagate(&filter, input, &GRAVITY_W, dt_s, zoh, &NOISE);
        }
        outcome
            .smoothed
            .extend(window.push(&motion).map(|chi| chi.pose));
        window.update(fix).expect("an update of the window");
        update(&mut filter, &fix, &UpdateOptions::ITERATED).expect("an update of the filter");
        outcome.newest.push(window.newest().mean.pose);
        outcome.filtered.push(filter.mean.pose);
    }
    outcome
}

#[test]
fn what_leaves_a_window_of_fifty_states_is_within_a_fifth_of_a_metre() {
    let Some(folder) = Recording::find() else {
        return;
    };
    let recording = Recording::read(&folder);
    for wrong_deg in [0.0, 10.0, -10.0] {
        let outcome = run(&recording, wrong_deg, &WindowOptions::new(50));
        assert_eq!(outcome.smoothed.len(), recording.fixes.len() - 50);
        // The first state belongs to the first fix, which is the prior's.
        let (position, heading) = rmse(outcome.smoothed.iter(), &recording.truth);
        let newest = rmse(outcome.newest.iter().skip(30), &recording.truth[31..]);
        let filtered = rmse(outcome.filtered.iter().skip(30), &recording.truth[31..]);
        println!(
            "{wrong_deg} deg wrong: {:.3} m east, {:.3} m north, {heading:.2} deg; newest {:.3} m, {:.3} deg; \
             filter {:.3} m, {:.3} deg",
            position.x,
            position.y,
            newest.0.norm(),
            newest.1,
            filtered.0.norm(),
            filtered.1
        );
        assert!(position.x <= 0.20 && position.y <= 0.28 && heading <= 0.4);
        // At its newest state a smoother is a filter with better linearisation points: the position may not be worse,
        // the heading, known to 0.36 deg, by not more than chance.
        assert!(newest.0.norm() <= filtered.0.norm() && newest.1 <= 1.02 * filtered.1);
    }
}
