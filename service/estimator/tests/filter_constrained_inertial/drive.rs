//! A car with an IMU and position sources, and a filter on board.

use inekf::filter::{
    Belief, Constrained, Covariance, InertialSide, Linearised, Side, UpdateError, UpdateOptions,
    Verdict, propagate, update_with,
};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{
    Declared, Discretisation, ImuIncrement, ImuInput, ImuNoise, ImuStep, InertialState,
    MeanMismatch, Motion, Observation, OutputMismatch, PointFix, Points, Pose, ProcessColumns,
    SpatialFix,
};
use nalgebra::{Matrix3, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::common::{GRAVITY_W, NOISE, normal, seeded};

pub const ZOH: Discretisation = Discretisation::ZeroOrderHold;
pub const SILENT: ImuNoise = ImuNoise {
    gyro_psd: 0.0,
    accel_psd: 0.0,
    gyro_bias_psd: 0.0,
    accel_bias_psd: 0.0,
};

pub const DT_S: f64 = 0.05;
pub const STEPS_PER_FIX: usize = 4;
pub const FIX_SIGMA_M: f64 = 0.02;
pub const LEVER_ARMS_B: [Vector3<f64>; 2] =
    [Vector3::new(0.8, 0.4, 1.2), Vector3::new(-1.1, -0.5, 0.9)];

/// A car that speeds up, weaves and nods on the way, brakes and stands.
pub struct Vehicle {
    pub truth: SE23,
    steps: usize,
}

impl Vehicle {
    pub fn start() -> Self {
        Self {
            truth: SE23 {
                rotation: SO3::from_roll_pitch_heading(0.02, -0.03, 0.7),
                velocity: Vector3::zeros(),
                position: Vector3::new(40.0, -25.0, 3.0),
            },
            steps: 0,
        }
    }

    /// Moves on, and says by which rate and force.
    fn step(&mut self) -> ImuInput {
        let time_s = self.steps as f64 * DT_S;
        let phase_s = time_s % 20.0;
        // Four seconds to 6 m/s, on until the twelfth, standing from the sixteenth.
        let speed = 1.5 * phase_s.min(16.0 - phase_s).clamp(0.0, 4.0);
        let moving = if speed > 0.0 { 1.0 } else { 0.0 };
        let omega_b = moving
            * Vector3::new(
                0.05 * (1.3 * time_s).sin(),
                0.04 * (1.7 * time_s).cos(),
                0.5 * (0.6 * time_s).sin(),
            );
        let SE23 {
            rotation, velocity, ..
        } = self.truth;
        let wanted_w = rotation.rotate(&Vector3::x()) * speed;
        let force_w = (wanted_w - velocity) / DT_S - GRAVITY_W;
        let input = ImuInput {
            omega_b,
            force_b: rotation.inverse().rotate(&force_w),
        };
        self.truth = ImuStep::new(&input, &GRAVITY_W, DT_S, ZOH)
            .step
            .apply(&self.truth);
        self.steps += 1;
        input
    }
}

/// What an IMU with the densities of `NOISE` makes of `input`; `share` of its noise.
pub fn sampled(input: &ImuInput, share: f64, rng: &mut ChaCha8Rng) -> ImuInput {
    ImuInput {
        omega_b: input.omega_b + share * (NOISE.gyro_psd / DT_S).sqrt() * normal::<3, 1>(rng),
        force_b: input.force_b + share * (NOISE.accel_psd / DT_S).sqrt() * normal::<3, 1>(rng),
    }
}

pub fn start_variances<const D: usize>() -> SVector<f64, D> {
    SVector::from_fn(|i, _| match i / 3 {
        0 => 1e-4,
        1 => 1e-2,
        2 => 1.0,
        3 => 1e-6,
        _ => 1e-4,
    })
}

/// A drive with a filter on board.
pub struct Run<G, S, T, const D: usize> {
    rng: ChaCha8Rng,
    pub vehicle: Vehicle,
    pub belief: Belief<G, S, D>,
    columns: ProcessColumns<D, T>,
    /// How much of the noise of start, samples and fixes there is.
    share: f64,
}

impl<G, S, T, const D: usize> Run<G, S, T, D>
where
    G: InertialState<D> + Pose<D, 3>,
    S: InertialSide,
    T: MeanMismatch,
    ImuIncrement: Motion<D, 3, Mismatch = T, Noise = ImuNoise>,
{
    pub fn start(declared: &[T], share: f64, seed: u64) -> Self {
        let mut rng = seeded(seed);
        let vehicle = Vehicle::start();
        let sigmas = start_variances::<D>().map(f64::sqrt);
        let off = share * sigmas.component_mul(&normal(&mut rng));
        let truth = G::from_parts(vehicle.truth, Vector3::zeros(), Vector3::zeros());
        let prior = Covariance::from_variances(&start_variances());
        let declared: Vec<_> = declared.iter().copied().map(Declared::hard).collect();
        Self {
            rng,
            vehicle,
            belief: Belief::from_left_covariance(truth.compose(&G::exp(&off)), prior),
            columns: ProcessColumns::new(&declared).expect("room"),
            share,
        }
    }

    /// As many steps as there are to a fix, with sensors that make `measured` of what acts.
    pub fn drive(&mut self, measured: impl Fn(&ImuInput) -> ImuInput) {
        for _ in 0..STEPS_PER_FIX {
            let actual = self.vehicle.step();
            let measured = sampled(&measured(&actual), self.share, &mut self.rng);
            let mean = &self.belief.mean;
            let increment = mean.increment(&measured, &GRAVITY_W, DT_S, ZOH);
            self.columns.advance(&increment, &NOISE);
            self.belief = propagate(&self.belief, &measured, &GRAVITY_W, DT_S, ZOH, &NOISE);
        }
    }

    /// Fixes of points of the body, from where it is.
    pub fn fixes<const K: usize, const M: usize>(
        &mut self,
        lever_arms_b: [Vector3<f64>; K],
    ) -> Points<K, 3, M> {
        Points::new(lever_arms_b.map(|lever_arm_b| PointFix {
            position_w: self.vehicle.truth.point_w(&lever_arm_b, 1.0)
                + self.share * FIX_SIGMA_M * normal::<3, 1>(&mut self.rng),
            covariance_w: Matrix3::identity() * (FIX_SIGMA_M * FIX_SIGMA_M),
            lever_arm_b,
            scale_error: 0.0,
        }))
    }

    /// The constrained update that the filter is in for.
    pub fn rule<'a, const K: usize, const M: usize>(
        &mut self,
        outputs: &'a [Declared<OutputMismatch>],
        fixes: &'a Points<K, 3, M>,
    ) -> Constrained<'a, D, K, 3, M> {
        let h = Observation::<G, D, M>::left_jacobian(fixes, &self.belief.mean);
        self.columns.hide_unseen::<G, 3, M>(&h);
        Constrained::new(&self.belief, &self.columns, outputs, fixes)
    }

    /// Makes it.
    pub fn fuse<const K: usize, const M: usize>(
        &mut self,
        fixes: &Points<K, 3, M>,
        rule: &Constrained<D, K, 3, M>,
    ) -> Result<(), UpdateError> {
        let correction = update_with(&mut self.belief, fixes, rule, &UpdateOptions::PLAIN)?;
        assert_eq!(correction.verdict, Verdict::Accepted);
        self.columns.reset();
        Ok(())
    }
}

/// Fixes of these points of the body, somewhere.
pub fn fixes_of<const K: usize, const M: usize>(
    lever_arms_b: [Vector3<f64>; K],
) -> Points<K, 3, M> {
    Points::new(lever_arms_b.map(|lever_arm_b| PointFix {
        position_w: Vector3::new(41.0, -24.0, 2.0),
        covariance_w: Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 2.0)),
        lever_arm_b,
        scale_error: 0.0,
    }))
}

/// A fix of the body's own origin.
pub fn fix_of_origin() -> SpatialFix {
    fixes_of([Vector3::zeros()])
}

/// `observation` from where the belief is.
pub fn linearised<G, S, O, const D: usize, const M: usize>(
    belief: &Belief<G, S, D>,
    observation: &O,
) -> Linearised<G, D, M>
where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
{
    let noise = observation.noise();
    Linearised::at(belief, observation, &belief.mean, &SVector::zeros(), &noise).expect("regular")
}
