//! InEKF and LC-InEKF on SE(3) against an independent implementation: 40 steps, two position sources with lever
//! arms and unlike noises, an assumed scale error, a frame that may be turned about the world's z axis.
//!
//! As in the plane, the golden innovation is in body axes: its columns are `R^T Delta`, its gains `K R`.

mod common;

use common::golden::{matrix, numbers, relative_error};
use inekf::filter::{
    Belief, Constrained, Covariance, GainRule, Kalman, Left, Linearised, UpdateOptions,
    propagate_odometry, update, update_with,
};
use inekf::lie::{SE3, SO3};
use inekf::model::{
    Declared, Observation, OdometryStep, OutputMismatch, PointFix, ProcessColumns, ProcessMismatch,
    SpatialPair,
};
use nalgebra::{SMatrix, SVector, Vector3};
use serde_json::Value;

const STATE_TOLERANCE: f64 = 1e-9;
const COVARIANCE_TOLERANCE: f64 = 1e-8;

type Filter = Belief<SE3, Left, 6>;

fn golden() -> Value {
    serde_json::from_str(include_str!("data/golden_se3_lc_yaw.json")).expect("valid JSON")
}

fn start(inputs: &Value) -> Filter {
    let pose = matrix::<4, 4>(&inputs["X0"]);
    let rotation = pose.fixed_view::<3, 3>(0, 0).into_owned();
    let mean = SE3 {
        rotation: SO3::from_matrix(&rotation).expect("a rotation"),
        position: pose.fixed_view::<3, 1>(0, 3).into_owned(),
    };
    Belief::new(mean, Covariance::from_upper(matrix(&inputs["P0_left"])))
}

fn step(inputs: &Value, k: usize) -> OdometryStep<SE3> {
    let mut increment = SVector::<f64, 6>::zeros();
    increment
        .fixed_rows_mut::<3>(0)
        .copy_from(&matrix::<3, 1>(&inputs["odo_rotvec"][k]));
    increment
        .fixed_rows_mut::<3>(3)
        .copy_from(&matrix::<3, 1>(&inputs["odo_u"][k]));
    OdometryStep::new(&increment, 0.5)
}

fn pair(inputs: &Value, k: usize) -> SpatialPair {
    let noise = matrix::<6, 6>(&inputs["N"]);
    let lever_arms = matrix::<2, 3>(&inputs["lever_arms"]);
    let scale_errors = numbers(&inputs["eps_hat"]);
    SpatialPair::new([0, 1].map(|source| {
        PointFix {
            position_w: matrix::<3, 1>(&inputs["y"][k][source]),
            covariance_w: noise
                .fixed_view::<3, 3>(3 * source, 3 * source)
                .into_owned(),
            lever_arm_b: lever_arms.row(source).transpose(),
            scale_error: scale_errors[source],
        }
    }))
}

fn assert_state(belief: &Filter, filter: &Value, suffix: &str, k: usize) {
    let at = |name: &str| &filter[format!("{name}{suffix}")][k];
    let turn = (belief.mean.rotation.matrix() - matrix::<3, 3>(at("R"))).norm();
    assert!(
        turn < STATE_TOLERANCE,
        "step {k}{suffix}: attitude off by {turn:e}"
    );
    let off = (belief.mean.position - matrix::<3, 1>(at("x"))).norm();
    assert!(
        off < STATE_TOLERANCE,
        "step {k}{suffix}: position off by {off:e}"
    );
    let error = relative_error(belief.covariance.matrix(), &matrix(at("P")));
    assert!(
        error < COVARIANCE_TOLERANCE,
        "step {k}{suffix}: P off by {error:e}"
    );
}

#[test]
fn left_inekf() {
    let golden = golden();
    let (inputs, filter) = (&golden["inputs"], &golden["filters"]["InEKF-left"]);
    let mut belief = start(inputs);
    assert_eq!(golden["n"], 40);
    for k in 0..40 {
        belief = propagate_odometry(&belief, &step(inputs, k), &matrix(&inputs["Q"]));
        assert_state(&belief, filter, "_pred", k);
        update(&mut belief, &pair(inputs, k), &UpdateOptions::PLAIN).expect("an update");
        assert_state(&belief, filter, "", k);
    }
}

fn assert_gains(
    filter: &Value,
    belief: &Filter,
    pair: &SpatialPair,
    rule: &Constrained<'_, 6, 2, 3, 6>,
    k: usize,
) {
    let noise = Observation::<SE3, 6, 6>::noise(pair);
    let at =
        Linearised::at(belief, pair, &belief.mean, &SVector::zeros(), &noise).expect("regular");
    let constraints = rule.constraints(&at).expect("room");
    let mut delta = SMatrix::<f64, 6, 3>::zeros();
    let mut t = SMatrix::<f64, 6, 3>::zeros();
    for (i, (delta_i, t_i)) in constraints.columns().enumerate() {
        delta.set_column(i, delta_i);
        t.set_column(i, t_i);
    }
    let mut turn = SMatrix::<f64, 6, 6>::zeros();
    for block in [0, 3] {
        let r = belief.mean.rotation.matrix();
        turn.fixed_view_mut::<3, 3>(block, block).copy_from(&r);
    }
    let l = rule.gain(&belief.covariance, &at).expect("solvable");
    let kalman = Kalman.gain(&belief.covariance, &at).expect("regular");
    let agree = |error: f64, bound: f64, what: &str| {
        assert!(error < bound, "{what}, step {k}: off by {error:e}");
    };
    agree(
        relative_error(&(turn.transpose() * delta), &matrix(&filter["Delta"][k])),
        1e-9,
        "Delta",
    );
    agree(relative_error(&t, &matrix(&filter["T"][k])), 1e-9, "T");
    agree(
        relative_error(&(kalman * turn), &matrix(&filter["K"][k])),
        1e-9,
        "K",
    );
    agree(
        relative_error(&(l * turn), &matrix(&filter["L"][k])),
        1e-9,
        "L",
    );
    agree(relative_error(&(l * delta), &t), 1e-12, "L Delta = T");
}

#[test]
fn lc_inekf() {
    let golden = golden();
    let (inputs, filter) = (&golden["inputs"], &golden["filters"]["LC-InEKF"]);
    let q = matrix::<6, 6>(&inputs["Q"]);
    let outputs = [
        OutputMismatch::MeasurementScale { source: 1 },
        OutputMismatch::MeasurementRotation {
            source: 0,
            axis_w: Some(Vector3::z()),
        },
    ]
    .map(Declared::hard);
    let scale = [Declared::hard(ProcessMismatch::OdometryScale)];
    let mut way = ProcessColumns::new(&scale).expect("room");
    let mut belief = start(inputs);
    for k in 0..40 {
        let step = step(inputs, k);
        belief = propagate_odometry(&belief, &step, &q);
        way.advance(&step, &q);
        assert_state(&belief, filter, "_pred", k);
        let pair = pair(inputs, k);
        let rule = Constrained::new(&belief, &way, &outputs, &pair);
        assert_gains(filter, &belief, &pair, &rule, k);
        update_with(&mut belief, &pair, &rule, &UpdateOptions::PLAIN).expect("an update");
        way.reset();
        assert_state(&belief, filter, "", k);
    }
}
