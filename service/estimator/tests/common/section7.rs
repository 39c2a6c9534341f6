//! The experiment of [LC] section VII at 10 Hz: a robot at 10 m/s that turns right once, odometry with a wrong
//! scale, one position source turned and one with a wrong scale, all unknown to the filters.

use inekf::lie::{LieGroup, SE2, SO2};
use inekf::model::{OdometryStep, PlanarPair, PointFix};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{normal, seeded};

pub const STEPS: usize = 330;
pub const DT_S: f64 = 0.1;
const SIGMA_FIX_M: f64 = 3.0;
const SIGMAS_ODOMETRY: Vector3<f64> = Vector3::new(1e-4, 1e-3, 1e-3);
const SIGMAS_START: Vector3<f64> = Vector3::new(0.03, 3.0, 3.0);

/// How the three mismatches come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Drawn once for each run: the paper's.
    Constant,
    /// Drawn again for each step.
    Redrawn,
    /// In each 2 s all three with probability 0.3, else none; the odometry's scale down to -0.5.
    Bursts,
    /// None.
    Clean,
}

/// Odometry scale, measurement scale, rotation.
fn draw(low: f64, rng: &mut ChaCha8Rng) -> [f64; 3] {
    [
        rng.random_range(low..0.15),
        rng.random_range(-0.1..0.1),
        rng.random_range(-0.05..0.05),
    ]
}

pub struct Run {
    /// Where a filter begins.
    pub start: SE2,
    /// Truth after each step.
    pub truth: Vec<SE2>,
    pub steps: Vec<OdometryStep<SE2>>,
    pub pairs: Vec<PlanarPair>,
}

impl Run {
    pub fn draw(seed: u64, law: Law) -> Self {
        Self::with_stop(seed, law, 0..0)
    }

    /// A run in which only the mismatches marked `true` exist: odometry scale, measurement scale, rotation.
    pub fn with_only(seed: u64, law: Law, exists: [bool; 3]) -> Self {
        Self::drive(seed, law, exists, 0..0)
    }

    /// A run in which the robot stands still during the given steps.
    pub fn with_stop(seed: u64, law: Law, stop: std::ops::Range<usize>) -> Self {
        Self::drive(seed, law, [true; 3], stop)
    }

    fn drive(seed: u64, law: Law, exists: [bool; 3], stop: std::ops::Range<usize>) -> Self {
        let mut rng = seeded(seed);
        let at_start = SE2 {
            rotation: SO2::from_angle(std::f64::consts::FRAC_PI_6),
            position: Vector2::new(-30.0, 30.0),
        };
        let off = SIGMAS_START.component_mul(&normal::<3, 1>(&mut rng));
        let start = SE2 {
            rotation: at_start.rotation * SO2::from_angle(off.x),
            position: at_start.position + off.yz(),
        };
        let mut run = Self {
            start,
            truth: Vec::new(),
            steps: Vec::new(),
            pairs: Vec::new(),
        };
        let mut chi = at_start;
        let mut mismatch = match law {
            Law::Constant => draw(-0.07, &mut rng),
            _ => [0.0; 3],
        };
        for k in 0..STEPS {
            match law {
                Law::Redrawn => mismatch = draw(-0.07, &mut rng),
                Law::Bursts if k % 20 == 0 => {
                    let on = rng.random_range(0.0..1.0) < 0.3;
                    mismatch = if on { draw(-0.5, &mut rng) } else { [0.0; 3] };
                }
                _ => {}
            }
            let turn = if (150..180).contains(&k) {
                -std::f64::consts::PI / 60.0
            } else {
                0.0
            };
            let motion = if stop.contains(&k) {
                [0.0, 0.0]
            } else {
                [turn, 10.0 * DT_S]
            };
            let existing = std::array::from_fn(|i| if exists[i] { mismatch[i] } else { 0.0 });
            run.step(&mut chi, motion, existing, &mut rng);
        }
        run
    }

    fn step(
        &mut self,
        chi: &mut SE2,
        [turn, way_m]: [f64; 2],
        [odometry, scale, rotation]: [f64; 3],
        rng: &mut ChaCha8Rng,
    ) {
        let increment =
            |way_m: f64| OdometryStep::<SE2>::new(&Vector3::new(turn, way_m, 0.0), DT_S);
        *chi = increment(way_m * (1.0 + odometry)).apply(chi);
        let w = SIGMAS_ODOMETRY.component_mul(&normal::<3, 1>(rng));
        let measured = increment(way_m).kappa.compose(&SE2::exp(&w));
        self.steps.push(OdometryStep {
            kappa: measured,
            dt_s: DT_S,
        });
        self.truth.push(*chi);
        let seen = [
            SO2::from_angle(rotation).inverse_rotate(&chi.position),
            chi.position * (1.0 + scale),
        ];
        self.pairs
            .push(PlanarPair::new(seen.map(|position_w| PointFix {
                position_w: position_w + SIGMA_FIX_M * normal::<2, 1>(rng),
                covariance_w: Matrix2::identity() * (SIGMA_FIX_M * SIGMA_FIX_M),
                lever_arm_b: Vector2::zeros(),
                scale_error: 0.0,
            })));
    }
}

/// Covariance of the odometry's noise for each step.
pub fn odometry_noise() -> Matrix3<f64> {
    Matrix3::from_diagonal(&SIGMAS_ODOMETRY.component_mul(&SIGMAS_ODOMETRY))
}

/// Variances of a filter at its start: theta, x, y.
pub fn start_variances() -> Vector3<f64> {
    SIGMAS_START.component_mul(&SIGMAS_START)
}
