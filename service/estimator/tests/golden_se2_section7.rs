//! Every filter of [LC] section VII in the plane against an independent implementation: 54 steps of 0.5 s, one
//! source with its frame turned, one with a wrong scale, odometry with a wrong scale.
//!
//! Predicted and updated state and covariance of every filter; Delta, T, K and L of the constrained ones. The
//! golden innovation of the left filters is in body axes, `R^T (y - h)`, so that theirs are `R^T Delta`, `K R`.

mod common;

use common::golden::{matrix, numbers, relative_error};
use inekf::filter::{
    Additive, Belief, Constrained, Covariance, GainRule, HInfinity, HInfinityGain, Kalman, Left,
    Linearised, Right, Side, UpdateOptions, propagate_odometry, update_with,
};
use inekf::lie::{SE2, SO2};
use inekf::model::{
    Declared, Observation, OdometryStep, OutputMismatch, PlanarPair, PointFix, ProcessColumns,
    ProcessMismatch,
};
use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use serde_json::Value;
use std::f64::consts::{PI, TAU};

const STATE_TOLERANCE: f64 = 1e-9;
const COVARIANCE_TOLERANCE: f64 = 1e-8;

type Columns = SMatrix<f64, 4, 3>;

struct Golden {
    file: Value,
}

impl Golden {
    fn read() -> Self {
        let file = include_str!("data/golden_se2_section7.json");
        Self {
            file: serde_json::from_str(file).expect("valid JSON"),
        }
    }

    fn input(&self, name: &str) -> &Value {
        &self.file["inputs"][name]
    }

    fn steps(&self) -> usize {
        self.file["n"].as_u64().expect("a number of steps") as usize
    }

    fn step(&self, k: usize) -> OdometryStep<SE2> {
        let theta = self.input("odo_dtheta")[k].as_f64().expect("an angle");
        let u = matrix::<2, 1>(&self.input("odo_u")[k]);
        OdometryStep::new(&Vector3::new(theta, u.x, u.y), 0.5)
    }

    fn pair(&self, k: usize, noise: &SMatrix<f64, 4, 4>) -> PlanarPair {
        let lever_arms = matrix::<2, 2>(self.input("lever_arms"));
        let scale_errors = numbers(self.input("eps_hat"));
        PlanarPair::new([0, 1].map(|source| {
            PointFix {
                position_w: matrix::<2, 1>(&self.input("y")[k][source]),
                covariance_w: noise
                    .fixed_view::<2, 2>(2 * source, 2 * source)
                    .into_owned(),
                lever_arm_b: lever_arms.row(source).transpose(),
                scale_error: scale_errors[source],
            }
        }))
    }

    fn start<S: Side>(&self, covariance: &str) -> Belief<SE2, S, 3> {
        let theta = self.input("theta0").as_f64().expect("an angle");
        let mean = SE2 {
            rotation: SO2::from_angle(theta),
            position: matrix::<2, 1>(self.input("x0")),
        };
        Belief::new(mean, Covariance::from_upper(matrix(self.input(covariance))))
    }
}

fn assert_state(
    belief: &Belief<SE2, impl Side, 3>,
    filter: &Value,
    suffix: &str,
    k: usize,
    what: &str,
) {
    let at = |name: &str| &filter[format!("{name}{suffix}")][k];
    let theta = at("theta").as_f64().expect("an angle");
    let turn = belief.mean.rotation.angle_rad() - theta;
    let turn = (turn + PI).rem_euclid(TAU) - PI;
    assert!(
        turn.abs() < STATE_TOLERANCE,
        "{what}, step {k}{suffix}: heading off by {turn:e}"
    );
    let off = (belief.mean.position - matrix::<2, 1>(at("x"))).norm();
    assert!(
        off < STATE_TOLERANCE,
        "{what}, step {k}{suffix}: position off by {off:e}"
    );
    let error = relative_error(belief.covariance.matrix(), &matrix(at("P")));
    assert!(
        error < COVARIANCE_TOLERANCE,
        "{what}, step {k}{suffix}: P off by {error:e}"
    );
}

/// Runs one filter; `factor` scales both noise covariances.
fn run<S: Side>(
    golden: &Golden,
    name: &str,
    prior: &str,
    factor: f64,
    rule: &impl GainRule<SE2, 3, 4>,
    options: &UpdateOptions,
) {
    let q = matrix::<3, 3>(golden.input("Q")) * factor;
    let noise = matrix::<4, 4>(golden.input("N")) * factor;
    let filter = &golden.file["filters"][name];
    let mut belief = golden.start::<S>(prior);
    assert_eq!(golden.steps(), 54);
    for k in 0..golden.steps() {
        let step = golden.step(k);
        belief = propagate_odometry(&belief, &step, &q);
        assert_state(&belief, filter, "_pred", k, name);
        let pair = golden.pair(k, &noise);
        update_with(&mut belief, &pair, rule, options).expect("an update");
        assert_state(&belief, filter, "", k, name);
    }
}

fn kalman<S: Side>(name: &str, prior: &str, options: &UpdateOptions) {
    run::<S>(&Golden::read(), name, prior, 1.0, &Kalman, options);
}

#[test]
fn left_inekf() {
    kalman::<Left>("InEKF-left", "P0_left", &UpdateOptions::PLAIN);
}

#[test]
fn right_inekf() {
    kalman::<Right>("InEKF-right", "P0_right", &UpdateOptions::PLAIN);
}

#[test]
fn ekf() {
    kalman::<Additive>("EKF", "P0_theta_x", &UpdateOptions::PLAIN);
}

#[test]
fn iterated_inekf() {
    let five = UpdateOptions {
        iterations: 5,
        ..UpdateOptions::PLAIN
    };
    kalman::<Left>("IterInEKF5", "P0_left", &five);
}

#[test]
fn h_infinity_in_both_forms() {
    let golden = Golden::read();
    let hinf = golden.input("hinf");
    let gamma = hinf["theta_gamma"].as_f64().expect("gamma");
    let nine_times = matrix::<3, 3>(golden.input("Q")) * 9.0;
    assert!(relative_error(&matrix::<3, 3>(&hinf["Q"]), &nine_times) < 1e-15);
    assert_eq!(
        matrix::<3, 3>(&hinf["Sbar"]),
        SMatrix::<f64, 3, 3>::identity()
    );
    for (name, gain) in [
        ("IHinfF", HInfinityGain::Widened),
        ("IHinfF-hsk", HInfinityGain::Kalman),
    ] {
        let rule = HInfinity { gamma, gain };
        run::<Left>(&golden, name, "P0_left", 9.0, &rule, &UpdateOptions::PLAIN);
    }
}

/// The mismatches of section VII, in the golden order.
const OUTPUTS: [OutputMismatch; 2] = [
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    },
];

/// Whether the gains agree, in the axes of the golden innovation: `turn` takes those to world axes.
fn assert_gains<S: Side>(
    filter: &Value,
    belief: &Belief<SE2, S, 3>,
    pair: &PlanarPair,
    rule: &Constrained<'_, 3, 2, 2, 4>,
    turn: &SMatrix<f64, 4, 4>,
    k: usize,
) {
    let noise = Observation::<SE2, 3, 4>::noise(pair);
    let at =
        Linearised::at(belief, pair, &belief.mean, &SVector::zeros(), &noise).expect("regular");
    let constraints = rule.constraints(&at).expect("room");
    let (mut delta, mut t) = (Columns::zeros(), SMatrix::<f64, 3, 3>::zeros());
    for (i, (delta_i, t_i)) in constraints.columns().enumerate() {
        delta.set_column(i, delta_i);
        t.set_column(i, t_i);
    }
    let l = rule.gain(&belief.covariance, &at).expect("solvable");
    let kalman = Kalman.gain(&belief.covariance, &at).expect("regular");
    let error = |actual: f64, what: &str| {
        assert!(
            actual < STATE_TOLERANCE,
            "{what}, step {k}: off by {actual:e}"
        )
    };
    error(
        relative_error(&(turn.transpose() * delta), &matrix(&filter["Delta"][k])),
        "Delta",
    );
    error(relative_error(&t, &matrix(&filter["T"][k])), "T");
    error(
        relative_error(&(kalman * turn), &matrix(&filter["K"][k])),
        "K",
    );
    error(relative_error(&(l * turn), &matrix(&filter["L"][k])), "L");
    error(relative_error(&(l * delta), &t) * 1e3, "L Delta = T");
}

fn constrained<S: Side>(name: &str, prior: &str, body_axes: bool) {
    let golden = Golden::read();
    let outputs = OUTPUTS.map(Declared::hard);
    let q = matrix::<3, 3>(golden.input("Q"));
    let noise = matrix::<4, 4>(golden.input("N"));
    let filter = &golden.file["filters"][name];
    let mut way =
        ProcessColumns::new(&[Declared::hard(ProcessMismatch::OdometryScale)]).expect("room");
    let mut belief = golden.start::<S>(prior);
    for k in 0..golden.steps() {
        let step = golden.step(k);
        belief = propagate_odometry(&belief, &step, &q);
        way.advance(&step, &q);
        assert_state(&belief, filter, "_pred", k, name);
        let pair = golden.pair(k, &noise);
        let rule = Constrained::new(&belief, &way, &outputs, &pair);
        let mut turn = SMatrix::<f64, 4, 4>::identity();
        if body_axes {
            for block in [0, 2] {
                let r = belief.mean.rotation.matrix();
                turn.fixed_view_mut::<2, 2>(block, block).copy_from(&r);
            }
        }
        assert_gains(filter, &belief, &pair, &rule, &turn, k);
        let correction =
            update_with(&mut belief, &pair, &rule, &UpdateOptions::PLAIN).expect("an update");
        assert_eq!(correction.degrees, 1);
        way.reset();
        assert_state(&belief, filter, "", k, name);
    }
}

#[test]
fn lc_inekf() {
    constrained::<Left>("LC-InEKF", "P0_left", true);
}

#[test]
fn lc_ekf() {
    constrained::<Additive>("LC-EKF", "P0_theta_x", false);
}

#[test]
fn the_start_is_one_belief_in_three_coordinates() {
    let golden = Golden::read();
    let left = golden.start::<Left>("P0_left").covariance;
    let mean = golden.start::<Left>("P0_left").mean;
    assert_ne!(mean.position, Vector2::zeros());
    let right = Belief::<SE2, Right, 3>::from_left_covariance(mean, left).covariance;
    let additive = Belief::<SE2, Additive, 3>::from_left_covariance(mean, left).covariance;
    assert!(relative_error(right.matrix(), &matrix(golden.input("P0_right"))) < 1e-12);
    assert!(relative_error(additive.matrix(), &matrix(golden.input("P0_theta_x"))) < 1e-12);
}
