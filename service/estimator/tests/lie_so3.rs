//! What is particular to rotations in space: quaternions, matrices, angles, and what is refused.

use inekf::lie::{LieGroup, RotationError, SO3};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{FRAC_PI_2, PI};

fn normal_vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Rotations of every angle in [0, pi], many of them at and near both ends.
fn rotations() -> Vec<SO3> {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut rotations = vec![SO3::identity()];
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        rotations.push(SO3::exp(&(PI * axis)));
        rotations.push(SO3::exp(&(-FRAC_PI_2 * axis)));
    }
    for i in 0..500 {
        let gap = 10f64.powf(-rng.random_range(0.0..16.0));
        let angle = match i % 3 {
            0 => rng.random_range(0.0..PI),
            1 => gap,
            _ => PI - gap,
        };
        rotations.push(SO3::exp(&(angle * normal_vector(&mut rng).normalize())));
    }
    rotations
}

#[test]
fn a_quarter_turn_to_the_left_takes_forward_to_north() {
    // Body to world, Hamilton: a body that looks north has its x axis along the world's y.
    let half = 0.5_f64.sqrt();
    let north = SO3::from_quaternion_xyzw([0.0, 0.0, half, half]).unwrap();
    assert!((north.rotate(&Vector3::x()) - Vector3::y()).amax() < 1e-15);
    assert!((north.rotate(&Vector3::y()) + Vector3::x()).amax() < 1e-15);
    assert!((north.inverse_rotate(&Vector3::y()) - Vector3::x()).amax() < 1e-15);
    assert!((north.heading_rad() - FRAC_PI_2).abs() < 1e-15);
    assert!((north.log() - FRAC_PI_2 * Vector3::z()).amax() < 1e-15);
}

#[test]
fn rotating_is_multiplying_by_the_matrix() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for r in rotations() {
        let a = normal_vector(&mut rng);
        assert!((r.rotate(&a) - r.matrix() * a).amax() < 3e-15);
        assert!((r.inverse_rotate(&a) - r.matrix().transpose() * a).amax() < 3e-15);
        assert!((r.matrix().transpose() * r.matrix() - Matrix3::identity()).amax() < 2e-15);
        assert!((r.matrix().determinant() - 1.0).abs() < 2e-15);
    }
}

#[test]
fn matrices_read_back_as_the_same_rotation_near_pi_too() {
    for r in rotations() {
        let again = SO3::from_matrix(&r.matrix()).unwrap();
        let difference = r.inverse().compose(&again).log();
        assert!(difference.amax() < 5e-15, "{r:?}: {difference:e}");
    }
}

#[test]
fn a_disturbed_matrix_is_projected_to_the_nearest_rotation() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for r in rotations() {
        let disturbed = r.matrix() + Matrix3::from_fn(|_, _| rng.random_range(-0.03..0.03));
        // The orthogonal polar factor, by Newton's iteration.
        let mut polar = disturbed;
        for _ in 0..12 {
            polar = (polar + polar.try_inverse().unwrap().transpose()) * 0.5;
        }
        let projected = SO3::from_matrix(&disturbed).unwrap().matrix();
        assert!((projected - polar).amax() < 5e-15);
    }
}

#[test]
fn what_is_no_rotation_is_refused_with_its_reason() {
    let not_a_rotation = [
        Matrix3::zeros(),
        -Matrix3::identity(),
        Matrix3::identity() * 1.2,
        Matrix3::identity() * 0.8,
        Matrix3::identity() * 1e200,
        Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0)),
        Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    ];
    for matrix in not_a_rotation {
        assert_eq!(
            SO3::from_matrix(&matrix),
            Err(RotationError::NotARotation),
            "{matrix}"
        );
    }
    for poison in [f64::NAN, f64::INFINITY] {
        for entry in 0..9 {
            let mut matrix = Matrix3::identity();
            matrix[entry] = poison;
            assert_eq!(SO3::from_matrix(&matrix), Err(RotationError::NotFinite));
        }
        for entry in 0..4 {
            let mut xyzw = [0.1, 0.2, 0.3, 0.4];
            xyzw[entry] = poison;
            assert_eq!(
                SO3::from_quaternion_xyzw(xyzw),
                Err(RotationError::NotFinite)
            );
        }
    }
    for xyzw in [[0.0; 4], [1e-200, 0.0, 0.0, 0.0], [0.0, 1e200, 0.0, 1.0]] {
        assert_eq!(
            SO3::from_quaternion_xyzw(xyzw),
            Err(RotationError::NoDirection)
        );
    }
    let message = RotationError::NotARotation.to_string();
    assert!(message.contains("determinant"), "{message}");
}

#[test]
fn quaternions_are_normalised_and_their_sign_means_nothing() {
    let r = SO3::from_quaternion_xyzw([1.0, -2.0, 3.0, 4.0]).unwrap();
    let opposite = SO3::from_quaternion_xyzw([-1.0, 2.0, -3.0, -4.0]).unwrap();
    assert_eq!(r, opposite);
    assert_eq!(r.log(), opposite.log());
    assert_ne!(r, r.inverse());
    let norm_squared: f64 = r.quaternion_xyzw().iter().map(|entry| entry * entry).sum();
    assert!((norm_squared - 1.0).abs() < 4e-16);
    let far = SO3::from_quaternion_xyzw([1e100, -2e100, 3e100, 4e100]).unwrap();
    assert!((far.inverse() * r).log().amax() < 1e-15);
}

#[test]
fn angles_build_the_product_of_elementary_rotations() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for _ in 0..200 {
        let roll = rng.random_range(-PI..PI);
        let pitch = rng.random_range(-1.5..1.5);
        let heading = rng.random_range(-PI..PI);
        let (sr, cr) = f64::sin_cos(roll);
        let (sp, cp) = f64::sin_cos(pitch);
        let (sh, ch) = f64::sin_cos(heading);
        let expected = Matrix3::new(ch, -sh, 0.0, sh, ch, 0.0, 0.0, 0.0, 1.0)
            * Matrix3::new(cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp)
            * Matrix3::new(1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr);
        let r = SO3::from_roll_pitch_heading(roll, pitch, heading);
        assert!((r.matrix() - expected).amax() < 2e-15);
        // Near vertical, heading loses digits as 1 / cos(pitch), here at most 14 times.
        assert!(
            (r.heading_rad() - heading).abs() < 2e-14,
            "{roll} {pitch} {heading}"
        );
    }
}

#[test]
fn angles_have_the_signs_of_a_body_that_is_forward_left_up() {
    let nose_down = SO3::from_roll_pitch_heading(0.0, 0.1, 0.0);
    assert!(nose_down.rotate(&Vector3::x()).z < 0.0);
    let left_side_up = SO3::from_roll_pitch_heading(0.1, 0.0, 0.0);
    assert!(left_side_up.rotate(&Vector3::y()).z > 0.0);
}
