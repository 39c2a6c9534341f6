//! A lively drive of one-second motions with a fix at the end of each, on SE_2(3) without or with biases.

use inekf::filter::{Belief, Left, Side};
use inekf::model::{Discretisation, ImuNoise, InertialState, PositionObservation};
use inekf::smoother::Preintegration;
use nalgebra::{Cholesky, Matrix3, SMatrix, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::common::{GRAVITY_W, NOISE, any_belief, any_input, any_state, normal, seeded};

pub const LEVER_ARM_B: Vector3<f64> = Vector3::new(0.5, -0.2, 1.5);
pub const ISOTROPIC: Matrix3<f64> = Matrix3::new(0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.25);
pub const ANISOTROPIC: Matrix3<f64> = Matrix3::new(0.25, 0.05, 0.0, 0.05, 0.16, 0.0, 0.0, 0.0, 1.0);

pub struct Drive<G, const D: usize> {
    pub first: Belief<G, Left, D>,
    pub seconds: Vec<(Preintegration<G, D>, PositionObservation)>,
}

/// Where the body would be without noise, one second on, by samples whose biases are removed exactly.
pub fn second<G: InertialState<D>, const D: usize>(
    reference: &G,
    noise: &ImuNoise,
    rng: &mut ChaCha8Rng,
) -> Preintegration<G, D> {
    let mut motion = Preintegration::new(reference);
    let mean = any_input(rng);
    for _ in 0..20 {
        let mut input = any_input(rng);
        input.omega_b = 0.3 * mean.omega_b + 0.1 * input.omega_b;
        input.force_b = 0.2 * mean.force_b + 0.1 * input.force_b - GRAVITY_W;
        let zoh = Discretisation::ZeroOrderHold;
        motion.push(&input, &GRAVITY_W, 0.05, zoh, noise);
    }
    motion
}

impl<G: InertialState<D>, const D: usize> Drive<G, D> {
    /// The truth starts `attitude` rad or so away from the first belief, and is moved by noise.
    pub fn new(seconds: usize, attitude: f64, covariance_w: Matrix3<f64>, seed: u64) -> Self {
        let mut rng = seeded(seed);
        let state = any_state(&mut rng);
        let mean = G::from_parts(state.pose, state.gyro_bias, state.accel_bias);
        let first: Belief<G, Left, D> = any_belief(mean, attitude, &mut rng);
        let disturbed = |chi: &G, covariance: &SMatrix<f64, D, D>, rng: &mut ChaCha8Rng| {
            let root = Cholesky::new(*covariance).expect("a covariance of full rank");
            Left::retract(chi, &(root.l() * normal::<D, 1>(rng)))
        };
        let mut truth = disturbed(&mean, first.covariance.matrix(), &mut rng);
        let seconds = (0..seconds)
            .map(|_| {
                let motion = second(&mean, &NOISE, &mut rng);
                let (next, _) = motion.transition(&truth);
                truth = disturbed(&next, motion.noise().matrix(), &mut rng);
                let pose = truth.pose();
                let seen_w = pose.position + pose.rotation.rotate(&LEVER_ARM_B);
                let fix = PositionObservation {
                    position_w: seen_w + 0.5 * normal::<3, 1>(&mut rng),
                    covariance_w,
                    lever_arm_b: LEVER_ARM_B,
                };
                (motion, fix)
            })
            .collect();
        Self { first, seconds }
    }
}
