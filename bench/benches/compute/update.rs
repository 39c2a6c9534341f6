//! One position fix: a single pass as in the papers, and three iterations with transport; and the planar
//! filter's update by two sources, plain and linearly constrained.

use core::hint::black_box;

use inekf::filter::{
    Belief, Constrained, Gate, Left, Right, Side, Transport, UpdateOptions, update, update_with,
};
use inekf::lie::{SE2, SE23, SO2};
use inekf::model::{
    Declared, InertialState, NavState, OdometryStep, OutputMismatch, PlanarPair, PointFix,
    PositionObservation, ProcessColumns, ProcessMismatch,
};
use nalgebra::{Matrix2, SMatrix, Vector2, Vector3};

use crate::dense;
use crate::setup::{assert_same, belief, fix, state};
use crate::suite::Suite;

/// Exactly three iterations: no step is small enough to stop early.
const THREE: UpdateOptions = UpdateOptions {
    iterations: 3,
    tolerance: 0.0,
    transport: Transport::Jacobian,
    gate: Gate::OPEN,
};

fn correct<G: InertialState<D>, S: Side, const D: usize>(
    belief: &mut Belief<G, S, D>,
    fix: &PositionObservation,
    options: &UpdateOptions,
) -> usize {
    let correction = update(belief, black_box(fix), options).expect("a sound fix");
    correction.iterations
}

fn position<G: InertialState<D>, S: Side, const D: usize>(
    suite: &mut impl Suite,
    name: &str,
    start: Belief<G, S, D>,
) {
    let antenna = fix(Vector3::new(1.2, -0.3, 0.8));
    let centred = fix(Vector3::zeros());
    let plain = UpdateOptions::PLAIN;

    suite.in_place(&format!("update/{name}/1"), start, |belief| {
        correct(belief, &antenna, &plain);
    });
    suite.in_place(&format!("update/{name}/1_no_lever"), start, |belief| {
        correct(belief, &centred, &plain);
    });
    suite.in_place(&format!("update/{name}/3"), start, |belief| {
        correct(belief, &antenna, &THREE);
    });
    if S::IS_LEFT {
        let (mut fast, mut plainly) = (start, start);
        correct(&mut fast, &antenna, &plain);
        dense::update(&mut plainly, &antenna);
        assert_same(fast.covariance.matrix(), plainly.covariance.matrix());
        suite.in_place(&format!("update/{name}/1/dense"), start, |belief| {
            dense::update(belief, black_box(&antenna));
        });
    }
    assert_eq!(correct(&mut { start }, &antenna, &THREE), 3);
}

/// Two sources of position in the plane, and odometry: \[LC\] section VII.
fn planar(suite: &mut impl Suite) {
    let start: Belief<SE2, Left, 3> = belief(SE2 {
        rotation: SO2::from_angle(0.7),
        position: Vector2::new(12.0, -5.0),
    });
    let pair = PlanarPair::new([(0.4, 1.0), (-0.6, 0.2)].map(|(x, y)| {
        let lever_arm_b = Vector2::new(x, y);
        PointFix {
            position_w: start.mean.position + start.mean.rotation.rotate(&lever_arm_b),
            covariance_w: Matrix2::identity() * 0.04,
            lever_arm_b,
            scale_error: 0.0,
        }
    }));
    let outputs = [
        OutputMismatch::MeasurementScale { source: 1 },
        OutputMismatch::MeasurementRotation {
            source: 0,
            axis_w: None,
        },
    ]
    .map(Declared::hard);
    let step = OdometryStep::<SE2>::new(&Vector3::new(0.05, 1.5, 0.1), 0.5);
    let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
    let mut way = ProcessColumns::<3>::new(&declared).expect("room for one");
    way.advance(&step, &SMatrix::identity());

    suite.in_place("update/se2_pair/kalman", start, |belief| {
        update(belief, black_box(&pair), &UpdateOptions::PLAIN).expect("sound fixes");
    });
    suite.in_place("update/se2_pair/lc", start, |belief| {
        let rule = Constrained::new(belief, &way, &outputs, &pair);
        update_with(belief, black_box(&pair), &rule, &UpdateOptions::PLAIN).expect("solvable");
    });
    suite.in_place("update/se2_pair/dense", start, |belief| {
        dense::update(belief, black_box(&pair));
    });
}

/// Registers the routines.
pub fn routines(suite: &mut impl Suite) {
    position::<SE23, Left, 9>(suite, "position_9_left", belief(state().pose));
    position::<SE23, Right, 9>(suite, "position_9_right", belief(state().pose));
    position::<NavState, Left, 15>(suite, "position_15_left", belief(state()));
    position::<NavState, Right, 15>(suite, "position_15_right", belief(state()));
    planar(suite);
}
