//! Every estimator, side and model against the library called directly, over a random drive with fixes at rows and
//! between them.

use inekf::filter::{
    Adaptive, Additive, Belief, Consider, Constrained, Covariance, Expected, HInfinity,
    HInfinityGain, Left, Right, STANDARD_MODES, Side, UpdateOptions, propagate_augmented,
    propagate_odometry, standard_modes, update, update_with,
};
use inekf::lie::{SE2, SE3, SO2, SO3};
use inekf::model::{
    Augmented, Declared, OdometryStep, OutputMismatch, PointFix, Points, ProcessColumns,
    ProcessMismatch, RigidPose, Unknowns,
};
use inekf_shared::message::StateVector;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::harness::{
    CHOICES, Input, PERIOD, PLANAR_HEADING, SIGMAS, START, fix, planar_state, plane, run, space,
    spatial_state,
};

/// What happens along a drive, as the library has it.
pub enum Op<G, const D: usize, const N: usize> {
    Step(OdometryStep<G>, SMatrix<f64, D, D>),
    Pair([PointFix<N>; 2]),
}

/// A filter of the library.
pub trait Oracle<G, const D: usize, const N: usize, const PAIR: usize> {
    fn step(&mut self, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>);
    fn pair(&mut self, points: &Points<2, N, PAIR>);
    /// The pose with its left-invariant covariance.
    fn pose(&self) -> (G, Covariance<D>);
}

/// The gains of a single belief.
pub enum Gain {
    Kalman,
    Hinf(HInfinity),
    Constrained,
}

/// One belief.
pub struct Single<G, S, const D: usize> {
    pub belief: Belief<G, S, D>,
    pub gain: Gain,
    pub way: ProcessColumns<D>,
    pub outputs: Vec<Declared<OutputMismatch>>,
}

impl<G, S, const D: usize, const N: usize, const PAIR: usize> Oracle<G, D, N, PAIR>
    for Single<G, S, D>
where
    G: RigidPose<D, N>,
    S: Side,
{
    fn step(&mut self, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>) {
        self.belief = propagate_odometry(&self.belief, step, q);
        self.way.advance(step, q);
    }

    fn pair(&mut self, points: &Points<2, N, PAIR>) {
        let options = UpdateOptions::ITERATED;
        match self.gain {
            Gain::Kalman => update(&mut self.belief, points, &options),
            Gain::Hinf(rule) => update_with(&mut self.belief, points, &rule, &options),
            Gain::Constrained => {
                let rule = Constrained::new(&self.belief, &self.way, &self.outputs, points);
                self.way.reset();
                update_with(&mut self.belief, points, &rule, &options)
            }
        }
        .unwrap();
    }

    fn pose(&self) -> (G, Covariance<D>) {
        (self.belief.mean, self.belief.left_covariance())
    }
}

/// Parameters beside the pose.
struct Learning<G, const D: usize, const A: usize> {
    belief: Belief<Augmented<G, D, 3, A>, Left, A>,
    unknowns: Unknowns,
    considers: bool,
}

fn corner<G: Copy, const D: usize, const A: usize>(
    belief: &Belief<Augmented<G, D, 3, A>, Left, A>,
) -> (G, Covariance<D>) {
    let p = belief.covariance.matrix();
    let own = SMatrix::from_fn(|i, j| p[(i, j)]);
    (belief.mean.pose, Covariance::from_upper(own))
}

impl<G, const D: usize, const A: usize, const N: usize, const PAIR: usize> Oracle<G, D, N, PAIR>
    for Learning<G, D, A>
where
    G: RigidPose<D, N>,
{
    fn step(&mut self, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>) {
        let noise = SMatrix::from_fn(|i, j| if i < D && j < D { q[(i, j)] } else { 0.0 });
        self.belief = propagate_augmented(&self.belief, &self.unknowns, step, &noise);
    }

    fn pair(&mut self, points: &Points<2, N, PAIR>) {
        let seen = self.unknowns.observe_by([0, 1], *points);
        let options = UpdateOptions::ITERATED;
        if self.considers {
            update_with(&mut self.belief, &seen, &Consider { first: D }, &options)
        } else {
            update(&mut self.belief, &seen, &options)
        }
        .unwrap();
    }

    fn pose(&self) -> (G, Covariance<D>) {
        corner(&self.belief)
    }
}

/// The bank.
struct Bank<G, const D: usize, const A: usize> {
    bank: Adaptive<G, D, 3, A, STANDARD_MODES>,
    unknowns: Unknowns,
}

impl<G, const D: usize, const A: usize, const N: usize, const PAIR: usize> Oracle<G, D, N, PAIR>
    for Bank<G, D, A>
where
    G: RigidPose<D, N>,
{
    fn step(&mut self, step: &OdometryStep<G>, q: &SMatrix<f64, D, D>) {
        self.bank.advance(&self.unknowns, step, q);
    }

    fn pair(&mut self, points: &Points<2, N, PAIR>) {
        let seen = self.unknowns.observe_by([0, 1], *points);
        self.bank.update(&seen).unwrap();
    }

    fn pose(&self) -> (G, Covariance<D>) {
        corner(&self.bank.estimate())
    }
}

/// The mismatches that the configurations declare.
pub fn process(sigma: f64) -> [Declared<ProcessMismatch>; 1] {
    [Declared {
        mismatch: ProcessMismatch::OdometryScale,
        sigma,
    }]
}

/// The same of the sources.
pub fn outputs(sigmas: [f64; 2]) -> Vec<Declared<OutputMismatch>> {
    vec![
        Declared {
            mismatch: OutputMismatch::MeasurementRotation {
                source: 0,
                axis_w: Some(Vector3::z()),
            },
            sigma: sigmas[0],
        },
        Declared {
            mismatch: OutputMismatch::MeasurementScale { source: 1 },
            sigma: sigmas[1],
        },
    ]
}

/// The filter of the library that a configuration asks for.
fn oracle<G, const D: usize, const N: usize, const PAIR: usize, const A: usize>(
    name: &str,
    prior: Belief<G, Left, D>,
) -> Box<dyn Oracle<G, D, N, PAIR>>
where
    G: RigidPose<D, N> + 'static,
{
    fn single<G, S, const D: usize, const N: usize, const PAIR: usize>(
        prior: Belief<G, Left, D>,
        gain: Gain,
        sigmas: [f64; 3],
    ) -> Box<dyn Oracle<G, D, N, PAIR>>
    where
        G: RigidPose<D, N> + 'static,
        S: Side + 'static,
    {
        Box::new(Single::<G, S, D> {
            belief: Belief::from_left_covariance(prior.mean, prior.covariance),
            gain,
            way: ProcessColumns::new(&process(sigmas[0])).unwrap(),
            outputs: outputs([sigmas[1], sigmas[2]]),
        })
    }
    let hard = [f64::INFINITY; 3];
    let (unknowns, sigmas) =
        Unknowns::declared::<N, 3>(&process(SIGMAS[0]), &outputs([SIGMAS[1], SIGMAS[2]])).unwrap();
    match name {
        "left" => single::<G, Left, D, N, PAIR>(prior, Gain::Kalman, hard),
        "right" => single::<G, Right, D, N, PAIR>(prior, Gain::Kalman, hard),
        "additive" => single::<G, Additive, D, N, PAIR>(prior, Gain::Kalman, hard),
        "hard left" => single::<G, Left, D, N, PAIR>(prior, Gain::Constrained, hard),
        "hard right" => single::<G, Right, D, N, PAIR>(prior, Gain::Constrained, hard),
        "hard additive" => single::<G, Additive, D, N, PAIR>(prior, Gain::Constrained, hard),
        "soft left" => single::<G, Left, D, N, PAIR>(prior, Gain::Constrained, SIGMAS),
        "soft additive" => single::<G, Additive, D, N, PAIR>(prior, Gain::Constrained, SIGMAS),
        "hinf" => {
            let rule = HInfinity {
                gamma: 0.02,
                gain: HInfinityGain::Widened,
            };
            single::<G, Left, D, N, PAIR>(prior, Gain::Hinf(rule), hard)
        }
        "consider" | "augmented" => {
            let p = SMatrix::<f64, A, A>::from_fn(|i, j| match (i, j) {
                _ if i < D && j < D => prior.covariance.matrix()[(i, j)],
                _ if i == j => sigmas[i - D].powi(2),
                _ => 0.0,
            });
            Box::new(Learning {
                belief: Belief::new(
                    Augmented::new(prior.mean, SVector::zeros()),
                    Covariance::from_upper(p),
                ),
                unknowns,
                considers: name == "consider",
            })
        }
        "adaptive" => {
            let bursts = SVector::from([BURST * SIGMAS[0], SIGMAS[1], SIGMAS[2]]);
            let expected = Expected::of(&unknowns, &sigmas, &bursts);
            let (modes, switching) = standard_modes(&expected, 0.1);
            Box::new(Bank::<G, D, A> {
                bank: Adaptive::new(&prior, modes, switching, UpdateOptions::ITERATED),
                unknowns,
            })
        }
        other => panic!("no oracle for {other}"),
    }
}

/// Burst of the odometry's scale in its sigmas, as the configuration's documentation has it.
const BURST: f64 = 3.0;

/// The drive: inputs for the engine and what the library does with them.
fn drive<G, const D: usize, const N: usize>(
    state: &StateVector,
    start: G,
    row: impl Fn(u64, u64, SVector<f64, D>) -> Input,
) -> (Vec<Input>, Vec<Op<G, D, N>>)
where
    G: RigidPose<D, N>,
{
    let mut random = ChaCha8Rng::seed_from_u64(20);
    let mut spread = |size: f64| size * (2.0 * random.random::<f64>() - 1.0);
    let (mut inputs, mut ops) = (vec![Input::Set(*state)], Vec::new());
    let mut truth = start;
    let noise = |dt_s: f64| {
        SMatrix::from_diagonal(&SVector::from_fn(|i, _| {
            let density: f64 = if i < G::ROTATION_DIM { 0.01 } else { 0.02 };
            density * density * dt_s
        }))
    };
    for k in 1..=60_u64 {
        let increment = SVector::<f64, D>::from_fn(|i, _| {
            if i == G::POSITION {
                0.5
            } else {
                spread(0.05) + if i + 1 == G::ROTATION_DIM { 0.06 } else { 0.0 }
            }
        });
        let whole = OdometryStep::<G>::new(&increment, 0.1);
        let stamp = START + k * PERIOD;
        // Between two rows, at a quarter of the row, or at its end.
        let share = match k % 5 {
            2 => Some(0.25),
            4 => Some(1.0),
            _ => None,
        };
        let part = |share: f64| OdometryStep {
            kappa: G::exp(&(whole.kappa.log() * share)),
            dt_s: 0.1 * share,
        };
        if let Some(share) = share {
            truth = part(share).apply(&truth);
            let at = stamp - ((1.0 - share) * PERIOD as f64) as u64;
            let fixes = [0_u32, 1].map(|source| {
                let seen = truth.position_w().map(|x| x + spread(0.4));
                inputs.push(fix(at, k, source, seen.as_slice()));
                PointFix::<N> {
                    position_w: seen,
                    covariance_w: SMatrix::from_diagonal(&SVector::from_fn(|i, _| {
                        if i == 0 { 0.04 } else { 0.09 }
                    })),
                    lever_arm_b: SVector::zeros(),
                    scale_error: 0.0,
                }
            });
            if share < 1.0 {
                ops.push(Op::Step(part(share), noise(0.1 * share)));
                ops.push(Op::Pair(fixes));
                ops.push(Op::Step(part(1.0 - share), noise(0.1 * (1.0 - share))));
                truth = part(1.0 - share).apply(&truth);
            } else {
                ops.push(Op::Step(whole, noise(0.1)));
                ops.push(Op::Pair(fixes));
            }
        } else {
            truth = whole.apply(&truth);
            ops.push(Op::Step(whole, noise(0.1)));
        }
        inputs.push(row(stamp, k, increment));
    }
    (inputs, ops)
}

/// Runs the drive through the engine and through the library, and compares the last estimates.
fn compare<G, const D: usize, const N: usize, const PAIR: usize, const A: usize>(
    state: StateVector,
    mean: G,
    row: impl Fn(u64, u64, SVector<f64, D>) -> Input,
    numbers: impl Fn(&G) -> Vec<f64>,
) where
    G: RigidPose<D, N> + 'static,
{
    let (inputs, ops) = drive::<G, D, N>(&state, mean, row);
    let triangle = &state.covariance[..D * (D + 1) / 2];
    let prior = Belief::new(mean, Covariance::from_upper_triangle(triangle).unwrap());
    for choice in CHOICES {
        let ours = run(&choice.text(N, ""), &inputs);
        assert_eq!(
            ours.counters.accepted, 48,
            "{} {:?}",
            choice.name, ours.counters
        );
        assert_eq!(ours.counters.unpaired + ours.counters.rejected, 0);
        let mut filter = oracle::<G, D, N, PAIR, A>(choice.name, prior);
        for op in &ops {
            match op {
                Op::Step(step, q) => filter.step(step, q),
                Op::Pair(fixes) => filter.pair(&Points::new(*fixes)),
            }
        }
        let (mean, covariance) = filter.pose();
        let last = ours.last();
        for (a, b) in last.mean.iter().zip(numbers(&mean)) {
            assert!((a - b).abs() < 1e-9, "{}: {last:?} {mean:?}", choice.name);
        }
        let scale = covariance.matrix().amax();
        for (a, b) in last.covariance.iter().zip(covariance.upper_triangle()) {
            assert!((a - b).abs() < 1e-9 * scale, "{}: {a} {b}", choice.name);
        }
    }
}

#[test]
fn every_filter_in_the_plane_is_the_library_called_directly() {
    let state = planar_state(START, [0.02, 1.0, 2.0]);
    let start = SE2 {
        rotation: SO2::from_angle(PLANAR_HEADING),
        position: Vector2::new(state.p_w_m[0], state.p_w_m[1]),
    };
    compare::<SE2, 3, 2, 4, 6>(
        state,
        start,
        |stamp, seq, u| plane(stamp, seq, u.into()),
        |chi| {
            let angle = SO2::angle_rad(&chi.rotation);
            vec![angle, chi.position.x, chi.position.y]
        },
    );
}

#[test]
fn every_filter_in_space_is_the_library_called_directly() {
    let state = spatial_state(START, [0.01, 0.01, 0.02, 1.0, 2.0, 1.5]);
    let start = SE3 {
        rotation: SO3::from_quaternion_xyzw(state.q_wb).unwrap(),
        position: state.p_w_m.into(),
    };
    compare::<SE3, 6, 3, 6, 9>(
        state,
        start,
        |stamp, seq, u| space(stamp, seq, u.into()),
        |chi| {
            let quaternion = chi.rotation.quaternion_xyzw();
            quaternion
                .into_iter()
                .chain(chi.position.iter().copied())
                .collect()
        },
    );
}
