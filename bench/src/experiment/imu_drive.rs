//! A drive through space for the experiments of \[PAR\]: SE_2(3), an IMU at 100 Hz, position fixes on a lever arm at
//! 1 Hz for 30 s.
//!
//! World frame ENU, body frame FLU; a sample speaks for the 10 ms that begin with it; tangent order rotation, velocity,
//! position; left-invariant. The start is off by 0.2 rad, 1 m/s and 3 m on each axis.

use inekf::filter::{Belief, Covariance, Left, Side};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{Discretisation, ImuInput, ImuNoise, InertialState, PositionObservation};
use inekf::smoother::Preintegration;
use nalgebra::{Matrix3, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

use super::section7::normal;

/// World frame ENU, m/s^2.
pub const GRAVITY_W: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);
/// Length of an IMU sample, s.
pub const IMU_DT_S: f64 = 0.01;
/// IMU samples between two fixes, and fixes.
const SAMPLES: usize = 100;
const FIXES: usize = 30;
/// Standard deviation of a fix on each axis, m.
const SIGMA_FIX_M: f64 = 0.5;
/// Of the start: rad, m/s, m, on each axis.
const SIGMAS_START: [f64; 3] = [0.2, 1.0, 3.0];
const LEVER_ARM_B: Vector3<f64> = Vector3::new(0.4, -0.2, 1.1);
/// A MEMS IMU whose biases are known.
pub const NOISE: ImuNoise = ImuNoise {
    gyro_psd: 4e-6,
    accel_psd: 1e-4,
    gyro_bias_psd: 0.0,
    accel_bias_psd: 0.0,
};

/// A vehicle in space that turns and climbs, with an IMU and position fixes.
pub struct ImuDrive {
    /// Where an estimator begins.
    start: SE23,
    samples: Vec<ImuInput>,
    /// One fix at the end of each second.
    pub fixes: Vec<PositionObservation>,
}

impl ImuDrive {
    /// A drive of its own for each state of `rng`.
    pub fn draw(rng: &mut ChaCha8Rng) -> Self {
        let mut chi = SE23 {
            rotation: SO3::exp(&Vector3::new(0.0, 0.0, 0.7)),
            velocity: Vector3::new(6.0, 5.0, 0.0),
            position: Vector3::new(40.0, -25.0, 3.0),
        };
        let off = start_sigmas().component_mul(&normal::<9, 1>(rng));
        let start = Left::retract(&chi, &off);
        let (mut samples, mut fixes) = (Vec::new(), Vec::new());
        for k in 0..SAMPLES * FIXES {
            let t_s = k as f64 * IMU_DT_S;
            let actual = ImuInput {
                omega_b: Vector3::new(0.2 * (1.3 * t_s).sin(), 0.1 * (0.9 * t_s).cos(), 0.3),
                force_b: Vector3::new(0.5 * (0.7 * t_s).cos(), 1.5, 0.3 * (1.1 * t_s).sin())
                    - chi.rotation.inverse_rotate(&GRAVITY_W),
            };
            let zoh = Discretisation::ZeroOrderHold;
            let step = chi.imu_step(&actual, &GRAVITY_W, IMU_DT_S, zoh);
            chi = chi.advance(&step, &NOISE).0;
            let [gyro, accel] = [NOISE.gyro_psd, NOISE.accel_psd].map(|p| (p / IMU_DT_S).sqrt());
            samples.push(ImuInput {
                omega_b: actual.omega_b + gyro * normal::<3, 1>(rng),
                force_b: actual.force_b + accel * normal::<3, 1>(rng),
            });
            if (k + 1) % SAMPLES == 0 {
                let antenna_w = chi.position + chi.rotation.rotate(&LEVER_ARM_B);
                fixes.push(PositionObservation {
                    position_w: antenna_w + SIGMA_FIX_M * normal::<3, 1>(rng),
                    covariance_w: Matrix3::identity() * (SIGMA_FIX_M * SIGMA_FIX_M),
                    lever_arm_b: LEVER_ARM_B,
                });
            }
        }
        Self {
            start,
            samples,
            fixes,
        }
    }

    /// The belief that all estimators begin with.
    pub fn first(&self) -> Belief<SE23, Left, 9> {
        let variances = start_sigmas().map(|sigma| sigma * sigma);
        Belief::new(self.start, Covariance::from_variances(&variances))
    }

    /// The IMU samples before fix `k`.
    pub fn samples(&self, k: usize) -> &[ImuInput] {
        &self.samples[k * SAMPLES..(k + 1) * SAMPLES]
    }

    /// The same samples as one motion.
    pub fn motion(&self, k: usize) -> Preintegration<SE23, 9> {
        let mut motion = Preintegration::new(&self.start);
        for sample in self.samples(k) {
            let zoh = Discretisation::ZeroOrderHold;
            motion.push(sample, &GRAVITY_W, IMU_DT_S, zoh, &NOISE);
        }
        motion
    }
}

fn start_sigmas() -> SVector<f64, 9> {
    SVector::from_fn(|i, _| SIGMAS_START[i / 3])
}
