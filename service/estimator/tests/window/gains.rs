//! The window against the batch smoother, the Kalman filter, a dense solution, and itself computed anew.

use inekf::filter::{Belief, Covariance, Forster, Gtsam, Left, Right, Side, UpdateOptions, update};
use inekf::lie::SE23;
use inekf::model::{ImuNoise, InertialState, NavState, PositionObservation, VelocityObservation};
use inekf::smoother::{Fix, Jacobians, PriorForm, Window, WindowOptions};
use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};

use crate::beside_batch::BesideBatch;
use crate::common::{NOISE, assert_same_covariance, seeded};
use crate::drive::{ANISOTROPIC, Drive, ISOTROPIC, LEVER_ARM_B, second};

fn distance<G: InertialState<D>, const D: usize>(a: &G, b: &G) -> f64 {
    let off = Left::difference(a, b).norm();
    if off.is_nan() { f64::INFINITY } else { off }
}

/// A window that nothing leaves does what one iteration of the batch smoother does, at every fix.
fn assert_is_batch<G: InertialState<D>, S: Side, const D: usize>(
    covariance_w: Matrix3<f64>,
    jacobians: Jacobians,
) {
    let drive = Drive::<G, D>::new(12, 0.2, covariance_w, 11);
    let mut beside = BesideBatch::<G, S, _, D, 3>::new(&drive.first, jacobians);
    for (motion, fix) in &drive.seconds {
        beside.assert_same_step(motion, |_| *fix);
    }
}

#[test]
fn constant_gains_are_those_computed_anew() {
    assert_is_batch::<SE23, Left, 9>(ISOTROPIC, Jacobians::Frozen);
    assert_is_batch::<SE23, Gtsam, 9>(ISOTROPIC, Jacobians::Frozen);
}

#[test]
fn a_window_that_nothing_leaves_is_the_batch_smoother() {
    for jacobians in [Jacobians::Frozen, Jacobians::Exact] {
        assert_is_batch::<SE23, Left, 9>(ANISOTROPIC, jacobians);
        assert_is_batch::<SE23, Right, 9>(ISOTROPIC, jacobians);
        assert_is_batch::<SE23, Gtsam, 9>(ANISOTROPIC, jacobians);
        assert_is_batch::<SE23, Forster, 9>(ISOTROPIC, jacobians);
        assert_is_batch::<NavState, Left, 15>(ISOTROPIC, jacobians);
        assert_is_batch::<NavState, Left, 15>(ANISOTROPIC, jacobians);
        assert_is_batch::<NavState, Gtsam, 15>(ISOTROPIC, jacobians);
    }
}

/// Fixes of position and velocity, some missing, in a window that states leave: with noise that is the same in all
/// directions, and with noise that differs by one rounding and so is taken as it comes.
#[test]
fn constant_gains_survive_marginalisation_and_mixed_fixes() {
    let drive = Drive::<SE23, 9>::new(60, 0.2, ISOTROPIC, 12);
    let nearly = Matrix3::from_diagonal(&Vector3::new(0.25, 0.25, 0.25 * (1.0 + 4e-16)));
    assert_ne!(nearly, ISOTROPIC);
    let fix_of = |k: usize, covariance_w: Matrix3<f64>| -> Option<Fix> {
        let fix = drive.seconds[k].1;
        match k % 5 {
            2 => None,
            3 => Some(
                VelocityObservation {
                    velocity_w: fix.position_w * 0.1,
                    covariance_w: covariance_w * 100.0,
                }
                .into(),
            ),
            _ => Some(
                PositionObservation {
                    covariance_w,
                    ..fix
                }
                .into(),
            ),
        }
    };
    for (prior, iterations) in [(PriorForm::GroupMean, 1), (PriorForm::Linear, 2)] {
        let options = WindowOptions {
            prior,
            iterations,
            ..WindowOptions::new(10)
        };
        let windows = || Window::<SE23, Left, 9>::new(&drive.first, &options);
        // The third sees some fixes as they come and so changes between the two ways.
        let [mut constant, mut anew, mut either] = [windows(), windows(), windows()];
        for (k, (motion, _)) in drive.seconds.iter().enumerate() {
            let noises = [
                ISOTROPIC,
                nearly,
                if k % 13 == 0 { nearly } else { ISOTROPIC },
            ];
            let mut estimates = Vec::new();
            for (window, noise) in [&mut constant, &mut anew, &mut either]
                .into_iter()
                .zip(noises)
            {
                window.push(motion);
                if let Some(fix) = fix_of(k, noise) {
                    window.update(fix).expect("an update");
                }
                let states: Vec<SE23> = window.states().copied().collect();
                estimates.push((states, window.newest().covariance));
            }
            for (states, covariance) in &estimates[1..] {
                for (actual, expected) in states.iter().zip(&estimates[0].0) {
                    let off = distance(actual, expected);
                    assert!(off < 1e-9, "{prior:?}, fix {k}: off by {off:e}");
                }
                let (actual, expected) = (covariance.matrix(), estimates[0].1.matrix());
                assert_same_covariance("P", actual, expected, 1e-9);
            }
        }
    }
}

/// Attitude known and kept without noise: velocity and position are linear, and the newest state is the filter's.
#[test]
fn in_the_linear_case_the_newest_state_is_the_kalman_filters() {
    let mut drive = Drive::<SE23, 9>::new(0, 0.2, ANISOTROPIC, 13);
    let steady = ImuNoise {
        gyro_psd: 0.0,
        ..NOISE
    };
    let mut rng = seeded(14);
    let mut p = *drive.first.covariance.matrix();
    p.fixed_view_mut::<3, 9>(0, 0).fill(0.0);
    p.fixed_view_mut::<9, 3>(0, 0).fill(0.0);
    drive.first = Belief::new(drive.first.mean, Covariance::from_upper(p));
    let motions: Vec<_> = (0..15)
        .map(|_| second(&drive.first.mean, &steady, &mut rng))
        .collect();
    for capacity in [1, 2, 6] {
        let mut window = Window::<SE23, Left, 9>::new(&drive.first, &WindowOptions::new(capacity));
        let mut filter = drive.first;
        for (k, motion) in motions.iter().enumerate() {
            filter = motion.carry(&filter);
            let fix = PositionObservation {
                position_w: filter.mean.position + Vector3::new(0.3, -0.2, 0.1) * (k as f64).sin(),
                covariance_w: ANISOTROPIC,
                lever_arm_b: LEVER_ARM_B,
            };
            update(&mut filter, &fix, &UpdateOptions::PLAIN).expect("an update of the filter");
            let left = window.push(motion);
            assert_eq!(left.is_some(), k + 1 >= capacity);
            window.update(fix).expect("an update of the window");
            let newest = window.newest();
            let off = distance(&newest.mean, &filter.mean);
            assert!(off < 1e-9, "window {capacity}, fix {k}: off by {off:e}");
            let off = newest.covariance.matrix() - filter.covariance.matrix();
            assert!(
                off.iter().all(|entry| entry.abs() < 1e-10),
                "P off by {off}"
            );
        }
    }
}

/// Those of all states, given all fixes, from the joint covariance of the whole chain as it was linearised last.
fn assert_covariances_are_joint<G: InertialState<D>, const D: usize>(states: usize) {
    let drive = Drive::<G, D>::new(states - 1, 0.2, ISOTROPIC, 15);
    let mut window = Window::<G, Left, D>::new(&drive.first, &WindowOptions::new(states));
    let mut linearised: Vec<G> = Vec::new();
    for (motion, fix) in &drive.seconds {
        window.push(motion);
        linearised = window.states().copied().collect();
        window.update(*fix).expect("an update");
    }

    let n = D * states;
    let mut joint = DMatrix::<f64>::zeros(n, n);
    joint
        .view_mut((0, 0), (D, D))
        .copy_from(drive.first.covariance.matrix());
    for (i, (motion, _)) in drive.seconds.iter().enumerate() {
        let f = motion.transition(&linearised[i]).1;
        let f = DMatrix::from_column_slice(D, D, f.as_slice());
        let end = D * (i + 1);
        let across = &f * joint.view((end - D, 0), (D, end));
        let q = motion.noise().matrix();
        let q = DMatrix::from_column_slice(D, D, q.as_slice());
        let own = across.view((0, end - D), (D, D)) * f.transpose() + q;
        joint.view_mut((end, 0), (D, end)).copy_from(&across);
        joint
            .view_mut((0, end), (end, D))
            .copy_from(&across.transpose());
        joint.view_mut((end, end), (D, D)).copy_from(&own);
    }
    let m = 3 * (states - 1);
    let mut h = DMatrix::<f64>::zeros(m, n);
    for i in 1..states {
        let (row, column) = (3 * (i - 1), D * i);
        let arm = LEVER_ARM_B.cross_matrix();
        h.view_mut((row, column), (3, 3)).copy_from(&-arm);
        h.view_mut((row, column + 6), (3, 3))
            .copy_from(&Matrix3::identity());
    }
    let s = &h * &joint * h.transpose() + DMatrix::identity(m, m) * ISOTROPIC[(0, 0)];
    let k = &joint * h.transpose() * s.try_inverse().expect("positive definite");
    let given_all = &joint - k * h * &joint;

    let mut seen = 0;
    window.covariances(&mut |i, covariance| {
        let expected: SMatrix<f64, D, D> = given_all.fixed_view::<D, D>(D * i, D * i).into();
        assert_same_covariance("smoothed", covariance.matrix(), &expected, 1e-7);
        assert_eq!(
            window.smoothed(i).map(|state| state.covariance),
            Some(*covariance)
        );
        seen += 1;
    });
    assert_eq!(seen, states);
    assert_eq!(window.smoothed(states - 1), Some(window.newest()));
    assert_eq!(window.smoothed(states), None);
    assert_eq!(window.smoothed(0), Some(window.oldest()));
}

#[test]
fn smoothed_covariances_are_those_of_the_joint_distribution() {
    assert_covariances_are_joint::<SE23, 9>(8);
    assert_covariances_are_joint::<NavState, 15>(8);
}
