//! The H-infinity rule against its definition with inverses, and the gamma that it refuses.

mod common;

use common::{any_belief, any_pose, assert_close, assert_within, noise_of_scale, normal, seeded};
use inekf::filter::{
    Belief, Covariance, HInfinity, HInfinityGain, Left, Right, UpdateError, UpdateOptions, update,
    update_with,
};
use inekf::lie::SE23;
use inekf::model::{Observation, PositionObservation};
use nalgebra::{SMatrix, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

type Filter = Belief<SE23, Left, 9>;

fn any_case(rng: &mut ChaCha8Rng) -> (Filter, PositionObservation) {
    let pose = any_pose(rng);
    let fix = PositionObservation {
        position_w: pose.position + normal::<3, 1>(rng),
        covariance_w: noise_of_scale(&Vector3::new(1.0, 2.0, 3.0), rng),
        lever_arm_b: normal(rng),
    };
    (any_belief(pose, 0.1, rng), fix)
}

/// `P^-1 + H^T N^-1 H`.
fn information(belief: &Filter, fix: &PositionObservation) -> SMatrix<f64, 9, 9> {
    let h: SMatrix<f64, 3, 9> = fix.left_jacobian(&belief.mean);
    let n_inverse = fix.covariance_w.try_inverse().expect("regular");
    belief.covariance.matrix().try_inverse().expect("regular") + h.transpose() * n_inverse * h
}

#[test]
fn it_is_the_definition() {
    let mut rng = seeded(601);
    for _ in 0..30 {
        let (prior, fix) = any_case(&mut rng);
        let information = information(&prior, &fix);
        let gamma = 0.5 * information.symmetric_eigenvalues().min();
        let widened = information - SMatrix::<f64, 9, 9>::identity() * gamma;
        let p_after = widened.try_inverse().expect("regular");
        let h: SMatrix<f64, 3, 9> = fix.left_jacobian(&prior.mean);
        let k = p_after * h.transpose() * fix.covariance_w.try_inverse().expect("regular");
        let z: Vector3<f64> = fix.residual(&prior.mean);
        let mut posterior = prior;
        let rule = HInfinity {
            gamma,
            gain: HInfinityGain::Widened,
        };
        let correction =
            update_with(&mut posterior, &fix, &rule, &UpdateOptions::PLAIN).expect("feasible");
        assert_close("xi", &correction.xi, &(k * z), 1e-9);
        assert_within(
            "P",
            posterior.covariance.matrix(),
            &p_after,
            1e-9 * p_after.amax(),
        );

        let mut with_kalman = prior;
        let rule = HInfinity {
            gamma,
            gain: HInfinityGain::Kalman,
        };
        let of_kalman =
            update_with(&mut with_kalman, &fix, &rule, &UpdateOptions::PLAIN).expect("feasible");
        let plain = update(&mut prior.clone(), &fix, &UpdateOptions::PLAIN).expect("an update");
        assert_close("Kalman", &of_kalman.xi, &plain.xi, 1e-12);
        assert_eq!(with_kalman.covariance, posterior.covariance);
    }
}

#[test]
fn gamma_of_zero_is_kalman() {
    let (prior, fix) = any_case(&mut seeded(602));
    let (mut a, mut b) = (prior.to_right(), prior.to_right());
    let rule = HInfinity {
        gamma: 0.0,
        gain: HInfinityGain::Widened,
    };
    update_with(&mut a, &fix, &rule, &UpdateOptions::PLAIN).expect("feasible");
    update(&mut b, &fix, &UpdateOptions::PLAIN).expect("an update");
    let same: (Belief<SE23, Right, 9>, _) = (a, b);
    // Not bit for bit: the Kalman rule subtracts W D^-1 W^T, any other takes Joseph's form.
    assert_close(
        "P",
        same.0.covariance.matrix(),
        same.1.covariance.matrix(),
        1e-14,
    );
    assert_close(
        "position",
        &same.0.mean.position,
        &same.1.mean.position,
        1e-14,
    );
}

#[test]
fn an_infeasible_gamma_is_refused_with_its_bound() {
    let mut rng = seeded(603);
    for _ in 0..20 {
        let (prior, fix) = any_case(&mut rng);
        let exact = information(&prior, &fix).symmetric_eigenvalues().min();
        let attempt = |gamma: f64| {
            let mut belief = prior;
            let rule = HInfinity {
                gamma,
                gain: HInfinityGain::Widened,
            };
            let outcome = update_with(&mut belief, &fix, &rule, &UpdateOptions::PLAIN);
            if outcome.is_err() {
                assert_eq!(belief, prior, "a refusal changes nothing");
            }
            outcome
        };
        let Err(UpdateError::InfeasibleGamma { bound }) = attempt(2.0 * exact) else {
            panic!("gamma is twice its bound");
        };
        assert!((bound / exact - 1.0).abs() < 1e-6, "{bound} for {exact}");
        assert!(attempt(0.99 * bound).is_ok());
        assert!(attempt(1.01 * bound).is_err());
        let text = UpdateError::InfeasibleGamma { bound }.to_string();
        assert!(text.contains(&bound.to_string()), "{text}");
    }
}

#[test]
fn a_known_state_stays_known() {
    let (prior, fix) = any_case(&mut seeded(604));
    let certain = Filter::new(prior.mean, Covariance::from_variances(&SVector::zeros()));
    let mut belief = certain;
    let rule = HInfinity {
        gamma: 1e6,
        gain: HInfinityGain::Widened,
    };
    update_with(&mut belief, &fix, &rule, &UpdateOptions::PLAIN).expect("nothing to widen");
    assert_eq!(belief.covariance, certain.covariance);
}
