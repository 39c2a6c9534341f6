//! A correction carried from then to now in one step, against the replay of the same samples through the filter.

use std::fmt::Debug;

use inekf::filter::{
    Additive, Belief, Covariance, Gate, InertialSide, LateCorrection, LateSide, Left, Right, Side,
    UpdateOptions, Verdict, propagate_in_place, propagate_odometry, update,
};
use inekf::lie::{LieGroup, SE2, SE3, SE23};
use inekf::model::{
    Automorphism, Discretisation, Drift, HeadingObservation, ImuInput, InertialState, NavState,
    Observation, OdometryStep, PointFix, Points, PositionObservation, RigidPose,
    VelocityObservation,
};
use nalgebra::{SMatrix, SVector, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::common::{
    GRAVITY_W, NOISE, any_belief, any_pose, assert_same_covariance, assert_within, normal, seeded,
};

const DELAYS: [usize; 4] = [1, 10, 100, 1000];
const SEEDS: u64 = 4;
const HELD: Discretisation = Discretisation::ZeroOrderHold;

/// One held sample.
#[derive(Clone, Copy, Debug)]
struct Sample {
    measured: ImuInput,
    dt_s: f64,
}

/// A body that hovers and shakes; no two samples are equally long.
fn samples(count: usize, rng: &mut ChaCha8Rng) -> Vec<Sample> {
    let sample = |rng: &mut ChaCha8Rng| Sample {
        measured: ImuInput {
            omega_b: 0.5 * normal::<3, 1>(rng),
            force_b: Vector3::new(0.0, 0.0, 9.8) + 2.0 * normal::<3, 1>(rng),
        },
        dt_s: rng.random_range(0.002..0.008),
    };
    (0..count).map(|_| sample(rng)).collect()
}

fn moved<G: InertialState<D>, S: InertialSide, const D: usize>(
    belief: &Belief<G, S, D>,
    samples: &[Sample],
) -> Belief<G, S, D> {
    let mut belief = *belief;
    for sample in samples {
        propagate_in_place(
            &mut belief,
            &sample.measured,
            &GRAVITY_W,
            sample.dt_s,
            HELD,
            &NOISE,
        );
    }
    belief
}

fn free_fall(samples: &[Sample]) -> Drift<SE23, <SE23 as InertialState<9>>::FreeMotion, 9> {
    let dt_s = samples.iter().map(|sample| sample.dt_s).sum();
    SE23::free_fall(&GRAVITY_W, dt_s).unwrap()
}

/// A fix of the position of an antenna, off by its noise.
fn position(chi: &SE23, sigma_m: f64, rng: &mut ChaCha8Rng) -> PositionObservation {
    let lever_arm_b = Vector3::new(0.8, -0.3, 1.2);
    PositionObservation {
        position_w: chi.position
            + chi.rotation.rotate(&lever_arm_b)
            + sigma_m * normal::<3, 1>(rng),
        covariance_w: SMatrix::identity() * (sigma_m * sigma_m),
        lever_arm_b,
    }
}

/// A belief that has seen ten fixes, as a filter in its stride has; the true state is near its mean.
fn in_stride<S: InertialSide>(seed: u64) -> (Belief<SE23, S, 9>, ChaCha8Rng) {
    let mut rng = seeded(seed);
    let mut belief: Belief<SE23, S, 9> = any_belief(any_pose(&mut rng), 0.1, &mut rng);
    for _ in 0..10 {
        belief = moved(&belief, &samples(50, &mut rng));
        let fix = position(&belief.mean, 0.5, &mut rng);
        update(&mut belief, &fix, &UpdateOptions::ITERATED).unwrap();
    }
    (belief, rng)
}

/// Fails unless means and covariances are the same to 1e-12 of the scale of each entry.
fn assert_same<G: LieGroup<D>, S: Side, const D: usize>(
    what: &str,
    actual: &Belief<G, S, D>,
    expected: &Belief<G, S, D>,
) {
    let apart = expected.mean.between(&actual.mean).log();
    let scale = expected.mean.log().amax().max(1.0);
    assert_within(what, &apart, &SVector::zeros(), 1e-12 * scale);
    let (p, replayed) = (actual.covariance.matrix(), expected.covariance.matrix());
    assert_same_covariance(what, p, replayed, 1e-12);
    assert_eq!(p, &p.transpose(), "{what}");
}

/// Corrects `then` by `correct`, and fails unless carrying that over `motion` gives what replaying `motion` does.
fn assert_replayed<G, S, A, const D: usize>(
    what: &str,
    then: &Belief<G, S, D>,
    motion: impl Fn(&Belief<G, S, D>) -> Belief<G, S, D>,
    drift: &Drift<G, A, D>,
    correct: impl Fn(&mut Belief<G, S, D>),
) where
    G: LieGroup<D>,
    S: LateSide,
    A: Automorphism<G, D> + Debug,
{
    let mut corrected = *then;
    correct(&mut corrected);
    assert_ne!(&corrected, then, "{what}: the correction must correct");
    let carried = LateCorrection::between(then, &corrected)
        .carried(drift, &motion(then))
        .unwrap();
    assert_same(what, &carried, &motion(&corrected));
}

fn corrected_by<G: LieGroup<D>, S: Side, const D: usize, const M: usize>(
    fix: impl Observation<G, D, M>,
    options: UpdateOptions,
) -> impl Fn(&mut Belief<G, S, D>) {
    move |belief| {
        let correction = update(belief, &fix, &options).unwrap();
        assert_eq!(correction.verdict, Verdict::Accepted);
    }
}

fn inertial<S: InertialSide + LateSide>(side: &str) {
    for delay in DELAYS {
        for seed in 0..SEEDS {
            let (then, mut rng) = in_stride::<S>(seed);
            let since = samples(delay, &mut rng);
            let drift = free_fall(&since);
            let what = format!("{side}, {delay} samples, seed {seed}");
            let check = |kind: &str, correct: &dyn Fn(&mut Belief<SE23, S, 9>)| {
                let what = format!("{what}, {kind}");
                assert_replayed(&what, &then, |b| moved(b, &since), &drift, correct);
            };
            let place = position(&then.mean, 0.5, &mut rng);
            check("position", &corrected_by(place, UpdateOptions::ITERATED));
            check("plain", &corrected_by(place, UpdateOptions::PLAIN));
            let gated = UpdateOptions {
                gate: Gate::of_probability(0.999_999),
                ..UpdateOptions::ITERATED
            };
            let speed = VelocityObservation {
                velocity_w: then.mean.velocity + 0.1 * normal::<3, 1>(&mut rng),
                covariance_w: SMatrix::identity() * 0.04,
            };
            check("velocity, gated", &corrected_by(speed, gated));
            let course = HeadingObservation {
                heading: then.mean.rotation.heading_rad() + 0.02,
                sigma: 0.05,
            };
            check("heading", &corrected_by(course, UpdateOptions::ITERATED));
        }
    }
}

#[test]
fn on_se23_a_carried_correction_is_the_replayed_one() {
    inertial::<Left>("left");
    inertial::<Right>("right");
    inertial::<Additive>("additive");
}

fn odometry<G, S, const D: usize, const N: usize>(side: &str, increment: SVector<f64, D>)
where
    G: RigidPose<D, N>,
    S: LateSide,
{
    for delay in DELAYS {
        for seed in 0..SEEDS {
            let mut rng = seeded(seed);
            let steps: Vec<_> = (0..delay)
                .map(|_| {
                    let shaken = increment + 0.02 * normal::<D, 1>(&mut rng);
                    OdometryStep::<G>::new(&shaken, 0.1)
                })
                .collect();
            let noise = normal::<D, D>(&mut rng) * 1e-3;
            let q = Covariance::from_upper(noise * noise.transpose());
            let start =
                SVector::<f64, D>::from_fn(|i, _| if i < G::ROTATION_DIM { 1.0 } else { 20.0 });
            let mean = G::exp(&normal::<D, 1>(&mut rng).component_mul(&start));
            let variances =
                SVector::<f64, D>::from_fn(|i, _| if i < G::ROTATION_DIM { 0.01 } else { 0.5 });
            let then = Belief::<G, S, D>::from_left_covariance(
                mean,
                Covariance::from_variances(&variances),
            );
            let fix = PointFix {
                position_w: mean.position_w() + 0.5 * normal::<N, 1>(&mut rng),
                covariance_w: SMatrix::identity() * 0.25,
                lever_arm_b: SVector::repeat(0.4),
                scale_error: 0.0,
            };
            let motion = |belief: &Belief<G, S, D>| {
                steps.iter().fold(*belief, |belief, step| {
                    propagate_odometry(&belief, step, q.matrix())
                })
            };
            let correct = |belief: &mut Belief<G, S, D>| {
                update::<_, _, _, D, N>(
                    belief,
                    &Points::<1, N, N>::new([fix]),
                    &UpdateOptions::ITERATED,
                )
                .unwrap();
            };
            let what = format!("{side}, {D} dimensions, {delay} steps, seed {seed}");
            assert_replayed(&what, &then, motion, &Drift::none(), correct);
        }
    }
}

#[test]
fn on_se2_and_se3_a_carried_correction_is_the_replayed_one() {
    let plane = SVector::from([0.05, 0.5, 0.01]);
    odometry::<SE2, Left, 3, 2>("left", plane);
    odometry::<SE2, Right, 3, 2>("right", plane);
    odometry::<SE2, Additive, 3, 2>("additive", plane);
    let space = SVector::from([0.01, -0.02, 0.05, 0.5, 0.01, -0.02]);
    odometry::<SE3, Left, 6, 3>("left", space);
    odometry::<SE3, Right, 6, 3>("right", space);
    odometry::<SE3, Additive, 6, 3>("additive", space);
}

/// Two hours of coarse samples: nothing has been accumulated that could have drifted.
#[test]
fn after_hours_a_carried_correction_is_still_the_replayed_one() {
    let (mut belief, mut rng) = in_stride::<Left>(11);
    let mut round = samples(100, &mut rng);
    for sample in &mut round {
        sample.dt_s *= 20.0;
    }
    for _ in 0..750 {
        belief = moved(&belief, &round);
        let rest = VelocityObservation {
            velocity_w: Vector3::zeros(),
            covariance_w: SMatrix::identity() * 0.01,
        };
        update(&mut belief, &rest, &UpdateOptions::ITERATED).unwrap();
        let fix = PositionObservation {
            position_w: 100.0 * normal::<3, 1>(&mut rng),
            ..position(&belief.mean, 0.5, &mut rng)
        };
        update(&mut belief, &fix, &UpdateOptions::ITERATED).unwrap();
    }
    let since = samples(1000, &mut rng);
    let fix = position(&belief.mean, 0.5, &mut rng);
    assert_replayed(
        "after hours",
        &belief,
        |b| moved(b, &since),
        &free_fall(&since),
        corrected_by(fix, UpdateOptions::ITERATED),
    );
}

/// Several late fixes one after the other, each given to the belief that has been given those before.
#[test]
fn corrections_follow_one_another() {
    let (then, mut rng) = in_stride::<Left>(12);
    let since = samples(300, &mut rng);
    let (mut replayed, mut raw) = (then, then);
    let mut now = moved(&then, &since);
    for part in 0..3 {
        let to = &since[100 * part..100 * (part + 1)];
        (replayed, raw) = (moved(&replayed, to), moved(&raw, to));
        let before = replayed;
        let fix = position(&raw.mean, 0.5, &mut rng);
        update(&mut replayed, &fix, &UpdateOptions::ITERATED).unwrap();
        now = LateCorrection::between(&before, &replayed)
            .carried(&free_fall(&since[100 * (part + 1)..]), &now)
            .unwrap();
    }
    assert_same("three in a row", &now, &replayed);
}

/// Without what makes it exact it is not: gravity left out, an update in between, or biases.
#[test]
fn it_is_no_replay_without_the_drift_or_with_an_update_in_between_or_with_biases() {
    let (then, mut rng) = in_stride::<Left>(13);
    let since = samples(100, &mut rng);
    let mut corrected = then;
    let fix = position(&then.mean, 0.5, &mut rng);
    update(&mut corrected, &fix, &UpdateOptions::ITERATED).unwrap();
    let late = LateCorrection::between(&then, &corrected);
    let apart = |a: &SE23, b: &SE23| a.between(b).log().amax();

    let replayed = moved(&corrected, &since);
    let weightless = SE23::free_fall(&Vector3::zeros(), free_fall(&since).automorphism.dt_s);
    let (wrong, _) = late.carried_with_share(&weightless.unwrap(), &moved(&then, &since));
    assert!(apart(&wrong.mean, &replayed.mean) > 1e-4);

    let between = |belief: &Belief<SE23, Left, 9>| {
        let mut belief = moved(belief, &since[..50]);
        let fix = position(&then.mean, 0.5, &mut seeded(3));
        update(&mut belief, &fix, &UpdateOptions::ITERATED).unwrap();
        moved(&belief, &since[50..])
    };
    let (wrong, _) = late.carried_with_share(&free_fall(&since), &between(&then));
    assert!(apart(&wrong.mean, &between(&corrected).mean) > 1e-3);

    // A state with biases has no free fall; its pose, carried as if it had none, is not where the replay takes it.
    assert!(NavState::free_fall(&GRAVITY_W, 1.0).is_none());
    let biased = NavState::from_parts(then.mean, Vector3::zeros(), Vector3::zeros());
    let then: Belief<NavState, Left, 15> = any_belief(biased, 0.1, &mut rng);
    let mut corrected = then;
    update(&mut corrected, &fix, &UpdateOptions::ITERATED).unwrap();
    let pose = |belief: &Belief<NavState, Left, 15>| {
        let p = belief.covariance.matrix().fixed_view::<9, 9>(0, 0);
        Belief::<SE23, Left, 9>::new(*belief.mean.pose(), Covariance::from_upper(p.into_owned()))
    };
    let late = LateCorrection::between(&pose(&then), &pose(&corrected));
    let (wrong, _) = late.carried_with_share(&free_fall(&since), &pose(&moved(&then, &since)));
    let replayed = pose(&moved(&corrected, &since));
    assert!(apart(&wrong.mean, &replayed.mean) > 1e-4);
}

/// A fix a million times as precise as the belief takes away what a difference cannot keep apart.
#[test]
fn what_would_lose_digits_is_refused() {
    let (then, mut rng) = in_stride::<Left>(14);
    let vague = Belief::<_, Left, 9>::new(then.mean, then.covariance.scaled(1e6));
    let since = samples(10, &mut rng);
    let mut corrected = vague;
    let fix = position(&then.mean, 0.01, &mut rng);
    update(&mut corrected, &fix, &UpdateOptions::ITERATED).unwrap();
    let late = LateCorrection::between(&vague, &corrected);
    assert!(
        late.carried(&free_fall(&since), &moved(&vague, &since))
            .is_none()
    );
}
