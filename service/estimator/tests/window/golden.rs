//! Against the golden vectors, to the tolerances that they come with: R 1e-10, v 1e-9 m/s, x 1e-8 m, P 1e-10 relative.

use inekf::filter::{
    Covariance, Forster, Gtsam, Left, Side, UpdateOptions, Verdict, propagate, update,
};
use inekf::lie::SE23;
use inekf::model::Discretisation::{self, Euler, ZeroOrderHold};
use inekf::smoother::{Jacobians, PriorForm, Window, WindowOptions};
use nalgebra::Matrix3;

use crate::align_straight::{DT_S, GRAVITY_W, first, fixes, motions, noise, rows, samples, vector};

const ROTATION: f64 = 1e-10;
const VELOCITY: f64 = 1e-9;
const POSITION: f64 = 1e-8;
const COVARIANCE: f64 = 1e-10;

/// `row`: R by rows, v, x.
fn assert_same_pose(chi: &SE23, row: &[f64], when: &str) {
    let rotation = (chi.rotation.matrix() - Matrix3::from_row_slice(&row[..9])).abs();
    let velocity = (chi.velocity - vector(&row[9..])).abs();
    let position = (chi.position - vector(&row[12..])).abs();
    let within = |entries: &[f64], bound: f64| entries.iter().all(|entry| *entry < bound);
    assert!(
        within(rotation.as_slice(), ROTATION),
        "{when}: R off by {rotation}"
    );
    assert!(
        within(velocity.as_slice(), VELOCITY),
        "{when}: v off by {velocity}"
    );
    assert!(
        within(position.as_slice(), POSITION),
        "{when}: x off by {position}"
    );
}

/// `upper`: the upper triangle by rows.
fn assert_same_covariance(covariance: &Covariance<9>, upper: &[f64], when: &str) {
    let expected = Covariance::<9>::from_upper_triangle(upper).expect("45 entries");
    let off = (covariance.matrix() - expected.matrix()).abs();
    let bound = COVARIANCE * expected.matrix().amax();
    assert!(
        off.iter().all(|entry| *entry < bound),
        "{when}: P off by {off}"
    );
}

fn assert_preintegration(discretisation: Discretisation, name: &str) {
    let expected = rows(name);
    assert_eq!(expected.len(), 40);
    for (motion, row) in motions(discretisation).iter().zip(&expected) {
        let when = format!("{name}, interval {}", row[0]);
        // The k of the file is not among its columns here: R, v, x, Q.
        assert_same_pose(&motion.motion().step.body, row, &when);
        assert_same_covariance(motion.noise(), &row[15..], &when);
    }
}

#[test]
fn preintegrated_motions() {
    assert_preintegration(ZeroOrderHold, "preint_zoh.csv");
    assert_preintegration(Euler, "preint_euler.csv");
}

fn assert_window<S: Side>(name: &str, discretisation: Discretisation, options: &WindowOptions) {
    let mut window = Window::<SE23, S, 9>::new(&first(), options);
    let estimates = rows(&format!("est_{name}.csv"));
    assert_eq!(estimates.len(), 40);
    let steps = motions(discretisation).into_iter().zip(fixes());
    for (k, ((motion, fix), row)) in steps.zip(&estimates).enumerate() {
        window.push(&motion);
        let correction = window.update(fix).expect("an update");
        assert_eq!(correction.verdict, Verdict::Accepted);
        let newest = window.newest();
        let when = format!("{name}, fix {}", k + 1);
        assert_same_pose(&newest.mean, row, &when);
        assert_same_covariance(&newest.covariance, &row[15..], &when);
    }
    let states = rows(&format!("window40_{name}.csv"));
    assert_eq!(window.states().len(), states.len());
    for (index, (chi, row)) in window.states().zip(&states).enumerate() {
        assert_same_pose(chi, row, &format!("{name}, state {index} at the end"));
    }
}

/// The set's own options: exact Jacobians of the first prior and of the motions.
fn exact(capacity: usize, prior: PriorForm) -> WindowOptions {
    WindowOptions {
        first_prior: PriorForm::Recentred,
        prior,
        jacobians: Jacobians::Exact,
        ..WindowOptions::new(capacity)
    }
}

#[test]
fn invariant_smoothing_in_a_window_of_ten() {
    assert_window::<Left>("W10_IS", ZeroOrderHold, &exact(10, PriorForm::GroupMean));
}

#[test]
fn invariant_smoothing_in_a_window_of_fifty() {
    assert_window::<Left>("W50_IS", ZeroOrderHold, &exact(50, PriorForm::GroupMean));
}

#[test]
fn three_iterations() {
    let options = WindowOptions {
        iterations: 3,
        ..exact(50, PriorForm::GroupMean)
    };
    assert_window::<Left>("W50_IS_3iter", ZeroOrderHold, &options);
}

#[test]
fn the_papers_discretisation() {
    assert_window::<Left>("W10_IS_euler", Euler, &exact(10, PriorForm::GroupMean));
}

#[test]
fn the_papers_jacobian_of_the_motion() {
    let options = WindowOptions {
        jacobians: Jacobians::Frozen,
        ..exact(50, PriorForm::GroupMean)
    };
    assert_window::<Left>("W50_IS_paperBCH", ZeroOrderHold, &options);
}

#[test]
fn constant_gains() {
    assert_window::<Left>(
        "W10_IS_noJ_everywhere",
        ZeroOrderHold,
        &WindowOptions::new(10),
    );
}

#[test]
fn a_linear_prior() {
    assert_window::<Left>(
        "W10_IS_prior_lin",
        ZeroOrderHold,
        &exact(10, PriorForm::Linear),
    );
}

#[test]
fn a_recentred_prior() {
    let options = exact(10, PriorForm::Recentred);
    assert_window::<Left>("W10_IS_prior_recentredJ", ZeroOrderHold, &options);
}

#[test]
fn gtsam() {
    assert_window::<Gtsam>("W50_GTSAM", ZeroOrderHold, &exact(50, PriorForm::GroupMean));
    assert_window::<Gtsam>(
        "W10_GTSAM_lin",
        ZeroOrderHold,
        &exact(10, PriorForm::Linear),
    );
}

#[test]
fn forster() {
    assert_window::<Forster>(
        "W10_FORSTER_lin",
        ZeroOrderHold,
        &exact(10, PriorForm::Linear),
    );
}

#[test]
fn the_filter_beside_it() {
    let mut belief = first();
    let estimates = rows("est_LIEKF.csv");
    let seconds = samples();
    for (k, ((second, fix), row)) in seconds.chunks(200).zip(fixes()).zip(&estimates).enumerate() {
        for sample in second {
            belief = propagate(&belief, sample, &GRAVITY_W, DT_S, ZeroOrderHold, &noise());
        }
        update(&mut belief, &fix, &UpdateOptions::PLAIN).expect("an update");
        let when = format!("filter, fix {}", k + 1);
        assert_same_pose(&belief.mean, row, &when);
        assert_same_covariance(&belief.covariance, &row[15..], &when);
    }
}
