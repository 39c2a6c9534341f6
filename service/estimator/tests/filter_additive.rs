//! The additive error on every group, and the other parametrisations beside it: what each means, its Jacobians against
//! numerical ones, and its change of coordinates to first order. And the EKF that the update core makes of the
//! additive one, against one written out densely.

mod common;

use common::{
    any_pose, any_rotation, any_state, assert_close, derivative_at_zero, noise_of_scale, normal,
    seeded,
};
use inekf::filter::{
    Additive, Belief, Covariance, Forster, Gtsam, Left, Right, Side, UpdateOptions, update,
};
use inekf::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3, TwoFrames};
use inekf::model::{NavState, PointFix, Pose, SpatialFix};
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;

/// An error far from small, with a rotation of up to 2.5 rad.
fn large<G: LieGroup<D>, const D: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, D> {
    let mut xi: SVector<f64, D> = 3.0 * normal::<D, 1>(rng);
    let norm = xi.rows(0, G::ROTATION_DIM).norm();
    xi.rows_mut(0, G::ROTATION_DIM)
        .scale_mut(2.5 / norm.max(2.5));
    xi
}

fn assert_definitions_of<S: Side, G: LieGroup<D>, const D: usize>(chi: &G, rng: &mut ChaCha8Rng) {
    let xi = large::<G, D>(rng);
    let there = S::retract(chi, &xi);
    assert_close("the way back", &S::difference(chi, &there), &xi, 1e-11);
    let numerical = derivative_at_zero(|d: &SVector<f64, D>| {
        S::difference(&there, &S::retract(chi, &(xi + d)))
    });
    let jacobian = S::jacobian::<G, D>(&xi);
    assert_close("Jacobian", &jacobian, &numerical, 1e-9);
    let by_origin =
        derivative_at_zero(|e: &SVector<f64, D>| S::difference(&S::retract(chi, e), &there));
    let expected = -(jacobian * by_origin);
    assert_close(
        "of the origin",
        &S::origin_jacobian::<G, D>(&xi),
        &expected,
        1e-8,
    );
    let change =
        derivative_at_zero(|xi: &SVector<f64, D>| S::difference(chi, &Left::retract(chi, xi)));
    assert_close("from the left", &S::from_left(chi), &change, 1e-9);
    let back =
        derivative_at_zero(|xi: &SVector<f64, D>| Left::difference(chi, &S::retract(chi, xi)));
    assert_close("to the left", &S::to_left(chi), &back, 1e-9);
}

fn assert_definitions<G: LieGroup<D>, const D: usize>(chi: &G, rng: &mut ChaCha8Rng) {
    assert_definitions_of::<Additive, G, D>(chi, rng);
    assert_definitions_of::<Gtsam, G, D>(chi, rng);
    assert_definitions_of::<Forster, G, D>(chi, rng);
    assert_definitions_of::<Left, G, D>(chi, rng);
    assert_definitions_of::<Right, G, D>(chi, rng);
}

fn any_two_frames(rng: &mut ChaCha8Rng) -> TwoFrames {
    let state = any_state(rng);
    TwoFrames {
        rotation: state.pose.rotation,
        velocity: state.pose.velocity,
        position: state.pose.position,
        gyro_bias: state.gyro_bias,
        accel_bias: state.accel_bias,
    }
}

#[test]
fn every_error_keeps_its_definitions_on_every_group() {
    let mut rng = seeded(501);
    for _ in 0..20 {
        let heading = SO2::from_angle(3.0 * normal::<1, 1>(&mut rng).x);
        let position = 30.0 * normal::<2, 1>(&mut rng);
        assert_definitions::<SO2, 1>(&heading, &mut rng);
        assert_definitions::<SO3, 3>(&any_rotation(&mut rng), &mut rng);
        assert_definitions::<SE2, 3>(
            &SE2 {
                rotation: heading,
                position,
            },
            &mut rng,
        );
        let pose = any_pose(&mut rng);
        let rigid = SE3 {
            rotation: pose.rotation,
            position: pose.position,
        };
        assert_definitions::<SE3, 6>(&rigid, &mut rng);
        assert_definitions::<SE23, 9>(&pose, &mut rng);
        assert_definitions::<NavState, 15>(&any_state(&mut rng), &mut rng);
        assert_definitions::<TwoFrames, 15>(&any_two_frames(&mut rng), &mut rng);
    }
}

#[test]
fn coordinates_add_in_world_axes() {
    let chi = SE2 {
        rotation: SO2::from_angle(2.0),
        position: Vector2::new(10.0, 20.0),
    };
    let moved = Additive::retract(&chi, &Vector3::new(0.5, 1.0, -2.0));
    assert!((moved.rotation.angle_rad() - 2.5).abs() < 1e-15);
    assert_close(
        "position",
        &moved.position,
        &Vector2::new(11.0, 18.0),
        1e-15,
    );
    let state = any_state(&mut seeded(502));
    let xi = large::<NavState, 15>(&mut seeded(503));
    let moved = Additive::retract(&state, &xi);
    let part = |start: usize| Vector3::new(xi[start], xi[start + 1], xi[start + 2]);
    let turned = SO3::exp(&part(0)).matrix() * state.pose.rotation.matrix();
    assert_close("attitude", &moved.pose.rotation.matrix(), &turned, 1e-13);
    assert_close(
        "velocity",
        &moved.pose.velocity,
        &(state.pose.velocity + part(3)),
        1e-13,
    );
    assert_close(
        "position",
        &moved.pose.position,
        &(state.pose.position + part(6)),
        1e-13,
    );
    assert_close(
        "gyro",
        &moved.gyro_bias,
        &(state.gyro_bias + part(9)),
        1e-13,
    );
    assert_close(
        "accelerometer",
        &moved.accel_bias,
        &(state.accel_bias + part(12)),
        1e-13,
    );
}

#[test]
fn an_update_is_that_of_an_ekf() {
    let mut rng = seeded(504);
    for _ in 0..20 {
        let pose = any_pose(&mut rng);
        let mean = SE3 {
            rotation: pose.rotation,
            position: pose.position,
        };
        let p = noise_of_scale(&SVector::<f64, 6>::repeat(0.5), &mut rng);
        let fix = SpatialFix::new([PointFix {
            position_w: mean.position + normal::<3, 1>(&mut rng),
            covariance_w: noise_of_scale(&Vector3::repeat(1.0), &mut rng),
            lever_arm_b: normal(&mut rng),
            scale_error: 0.0,
        }]);
        // h = x + Exp(phi) R b: H = [-hat(R b), I].
        let PointFix {
            position_w,
            covariance_w,
            lever_arm_b,
            ..
        } = fix.fixes[0];
        let arm_w = mean.rotation.rotate(&lever_arm_b);
        let mut h = SMatrix::<f64, 3, 6>::zeros();
        h.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&-arm_w.cross_matrix());
        h.fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&Matrix3::identity());
        let s = h * p * h.transpose() + covariance_w;
        let k = p * h.transpose() * s.try_inverse().expect("regular");
        let xi = k * (position_w - mean.position - arm_w);
        let mut belief = Belief::<SE3, Additive, 6>::new(mean, Covariance::from_upper(p));
        let correction = update(&mut belief, &fix, &UpdateOptions::PLAIN).expect("an update");
        assert_close("xi", &correction.xi, &xi, 1e-11);
        assert_close(
            "position",
            &belief.mean.position_w(),
            &(mean.position + xi.fixed_rows::<3>(3)),
            1e-11,
        );
        let turned = SO3::exp(&xi.fixed_rows::<3>(0).into_owned()) * mean.rotation;
        assert_close(
            "attitude",
            &belief.mean.rotation.matrix(),
            &turned.matrix(),
            1e-11,
        );
        assert_close(
            "P",
            belief.covariance.matrix(),
            &(p - k * s * k.transpose()),
            1e-11,
        );
    }
}

/// Where nothing is turned and nothing is far, all three errors are one.
#[test]
fn at_the_identity_the_sides_agree() {
    let p = noise_of_scale(&SVector::<f64, 6>::repeat(0.5), &mut seeded(505));
    let covariance = Covariance::from_upper(p);
    let right = Belief::<SE3, Right, 6>::from_left_covariance(SE3::identity(), covariance);
    let additive = Belief::<SE3, Additive, 6>::from_left_covariance(SE3::identity(), covariance);
    assert_close("right", right.covariance.matrix(), &p, 1e-15);
    assert_close("additive", additive.covariance.matrix(), &p, 1e-15);
}
