//! The first belief: levelling in many attitudes, and the covariance against independent world-frame errors
//! carried numerically through the definition of the invariant error.

mod common;

use std::f64::consts::PI;

use common::{
    any_rotation, assert_same_covariance, assert_within, derivative_at_zero, noise_of_scale,
    normal, seeded,
};
use inekf::filter::{Alignment, Belief, BiasPrior, Left, Levelled, Right, Side};
use inekf::lie::{SE23, SO3};
use inekf::model::{InertialState, NavState};
use nalgebra::{SMatrix, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

/// The specific force of a body at rest.
fn force_at_rest(r_wb: &SO3) -> Vector3<f64> {
    r_wb.matrix().transpose() * Vector3::new(0.0, 0.0, 9.80665)
}

#[test]
fn levelling_recovers_the_attitude_where_the_heading_is_known() {
    for roll in [-3.1, -2.0, -0.3, 0.0, 0.01, 1.0, 1.6, 3.0] {
        for pitch in [-1.55, -0.8, 0.0, 0.02, 0.7, 1.55] {
            for heading in [-3.0, 0.0, 1.2, PI] {
                let truth = SO3::from_roll_pitch_heading(roll, pitch, heading);
                // Near the vertical the roll hangs on what little of the force is not along x.
                let rounding = 1e-15 / pitch.cos();
                let levelled =
                    Levelled::from_force(&force_at_rest(&truth), heading).expect("gravity");
                assert_within(
                    "attitude",
                    &levelled.r_wb.matrix(),
                    &truth.matrix(),
                    rounding,
                );
            }
        }
    }
}

/// In any attitude, vertical ones included: what the accelerometer calls up is up.
#[test]
fn levelling_puts_up_where_the_force_points() {
    let mut rng = seeded(61);
    let straight_up = SO3::from_roll_pitch_heading(0.0, -PI / 2.0, 0.4);
    let straight_down = SO3::from_roll_pitch_heading(0.7, PI / 2.0, 0.0);
    let many = (0..200).map(|_| any_rotation(&mut rng));
    for truth in many.chain([straight_up, straight_down]) {
        let force_b = force_at_rest(&truth);
        let levelled = Levelled::from_force(&force_b, 1.0).expect("gravity");
        let up_w = levelled.r_wb.matrix() * force_b;
        assert_within("up", &up_w, &Vector3::new(0.0, 0.0, 9.80665), 1e-13);
    }
}

#[test]
fn levelling_takes_the_heading_it_is_given() {
    let mut rng = seeded(62);
    for heading in [-3.0, -1.0, 0.0, 2.0] {
        let force_b = force_at_rest(&any_rotation(&mut rng)) * 0.9;
        let levelled = Levelled::from_force(&force_b, heading).expect("gravity");
        let forward_w = levelled.r_wb.matrix().column(0).into_owned();
        assert!((forward_w.y.atan2(forward_w.x) - heading).abs() < 1e-12);
    }
}

#[test]
fn without_a_force_there_is_no_level() {
    for force_b in [
        Vector3::zeros(),
        Vector3::new(0.3, -0.2, 0.1),
        Vector3::new(f64::NAN, 0.0, 9.8),
        Vector3::new(0.0, f64::INFINITY, 9.8),
    ] {
        assert_eq!(Levelled::from_force(&force_b, 0.0), None);
    }
}

fn any_alignment(rng: &mut ChaCha8Rng) -> Alignment {
    Alignment {
        r_wb: any_rotation(rng),
        tilt_sigma: 0.02,
        heading_sigma: 0.7,
        velocity_w: 10.0 * normal::<3, 1>(rng),
        velocity_sigma: 0.4,
        position_w: 100.0 * normal::<3, 1>(rng),
        position_covariance_w: noise_of_scale(&Vector3::new(1.0, 2.0, 5.0), rng),
        lever_arm_b: normal(rng),
        biases: BiasPrior {
            gyro_bias: 0.01 * normal::<3, 1>(rng),
            gyro_sigma: 0.003,
            accel_bias: 0.1 * normal::<3, 1>(rng),
            accel_sigma: 0.05,
        },
    }
}

/// The true state if the world-frame errors of what the alignment was told are `e`: attitude about the world
/// axes, velocity, antenna position, biases.
fn truth_behind<G: InertialState<D>, const D: usize>(told: &Alignment, e: &SVector<f64, 15>) -> G {
    let error = |start: usize| Vector3::new(e[start], e[start + 1], e[start + 2]);
    let rotation =
        SO3::from_matrix(&(nalgebra::Rotation3::new(error(0)).into_inner() * told.r_wb.matrix()))
            .expect("a rotation");
    let antenna_w = told.position_w + error(6);
    G::from_parts(
        SE23 {
            rotation,
            velocity: told.velocity_w + error(3),
            position: antenna_w - rotation.matrix() * told.lever_arm_b,
        },
        told.biases.gyro_bias + error(9),
        told.biases.accel_bias + error(12),
    )
}

/// The covariance of those independent errors.
fn told_covariance(told: &Alignment) -> SMatrix<f64, 15, 15> {
    let sigmas = [
        told.tilt_sigma,
        told.tilt_sigma,
        told.heading_sigma,
        told.velocity_sigma,
        told.velocity_sigma,
        told.velocity_sigma,
        0.0,
        0.0,
        0.0,
        told.biases.gyro_sigma,
        told.biases.gyro_sigma,
        told.biases.gyro_sigma,
        told.biases.accel_sigma,
        told.biases.accel_sigma,
        told.biases.accel_sigma,
    ];
    let mut p = SMatrix::from_diagonal(&SVector::from(sigmas.map(|sigma| sigma * sigma)));
    p.fixed_view_mut::<3, 3>(6, 6)
        .copy_from(&told.position_covariance_w);
    p
}

fn assert_first_belief<G: InertialState<D>, S: Side, const D: usize>(what: &str, told: &Alignment) {
    let belief: Belief<G, S, D> = told.belief();
    let as_told: G = truth_behind(told, &SVector::zeros());
    assert_within(
        what,
        &S::difference(&as_told, &belief.mean),
        &SVector::zeros(),
        1e-13 * told.position_w.norm(),
    );
    let spread = derivative_at_zero(|e: &SVector<f64, 15>| {
        S::difference(&belief.mean, &truth_behind::<G, D>(told, e))
    });
    let expected = spread * told_covariance(told) * spread.transpose();
    assert_same_covariance(what, belief.covariance.matrix(), &expected, 1e-8);
}

#[test]
fn the_covariance_is_that_of_independent_errors_in_the_world() {
    let mut rng = seeded(63);
    for _ in 0..20 {
        let told = any_alignment(&mut rng);
        assert_first_belief::<SE23, Left, 9>("left, 9 states", &told);
        assert_first_belief::<SE23, Right, 9>("right, 9 states", &told);
        assert_first_belief::<NavState, Left, 15>("left, 15 states", &told);
        assert_first_belief::<NavState, Right, 15>("right, 15 states", &told);
    }
}

/// Perfectly levelled, only the heading unknown: rank one in the attitude, the case of [IS] section V.
#[test]
fn what_is_known_exactly_has_no_variance() {
    let told = Alignment {
        tilt_sigma: 0.0,
        r_wb: SO3::from_roll_pitch_heading(0.0, 0.0, 0.3),
        ..any_alignment(&mut seeded(64))
    };
    let belief: Belief<NavState, Left, 15> = told.belief();
    let attitude = belief
        .covariance
        .matrix()
        .fixed_view::<3, 3>(0, 0)
        .into_owned();
    let expected = SMatrix::from_diagonal(&Vector3::new(0.0, 0.0, 0.49));
    assert_within("attitude", &attitude, &expected, 1e-16);
}
