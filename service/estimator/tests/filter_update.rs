//! One pass of the update against the textbook, computed densely: gain from an inverse, covariance in
//! Joseph's form. And what must not happen: asymmetry, a lost covariance, a belief changed by a refusal.

mod common;

use common::{
    GRAVITY_W, any_belief, any_input, any_state, assert_close, assert_same_covariance,
    assert_within, noise_of_scale, normal, seeded, sigmas,
};
use inekf::filter::{
    Belief, Covariance, Gate, Left, Right, Side, UpdateError, UpdateOptions, Verdict, propagate,
    update,
};
use inekf::lie::{LieGroup, SE23, SO3};
use inekf::model::{
    Discretisation, HeadingObservation, ImuNoise, ImuStep, NavState, Observation,
    PositionObservation, VelocityObservation,
};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

fn dense<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, a.as_slice())
}

/// `(I - K H) P (I - K H)^T + K N K^T`.
fn joseph(p: &DMatrix<f64>, h: &DMatrix<f64>, n: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let s = h * p * h.transpose() + n;
    let k = p * h.transpose() * s.try_inverse().expect("positive definite");
    let kept = DMatrix::identity(p.nrows(), p.nrows()) - &k * h;
    let after = &kept * p * kept.transpose() + &k * n * k.transpose();
    (k, after)
}

fn assert_textbook<G, S, O, const D: usize, const M: usize>(
    what: &str,
    prior: &Belief<G, S, D>,
    observation: &O,
) where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
{
    let h = dense(&(observation.left_jacobian(&prior.mean) * S::to_left(&prior.mean)));
    let (p, n) = (
        dense(prior.covariance.matrix()),
        dense(&observation.noise()),
    );
    let z = DVector::from_column_slice(observation.residual(&prior.mean).as_slice());
    let (k, p_after) = joseph(&p, &h, &n);
    let xi = SVector::<f64, D>::from_column_slice((&k * &z).as_slice());
    let s = &h * &p * h.transpose() + &n;
    let nis = (z.transpose() * s.try_inverse().expect("positive definite") * &z)[0];

    let mut posterior = *prior;
    let correction = update(&mut posterior, observation, &UpdateOptions::PLAIN).expect("an update");
    assert_eq!(
        (correction.verdict, correction.iterations),
        (Verdict::Accepted, 1)
    );
    assert_close(what, &correction.xi, &xi, 1e-12);
    assert!(
        (correction.nis / nis - 1.0).abs() < 1e-12,
        "{what}: NIS {} for {nis}",
        correction.nis
    );
    let gap = S::difference(&S::retract(&prior.mean, &xi), &posterior.mean);
    assert_close(what, &gap, &SVector::zeros(), 1e-11);
    let expected = SMatrix::<f64, D, D>::from_column_slice(p_after.as_slice());
    assert_same_covariance(what, posterior.covariance.matrix(), &expected, 1e-12);
}

fn any_fix(chi: &SE23, sigma_m: f64, rng: &mut ChaCha8Rng) -> PositionObservation {
    let lever_arm_b = normal(rng);
    PositionObservation {
        position_w: chi.position + chi.rotation.rotate(&lever_arm_b) + 2.0 * normal::<3, 1>(rng),
        covariance_w: noise_of_scale(&Vector3::repeat(sigma_m), rng),
        lever_arm_b,
    }
}

#[test]
fn one_pass_is_the_textbook_update() {
    let mut rng = seeded(81);
    for _ in 0..20 {
        let state = any_state(&mut rng);
        let fix = any_fix(&state.pose, 1.0, &mut rng);
        let velocity = VelocityObservation {
            velocity_w: state.pose.velocity + normal::<3, 1>(&mut rng),
            covariance_w: noise_of_scale(&Vector3::new(0.1, 0.2, 0.3), &mut rng),
        };
        let heading = HeadingObservation {
            heading: state.pose.rotation.heading_rad() + 0.1,
            sigma: 0.05,
        };
        let pose_left: Belief<SE23, Left, 9> = any_belief(state.pose, 0.2, &mut rng);
        let left: Belief<NavState, Left, 15> = any_belief(state, 0.2, &mut rng);
        assert_textbook("position, left, 9", &pose_left, &fix);
        assert_textbook("position, right, 9", &pose_left.to_right(), &fix);
        assert_textbook("position, left, 15", &left, &fix);
        assert_textbook("position, right, 15", &left.to_right(), &fix);
        assert_textbook("velocity, left, 15", &left, &velocity);
        assert_textbook("velocity, right, 15", &left.to_right(), &velocity);
        assert_textbook("heading, left, 15", &left, &heading);
        assert_textbook("heading, right, 9", &pose_left.to_right(), &heading);
    }
}

/// Ten thousand fixes of 1 cm on a body that does not move, the prior known to metres: the covariance shrinks
/// by seven orders of magnitude, stays exactly symmetric, and is the one that Joseph's form carries along.
fn assert_stays_symmetric<S: Side>(tolerance: f64) {
    const SIGMA_M: f64 = 0.01;
    let mut rng = seeded(82);
    let truth = any_state(&mut rng);
    let mut belief: Belief<NavState, S, 15> = any_belief(truth, 0.05, &mut rng);
    let mut p = dense(belief.covariance.matrix());
    for k in 0..10_000 {
        let fix = PositionObservation {
            position_w: truth.pose.position + SIGMA_M * normal::<3, 1>(&mut rng),
            covariance_w: Matrix3::identity() * (SIGMA_M * SIGMA_M),
            lever_arm_b: Vector3::zeros(),
        };
        let h = Observation::<NavState, 15, 3>::left_jacobian(&fix, &belief.mean)
            * S::to_left(&belief.mean);
        p = joseph(&p, &dense(&h), &dense(&fix.covariance_w)).1;
        update(&mut belief, &fix, &UpdateOptions::PLAIN).expect("an update");
        let actual = belief.covariance.matrix();
        assert_eq!(actual, &actual.transpose());
        if k % 500 == 0 || k == 9_999 {
            let expected = SMatrix::<f64, 15, 15>::from_column_slice(p.as_slice());
            assert_same_covariance(&format!("fix {k}"), actual, &expected, tolerance);
        }
    }
    let sigma_m = belief.left_covariance().matrix()[(6, 6)].sqrt();
    assert!(
        (sigma_m / (SIGMA_M / 100.0) - 1.0).abs() < 0.01,
        "one hundredth: {sigma_m}"
    );
}

#[test]
fn ten_thousand_precise_fixes_keep_the_left_covariance() {
    assert_stays_symmetric::<Left>(1e-11);
}

/// The world-frame covariance of the position, 50 m from the origin, is all but that of the attitude: its
/// smallest eigenvalue, in units of its variances, falls to 1e-9 and multiplies the rounding of either form.
#[test]
fn ten_thousand_precise_fixes_keep_the_right_covariance() {
    assert_stays_symmetric::<Right>(1e-7);
}

/// Nothing known to a thousand kilometres, then a fix of a millimetre: 18 orders of magnitude in variance,
/// of which `P - K H P` would keep none.
#[test]
fn a_fix_far_more_precise_than_the_prior_counts() {
    let mut rng = seeded(83);
    for (options, tolerance) in [
        (UpdateOptions::PLAIN, 1e-6),
        // The transport over 400 km cancels the position's share in the attitude, 1e12 times its own.
        (UpdateOptions::ITERATED, 1e-3),
    ] {
        let truth = any_state(&mut rng);
        let mut scale = sigmas::<15>(0.01);
        scale.fixed_rows_mut::<3>(6).fill(1e6);
        let variances = scale.component_mul(&scale);
        let mut belief: Belief<NavState, Left, 15> =
            Belief::new(truth, Covariance::from_variances(&variances));
        belief.mean.pose.position += Vector3::new(3e5, -2e5, 1e5);
        let fix = PositionObservation {
            position_w: truth.pose.position,
            covariance_w: noise_of_scale(&Vector3::repeat(1e-3), &mut rng),
            lever_arm_b: Vector3::zeros(),
        };
        update(&mut belief, &fix, &options).expect("an update");
        assert_close(
            "position",
            &belief.mean.pose.position,
            &truth.pose.position,
            1e-9,
        );
        let r = belief.mean.pose.rotation.matrix();
        let p = belief
            .covariance
            .matrix()
            .fixed_view::<3, 3>(6, 6)
            .into_owned();
        assert_same_covariance(
            "covariance",
            &(r * p * r.transpose()),
            &fix.covariance_w,
            tolerance,
        );
    }
}

/// A covariance `B B^T` of rank r is a prior `xi = B c`, c standard normal: the same update in r
/// coordinates, in information form.
#[test]
fn a_singular_prior_is_updated_within_its_range() {
    let mut rng = seeded(84);
    for rank in 1..=4 {
        for _ in 0..20 {
            let state = any_state(&mut rng);
            let full: SMatrix<f64, 15, 4> =
                SMatrix::from_diagonal(&sigmas::<15>(0.1)) * normal::<15, 4>(&mut rng);
            let b = dense(&full).columns(0, rank).into_owned();
            let p = SMatrix::<f64, 15, 15>::from_column_slice((&b * b.transpose()).as_slice());
            let prior: Belief<NavState, Left, 15> = Belief::new(state, Covariance::from_upper(p));
            let fix = any_fix(&state.pose, 0.3, &mut rng);

            let hb = dense(&Observation::<NavState, 15, 3>::left_jacobian(&fix, &state)) * &b;
            let weight = dense(&fix.covariance_w.try_inverse().expect("positive definite"));
            let information = DMatrix::identity(rank, rank) + hb.transpose() * &weight * &hb;
            let c_covariance = information.try_inverse().expect("positive definite");
            let z = Observation::<NavState, 15, 3>::residual(&fix, &state);
            let c =
                &c_covariance * hb.transpose() * &weight * DVector::from_column_slice(z.as_slice());

            let mut posterior = prior;
            let correction =
                update(&mut posterior, &fix, &UpdateOptions::PLAIN).expect("an update");
            let xi = SVector::<f64, 15>::from_column_slice((&b * c).as_slice());
            assert_close("correction", &correction.xi, &xi, 1e-10);
            let p = SMatrix::<f64, 15, 15>::from_column_slice(
                (&b * c_covariance * b.transpose()).as_slice(),
            );
            assert_same_covariance("covariance", posterior.covariance.matrix(), &p, 1e-11);
        }
    }
}

/// Only the heading unknown and no process noise: rank one for ever. No fix is refused because a variance
/// rounds below zero, and the error stays in the one direction left to it.
#[test]
fn a_prior_of_rank_one_survives_thousands_of_iterated_fixes() {
    let mut rng = seeded(85);
    let quiet = ImuNoise {
        gyro_psd: 0.0,
        accel_psd: 0.0,
        gyro_bias_psd: 0.0,
        accel_bias_psd: 0.0,
    };
    let zoh = Discretisation::ZeroOrderHold;
    for (roll, pitch) in [(0.0, 0.0), (0.3, 0.0), (0.0, -0.2), (0.1, 0.2)] {
        let mut truth = SE23 {
            rotation: SO3::from_roll_pitch_heading(roll, pitch, 0.4),
            ..SE23::identity()
        };
        let mut vertical = SVector::<f64, 9>::zeros();
        vertical
            .fixed_rows_mut::<3>(0)
            .copy_from(&truth.rotation.inverse_rotate(&Vector3::z()));
        let mut belief: Belief<SE23, Left, 9> = Belief::new(
            truth * SE23::exp(&(-0.7 * vertical)),
            Covariance::from_upper(0.49 * vertical * vertical.transpose()),
        );
        for _ in 0..5_000 {
            let measured = any_input(&mut rng);
            truth = ImuStep::new(&measured, &GRAVITY_W, 0.01, zoh)
                .step
                .apply(&truth);
            belief = propagate(&belief, &measured, &GRAVITY_W, 0.01, zoh, &quiet);
            let fix = PositionObservation {
                position_w: truth.position + 0.1 * normal::<3, 1>(&mut rng),
                covariance_w: Matrix3::identity() * 0.01,
                lever_arm_b: Vector3::zeros(),
            };
            update(&mut belief, &fix, &UpdateOptions::ITERATED).expect("an update");
        }
        let xi = Left::difference(&belief.mean, &truth);
        let eigen = belief.covariance.matrix().symmetric_eigen();
        let largest = eigen.eigenvalues.imax();
        let direction = eigen.eigenvectors.column(largest).into_owned();
        let along = direction.dot(&xi);
        let deviations = along / eigen.eigenvalues[largest].sqrt();
        assert!(
            deviations.abs() < 4.0,
            "off by {deviations} standard deviations"
        );
        assert_within(
            "across",
            &(xi - direction * along),
            &SVector::zeros(),
            1e-5 * along.abs(),
        );
    }
}

/// A belief, and a fix far from it.
fn doubtful() -> (Belief<NavState, Left, 15>, PositionObservation) {
    let mut rng = seeded(86);
    let belief = any_belief(any_state(&mut rng), 0.1, &mut rng);
    let mut fix = any_fix(&belief.mean.pose, 0.5, &mut rng);
    fix.position_w.x += 30.0;
    (belief, fix)
}

#[test]
fn beyond_the_gate_nothing_moves() {
    let (prior, fix) = doubtful();
    let mut open = prior;
    let nis = update(&mut open, &fix, &UpdateOptions::ITERATED)
        .expect("an update")
        .nis;
    for plain in [UpdateOptions::PLAIN, UpdateOptions::ITERATED] {
        let mut belief = prior;
        let closed = UpdateOptions {
            gate: Gate::at(nis * (1.0 - 1e-12)),
            ..plain
        };
        let refused = update(&mut belief, &fix, &closed).expect("a verdict");
        assert_eq!(
            (refused.verdict, refused.nis, refused.iterations),
            (Verdict::Gated, nis, 0)
        );
        assert_eq!(refused.xi, SVector::<f64, 15>::zeros());
        assert_eq!(belief, prior);
        let just_open = UpdateOptions {
            gate: Gate::at(nis),
            ..plain
        };
        let accepted = update(&mut belief, &fix, &just_open).expect("an update");
        assert_eq!((accepted.verdict, accepted.nis), (Verdict::Accepted, nis));
        assert_ne!(belief, prior);
    }
}

#[test]
fn what_cannot_be_computed_is_an_error_and_nothing_moves() {
    let (prior, fix) = doubtful();
    let with_noise = |covariance_w| PositionObservation {
        covariance_w,
        ..fix
    };
    let indefinite = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
    let mut unbounded = fix;
    unbounded.position_w.y = f64::INFINITY;
    let mut unknown = fix;
    unknown.position_w.z = f64::NAN;
    let no_variance = UpdateError::InnovationNotPositiveDefinite;
    for (faulty, expected) in [
        (with_noise(indefinite), no_variance),
        (with_noise(-Matrix3::identity()), no_variance),
        (with_noise(Matrix3::zeros()), no_variance),
        (with_noise(Matrix3::repeat(f64::NAN)), no_variance),
        (unbounded, UpdateError::NotFinite),
        (unknown, UpdateError::NotFinite),
    ] {
        for options in [UpdateOptions::PLAIN, UpdateOptions::ITERATED] {
            let mut belief = prior;
            assert_eq!(
                update(&mut belief, &faulty, &options),
                Err(expected),
                "{faulty:?}"
            );
            assert_eq!(belief, prior);
        }
    }
}

#[test]
fn errors_name_the_remedy() {
    for error in [
        UpdateError::InnovationNotPositiveDefinite,
        UpdateError::NotFinite,
    ] {
        assert!(
            error.to_string().contains("check the measurement"),
            "{error}"
        );
    }
}
