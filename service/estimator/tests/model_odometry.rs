//! Odometry, points and mismatches: every Jacobian and every column against numerical derivatives of the model
//! that they linearise, in the plane, in space and on SE_2(3).

mod common;

use common::{
    any_pose, any_rotation, any_state, assert_close, derivative_at_zero, noise_of_scale, normal,
    seeded,
};
use inekf::filter::{Additive, Belief, Covariance, Left, Right, Side, propagate_odometry};
use inekf::lie::{LieGroup, SE2, SE3, SE23, SO2, SO3};
use inekf::model::{
    Declared, NavState, Observation, OdometryStep, OutputMismatch, PlanarPair, PointFix, Points,
    Pose, ProcessColumns, ProcessMismatch, RigidPose, SpatialPair,
};
use nalgebra::{Matrix1, SMatrix, SVector, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;

fn any_planar(rng: &mut ChaCha8Rng) -> SE2 {
    SE2 {
        rotation: SO2::from_angle(3.0 * normal::<1, 1>(rng).x),
        position: 30.0 * normal::<2, 1>(rng),
    }
}

fn any_spatial(rng: &mut ChaCha8Rng) -> SE3 {
    SE3 {
        rotation: any_rotation(rng),
        position: 30.0 * normal::<3, 1>(rng),
    }
}

fn any_step<G: RigidPose<D, N>, const D: usize, const N: usize>(
    rng: &mut ChaCha8Rng,
) -> OdometryStep<G> {
    OdometryStep::new(&normal::<D, 1>(rng), 0.1)
}

/// `f(chi exp(xi)) = f(chi) exp(F xi)`, exactly: for errors of any size.
fn assert_group_affine<G: RigidPose<D, N>, const D: usize, const N: usize>(
    chi: G,
    rng: &mut ChaCha8Rng,
) {
    for _ in 0..50 {
        let step = any_step::<G, D, N>(rng);
        let xi = 0.5 * normal::<D, 1>(rng);
        let there = step.apply(&chi.compose(&G::exp(&xi)));
        let predicted = step
            .apply(&chi)
            .compose(&G::exp(&(step.left_jacobian() * xi)));
        let gap = predicted.inverse().compose(&there).log();
        assert_close("group-affine", &gap, &SVector::zeros(), 1e-12);
    }
}

#[test]
fn odometry_is_group_affine() {
    let mut rng = seeded(201);
    assert_group_affine::<SE2, 3, 2>(any_planar(&mut rng), &mut rng);
    assert_group_affine::<SE3, 6, 3>(any_spatial(&mut rng), &mut rng);
}

#[test]
fn the_increment_is_taken_literally() {
    let quarter =
        OdometryStep::<SE2>::new(&Vector3::new(core::f64::consts::FRAC_PI_2, 2.0, 1.0), 0.1);
    let start = SE2 {
        rotation: SO2::from_angle(core::f64::consts::PI),
        position: Vector2::new(10.0, 20.0),
    };
    let end = quarter.apply(&start);
    assert_close("position", &end.position, &Vector2::new(8.0, 19.0), 1e-14);
    assert_close(
        "heading",
        &Matrix1::new(end.rotation.angle_rad()),
        &Matrix1::new(-core::f64::consts::FRAC_PI_2),
        1e-14,
    );

    let turn = Vector3::new(0.3, -0.2, 1.1);
    let mut increment = SVector::<f64, 6>::zeros();
    increment.fixed_rows_mut::<3>(0).copy_from(&turn);
    increment
        .fixed_rows_mut::<3>(3)
        .copy_from(&Vector3::new(1.0, 2.0, 3.0));
    let kappa = OdometryStep::<SE3>::new(&increment, 0.1).kappa;
    assert_eq!(kappa.position, Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(kappa.rotation, SO3::exp(&turn));
}

/// One belief, in any coordinates: what is propagated on side S is what the left side propagates. And the
/// transition of side S against a numerical derivative of the step.
fn assert_side<G: RigidPose<D, N>, S: Side, const D: usize, const N: usize>(
    start: G,
    rng: &mut ChaCha8Rng,
) {
    let prior = Covariance::from_upper(noise_of_scale(&SVector::<f64, D>::repeat(0.3), rng));
    let q = noise_of_scale(&SVector::<f64, D>::repeat(0.01), rng);
    let mut left = Belief::<G, Left, D>::new(start, prior);
    let mut other = Belief::<G, S, D>::from_left_covariance(start, prior);
    for _ in 0..50 {
        let step = any_step::<G, D, N>(rng);
        let before = other;
        left = propagate_odometry(&left, &step, &q);
        other = propagate_odometry(&other, &step, &q);
        let f = derivative_at_zero(|xi: &SVector<f64, D>| {
            S::difference(&other.mean, &step.apply(&S::retract(&before.mean, xi)))
        });
        let a = S::from_left(&other.mean);
        let expected = f * before.covariance.matrix() * f.transpose() + a * q * a.transpose();
        assert_close("numerical", other.covariance.matrix(), &expected, 1e-8);
    }
    assert_eq!(left.mean, other.mean);
    assert_close(
        "50 steps",
        other.left_covariance().matrix(),
        left.covariance.matrix(),
        1e-8,
    );
}

#[test]
fn every_side_propagates_one_belief() {
    let mut rng = seeded(202);
    assert_side::<SE2, Left, 3, 2>(any_planar(&mut rng), &mut rng);
    assert_side::<SE2, Right, 3, 2>(any_planar(&mut rng), &mut rng);
    assert_side::<SE2, Additive, 3, 2>(any_planar(&mut rng), &mut rng);
    assert_side::<SE3, Right, 6, 3>(any_spatial(&mut rng), &mut rng);
    assert_side::<SE3, Additive, 6, 3>(any_spatial(&mut rng), &mut rng);
}

fn any_points<const K: usize, const N: usize, const M: usize>(
    rng: &mut ChaCha8Rng,
) -> Points<K, N, M> {
    Points::new(core::array::from_fn(|_| PointFix {
        position_w: 30.0 * normal::<N, 1>(rng),
        covariance_w: noise_of_scale(&SVector::repeat(2.0), rng),
        lever_arm_b: normal::<N, 1>(rng),
        scale_error: 0.1 * normal::<1, 1>(rng).x,
    }))
}

fn assert_points<G, const D: usize, const N: usize, const M: usize>(
    chi: G,
    points: &Points<2, N, M>,
) where
    G: Pose<D, N>,
{
    let numerical =
        derivative_at_zero(|xi: &SVector<f64, D>| -points.residual(&chi.compose(&G::exp(xi))));
    assert_close("H", &points.left_jacobian(&chi), &numerical, 1e-9);
    let residual = points.residual(&chi);
    let noise = Observation::<G, D, M>::noise(points);
    for (source, fix) in points.fixes.iter().enumerate() {
        let expected = fix.position_w
            - chi.position_w() * (1.0 + fix.scale_error)
            - chi.rotation_matrix() * fix.lever_arm_b;
        assert_close(
            "residual",
            &residual.fixed_rows::<N>(N * source).into_owned(),
            &expected,
            1e-14,
        );
        let block = noise
            .fixed_view::<N, N>(N * source, N * source)
            .into_owned();
        assert_eq!(block, fix.covariance_w);
    }
    assert_eq!(
        noise.fixed_view::<N, N>(0, N).amax(),
        0.0,
        "sources are independent"
    );
}

#[test]
fn points_are_seen_from_every_pose() {
    let mut rng = seeded(203);
    for _ in 0..20 {
        let planar: PlanarPair = any_points(&mut rng);
        let spatial: SpatialPair = any_points(&mut rng);
        assert_points::<SE2, 3, 2, 4>(any_planar(&mut rng), &planar);
        assert_points::<SE3, 6, 3, 6>(any_spatial(&mut rng), &spatial);
        assert_points::<SE23, 9, 3, 6>(any_pose(&mut rng), &spatial);
        assert_points::<NavState, 15, 3, 6>(any_state(&mut rng), &spatial);
    }
}

/// The columns of the process mismatches against the error that a wrong increment makes, over several steps.
fn assert_process<G: RigidPose<D, N>, const D: usize, const N: usize>(
    start: G,
    mismatch: ProcessMismatch,
    wrong: impl Fn(&SVector<f64, D>, f64) -> SVector<f64, D>,
    rng: &mut ChaCha8Rng,
) {
    let increments: [SVector<f64, D>; 4] = core::array::from_fn(|_| normal(rng));
    let mut columns = ProcessColumns::new(&[Declared::hard(mismatch)]).expect("room");
    let mut assumed = start;
    for increment in &increments {
        let step = OdometryStep::new(increment, 0.1);
        assumed = step.apply(&assumed);
        columns.advance(&step, &SMatrix::zeros());
    }
    let numerical = derivative_at_zero(|m: &SVector<f64, 1>| {
        let truth = increments.iter().fold(start, |chi, increment| {
            OdometryStep::new(&wrong(increment, m.x), 0.1).apply(&chi)
        });
        assumed.inverse().compose(&truth).log()
    });
    let (_, column) = columns.active().next().expect("one column");
    assert_close("d", &column, &numerical, 1e-9);
    columns.reset();
    let (_, column) = columns.active().next().expect("no noise, no gate");
    assert_eq!(column.amax(), 0.0);
}

#[test]
fn a_process_mismatch_accumulates() {
    let mut rng = seeded(204);
    for _ in 0..10 {
        let scale = ProcessMismatch::OdometryScale;
        let planar = |increment: &Vector3<f64>, m: f64| {
            Vector3::new(
                increment.x,
                increment.y * (1.0 + m),
                increment.z * (1.0 + m),
            )
        };
        assert_process::<SE2, 3, 2>(any_planar(&mut rng), scale, planar, &mut rng);
        let spatial = |increment: &SVector<f64, 6>, m: f64| {
            SVector::from_fn(|i, _| {
                if i < 3 {
                    increment[i]
                } else {
                    increment[i] * (1.0 + m)
                }
            })
        };
        assert_process::<SE3, 6, 3>(any_spatial(&mut rng), scale, spatial, &mut rng);
        let turn = ProcessMismatch::OdometryTurnScale;
        let planar = |increment: &Vector3<f64>, m: f64| {
            Vector3::new(increment.x * (1.0 + m), increment.y, increment.z)
        };
        assert_process::<SE2, 3, 2>(any_planar(&mut rng), turn, planar, &mut rng);
        let spatial = |increment: &SVector<f64, 6>, m: f64| {
            // A turn beyond pi is one below, about the other axis.
            let rotation = SO3::exp(&increment.fixed_rows::<3>(0).into_owned());
            let mut wrong = *increment;
            let scaled = rotation.log() * (1.0 + m);
            wrong.fixed_rows_mut::<3>(0).copy_from(&scaled);
            wrong
        };
        assert_process::<SE3, 6, 3>(any_spatial(&mut rng), turn, spatial, &mut rng);
        // A rotation gained in the body at the end of the step: Omega Exp(m dt e).
        let bias = ProcessMismatch::OdometryRotationBias { axis: 0 };
        let planar = |increment: &Vector3<f64>, m: f64| increment + Vector3::x() * (0.1 * m);
        assert_process::<SE2, 3, 2>(any_planar(&mut rng), bias, planar, &mut rng);
        let bias = ProcessMismatch::OdometryRotationBias { axis: 1 };
        let spatial = |increment: &SVector<f64, 6>, m: f64| {
            let rotation = SO3::exp(&increment.fixed_rows::<3>(0).into_owned());
            let turned = rotation * SO3::exp(&(Vector3::y() * (0.1 * m)));
            let mut wrong = *increment;
            wrong.fixed_rows_mut::<3>(0).copy_from(&turned.log());
            wrong
        };
        assert_process::<SE3, 6, 3>(any_spatial(&mut rng), bias, spatial, &mut rng);
    }
}

#[test]
fn a_way_within_its_noise_tells_nothing() {
    let declared = [
        Declared::hard(ProcessMismatch::OdometryScale),
        Declared::hard(ProcessMismatch::OdometryRotationBias { axis: 0 }),
    ];
    let q = SMatrix::from_diagonal(&Vector3::new(1e-6, 1e-4, 1e-4));
    let mut columns = ProcessColumns::new(&declared).expect("room");
    let step = |way_m: f64| OdometryStep::<SE2>::new(&Vector3::new(0.0, way_m, 0.0), 0.1);
    columns.advance(&step(0.049), &q);
    let kinds: Vec<_> = columns
        .active()
        .map(|(declared, _)| declared.mismatch)
        .collect();
    assert_eq!(kinds, [ProcessMismatch::OdometryRotationBias { axis: 0 }]);
    // 0.098 m after two steps, with a noise of 0.0141 m.
    columns.advance(&step(0.049), &q);
    assert_eq!(columns.active().count(), 2);
    columns.reset();
    columns.advance(&step(0.051), &q);
    assert_eq!(columns.active().count(), 2);
    assert!(
        ProcessColumns::<3>::new(&[declared[0]; 6]).is_none(),
        "more than there is room for"
    );
}

#[test]
fn a_turn_within_its_noise_tells_nothing() {
    let declared = [
        ProcessMismatch::OdometryTurnScale,
        ProcessMismatch::OdometryScale,
    ];
    let mut columns = ProcessColumns::new(&declared.map(Declared::hard)).expect("room");
    let q = SMatrix::from_diagonal(&Vector3::new(1e-6, 1e-4, 1e-4));
    // 10 m straight on, but for the noise of 1 mrad: the scale of the way is seen, that of the turn is not.
    let step = |turn: f64| OdometryStep::<SE2>::new(&Vector3::new(turn, 10.0, 0.0), 0.1);
    columns.advance(&step(0.0049), &q);
    let kinds: Vec<_> = columns.active().map(|(it, _)| it.mismatch).collect();
    assert_eq!(kinds, [ProcessMismatch::OdometryScale]);
    columns.reset();
    columns.advance(&step(-0.0051), &q);
    assert_eq!(columns.active().count(), 2);
    columns.advance(&step(-0.001), &q);
    assert_eq!(
        columns.active().count(),
        1,
        "after two steps 7.1 mrad count"
    );
}

/// The columns of an output mismatch against the model with its parameters, at zero.
fn assert_output<G: Pose<D, N>, const D: usize, const N: usize, const M: usize, const R: usize>(
    chi: &G,
    points: &Points<2, N, M>,
    mismatch: OutputMismatch,
    seen: impl Fn(&PointFix<N>, &SVector<f64, R>) -> SVector<f64, N>,
) {
    let columns = mismatch.columns(points, chi);
    assert_eq!(columns.as_slice().len(), R);
    let mut analytic = SMatrix::<f64, M, R>::zeros();
    for (i, column) in columns.as_slice().iter().enumerate() {
        analytic.set_column(i, column);
    }
    let source = mismatch.source();
    let numerical = derivative_at_zero(|m: &SVector<f64, R>| {
        let mut y = SVector::<f64, M>::zeros();
        y.fixed_rows_mut::<N>(N * source)
            .copy_from(&seen(&points.fixes[source], m));
        y
    });
    assert_close("dh", &analytic, &numerical, 1e-9);
}

fn assert_spatial_outputs<G: Pose<D, 3>, const D: usize>(chi: &G, points: &SpatialPair) {
    let scale = OutputMismatch::MeasurementScale { source: 1 };
    assert_output(chi, points, scale, |fix, m: &SVector<f64, 1>| {
        chi.position_w() * (1.0 + fix.scale_error + m.x) + chi.rotation_matrix() * fix.lever_arm_b
    });
    let expected = |fix: &PointFix<3>| {
        chi.position_w() * (1.0 + fix.scale_error) + chi.rotation_matrix() * fix.lever_arm_b
    };
    let any = OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    };
    assert_output(chi, points, any, |fix, m: &Vector3<f64>| {
        SO3::exp(m).inverse_rotate(&expected(fix))
    });
    let about_z = OutputMismatch::MeasurementRotation {
        source: 1,
        axis_w: Some(Vector3::z()),
    };
    assert_output(chi, points, about_z, |fix, m: &SVector<f64, 1>| {
        SO3::exp(&(Vector3::z() * m.x)).inverse_rotate(&expected(fix))
    });
}

#[test]
fn output_mismatches_are_derivatives_of_the_fix() {
    let mut rng = seeded(205);
    for _ in 0..20 {
        let points: PlanarPair = any_points(&mut rng);
        let chi = any_planar(&mut rng);
        let scale = OutputMismatch::MeasurementScale { source: 1 };
        assert_output(&chi, &points, scale, |fix, m: &SVector<f64, 1>| {
            chi.position * (1.0 + fix.scale_error + m.x) + chi.rotation.rotate(&fix.lever_arm_b)
        });
        let turned = OutputMismatch::MeasurementRotation {
            source: 0,
            axis_w: None,
        };
        assert_output(&chi, &points, turned, |fix, m: &SVector<f64, 1>| {
            SO2::from_angle(m.x).inverse_rotate(&fix.expected_w(&chi))
        });
        let points: SpatialPair = any_points(&mut rng);
        assert_spatial_outputs::<SE3, 6>(&any_spatial(&mut rng), &points);
        assert_spatial_outputs::<SE23, 9>(&any_pose(&mut rng), &points);
        assert_spatial_outputs::<NavState, 15>(&any_state(&mut rng), &points);
    }
}
