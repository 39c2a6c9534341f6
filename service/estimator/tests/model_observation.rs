//! The sensors: every Jacobian against a numerical one, for states with and without biases, and residuals
//! written out.

mod common;

use std::f64::consts::PI;

use common::{
    any_pose, any_state, assert_close, assert_within, derivative_at_zero, noise_of_scale, normal,
    seeded,
};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{
    HeadingObservation, NavState, Observation, PositionObservation, VelocityObservation,
};
use nalgebra::{SVector, Vector3};

/// `z(chi exp(xi)) = z(chi) - H xi` to first order.
fn assert_jacobian<G, O, const D: usize, const M: usize>(what: &str, observation: &O, chi: &G)
where
    G: LieGroup<D>,
    O: Observation<G, D, M>,
{
    let numerical =
        derivative_at_zero(|xi: &SVector<f64, D>| -observation.residual(&chi.compose(&G::exp(xi))));
    assert_close(what, &observation.left_jacobian(chi), &numerical, 1e-9);
}

#[test]
fn a_position_is_that_of_the_antenna() {
    let mut rng = seeded(41);
    for _ in 0..50 {
        let state = any_state(&mut rng);
        let fix = PositionObservation {
            position_w: 50.0 * normal::<3, 1>(&mut rng),
            covariance_w: noise_of_scale(&Vector3::new(1.0, 2.0, 3.0), &mut rng),
            lever_arm_b: normal(&mut rng),
        };
        assert_jacobian::<SE23, _, 9, 3>("position, 9 states", &fix, &state.pose);
        assert_jacobian::<NavState, _, 15, 3>("position, 15 states", &fix, &state);
        let antenna_w = state.pose.position + state.pose.rotation.matrix() * fix.lever_arm_b;
        let residual = Observation::<SE23, 9, 3>::residual(&fix, &state.pose);
        assert_close("residual", &residual, &(fix.position_w - antenna_w), 1e-14);
        assert_eq!(
            Observation::<NavState, 15, 3>::noise(&fix),
            fix.covariance_w
        );
    }
}

#[test]
fn a_velocity_is_that_of_the_imu() {
    let mut rng = seeded(42);
    for _ in 0..50 {
        let state = any_state(&mut rng);
        let observed = VelocityObservation {
            velocity_w: 10.0 * normal::<3, 1>(&mut rng),
            covariance_w: noise_of_scale(&Vector3::new(0.1, 0.2, 0.3), &mut rng),
        };
        assert_jacobian::<SE23, _, 9, 3>("velocity, 9 states", &observed, &state.pose);
        assert_jacobian::<NavState, _, 15, 3>("velocity, 15 states", &observed, &state);
        let residual = Observation::<NavState, 15, 3>::residual(&observed, &state);
        assert_eq!(residual, observed.velocity_w - state.pose.velocity);
        assert_eq!(
            Observation::<NavState, 15, 3>::noise(&observed),
            observed.covariance_w
        );
    }
}

/// In every attitude with a heading: level, tilted to 80 degrees, upside down, and with the heading at the
/// seam of the angle.
#[test]
fn a_heading_is_that_of_the_forward_axis() {
    let mut rng = seeded(43);
    let headings = [0.0, 1.0, -2.5, PI - 1e-4, -PI + 1e-4, PI / 2.0];
    for heading in headings {
        for (roll, pitch) in [(0.0, 0.0), (0.4, -0.7), (-1.2, 1.1), (2.9, 0.3), (0.2, 1.4)] {
            let mut state = any_state(&mut rng);
            state.pose.rotation = SO3::from_roll_pitch_heading(roll, pitch, heading);
            let observed = HeadingObservation {
                heading: heading + 0.3,
                sigma: 0.1,
            };
            assert_jacobian::<SE23, _, 9, 1>("heading, 9 states", &observed, &state.pose);
            assert_jacobian::<NavState, _, 15, 1>("heading, 15 states", &observed, &state);
            let residual = Observation::<SE23, 9, 1>::residual(&observed, &state.pose);
            assert!(
                (residual[0] - 0.3).abs() < 1e-13,
                "residual {}",
                residual[0]
            );
            let noise = Observation::<SE23, 9, 1>::noise(&observed);
            assert!((noise[0] - 0.01).abs() < 1e-16);
        }
    }
}

/// Level, a heading observes the turn about the vertical and nothing else.
#[test]
fn a_level_heading_is_the_turn_about_z() {
    let pose = SE23 {
        rotation: SO3::from_roll_pitch_heading(0.0, 0.0, 2.0),
        ..any_pose(&mut seeded(44))
    };
    let observed = HeadingObservation {
        heading: 0.0,
        sigma: 0.1,
    };
    let h = Observation::<SE23, 9, 1>::left_jacobian(&observed, &pose);
    let expected = SVector::<f64, 9>::ith(2, 1.0).transpose();
    assert_within("H", &h, &expected, 1e-15);
}

/// The shorter way round, for measured headings of any winding.
#[test]
fn a_heading_residual_is_wrapped() {
    let at = |heading: f64| SE23 {
        rotation: SO3::from_roll_pitch_heading(0.1, -0.2, heading),
        ..SE23::identity()
    };
    let residual = |measured: f64, heading: f64| {
        let observed = HeadingObservation {
            heading: measured,
            sigma: 1.0,
        };
        Observation::<SE23, 9, 1>::residual(&observed, &at(heading))[0]
    };
    for (measured, heading, expected) in [
        (3.1, -3.1, 6.2 - 2.0 * PI),
        (-3.1, 3.1, 2.0 * PI - 6.2),
        (-3.1, -3.0, -0.1),
        (0.5 + 4.0 * PI, 0.2, 0.3),
        (0.5 - 6.0 * PI, 0.2, 0.3),
        (1.5, -1.5, 3.0),
    ] {
        let actual = residual(measured, heading);
        assert!(
            (actual - expected).abs() < 1e-13,
            "{measured} at {heading}: {actual}, expected {expected}"
        );
    }
}

/// Pointing straight up there is no heading: nothing is learnt, and nothing breaks.
#[test]
fn straight_up_a_heading_says_nothing() {
    let pose = SE23 {
        // A turn about y by -pi/2, from exact parts: the forward axis is exactly vertical.
        rotation: SO3::from_quaternion_xyzw([0.0, -1.0, 0.0, 1.0]).expect("a rotation"),
        ..SE23::identity()
    };
    assert!(pose.rotation.matrix()[(2, 0)] > 1.0 - 1e-15);
    let observed = HeadingObservation {
        heading: 1.0,
        sigma: 0.1,
    };
    assert_eq!(
        Observation::<SE23, 9, 1>::left_jacobian(&observed, &pose),
        SVector::<f64, 9>::zeros().transpose()
    );
    assert!(Observation::<SE23, 9, 1>::residual(&observed, &pose)[0].is_finite());
}
