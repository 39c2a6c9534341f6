//! The group-affine property itself, [IS] (3), (6), (7) and Proposition 1: the error of an IMU step obeys a
//! linear law exactly, for errors of any size and wherever the state is.

mod common;

use common::{
    GRAVITY_W, any_input, any_pose, assert_close, assert_same_pose, derivative_at_zero, normal,
    seeded,
};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{Automorphism, Discretisation, FreeMotion, ImuStep};
use nalgebra::SVector;
use rand_chacha::ChaCha8Rng;

const BOTH: [Discretisation; 2] = [Discretisation::ZeroOrderHold, Discretisation::Euler];
const SAMPLES: usize = 200;

/// Half a second, long enough that nothing is small.
const DT_S: f64 = 0.5;

fn any_step(discretisation: Discretisation, rng: &mut ChaCha8Rng) -> ImuStep {
    ImuStep::new(&any_input(rng), &GRAVITY_W, DT_S, discretisation)
}

/// A tangent vector far from small: rotations of about 2 rad, 10 m/s and 10 m.
fn large(rng: &mut ChaCha8Rng) -> SVector<f64, 9> {
    let mut xi: SVector<f64, 9> = 10.0 * normal::<9, 1>(rng);
    let rotation = xi.fixed_rows::<3>(0) * 0.1;
    xi.fixed_rows_mut::<3>(0).copy_from(&rotation);
    xi
}

#[test]
fn free_motion_is_an_automorphism() {
    let mut rng = seeded(1);
    let phi = FreeMotion { dt_s: DT_S };
    for _ in 0..SAMPLES {
        let (a, b) = (any_pose(&mut rng), any_pose(&mut rng));
        let together = phi.apply(&(a * b));
        assert_same_pose(
            "phi(a b)",
            &together,
            &(phi.apply(&a) * phi.apply(&b)),
            1e-14,
        );
        let back = FreeMotion { dt_s: -DT_S }.apply(&phi.apply(&a));
        assert_same_pose("back", &back, &a, 1e-14);
    }
}

#[test]
fn the_differential_of_free_motion_is_exact_for_any_error() {
    let mut rng = seeded(2);
    let phi = FreeMotion { dt_s: DT_S };
    for _ in 0..SAMPLES {
        let (chi, xi) = (any_pose(&mut rng), large(&mut rng));
        let moved = phi.apply(&(chi * SE23::exp(&xi)));
        let expected = phi.apply(&chi) * SE23::exp(&(phi.differential() * xi));
        assert_same_pose("phi(chi exp(xi))", &moved, &expected, 1e-13);
    }
}

#[test]
fn a_large_left_error_propagates_linearly() {
    let mut rng = seeded(3);
    for discretisation in BOTH {
        for _ in 0..SAMPLES {
            let step = any_step(discretisation, &mut rng).step;
            let (chi, xi) = (any_pose(&mut rng), large(&mut rng));
            let moved = step.apply(&(chi * SE23::exp(&xi)));
            let expected = step.apply(&chi) * SE23::exp(&(step.left_jacobian() * xi));
            assert_same_pose("left error", &moved, &expected, 1e-13);
        }
    }
}

#[test]
fn a_large_right_error_propagates_linearly() {
    let mut rng = seeded(4);
    for discretisation in BOTH {
        for _ in 0..SAMPLES {
            let step = any_step(discretisation, &mut rng).step;
            let (chi, xi) = (any_pose(&mut rng), large(&mut rng));
            let moved = step.apply(&(SE23::exp(&xi) * chi));
            let expected = SE23::exp(&(step.right_jacobian() * xi)) * step.apply(&chi);
            assert_same_pose("right error", &moved, &expected, 1e-13);
        }
    }
}

/// A thousand steps, one error of 2 rad: the filter's linear error is still the true one.
#[test]
fn the_product_of_the_jacobians_carries_a_large_error_through_a_trajectory() {
    let mut rng = seeded(5);
    for discretisation in BOTH {
        let mut wrong = any_pose(&mut rng);
        let xi = SVector::from([1.6, -0.9, 0.8, 3.0, -2.0, 1.0, 40.0, -30.0, 5.0]);
        let mut truth = wrong * SE23::exp(&xi);
        let mut carried = xi;
        for _ in 0..1000 {
            let step = ImuStep::new(&any_input(&mut rng), &GRAVITY_W, 0.01, discretisation).step;
            wrong = step.apply(&wrong);
            truth = step.apply(&truth);
            carried = step.left_jacobian() * carried;
        }
        assert!(wrong.position.norm() > 100.0, "it moved");
        assert_same_pose(
            "after 1000 steps",
            &(wrong * SE23::exp(&carried)),
            &truth,
            1e-11,
        );
    }
}

#[test]
fn both_jacobians_match_numerical_ones() {
    let mut rng = seeded(6);
    for discretisation in BOTH {
        for _ in 0..20 {
            let step = any_step(discretisation, &mut rng).step;
            let chi = any_pose(&mut rng);
            let after = step.apply(&chi);
            let left = derivative_at_zero(|xi: &SVector<f64, 9>| {
                (after.inverse() * step.apply(&(chi * SE23::exp(xi)))).log()
            });
            assert_close("left", &step.left_jacobian(), &left, 1e-9);
            let right = derivative_at_zero(|xi: &SVector<f64, 9>| {
                (step.apply(&(SE23::exp(xi) * chi)) * after.inverse()).log()
            });
            assert_close("right", &step.right_jacobian(), &right, 1e-9);
        }
    }
}
