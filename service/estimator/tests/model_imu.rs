//! One IMU interval as a step: `zoh` against a fine integration of `R' = R [omega]x`, `v' = R a + g`,
//! `p' = v`, `euler` against [IS] (17), the input Jacobian against numerical differentiation.

mod common;

use common::{
    GRAVITY_W, any_input, any_pose, any_state, assert_close, assert_same_pose, assert_within,
    derivative_at_zero, parts, seeded,
};
use inekf::lie::{LieGroup, SE23, SO3, hat};
use inekf::model::{Discretisation, ImuInput, ImuStep, InertialState};
use nalgebra::{Matrix3, SVector, Vector3};

type Triple = (Matrix3<f64>, Vector3<f64>, Vector3<f64>);

/// Classical Runge-Kutta on the plain matrix differential equation; its error falls with `substeps^-4`.
fn integrate(start: Triple, input: &ImuInput, duration_s: f64, substeps: usize) -> Triple {
    let h = duration_s / substeps as f64;
    let omega = hat(&input.omega_b);
    let slope = |(r, v, _): &Triple| (r * omega, r * input.force_b + GRAVITY_W, *v);
    let along = |x: &Triple, k: &Triple, h: f64| (x.0 + k.0 * h, x.1 + k.1 * h, x.2 + k.2 * h);
    (0..substeps).fold(start, |x, _| {
        let k1 = slope(&x);
        let k2 = slope(&along(&x, &k1, 0.5 * h));
        let k3 = slope(&along(&x, &k2, 0.5 * h));
        let k4 = slope(&along(&x, &k3, h));
        let x = along(&x, &k1, h / 6.0);
        let x = along(&x, &k2, h / 3.0);
        let x = along(&x, &k3, h / 3.0);
        along(&x, &k4, h / 6.0)
    })
}

#[test]
fn zero_order_hold_is_the_exact_flow() {
    let mut rng = seeded(11);
    for dt_s in [0.005, 0.1, 1.0] {
        for _ in 0..5 {
            let (chi, input) = (any_pose(&mut rng), any_input(&mut rng));
            let step = ImuStep::new(&input, &GRAVITY_W, dt_s, Discretisation::ZeroOrderHold).step;
            let (r, v, p) = parts(&step.apply(&chi));
            let (r_fine, v_fine, p_fine) = integrate(parts(&chi), &input, dt_s, 2000);
            assert_close("attitude", &r, &r_fine, 1e-11);
            assert_close("velocity", &v, &v_fine, 1e-11);
            assert_close("position", &p, &p_fine, 1e-11);
        }
    }
}

/// A split interval is the whole one: what a fix between two samples relies on.
#[test]
fn two_parts_of_a_held_interval_make_the_whole() {
    let mut rng = seeded(12);
    for _ in 0..50 {
        let (chi, input) = (any_pose(&mut rng), any_input(&mut rng));
        let over = |chi: &SE23, dt_s| {
            ImuStep::new(&input, &GRAVITY_W, dt_s, Discretisation::ZeroOrderHold)
                .step
                .apply(chi)
        };
        assert_same_pose(
            "0.3 s + 0.5 s",
            &over(&over(&chi, 0.3), 0.5),
            &over(&chi, 0.8),
            1e-13,
        );
    }
}

#[test]
fn euler_is_the_scheme_of_the_paper() {
    let mut rng = seeded(13);
    let dt_s = 0.2;
    for _ in 0..50 {
        let (chi, input) = (any_pose(&mut rng), any_input(&mut rng));
        let after = ImuStep::new(&input, &GRAVITY_W, dt_s, Discretisation::Euler)
            .step
            .apply(&chi);
        let (r, v, p) = parts(&chi);
        let turned = r * SO3::exp(&(input.omega_b * dt_s)).matrix();
        assert_close("R Exp(dt omega)", &after.rotation.matrix(), &turned, 1e-14);
        let faster = v + dt_s * (r * input.force_b + GRAVITY_W);
        assert_close("v + dt (R a + g)", &after.velocity, &faster, 1e-14);
        assert_close("x + dt v", &after.position, &(p + dt_s * v), 1e-14);
    }
}

/// The sign convention: specific force, +9.81 on z when level and at rest.
#[test]
fn a_body_at_rest_stays_where_it_is() {
    let mut rng = seeded(14);
    for discretisation in [Discretisation::ZeroOrderHold, Discretisation::Euler] {
        let mut chi = any_pose(&mut rng);
        chi.velocity = Vector3::zeros();
        let at_rest = ImuInput {
            omega_b: Vector3::zeros(),
            force_b: chi.rotation.matrix().transpose() * Vector3::new(0.0, 0.0, 9.80665),
        };
        let after = ImuStep::new(&at_rest, &GRAVITY_W, 2.0, discretisation)
            .step
            .apply(&chi);
        assert_same_pose("at rest", &after, &chi, 1e-14);
    }
}

#[test]
fn the_input_jacobian_matches_a_numerical_one() {
    let mut rng = seeded(15);
    for discretisation in [Discretisation::ZeroOrderHold, Discretisation::Euler] {
        for dt_s in [0.01, 0.3, 1.0] {
            for _ in 0..10 {
                let input = any_input(&mut rng);
                let nominal = ImuStep::new(&input, &GRAVITY_W, dt_s, discretisation);
                let numerical = derivative_at_zero(|d: &SVector<f64, 6>| {
                    let disturbed = ImuInput {
                        omega_b: input.omega_b + d.fixed_rows::<3>(0),
                        force_b: input.force_b + d.fixed_rows::<3>(3),
                    };
                    let step = ImuStep::new(&disturbed, &GRAVITY_W, dt_s, discretisation).step;
                    (nominal.step.body.inverse() * step.body).log()
                });
                assert_close("B", &nominal.input_jacobian, &numerical, 1e-9);
            }
        }
    }
}

#[test]
fn the_input_jacobian_is_regular_without_rotation() {
    let input = ImuInput {
        omega_b: Vector3::zeros(),
        force_b: Vector3::new(1.0, -2.0, 9.0),
    };
    let dt_s = 0.1;
    let b = ImuStep::new(&input, &GRAVITY_W, dt_s, Discretisation::ZeroOrderHold).input_jacobian;
    let block = |row, column| b.fixed_view::<3, 3>(row, column).into_owned();
    assert_within(
        "rotation by rate",
        &block(0, 0),
        &(Matrix3::identity() * dt_s),
        1e-15,
    );
    assert_within(
        "velocity by force",
        &block(3, 3),
        &(Matrix3::identity() * dt_s),
        1e-15,
    );
    // Half of the turn acts on the force on average for the velocity, a third of it for the position.
    let tilt = -hat(&input.force_b);
    assert_within(
        "velocity by rate",
        &block(3, 0),
        &(tilt * (dt_s * dt_s / 2.0)),
        1e-15,
    );
    assert_within(
        "position by rate",
        &block(6, 0),
        &(tilt * (dt_s.powi(3) / 6.0)),
        1e-15,
    );
}

#[test]
fn the_biases_of_the_state_are_taken_off_the_sample() {
    let mut rng = seeded(16);
    let (state, measured) = (any_state(&mut rng), any_input(&mut rng));
    let step = state.imu_step(&measured, &GRAVITY_W, 0.1, Discretisation::ZeroOrderHold);
    let free = ImuInput {
        omega_b: measured.omega_b - state.gyro_bias,
        force_b: measured.force_b - state.accel_bias,
    };
    let expected = ImuStep::new(&free, &GRAVITY_W, 0.1, Discretisation::ZeroOrderHold);
    assert_eq!(step.step, expected.step);
    assert_eq!(step.input_jacobian, expected.input_jacobian);
    let unbiased = state
        .pose
        .imu_step(&measured, &GRAVITY_W, 0.1, Discretisation::ZeroOrderHold);
    assert_ne!(unbiased.step, expected.step);
}

#[test]
fn the_midpoint_is_the_mean() {
    let a = ImuInput {
        omega_b: Vector3::new(1.0, 2.0, 3.0),
        force_b: Vector3::new(0.0, -4.0, 8.0),
    };
    let b = ImuInput {
        omega_b: Vector3::new(3.0, 2.0, -3.0),
        force_b: Vector3::new(1.0, 4.0, 0.0),
    };
    let middle = a.midpoint(&b);
    assert_eq!(middle.omega_b, Vector3::new(2.0, 2.0, 0.0));
    assert_eq!(middle.force_b, Vector3::new(0.5, 0.0, 4.0));
}
