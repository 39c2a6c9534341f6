//! The linear form of every term in every parametrisation, against numerical derivatives of the residuals; and each
//! parametrisation against the formula that names it.

use inekf::filter::{Additive, Belief, Forster, Gtsam, Left, Right, Side};
use inekf::lie::{LieGroup, SE2, SE3, SE23};
use inekf::model::{
    Discretisation, ImuStep, Observation, OdometryStep, PositionObservation, RigidPose,
};
use inekf::smoother::linearise::{Jacobians, measurement, motion, prior};
use inekf::smoother::{Link, Motion};
use nalgebra::{SVector, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::common::{
    GRAVITY_W, any_input, any_pose, assert_close, assert_within, covariance_of_scale,
    derivative_at_zero, noise_of_scale, normal, seeded,
};

fn near<G: LieGroup<D>, const D: usize>(chi: &G, rng: &mut ChaCha8Rng) -> G {
    Left::retract(chi, &(0.7 * normal::<D, 1>(rng)))
}

/// `r(e, d) = J^-1 (to_left d - F to_left e - a)` to first order, for errors e and d in the coordinates of S.
fn assert_motion<G, S, T, const D: usize>(link: &Link<T, D>, from: &G, rng: &mut ChaCha8Rng)
where
    G: LieGroup<D>,
    S: Side,
    T: Motion<G, D>,
{
    let to = near(&link.motion.apply(from), rng);
    let linear = motion::<G, S, T, D>(link, from, &to, Jacobians::Exact);
    let residual = |from: &G, to: &G| S::Residual::difference(&link.motion.apply(from), to);
    // J is the inverse of how the residual follows its end.
    let by_end = derivative_at_zero(|d| residual(from, &Left::retract(&to, d)));
    let jacobian = by_end.try_inverse().expect("a regular Jacobian");
    assert_close(
        "offset",
        &linear.offset,
        &-(jacobian * residual(from, &to)),
        1e-8,
    );
    let reached = link.motion.apply(from);
    let root = jacobian * S::Residual::from_left(&reached);
    assert_close(
        "noise",
        &linear.noise,
        &(root * link.noise * root.transpose()),
        1e-8,
    );

    let by_end = derivative_at_zero(|d| residual(from, &S::retract(&to, d)));
    assert_close("end", &(jacobian * by_end), &S::to_left(&to), 1e-8);
    let by_start = derivative_at_zero(|e| residual(&S::retract(from, e), &to));
    let expected = -(linear.transition * S::to_left(from));
    assert_close("start", &(jacobian * by_start), &expected, 1e-8);

    let frozen = motion::<G, S, T, D>(link, from, &reached, Jacobians::Frozen);
    let exact = motion::<G, S, T, D>(link, from, &reached, Jacobians::Exact);
    assert_close("frozen", &exact.transition, &frozen.transition, 1e-12);
    assert_close("frozen", &exact.noise, &frozen.noise, 1e-12);
    assert_within("frozen", &exact.offset, &frozen.offset, 1e-12);
    let off = motion::<G, Left, T, D>(link, from, &to, Jacobians::Frozen);
    assert_eq!(off.transition, link.motion.left_jacobian(from));
    assert_eq!(off.noise, link.noise);
}

/// `xi_left ~ N(m, P)` is the prior around another state, to first order.
fn assert_prior<G: LieGroup<D>, P: Side, const D: usize>(mean: &G, rng: &mut ChaCha8Rng) {
    let covariance = covariance_of_scale(&SVector::repeat(0.5), rng);
    let belief = Belief::<G, P, D>::new(*mean, covariance);
    let chi = near(mean, rng);
    let linear = prior(&belief, &chi, Jacobians::Exact);
    let residual = |chi: &G| P::difference(mean, chi);
    let by_state = derivative_at_zero(|d| residual(&Left::retract(&chi, d)));
    let jacobian = by_state.try_inverse().expect("a regular Jacobian");
    assert_close("mean", &linear.mean, &-(jacobian * residual(&chi)), 1e-8);
    let expected = jacobian * covariance.matrix() * jacobian.transpose();
    assert_close("covariance", linear.covariance.matrix(), &expected, 1e-8);
    // Where the state is the mean, exact or frozen is the same.
    let exact = prior(&belief, mean, Jacobians::Exact);
    let frozen = prior(&belief, mean, Jacobians::Frozen);
    assert_close(
        "frozen",
        exact.covariance.matrix(),
        frozen.covariance.matrix(),
        1e-12,
    );
}

fn assert_group<G, T, const D: usize>(chi: &G, motion: T, rng: &mut ChaCha8Rng)
where
    G: LieGroup<D>,
    T: Motion<G, D>,
{
    let link = Link {
        motion,
        noise: noise_of_scale(&SVector::repeat(0.3), rng),
    };
    macro_rules! every {
        ($($side:ty),*) => { $(
            assert_motion::<G, $side, T, D>(&link, chi, rng);
            assert_prior::<G, $side, D>(chi, rng);
        )* };
    }
    every!(Left, Right, Gtsam, Forster, Additive);
}

fn any_odometry<G: RigidPose<D, N>, const D: usize, const N: usize>(
    rng: &mut ChaCha8Rng,
) -> OdometryStep<G> {
    OdometryStep::new(&normal(rng), 1.0)
}

#[test]
fn every_term_is_linearised_exactly_in_every_parametrisation() {
    let mut rng = seeded(841);
    for _ in 0..5 {
        let step = any_odometry::<SE2, 3, 2>(&mut rng);
        assert_group(&SE2::exp(&normal(&mut rng)), step, &mut rng);
        let step = any_odometry::<SE3, 6, 3>(&mut rng);
        assert_group(&SE3::exp(&normal(&mut rng)), step, &mut rng);
        let input = any_input(&mut rng);
        let imu = ImuStep::new(&input, &GRAVITY_W, 0.1, Discretisation::ZeroOrderHold);
        assert_group(&SE23::exp(&normal(&mut rng)), imu, &mut rng);
        assert_group(&SE23::exp(&normal(&mut rng)), imu.step, &mut rng);
    }
}

#[test]
fn an_observation_is_linearised_in_the_left_error() {
    let mut rng = seeded(842);
    let chi = any_pose(&mut rng);
    let observation = PositionObservation {
        position_w: normal(&mut rng),
        covariance_w: noise_of_scale(&Vector3::repeat(1.0), &mut rng),
        lever_arm_b: normal(&mut rng),
    };
    let linear = measurement::<SE23, _, 9, 3>(&observation, &chi);
    let numerical = derivative_at_zero(|xi: &SVector<f64, 9>| -> SVector<f64, 3> {
        observation.residual(&Left::retract(&chi, xi))
    });
    assert_close("H", &linear.jacobian, &-numerical, 1e-8);
    assert_eq!(linear.value, observation.residual(&chi));
    assert_eq!(linear.noise, observation.covariance_w);
}

#[test]
fn the_rivals_are_those_of_the_paper() {
    let mut rng = seeded(843);
    for _ in 0..10 {
        let chi = any_pose(&mut rng);
        let xi: SVector<f64, 9> = normal(&mut rng);
        let part = |start: usize| xi.fixed_rows::<3>(start).into_owned();
        let turned = |by: &Vector3<f64>| chi.rotation.rotate(by);
        let rotation = chi.rotation * inekf::lie::SO3::exp(&part(0));
        let same = |name: &str, actual: &SE23, velocity: Vector3<f64>, position: Vector3<f64>| {
            let expected = SE23 {
                rotation,
                velocity,
                position,
            };
            let gap = Left::difference(&expected, actual);
            assert_within(name, &gap, &SVector::zeros(), 1e-12);
        };
        // (23), (22), and plain addition in the world.
        let (v, x) = (chi.velocity, chi.position);
        let gtsam = Gtsam::retract(&chi, &xi);
        same("(23)", &gtsam, v + turned(&part(3)), x + turned(&part(6)));
        let forster = Forster::retract(&chi, &xi);
        same("(22)", &forster, v + part(3), x + turned(&part(6)));
        let mut in_world = xi;
        in_world.fixed_rows_mut::<3>(0).copy_from(&turned(&part(0)));
        let additive = Additive::retract(&chi, &in_world);
        same("additive", &additive, v + part(3), x + part(6));
    }
}
