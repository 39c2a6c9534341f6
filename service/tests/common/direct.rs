//! The filter without the engine: the oracle of what the engine does with the library.

use inekf::filter::{Belief, Covariance, Gate, Left, Transport, UpdateOptions, propagate, update};
use inekf::lie::{SE23, SO3};
use inekf::model::{
    Discretisation, HeadingObservation, ImuInput, ImuNoise, InertialState, NavState, Observation,
    PositionObservation, VelocityObservation,
};
use inekf_shared::message::{HeadingFix, ImuSample, PositionFix, StateVector, VelocityFix};
use nalgebra::{Matrix3, Vector3};

use super::{GRAVITY, LEVER_ARM_B};

/// The filter without the engine: one call of the library per step, in the order a test gives.
pub struct Direct {
    /// The belief so far.
    pub belief: Belief<NavState, Left, 15>,
}

impl Direct {
    /// Starts from `state`, of 15 dimensions.
    pub fn new(state: &StateVector) -> Self {
        let pose = SE23 {
            rotation: SO3::from_quaternion_xyzw(state.q_wb).unwrap(),
            velocity: state.v_w_mps.into(),
            position: state.p_w_m.into(),
        };
        let mean = NavState {
            pose,
            gyro_bias: state.gyro_bias_rps.into(),
            accel_bias: state.accel_bias_mps2.into(),
        };
        let covariance = Covariance::from_upper_triangle(&state.covariance).unwrap();
        Self {
            belief: Belief::new(mean, covariance),
        }
    }

    /// The noise of the configuration above.
    pub fn noise() -> ImuNoise {
        ImuNoise {
            gyro_psd: 3e-4 * 3e-4,
            accel_psd: 2e-2 * 2e-2,
            gyro_bias_psd: 1e-5 * 1e-5,
            accel_bias_psd: 1e-4 * 1e-4,
        }
    }

    /// Propagates for `dt_ns` with this input and the configured noise.
    pub fn propagate(&mut self, input: &ImuInput, dt_ns: u64) {
        self.propagate_with(input, dt_ns, &Self::noise());
    }

    /// Propagates for `dt_ns` with this input and noise.
    pub fn propagate_with(&mut self, input: &ImuInput, dt_ns: u64, noise: &ImuNoise) {
        self.belief = propagate(
            &self.belief,
            input,
            &Vector3::new(0.0, 0.0, -GRAVITY),
            dt_ns as f64 * 1e-9,
            Discretisation::ZeroOrderHold,
            noise,
        );
    }

    /// Fuses a position of source 0 or 1.
    pub fn position(&mut self, fix: &PositionFix) {
        let lever_arm_b = if fix.source == 1 {
            LEVER_ARM_B.into()
        } else {
            Vector3::zeros()
        };
        self.fuse(&PositionObservation {
            position_w: fix.position_w_m.into(),
            covariance_w: Matrix3::from_row_slice(&fix.covariance_w_m2),
            lever_arm_b,
        });
    }

    /// Fuses a velocity.
    pub fn velocity(&mut self, fix: &VelocityFix) {
        self.fuse(&VelocityObservation {
            velocity_w: fix.velocity_w_mps.into(),
            covariance_w: Matrix3::from_row_slice(&fix.covariance_w),
        });
    }

    /// Fuses a heading.
    pub fn heading(&mut self, fix: &HeadingFix) {
        self.fuse(&HeadingObservation {
            heading: fix.heading_rad,
            sigma: fix.sigma_rad,
        });
    }

    fn fuse<O: Observation<NavState, 15, M>, const M: usize>(&mut self, observation: &O) {
        let options = UpdateOptions {
            iterations: 10,
            tolerance: 1e-6,
            transport: Transport::Jacobian,
            gate: Gate::OPEN,
        };
        let correction = update(&mut self.belief, observation, &options).unwrap();
        assert!(correction.xi.norm() > 0.0, "the fix must say something");
    }

    /// Every bit of the belief, as [`belief_bits`] has it.
    pub fn bits(&self) -> Vec<u64> {
        let mean = &self.belief.mean;
        let pose = mean.pose();
        pose.rotation
            .quaternion_xyzw()
            .iter()
            .chain(pose.velocity.iter())
            .chain(pose.position.iter())
            .chain(mean.gyro_bias.iter())
            .chain(mean.accel_bias.iter())
            .copied()
            .chain(self.belief.covariance.upper_triangle())
            .map(f64::to_bits)
            .collect()
    }
}

/// What a sample says, as the library has it.
pub fn input_of(sample: &ImuSample) -> ImuInput {
    ImuInput {
        omega_b: sample.gyro_rps.into(),
        force_b: sample.accel_mps2.into(),
    }
}
