//! The simulation of \[LC\] section VII: a robot in the plane with odometry and two position sources, and models
//! that are wrong.
//!
//! The robot starts at (-30, 30) m with a heading of pi/6 rad, drives at 10 m/s, turns right by a right angle from
//! 15 s to 18 s, and drives on until 33 s. World axes east and north; tangent order `(theta, x, y)`, rad and m.
//! What the sensors say, with mismatches `e_u, e_y, psi` that no filter knows:
//!
//! ```text
//! chi_k = chi_{k-1} (Omega, (1 + e_u) u)      y0 = R(psi)^T x + 3 m      y1 = (1 + e_y) x + 3 m
//! ```
//!
//! Odometry noise 0.001 rad/s and 0.01 m/s, constant over a step. The start is off by 0.03 rad and 3 m.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use clap::ValueEnum;
use inekf::lie::{LieGroup, SE2, SO2};
use inekf::model::{OdometryStep, PlanarPair, PointFix};
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Length of a run, s.
pub const DURATION_S: f64 = 33.0;
/// The turn begins and ends, s.
const TURN_S: [f64; 2] = [15.0, 18.0];
const SPEED_M_S: f64 = 10.0;
/// Standard deviation of a position fix on each axis, m.
const SIGMA_FIX_M: f64 = 3.0;
/// Standard deviations of the odometry, rad/s and m/s.
const SIGMAS_ODOMETRY: Vector3<f64> = Vector3::new(1e-3, 1e-2, 1e-2);
/// Standard deviations of the start, rad and m.
const SIGMAS_START: Vector3<f64> = Vector3::new(0.03, 3.0, 3.0);
/// Length of a segment of [`MismatchLaw::Bursts`], s.
const BURST_S: f64 = 2.0;
/// Probability that a segment is disturbed.
const BURST_PROBABILITY: f64 = 0.3;
/// Least odometry scale, and least odometry scale in a burst.
const LEAST_SCALE: [f64; 2] = [-0.07, -0.5];

/// How the three mismatches come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MismatchLaw {
    /// All three, drawn once for each run: the paper's.
    Constant,
    /// All three, drawn again for each step.
    Redrawn,
    /// In each 2 s all three with probability 0.3, else none; the odometry's scale down to -0.5.
    Bursts,
    /// None: the models are right.
    None,
    /// The odometry's scale alone, drawn once for each run.
    OdometryScale,
    /// The scale of the second source alone, drawn once for each run.
    MeasurementScale,
    /// The rotation of the first source alone, drawn once for each run.
    MeasurementRotation,
}

/// What is to be simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// How the models are wrong.
    pub law: MismatchLaw,
    /// Length of a step, s; a fix of each source at the end of every step.
    pub dt_s: f64,
}

impl Setup {
    /// The paper's mismatches, and steps of 0.1 s.
    pub const PAPER: Self = Self {
        law: MismatchLaw::Constant,
        dt_s: 0.1,
    };

    /// How many steps a run has.
    pub fn steps(&self) -> usize {
        (DURATION_S / self.dt_s).round() as usize
    }
}

/// The three mismatches during one step.
#[derive(Clone, Copy, Default)]
struct Mismatch {
    odometry_scale: f64,
    measurement_scale: f64,
    rotation_rad: f64,
}

impl Mismatch {
    /// The distributions of the paper, but for the least scale of the odometry.
    fn draw(least_scale: f64, rng: &mut ChaCha8Rng) -> Self {
        Self {
            odometry_scale: rng.random_range(least_scale..0.15),
            measurement_scale: rng.random_range(-0.1..0.1),
            rotation_rad: rng.random_range(-0.05..0.05),
        }
    }

    /// What holds from the first step on.
    fn at_start(law: MismatchLaw, rng: &mut ChaCha8Rng) -> Self {
        // Drawn whatever the law, so that runs of one seed share their noise.
        let all = Self::draw(LEAST_SCALE[0], rng);
        let mut alone = Self::default();
        match law {
            MismatchLaw::Constant => return all,
            MismatchLaw::OdometryScale => alone.odometry_scale = all.odometry_scale,
            MismatchLaw::MeasurementScale => alone.measurement_scale = all.measurement_scale,
            MismatchLaw::MeasurementRotation => alone.rotation_rad = all.rotation_rad,
            MismatchLaw::Redrawn | MismatchLaw::Bursts | MismatchLaw::None => {}
        }
        alone
    }
}

/// One simulated run.
#[derive(Clone, Debug)]
pub struct Run {
    /// Length of a step, s.
    pub dt_s: f64,
    /// Where a filter begins.
    pub start: SE2,
    /// Truth after each step.
    pub truth: Vec<SE2>,
    /// What the odometry says of each step.
    pub steps: Vec<OdometryStep<SE2>>,
    /// What the two position sources say after each step.
    pub pairs: Vec<PlanarPair>,
}

impl Run {
    /// Run number `index` of `seed`; the same whatever else is drawn.
    pub fn draw(setup: &Setup, seed: u64, index: u64) -> Self {
        let mut noise = stream(seed, 2 * index);
        // The mismatches have draws of their own: the noise is the same under every law.
        let mut draws = stream(seed, 2 * index + 1);
        let mut chi = SE2 {
            rotation: SO2::from_angle(FRAC_PI_6),
            position: Vector2::new(-30.0, 30.0),
        };
        let off = SIGMAS_START.component_mul(&normal::<3, 1>(&mut noise));
        let start = SE2 {
            rotation: chi.rotation * SO2::from_angle(off.x),
            position: chi.position + off.yz(),
        };
        let mut run = Self {
            dt_s: setup.dt_s,
            start,
            truth: Vec::new(),
            steps: Vec::new(),
            pairs: Vec::new(),
        };
        let mut mismatch = Mismatch::at_start(setup.law, &mut draws);
        let mut segment = None;
        for k in 0..setup.steps() {
            let begin_s = k as f64 * setup.dt_s;
            match setup.law {
                MismatchLaw::Redrawn => mismatch = Mismatch::draw(LEAST_SCALE[0], &mut draws),
                MismatchLaw::Bursts => {
                    // A step counts to the segment of its middle, which rounding cannot move.
                    let current = ((begin_s + 0.5 * setup.dt_s) / BURST_S) as u64;
                    if segment.replace(current) != Some(current) {
                        let on = draws.random_range(0.0..1.0) < BURST_PROBABILITY;
                        let drawn = Mismatch::draw(LEAST_SCALE[1], &mut draws);
                        mismatch = if on { drawn } else { Mismatch::default() };
                    }
                }
                _ => {}
            }
            run.step(
                &mut chi,
                turn_rad(begin_s, setup.dt_s),
                mismatch,
                &mut noise,
            );
        }
        run
    }

    fn step(&mut self, chi: &mut SE2, turn_rad: f64, mismatch: Mismatch, rng: &mut ChaCha8Rng) {
        let way_m = SPEED_M_S * self.dt_s;
        let increment =
            |way_m: f64| OdometryStep::<SE2>::new(&Vector3::new(turn_rad, way_m, 0.0), self.dt_s);
        *chi = increment(way_m * (1.0 + mismatch.odometry_scale)).apply(chi);
        let w = (SIGMAS_ODOMETRY * self.dt_s).component_mul(&normal::<3, 1>(rng));
        self.steps.push(OdometryStep {
            kappa: increment(way_m).kappa.compose(&SE2::exp(&w)),
            dt_s: self.dt_s,
        });
        self.truth.push(*chi);
        let seen = [
            SO2::from_angle(mismatch.rotation_rad).inverse_rotate(&chi.position),
            chi.position * (1.0 + mismatch.measurement_scale),
        ];
        let fixes = seen.map(|position_w| PointFix {
            position_w: position_w + SIGMA_FIX_M * normal::<2, 1>(rng),
            covariance_w: Matrix2::identity() * (SIGMA_FIX_M * SIGMA_FIX_M),
            lever_arm_b: Vector2::zeros(),
            scale_error: 0.0,
        });
        self.pairs.push(PlanarPair::new(fixes));
    }

    /// Covariance of the odometry's noise over one step, of the left-invariant error.
    pub fn odometry_noise(&self) -> Matrix3<f64> {
        let sigmas = SIGMAS_ODOMETRY * self.dt_s;
        Matrix3::from_diagonal(&sigmas.component_mul(&sigmas))
    }
}

/// Variances of a filter at its start, of the left-invariant error.
pub fn start_variances() -> Vector3<f64> {
    SIGMAS_START.component_mul(&SIGMAS_START)
}

/// How far the robot turns during a step, rad.
fn turn_rad(begin_s: f64, dt_s: f64) -> f64 {
    let [from, to] = TURN_S;
    let within_s = ((begin_s + dt_s).min(to) - begin_s.max(from)).max(0.0);
    -FRAC_PI_2 * within_s / (to - from)
}

/// A generator of its own for each number `index` of `seed`.
pub(super) fn stream(seed: u64, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}

/// Independent standard normal entries.
pub(super) fn normal<const R: usize, const C: usize>(rng: &mut ChaCha8Rng) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| rng.sample(StandardNormal))
}
