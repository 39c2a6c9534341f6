//! The model `imu`: an IMU moves SE_2(3), with biases or without; position, velocity and heading correct it.

use inekf::filter::{
    Alignment, Belief, InertialSide, LateCorrection, Levelled, UpdateError, Verdict,
    propagate_in_place,
};
use inekf::lie::{LieGroup, SO3};
use inekf::model::{Discretisation, ImuInput, ImuNoise, InertialState, VelocityObservation};
use inekf::smoother::Preintegration;
use inekf_shared::message::{
    EstimateSe23, HeadingFix, INPUT_IMU, ImuSample, MODEL_IMU, PositionFix, ProcessNoise,
    StateVector, VelocityFix, ZERO_VELOCITY_SOURCE, Zero,
};
use nalgebra::{Matrix3, Vector3};

use super::driver::Engine;
use super::fix::Fix;
use super::levelling::Levelling;
use super::model::{Fused, Preceding, Workings};
use super::processor::{Processor, Work};
use super::recovery::Widening;
use super::resume::Doubt;
use super::settings::{
    FusionSettings, ImuSettings, InitialSettings, LevelSource, Settings, seconds,
};
use super::tally::Refusal;
use crate::config::{Hold, InertialNoise};

pub(super) mod aiding;
mod intake;
mod request;
pub(super) mod standstill;

use aiding::Aiding;
use standstill::{Standstill, StandstillSettings};

/// An inertial filter of side S on the state G (9 or 15 dimensions).
///
/// ```
#[doc = include_str!("../example.txt")]
/// use inekf_service::engine::{Engine, Inertial};
///
/// // What its engine is made of.
/// let engine: Engine<Inertial<NavState, Left, 15>> = engine;
/// assert_eq!(engine.state().1, WAITING_FOR_IMU);
/// ```
#[derive(Debug)]
pub struct Inertial<G, S, const D: usize> {
    imu: ImuSettings,
    initial: InitialSettings,
    fusion: FusionSettings,
    processor: Processor,
    levelling: Levelling,
    standstill: Option<Standstill>,
    filter: core::marker::PhantomData<(G, S)>,
}

/// An engine of the model `imu`.
pub type InertialEngine<G, S, const D: usize> = Engine<Inertial<G, S, D>>;

impl<G: InertialState<D>, S: InertialSide, const D: usize> InertialEngine<G, S, D> {
    /// An engine that waits for its first samples, with all the memory it will ever use.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// let engine = InertialEngine::<NavState, Left, 15>::new(settings("inekf"));
    /// assert!(engine.snapshot().is_none());
    /// ```
    pub fn new(settings: Settings) -> Self {
        Self::of(Inertial::new(&settings), settings.fusion)
    }
}

/// What moves the state between two samples.
#[derive(Clone, Copy, Debug)]
pub struct ImuMotion {
    held: ImuInput,
    noise: ImuNoise,
}

impl<G: InertialState<D>, S: InertialSide, const D: usize> Inertial<G, S, D> {
    /// The model that `settings` describe.
    pub(super) fn new(settings: &Settings) -> Self {
        let window_ns = match settings.initial.level {
            LevelSource::Accelerometer { window_ns } => window_ns,
            LevelSource::Given { .. } => 0,
        };
        Self {
            imu: settings.imu,
            initial: settings.initial,
            fusion: settings.fusion,
            processor: Processor::detect(),
            levelling: Levelling::new(window_ns),
            standstill: settings.imu.standstill.map(Standstill::new),
            filter: core::marker::PhantomData,
        }
    }

    /// Adds the next `part_ns` nanoseconds of a motion to those of `whole`.
    pub(super) fn integrate(
        &self,
        whole: &mut Preintegration<G, D>,
        motion: &ImuMotion,
        part_ns: u64,
    ) {
        whole.push(
            &motion.held,
            &self.imu.g_w,
            seconds(part_ns),
            self.imu.discretisation,
            &motion.noise,
        );
    }

    /// The input that speaks for an interval. Over a gap neither end does: their mean is the best
    /// guess, and [`ImuSettings::noise`] doubts it.
    fn held(&self, before: Option<&ImuInput>, after: &ImuInput, interval_ns: u64) -> ImuInput {
        let Some(before) = before else { return *after };
        if interval_ns > self.imu.max_gap_ns {
            return before.midpoint(after);
        }
        match self.imu.hold {
            Hold::Backward => *after,
            Hold::Forward => *before,
            Hold::Midpoint => before.midpoint(after),
        }
    }
}

impl<G: InertialState<D>, S: InertialSide, const D: usize> Workings for Inertial<G, S, D> {
    type Sample = ImuSample;
    type Estimate = EstimateSe23;
    type Input = ImuInput;
    type Motion = ImuMotion;
    type Measurement = Aiding;
    type State = Belief<G, S, D>;
    const INPUT: usize = INPUT_IMU;

    fn initial(&self) -> &InitialSettings {
        &self.initial
    }

    fn restart_gap_ns(&self) -> u64 {
        self.imu.restart_gap_ns
    }

    fn max_gap_ns(&self) -> u64 {
        self.imu.max_gap_ns
    }

    fn sample(
        &self,
        message: &ImuSample,
        _before: &Preceding<ImuInput>,
    ) -> Result<ImuInput, Refusal> {
        intake::imu(message, &self.imu)
    }

    fn position(&self, message: &PositionFix) -> Result<Fix<Aiding>, Refusal> {
        intake::position(message, &self.fusion.sources)
    }

    fn velocity(&self, message: &VelocityFix) -> Result<Fix<Aiding>, Refusal> {
        intake::velocity(message, &self.fusion.sources)
    }

    fn heading(&self, message: &HeadingFix) -> Result<Fix<Aiding>, Refusal> {
        intake::heading(message, &self.fusion.sources)
    }

    fn propose(&mut self, stamp_ns: u64, input: &ImuInput) -> Option<Fix<Aiding>> {
        let stands = self.standstill.as_mut()?.push(stamp_ns, input);
        let StandstillSettings {
            sigma, block_ns, ..
        } = self.imu.standstill?;
        stands.then(|| Fix {
            stamp_ns,
            source: ZERO_VELOCITY_SOURCE,
            partner: None,
            // Counts them, so that the covariance is mended as often as with any other fix.
            seq: stamp_ns / block_ns.max(1),
            measurement: Aiding::Standstill(VelocityObservation {
                velocity_w: Vector3::zeros(),
                covariance_w: Matrix3::identity() * (sigma * sigma),
            }),
        })
    }

    fn attitude(&mut self, stamp_ns: u64, input: &ImuInput) -> Option<SO3> {
        match self.initial.level {
            LevelSource::Given { roll, pitch } => Some(SO3::from_roll_pitch_heading(
                roll,
                pitch,
                self.initial.heading,
            )),
            LevelSource::Accelerometer { .. } => {
                self.levelling.push(stamp_ns, input);
                if !self.levelling.is_full() {
                    return None;
                }
                let force_b = self.levelling.mean_force()?;
                Some(Levelled::from_force(&force_b, self.initial.heading)?.r_wb)
            }
        }
    }

    fn forget_attitude(&mut self) {
        self.levelling.clear();
    }

    fn start_ns(&self, given_ns: Option<u64>, stamp_ns: u64, _input: &ImuInput) -> u64 {
        given_ns.unwrap_or(stamp_ns)
    }

    fn aligned(&self, alignment: &Alignment) -> Belief<G, S, D> {
        alignment.belief()
    }

    fn requested(&self, state: &StateVector) -> Result<Belief<G, S, D>, &'static str> {
        request::belief_of(state, &self.initial)
    }

    fn motion(&self, before: Option<&ImuInput>, after: &ImuInput, interval_ns: u64) -> ImuMotion {
        ImuMotion {
            held: self.held(before, after, interval_ns),
            noise: self.imu.noise(interval_ns),
        }
    }

    fn advance(&self, belief: &mut Belief<G, S, D>, motion: &ImuMotion, part_ns: u64) {
        self.processor.run(Advance {
            belief,
            motion,
            imu: &self.imu,
            part_ns,
        });
    }

    /// One step of propagation, whatever the discretisation of the samples: the rates are constant over it.
    fn endure(&self, belief: &mut Belief<G, S, D>, silence_ns: u64, doubt: &Doubt) {
        if silence_ns == 0 {
            return;
        }
        let mean = &belief.mean;
        let weight_b = mean.pose().rotation.inverse_rotate(&self.imu.g_w);
        let coasting = ImuInput {
            omega_b: mean.gyro_bias(),
            force_b: mean.accel_bias() - weight_b,
        };
        propagate_in_place(
            belief,
            &coasting,
            &self.imu.g_w,
            seconds(silence_ns),
            Discretisation::ZeroOrderHold,
            &self.imu.noise_of_silence(silence_ns, doubt),
        );
    }

    fn reload_noise(&mut self, noise: &ProcessNoise) -> Result<(), &'static str> {
        let noise = InertialNoise::from_numbers(noise)?;
        self.imu.white = noise.white;
        self.imu.gyro_bias_walk = noise.gyro_bias_walk;
        self.imu.accel_bias_walk = noise.accel_bias_walk;
        Ok(())
    }

    fn is_sound(&self, belief: &Belief<G, S, D>) -> bool {
        let mean = &belief.mean;
        let pose = mean.pose();
        // Asked of every sample: without a branch for each number. NaN is not within anything.
        let variances = belief.covariance.matrix().diagonal();
        pose.rotation.is_finite()
            & is_within(&pose.position, MAX_POSITION_M)
            & is_within(&pose.velocity, MAX_VELOCITY_MPS)
            & is_within(&mean.gyro_bias(), self.imu.max_gyro)
            & is_within(&mean.accel_bias(), self.imu.max_accel)
            & variances.iter().fold(true, |sound, variance| {
                sound & (0.0..=f64::MAX).contains(variance)
            })
    }

    fn fuse(
        &self,
        belief: &mut Belief<G, S, D>,
        fix: &Fix<Aiding>,
        gated: bool,
    ) -> Result<Fused, UpdateError> {
        if let (Aiding::Standstill(_), Some(settings)) = (&fix.measurement, &self.imu.standstill)
            && !Standstill::is_believable(settings, belief)
        {
            return Ok(Fused {
                verdict: Verdict::Gated,
                nis: f64::NAN,
            });
        }
        let options = self.fusion.options(gated);
        let fused = fix.measurement.fuse(belief, &options)?;
        if fused.verdict == Verdict::Accepted && fix.is_mended() {
            belief.covariance = belief.covariance.made_definite();
        }
        Ok(fused)
    }

    fn widening(&self, belief: &Belief<G, S, D>, fix: &Fix<Aiding>, nis: f64) -> Widening {
        fix.measurement.widening(&belief.mean, nis)
    }

    fn fuse_widened(
        &self,
        belief: &mut Belief<G, S, D>,
        fix: &Fix<Aiding>,
        widening: &Widening,
    ) -> Result<Fused, UpdateError> {
        let mut wide = fix.measurement.widened(belief, widening);
        let fused = self.fuse(&mut wide, fix, false)?;
        *belief = wide;
        Ok(fused)
    }

    /// Where the samples are held constant over their intervals: Euler's gravity depends on how long each of them was.
    fn carries(&self) -> bool {
        G::IS_GROUP_AFFINE && self.imu.discretisation == Discretisation::ZeroOrderHold
    }

    fn carry(
        &self,
        before: &Belief<G, S, D>,
        after: &Belief<G, S, D>,
        elapsed_ns: u64,
        now: &Belief<G, S, D>,
    ) -> (Belief<G, S, D>, f64) {
        match G::free_fall(&self.imu.g_w, seconds(elapsed_ns)) {
            Some(drift) => LateCorrection::between(before, after).carried_with_share(&drift, now),
            None => (*now, 0.0),
        }
    }

    fn place_w(&self, belief: &Belief<G, S, D>) -> Vector3<f64> {
        belief.mean.pose().position
    }

    fn write(&self, belief: &Belief<G, S, D>, message: &mut EstimateSe23) {
        let pose = belief.mean.pose();
        message.head.dimension = D as u32;
        message.q_wb = pose.rotation.quaternion_xyzw();
        message.v_w_mps = pose.velocity.into();
        message.p_w_m = pose.position.into();
        message.gyro_bias_rps = belief.mean.gyro_bias().into();
        message.accel_bias_mps2 = belief.mean.accel_bias().into();
        belief.with_left_covariance(|p| p.write_upper_triangle(&mut message.covariance));
    }

    fn snapshot(&self, stamp_ns: u64, belief: &Belief<G, S, D>) -> StateVector {
        let pose = belief.mean.pose();
        let mut state = StateVector {
            model: MODEL_IMU,
            dimension: D as u32,
            stamp_ns,
            q_wb: pose.rotation.quaternion_xyzw(),
            v_w_mps: pose.velocity.into(),
            p_w_m: pose.position.into(),
            gyro_bias_rps: belief.mean.gyro_bias().into(),
            accel_bias_mps2: belief.mean.accel_bias().into(),
            ..StateVector::ZERO
        };
        belief.with_left_covariance(|p| p.write_upper_triangle(&mut state.covariance));
        state
    }
}

/// The step that every sample takes.
struct Advance<'a, G, S, const D: usize> {
    belief: &'a mut Belief<G, S, D>,
    motion: &'a ImuMotion,
    imu: &'a ImuSettings,
    part_ns: u64,
}

impl<G: InertialState<D>, S: InertialSide, const D: usize> Work for Advance<'_, G, S, D> {
    #[inline(always)]
    fn run(self) {
        propagate_in_place(
            self.belief,
            &self.motion.held,
            &self.imu.g_w,
            seconds(self.part_ns),
            self.imu.discretisation,
            &self.motion.noise,
        );
    }
}

/// Whether no component is larger than `limit`.
fn is_within(vector: &Vector3<f64>, limit: f64) -> bool {
    vector.iter().fold(true, |within, component| {
        within & (component.abs() <= limit)
    })
}

/// Beyond this, m, an estimate is not of this world: the filter has diverged.
const MAX_POSITION_M: f64 = 1e10;
/// Likewise, m/s.
const MAX_VELOCITY_MPS: f64 = 1e6;
