//! No filter allocates: every gain rule and the adaptive bank, in the plane and in space, after it was made.

mod common;
#[path = "common/counting.rs"]
mod counting;

use common::section7::{Law, Run, odometry_noise, start_variances};
use counting::allocations;
use inekf::filter::{
    Adaptive, Belief, Consider, Constrained, Covariance, Expected, HInfinity, HInfinityGain, Left,
    STANDARD_MODES, UpdateOptions, Verdict, propagate_augmented, propagate_odometry,
    standard_modes, update, update_with,
};
use inekf::lie::{LieGroup, SE2, SE3};
use inekf::model::{
    Augmented, Declared, OdometryStep, OutputMismatch, PlanarFix, PointFix, ProcessColumns,
    ProcessMismatch, SpatialFix, Unknowns,
};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::hint::black_box;

#[test]
fn the_counter_counts() {
    assert!(allocations(|| drop(black_box(vec![1_u8; 100]))) >= 2);
    assert_eq!(allocations(|| {}), 0);
}

const PROCESS: [ProcessMismatch; 3] = [
    ProcessMismatch::OdometryScale,
    ProcessMismatch::OdometryTurnScale,
    ProcessMismatch::OdometryRotationBias { axis: 0 },
];
const OUTPUTS: [OutputMismatch; 2] = [
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    },
];

#[test]
fn the_adaptive_bank_allocates_nothing_in_the_plane() {
    let run = Run::draw(1, Law::Bursts);
    let prior = Belief::new(run.start, Covariance::from_variances(&start_variances()));
    let options = UpdateOptions::ITERATED;
    let mut accepted = 0;
    let calls = allocations(|| {
        let unknowns = Unknowns::new::<2, 6>(&PROCESS, &OUTPUTS).expect("five of six");
        let sigmas = SVector::from([0.08, 0.05, 0.005, 0.06, 0.03, 0.0]);
        let expected = Expected::of(&unknowns, &sigmas, &sigmas);
        let (modes, switching) = standard_modes(&expected, 0.1);
        let mut bank: Adaptive<SE2, 3, 6, 9, STANDARD_MODES> =
            Adaptive::new(&prior, modes, switching, options);
        for (step, pair) in run.steps.iter().zip(&run.pairs) {
            bank.advance(&unknowns, step, &odometry_noise());
            for (source, fix) in pair.fixes.into_iter().enumerate() {
                let seen = unknowns.observe_from(source, PlanarFix::new([fix]));
                accepted += u32::from(bank.update(&seen) == Ok(Verdict::Accepted));
            }
            black_box(bank.estimate());
        }
    });
    assert_eq!((calls, accepted), (0, 2 * 330));
}

#[test]
fn the_adaptive_bank_allocates_nothing_in_space() {
    let turned = OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    };
    let calls = allocations(|| {
        let unknowns = Unknowns::new::<3, 6>(&PROCESS, &[turned]).expect("six");
        let sigmas = SVector::from([0.08, 0.05, 0.005, 0.03, 0.03, 0.03]);
        let expected = Expected::of(&unknowns, &sigmas, &sigmas);
        let (modes, switching) = standard_modes(&expected, 0.1);
        let variances = SVector::from([0.01, 0.01, 0.01, 1.0, 1.0, 1.0]);
        let prior = Belief::new(SE3::identity(), Covariance::from_variances(&variances));
        let mut bank: Adaptive<SE3, 6, 6, 12, STANDARD_MODES> =
            Adaptive::new(&prior, modes, switching, UpdateOptions::ITERATED);
        let step = OdometryStep::new(&SVector::from([0.01, -0.02, 0.1, 1.0, 0.1, 0.0]), 0.1);
        let q = SMatrix::from_diagonal_element(1e-4);
        let mut truth = SE3::identity();
        for _ in 0..100 {
            truth = step.apply(&truth);
            bank.advance(&unknowns, &step, &q);
            let fix = PointFix {
                position_w: truth.position,
                covariance_w: Matrix3::identity(),
                lever_arm_b: Vector3::new(0.3, 0.1, -0.2),
                scale_error: 0.0,
            };
            let seen = unknowns.observe(SpatialFix::new([fix]));
            assert_eq!(bank.update(&seen), Ok(Verdict::Accepted));
            black_box(bank.estimate());
        }
    });
    assert_eq!(calls, 0);
}

#[test]
fn no_gain_rule_allocates() {
    let run = Run::draw(2, Law::Constant);
    let hard = OUTPUTS.map(Declared::hard);
    let soft = OUTPUTS.map(|mismatch| Declared::soft(mismatch, 0.05));
    let start = Covariance::from_variances(&start_variances());
    let h_infinity = HInfinity {
        gamma: 1e-3,
        gain: HInfinityGain::Widened,
    };
    let calls = allocations(|| {
        let unknowns = Unknowns::new::<2, 5>(&PROCESS, &OUTPUTS).expect("five");
        let mut way = ProcessColumns::new(&[Declared::hard(PROCESS[0])]).expect("room");
        let mut beliefs = [Belief::<SE2, Left, 3>::new(run.start, start); 4];
        let augmented = Augmented::<SE2, 3, 5, 8>::new(run.start, SVector::zeros());
        let variances = SVector::from([0.01, 4.0, 4.0, 1e-2, 1e-2, 1e-4, 1e-2, 1e-3]);
        let augmented =
            Belief::<_, Left, 8>::new(augmented, Covariance::from_variances(&variances));
        let mut learned = [augmented; 2];
        let mut q = SMatrix::<f64, 8, 8>::zeros();
        q.fixed_view_mut::<3, 3>(0, 0).copy_from(&odometry_noise());
        for (step, pair) in run.steps.iter().zip(&run.pairs) {
            way.advance(step, &odometry_noise());
            beliefs = beliefs.map(|belief| propagate_odometry(&belief, step, &odometry_noise()));
            let [plain, constrained, softened, bounded] = &mut beliefs;
            let options = &UpdateOptions::ITERATED;
            update(plain, pair, options).expect("an update");
            let rule = Constrained::new(constrained, &way, &hard, pair);
            update_with(constrained, pair, &rule, options).expect("an update");
            let rule = Constrained::new(softened, &way, &soft, pair);
            update_with(softened, pair, &rule, options).expect("an update");
            update_with(bounded, pair, &h_infinity, options).expect("an update");
            way.reset();

            let seen = unknowns.observe(*pair);
            learned = learned.map(|belief| propagate_augmented(&belief, &unknowns, step, &q));
            update(&mut learned[0], &seen, options).expect("an update");
            let rule = Consider { first: 3 };
            update_with(&mut learned[1], &seen, &rule, options).expect("an update");
        }
        black_box((beliefs, learned));
    });
    assert_eq!(calls, 0);
}
