//! A car that weaves and changes speed, with fixes at 1 Hz: truth, samples, and a first belief whose heading
//! is wrong.

use inekf::filter::{Alignment, Belief, BiasPrior, InertialSide, propagate};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{Discretisation, ImuInput, ImuNoise, ImuStep, PositionObservation};
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;

use super::{GRAVITY_W, normal, seeded};

/// Densities of a good IMU, without biases.
const QUIET: ImuNoise = ImuNoise {
    gyro_psd: 1e-8,
    accel_psd: 1e-6,
    gyro_bias_psd: 0.0,
    accel_bias_psd: 0.0,
};

const DT_S: f64 = 0.01;

/// The car, where it is.
pub struct Drive {
    pub truth: SE23,
    time_s: f64,
    rng: ChaCha8Rng,
}

impl Drive {
    pub fn start(seed: u64) -> Self {
        let rotation = SO3::from_roll_pitch_heading(0.0, 0.0, 0.3);
        let truth = SE23 {
            rotation,
            velocity: rotation.rotate(&Vector3::new(10.0, 0.0, 0.0)),
            position: Vector3::zeros(),
        };
        Self {
            truth,
            time_s: 0.0,
            rng: seeded(seed),
        }
    }

    /// A belief drawn from its own covariance, but for the heading.
    pub fn belief<S: InertialSide>(
        &mut self,
        wrong_deg: f64,
        sigma_deg: f64,
        fix_sigma_m: f64,
    ) -> Belief<SE23, S, 9> {
        let (tilt_sigma, velocity_sigma) = (0.01, 0.1);
        let mut tilt_w = tilt_sigma * normal::<3, 1>(&mut self.rng);
        tilt_w.z = 0.0;
        let turned = SO3::from_roll_pitch_heading(0.0, 0.0, wrong_deg.to_radians());
        Alignment {
            r_wb: SO3::exp(&tilt_w) * turned * self.truth.rotation,
            tilt_sigma,
            heading_sigma: sigma_deg.to_radians(),
            velocity_w: self.truth.velocity + velocity_sigma * normal::<3, 1>(&mut self.rng),
            velocity_sigma,
            position_w: self.truth.position + fix_sigma_m * normal::<3, 1>(&mut self.rng),
            position_covariance_w: Matrix3::identity() * (fix_sigma_m * fix_sigma_m),
            lever_arm_b: Vector3::zeros(),
            biases: BiasPrior {
                gyro_bias: Vector3::zeros(),
                gyro_sigma: 0.0,
                accel_bias: Vector3::zeros(),
                accel_sigma: 0.0,
            },
        }
        .belief()
    }

    /// One second of samples for all `beliefs`, and the fix at its end.
    pub fn second<S: InertialSide>(
        &mut self,
        beliefs: &mut [Belief<SE23, S, 9>],
        fix_sigma_m: f64,
    ) -> PositionObservation {
        let zoh = Discretisation::ZeroOrderHold;
        let gyro_sigma = (QUIET.gyro_psd / DT_S).sqrt();
        let accel_sigma = (QUIET.accel_psd / DT_S).sqrt();
        for _ in 0..100 {
            let yaw_rate = 0.3 * (0.5 * self.time_s).sin();
            let along = 0.5 * (0.3 * self.time_s).cos();
            let input = ImuInput {
                omega_b: Vector3::new(0.0, 0.0, yaw_rate),
                force_b: Vector3::new(along, 10.0 * yaw_rate, -GRAVITY_W.z),
            };
            self.truth = ImuStep::new(&input, &GRAVITY_W, DT_S, zoh)
                .step
                .apply(&self.truth);
            let measured = ImuInput {
                omega_b: input.omega_b + gyro_sigma * normal::<3, 1>(&mut self.rng),
                force_b: input.force_b + accel_sigma * normal::<3, 1>(&mut self.rng),
            };
            for belief in beliefs.iter_mut() {
                *belief = propagate(belief, &measured, &GRAVITY_W, DT_S, zoh, &QUIET);
            }
            self.time_s += DT_S;
        }
        PositionObservation {
            position_w: self.truth.position + fix_sigma_m * normal::<3, 1>(&mut self.rng),
            covariance_w: Matrix3::identity() * (fix_sigma_m * fix_sigma_m),
            lever_arm_b: Vector3::zeros(),
        }
    }
}
