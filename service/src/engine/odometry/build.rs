//! From a configuration to the filter that it asks for.

use inekf::filter::{
    Additive, Expected, HInfinity, HInfinityGain, Left, Right, Side, UpdateError, standard_modes,
};
use inekf::lie::{SE2, SE3};
use inekf::model::{Declared, OutputMismatch, PointFix, ProcessColumns, ProcessMismatch, Unknowns};
use nalgebra::{SMatrix, SVector, Vector3};

use super::super::build::Use;
use super::super::driver::Engine;
use super::super::fix::FixKind;
use super::super::settings::{FusionSettings, InitialSettings, SourceSettings};
use super::bank::Bank;
use super::filter::PoseFilter;
use super::learning::Learning;
use super::sighting::points;
use super::single::{Gain, Single, SourceMismatches};
use super::vehicle::Vehicle;
use super::{Odometry, RowSettings};
use crate::config::{
    Axis, Config, Estimator, GapPolicy, HinfGain, Invariance, Mismatch, Mismatched, Model,
    Odometry as OdometryConfig, Wrong,
};

/// A restart is certain after a gap this many times `max_gap_s`.
const RESTART_GAPS: u64 = 20;

/// Everything that the filters of one configuration have in common.
struct Plan<'a> {
    config: &'a Config,
    rows: RowSettings,
    initial: InitialSettings,
    fusion: FusionSettings,
    process: Vec<Declared<ProcessMismatch>>,
    outputs: Vec<Declared<OutputMismatch>>,
}

/// Hands an engine of the configured odometry model to `user`.
///
/// # Errors
/// The declared mismatches cannot be constrained with the configured sources.
pub fn build<U: Use>(
    config: &Config,
    odometry: &OdometryConfig,
    initial: InitialSettings,
    fusion: FusionSettings,
    user: U,
) -> Result<U::Output, UpdateError> {
    let (process, outputs) = mismatches(&config.mismatched, config.model);
    let plan = Plan {
        config,
        rows: rows(config, odometry),
        initial,
        fusion: widened_sources(config, fusion),
        process,
        outputs,
    };
    match config.model {
        Model::Odometry3d => plan.in_space(user),
        Model::Odometry2d | Model::Imu => plan.in_plane(user),
    }
}

fn rows(config: &Config, odometry: &OdometryConfig) -> RowSettings {
    let rows = &odometry.rows;
    let max_gap_ns = rows.max_gap_ns();
    RowSettings {
        max_rotation: rows.max_rotation_rad,
        max_translation: rows.max_translation_m,
        max_gap_ns,
        restart_gap_ns: match rows.on_gap {
            GapPolicy::Inflate => max_gap_ns.saturating_mul(RESTART_GAPS),
            GapPolicy::Reinitialise => max_gap_ns,
        },
        first_period_ns: rows.first_period_ns(),
        noise: odometry.noise.scaled(noise_factor(config)),
        noise_factor: noise_factor(config),
    }
}

/// The H-infinity filter takes noise for a bound: so many standard deviations.
fn noise_factor(config: &Config) -> f64 {
    config.hinf.as_ref().map_or(1.0, |hinf| hinf.noise_factor)
}

fn widened_sources(config: &Config, mut fusion: FusionSettings) -> FusionSettings {
    for source in fusion.sources[FixKind::Position as usize]
        .iter_mut()
        .flatten()
    {
        source.sigma_scale *= noise_factor(config);
    }
    fusion
}

/// The declared mismatches: those of the odometry, and those of the sources.
fn mismatches(
    mismatched: &[Mismatched],
    model: Model,
) -> (
    Vec<Declared<ProcessMismatch>>,
    Vec<Declared<OutputMismatch>>,
) {
    let (mut process, mut outputs) = (Vec::new(), Vec::new());
    for &Mismatched { what, sigma, .. } in mismatched {
        let mut of_process = |mismatch| process.push(Declared { mismatch, sigma });
        let mut of_source = |mismatch| outputs.push(Declared { mismatch, sigma });
        match what {
            Wrong::OdometryScale => of_process(ProcessMismatch::OdometryScale),
            Wrong::OdometryTurnScale => of_process(ProcessMismatch::OdometryTurnScale),
            Wrong::OdometryRotationBias { axis } => {
                // In the plane the rotation has one axis.
                let axis = match model {
                    Model::Odometry2d => 0,
                    _ => axis as usize,
                };
                of_process(ProcessMismatch::OdometryRotationBias { axis });
            }
            Wrong::MeasurementScale { source } => {
                of_source(OutputMismatch::MeasurementScale {
                    source: source as usize,
                });
            }
            Wrong::MeasurementRotation { source, axis } => {
                of_source(OutputMismatch::MeasurementRotation {
                    source: source as usize,
                    axis_w: axis.map(unit),
                });
            }
        }
    }
    (process, outputs)
}

fn unit(axis: Axis) -> Vector3<f64> {
    match axis {
        Axis::X => Vector3::x(),
        Axis::Y => Vector3::y(),
        Axis::Z => Vector3::z(),
    }
}

impl Plan<'_> {
    fn in_plane<U: Use>(&self, user: U) -> Result<U::Output, UpdateError> {
        let few = self.parameters() <= 3;
        match (self.config.mismatch, few) {
            (Mismatch::Consider | Mismatch::Augmented, true) => {
                self.run::<SE2, _, 3, 2, 4, U>(self.learning::<3, 6, 2>()?, user)
            }
            (Mismatch::Consider | Mismatch::Augmented, false) => {
                self.run::<SE2, _, 3, 2, 4, U>(self.learning::<6, 9, 2>()?, user)
            }
            (Mismatch::Adaptive, true) => {
                self.run::<SE2, _, 3, 2, 4, U>(self.bank::<3, 6, 2>()?, user)
            }
            (Mismatch::Adaptive, false) => {
                self.run::<SE2, _, 3, 2, 4, U>(self.bank::<6, 9, 2>()?, user)
            }
            (Mismatch::None | Mismatch::Hard | Mismatch::Soft, _) => {
                self.singly::<SE2, 3, 2, 4, U>(user)
            }
        }
    }

    fn in_space<U: Use>(&self, user: U) -> Result<U::Output, UpdateError> {
        let few = self.parameters() <= 3;
        match (self.config.mismatch, few) {
            (Mismatch::Consider | Mismatch::Augmented, true) => {
                self.run::<SE3, _, 6, 3, 6, U>(self.learning::<3, 9, 3>()?, user)
            }
            (Mismatch::Consider | Mismatch::Augmented, false) => {
                self.run::<SE3, _, 6, 3, 6, U>(self.learning::<6, 12, 3>()?, user)
            }
            (Mismatch::Adaptive, true) => {
                self.run::<SE3, _, 6, 3, 6, U>(self.bank::<3, 9, 3>()?, user)
            }
            (Mismatch::Adaptive, false) => {
                self.run::<SE3, _, 6, 3, 6, U>(self.bank::<6, 12, 3>()?, user)
            }
            (Mismatch::None | Mismatch::Hard | Mismatch::Soft, _) => {
                self.singly::<SE3, 6, 3, 6, U>(user)
            }
        }
    }

    /// How many parameters the mismatches have.
    fn parameters(&self) -> usize {
        let declared = self.config.mismatched.iter();
        declared
            .map(|mismatched| mismatched.what.parameters())
            .sum()
    }

    fn run<G, F, const D: usize, const N: usize, const PAIR: usize, U: Use>(
        &self,
        filter: F,
        user: U,
    ) -> Result<U::Output, UpdateError>
    where
        G: Vehicle<D, N> + 'static,
        F: PoseFilter<G, D, N> + 'static,
    {
        let model = Odometry::<G, F, D, N, PAIR>::new(self.rows, self.initial, self.fusion, filter);
        Ok(user.with(Engine::of(model, self.fusion)))
    }

    /// One belief, on the side that is asked for.
    fn singly<G, const D: usize, const N: usize, const PAIR: usize, U: Use>(
        &self,
        user: U,
    ) -> Result<U::Output, UpdateError>
    where
        G: Vehicle<D, N> + 'static,
    {
        match self.config.invariance {
            Some(Invariance::Left) => {
                self.run::<G, _, D, N, PAIR, U>(self.single::<G, Left, D, N, PAIR>()?, user)
            }
            Some(Invariance::Right) => {
                self.run::<G, _, D, N, PAIR, U>(self.single::<G, Right, D, N, PAIR>()?, user)
            }
            None => {
                self.run::<G, _, D, N, PAIR, U>(self.single::<G, Additive, D, N, PAIR>()?, user)
            }
        }
    }

    fn single<G, S, const D: usize, const N: usize, const PAIR: usize>(
        &self,
    ) -> Result<Single<S, D>, UpdateError>
    where
        G: Vehicle<D, N> + 'static,
        S: Side,
    {
        let mut outputs = SourceMismatches::default();
        for (slot, declared) in outputs.iter_mut().zip(&self.outputs) {
            *slot = Some(*declared);
        }
        let gain = match (self.config.estimator, &self.config.hinf) {
            (Estimator::LcInekf | Estimator::LcEkf, _) => Gain::Constrained,
            (_, Some(hinf)) => Gain::HInfinity(HInfinity {
                gamma: hinf.gamma,
                gain: match hinf.gain {
                    HinfGain::Widened => HInfinityGain::Widened,
                    HinfGain::Kalman => HInfinityGain::Kalman,
                },
            }),
            _ => Gain::Kalman,
        };
        let single = Single {
            gain,
            process: ProcessColumns::new(&self.process).ok_or(UpdateError::TooManyConstraints)?,
            process_count: self.process.len(),
            outputs,
            stacked: self.fusion.stack.map(|stack| stack.sources),
            side: core::marker::PhantomData,
        };
        self.check::<G, S, D, N, PAIR>(&single)?;
        Ok(single)
    }

    /// Whether every update that the sources can make has a constrained gain.
    fn check<G, S, const D: usize, const N: usize, const PAIR: usize>(
        &self,
        single: &Single<S, D>,
    ) -> Result<(), UpdateError>
    where
        G: Vehicle<D, N> + 'static,
        S: Side,
    {
        let sources = &self.fusion.sources[FixKind::Position as usize];
        for (id, settings) in (0..).zip(sources) {
            if let Some(settings) = settings {
                let alone = points::<1, N, N>([seen(settings)]);
                single.check::<G, 1, N, N>(&self.process, &[id], &alone)?;
            }
        }
        if let Some(stack) = self.fusion.stack
            && let [Some(one), Some(other)] = stack.sources.map(|id| sources[id as usize])
        {
            let both = points::<2, N, PAIR>([seen(&one), seen(&other)]);
            single.check::<G, 2, N, PAIR>(&self.process, &stack.sources, &both)?;
        }
        Ok(())
    }

    fn learning<const P: usize, const A: usize, const N: usize>(
        &self,
    ) -> Result<Learning<P, A>, UpdateError> {
        let (unknowns, sigmas) = Unknowns::declared::<N, P>(&self.process, &self.outputs)
            .ok_or(UpdateError::TooManyConstraints)?;
        Ok(Learning {
            unknowns,
            parameters: self.parameters(),
            declared: self.config.mismatched.len(),
            sigmas,
            walks: self.by_parameter(|mismatched| mismatched.walk),
            considers: self.config.mismatch == Mismatch::Consider,
        })
    }

    fn bank<const P: usize, const A: usize, const N: usize>(
        &self,
    ) -> Result<Bank<P, A>, UpdateError> {
        let (unknowns, sigmas) = Unknowns::declared::<N, P>(&self.process, &self.outputs)
            .ok_or(UpdateError::TooManyConstraints)?;
        let bursts = self.by_parameter(|mismatched| mismatched.burst_sigma);
        let expected = Expected::of(&unknowns, &sigmas, &bursts);
        let (modes, switching) = standard_modes(&expected, WHITE_INTERVAL_S);
        Ok(Bank {
            unknowns,
            parameters: self.parameters(),
            declared: self.config.mismatched.len(),
            modes,
            switching,
            options: self.fusion.update,
        })
    }

    /// A value of each parameter, those of the odometry first; zero in the places that are left over.
    fn by_parameter<const P: usize>(&self, value: impl Fn(&Mismatched) -> f64) -> SVector<f64, P> {
        let declared = &self.config.mismatched;
        let of_odometry = declared.iter().filter(|one| one.what.source().is_none());
        let of_sources = declared.iter().filter(|one| one.what.source().is_some());
        let mut values = SVector::<f64, P>::zeros();
        let mut places = values.iter_mut();
        for one in of_odometry.chain(of_sources) {
            for place in places.by_ref().take(one.what.parameters()) {
                *place = value(one);
            }
        }
        values
    }
}

/// How long a mismatch that is drawn anew keeps its value along the way, s: the step of \[LC\] VII.
const WHITE_INTERVAL_S: f64 = 0.1;

/// A fix of a source, anywhere.
fn seen<const N: usize>(settings: &SourceSettings) -> PointFix<N> {
    PointFix {
        position_w: SVector::zeros(),
        covariance_w: SMatrix::identity(),
        lever_arm_b: SVector::from_fn(|i, _| settings.lever_arm_b[i]),
        scale_error: settings.scale_error,
    }
}
