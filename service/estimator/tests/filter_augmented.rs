//! Mismatches carried as states: the models against numerical derivatives, the filter against an ordinary EKF
//! written out densely, the considered form against Schmidt's equations.

mod common;

use common::section7::{DT_S, Law, Run, odometry_noise, start_variances};
use common::{
    any_rotation, assert_close, assert_within, covariance_of_scale, derivative_at_zero, normal,
    seeded,
};
use inekf::filter::{
    Additive, Belief, Consider, Covariance, Left, Right, UpdateOptions, propagate_augmented,
    propagate_odometry, update, update_with,
};
use inekf::lie::{LieGroup, SE2, SE3, SO2};
use inekf::model::{
    Augmented, Observation, OdometryStep, OutputMismatch, PlanarPair, PointFix, Pose,
    ProcessMismatch, RigidPose, SpatialPair, Unknowns,
};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

const PLANAR_PROCESS: [ProcessMismatch; 3] = [
    ProcessMismatch::OdometryScale,
    ProcessMismatch::OdometryTurnScale,
    ProcessMismatch::OdometryRotationBias { axis: 0 },
];
const PLANAR_OUTPUTS: [OutputMismatch; 2] = [
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: None,
    },
];
const SPATIAL_PROCESS: [ProcessMismatch; 4] = [
    ProcessMismatch::OdometryRotationBias { axis: 0 },
    ProcessMismatch::OdometryScale,
    ProcessMismatch::OdometryTurnScale,
    ProcessMismatch::OdometryRotationBias { axis: 2 },
];
const SPATIAL_OUTPUTS: [OutputMismatch; 3] = [
    OutputMismatch::MeasurementRotation {
        source: 1,
        axis_w: None,
    },
    OutputMismatch::MeasurementScale { source: 1 },
    OutputMismatch::MeasurementRotation {
        source: 0,
        axis_w: Some(Vector3::new(0.0, 0.6, 0.8)),
    },
];

type Planar = Augmented<SE2, 3, 5, 8>;
type Spatial = Augmented<SE3, 6, 9, 15>;

fn planar(rng: &mut ChaCha8Rng) -> Planar {
    let pose = SE2 {
        rotation: SO2::from_angle(normal::<1, 1>(rng).x),
        position: 30.0 * normal::<2, 1>(rng),
    };
    Augmented::new(pose, 0.1 * normal::<5, 1>(rng))
}

fn spatial(rng: &mut ChaCha8Rng) -> Spatial {
    let pose = SE3 {
        rotation: any_rotation(rng),
        position: 30.0 * normal::<3, 1>(rng),
    };
    Augmented::new(pose, 0.3 * normal::<9, 1>(rng))
}

fn any_fix<const N: usize>(rng: &mut ChaCha8Rng) -> PointFix<N> {
    PointFix {
        position_w: 30.0 * normal::<N, 1>(rng),
        covariance_w: SMatrix::identity() * 4.0,
        lever_arm_b: normal::<N, 1>(rng),
        scale_error: 0.05,
    }
}

/// F against the derivative of the augmented step, at parameters that are not zero.
fn assert_transition<G, const B: usize, const P: usize, const D: usize, const N: usize>(
    state: &Augmented<G, B, P, D>,
    unknowns: &Unknowns,
    step: &OdometryStep<G>,
) where
    G: RigidPose<B, N>,
{
    let after = |state: &Augmented<G, B, P, D>| {
        Augmented::<G, B, P, D>::new(
            unknowns.step(step, state).step.apply(&state.pose),
            state.parameters,
        )
    };
    let there = after(state);
    let numerical = derivative_at_zero(|xi: &SVector<f64, D>| {
        there
            .inverse()
            .compose(&after(&state.compose(&Augmented::exp(xi))))
            .log()
    });
    assert_close(
        "F",
        &unknowns.step(step, state).left_jacobian,
        &numerical,
        1e-9,
    );
}

fn assert_observed<G, O, const D: usize, const M: usize>(chi: &G, observation: &O)
where
    G: LieGroup<D>,
    O: Observation<G, D, M>,
{
    let numerical =
        derivative_at_zero(|xi: &SVector<f64, D>| -observation.residual(&chi.compose(&G::exp(xi))));
    assert_close("H", &observation.left_jacobian(chi), &numerical, 1e-9);
}

#[test]
fn the_models_are_differentiated_where_the_parameters_are() {
    let mut rng = seeded(401);
    let in_plane = Unknowns::new::<2, 5>(&PLANAR_PROCESS, &PLANAR_OUTPUTS).expect("five");
    let in_space = Unknowns::new::<3, 9>(&SPATIAL_PROCESS, &SPATIAL_OUTPUTS).expect("nine");
    for _ in 0..20 {
        let state = planar(&mut rng);
        assert_transition(
            &state,
            &in_plane,
            &OdometryStep::new(&normal::<3, 1>(&mut rng), 0.1),
        );
        let pair = PlanarPair::new([any_fix(&mut rng), any_fix(&mut rng)]);
        assert_observed::<Planar, _, 8, 4>(&state, &in_plane.observe(pair));
        let state = spatial(&mut rng);
        assert_transition(
            &state,
            &in_space,
            &OdometryStep::new(&normal::<6, 1>(&mut rng), 0.1),
        );
        let pair = SpatialPair::new([any_fix(&mut rng), any_fix(&mut rng)]);
        assert_observed::<Spatial, _, 15, 6>(&state, &in_space.observe(pair));
    }
    assert!(
        Unknowns::new::<3, 8>(&SPATIAL_PROCESS, &SPATIAL_OUTPUTS).is_none(),
        "nine, not eight"
    );
}

fn assert_group<const D: usize, G: LieGroup<D>>(x: G, y: G, rng: &mut ChaCha8Rng) {
    let same = |what: &str, a: G, b: G| {
        assert_close(
            what,
            &a.compose(&b.inverse()).log(),
            &SVector::zeros(),
            1e-11,
        );
    };
    let xi = 0.5 * normal::<D, 1>(rng);
    same("exp of log", G::exp(&x.log()), x);
    same(
        "inverse",
        x.compose(&y).inverse(),
        y.inverse().compose(&x.inverse()),
    );
    same(
        "Ad",
        x.compose(&G::exp(&xi)),
        G::exp(&(x.adjoint() * xi)).compose(&x),
    );
    let there = G::exp(&xi);
    let numerical =
        derivative_at_zero(|d: &SVector<f64, D>| G::exp(&(xi + d)).compose(&there.inverse()).log());
    assert_close("Jl", &G::left_jacobian(&xi), &numerical, 1e-9);
    let product = G::left_jacobian(&xi) * G::left_jacobian_inverse(&xi);
    assert_close("Jl inverse", &product, &SMatrix::identity(), 1e-12);
    let numerical = derivative_at_zero(|d: &SVector<f64, D>| G::exp(d).adjoint() * xi);
    let bracket = SMatrix::<f64, D, D>::from_fn(|row, column| {
        (G::ad(&SVector::from_fn(|i, _| f64::from(i == column))) * xi)[row]
    });
    assert_close("ad", &bracket, &numerical, 1e-9);
    same("identity", x.compose(&G::identity()), x);
    assert!(x.is_finite() && x.normalized().is_finite());
}

#[test]
fn the_augmented_state_is_a_group() {
    let mut rng = seeded(404);
    for _ in 0..10 {
        let (x, y) = (planar(&mut rng), planar(&mut rng));
        assert_group::<8, Planar>(x, y, &mut rng);
        let (x, y) = (spatial(&mut rng), spatial(&mut rng));
        assert_group::<15, Spatial>(x, y, &mut rng);
        let mut lost = x;
        lost.parameters[3] = f64::NAN;
        assert!(!lost.is_finite());
    }
}

#[test]
fn at_zero_the_columns_are_those_of_the_constraints() {
    let mut rng = seeded(402);
    let unknowns = Unknowns::new::<3, 9>(&SPATIAL_PROCESS, &SPATIAL_OUTPUTS).expect("nine");
    for _ in 0..10 {
        let state = Spatial::new(spatial(&mut rng).pose, SVector::zeros());
        let step = OdometryStep::<SE3>::new(&normal::<6, 1>(&mut rng), 0.1);
        let f = unknowns.step(&step, &state).left_jacobian;
        for (i, mismatch) in SPATIAL_PROCESS.iter().enumerate() {
            let column = f.fixed_view::<6, 1>(0, 6 + i).into_owned();
            assert_close("d", &column, &mismatch.direction(&step), 1e-14);
        }
        let pair = SpatialPair::new([any_fix(&mut rng), any_fix(&mut rng)]);
        let h = Observation::<Spatial, 15, 6>::left_jacobian(&unknowns.observe(pair), &state);
        let mut next = 6 + SPATIAL_PROCESS.len();
        for mismatch in SPATIAL_OUTPUTS {
            for column in mismatch.columns(&pair, &state.pose).as_slice() {
                assert_close("dh", &h.column(next).into_owned(), column, 1e-13);
                next += 1;
            }
        }
        assert_eq!(next, 15);
    }
}

/// An ordinary EKF on `(theta, x, y, m_u, m_s, m_r)`, all of it dense, with the model written out.
struct Ekf {
    x: DVector<f64>,
    p: DMatrix<f64>,
}

impl Ekf {
    fn predict(&mut self, dtheta: f64, u: Vector2<f64>, q_body: &Matrix3<f64>, walk: f64) {
        let rotation = |theta: f64| {
            let (sin, cos) = theta.sin_cos();
            Matrix2::new(cos, -sin, sin, cos)
        };
        let r = rotation(self.x[0]);
        let way = r * u;
        let (scaled, turned) = (
            way * (1.0 + self.x[3]),
            Vector2::new(-way.y, way.x) * (1.0 + self.x[3]),
        );
        let mut f = DMatrix::identity(6, 6);
        for row in 0..2 {
            f[(1 + row, 0)] = turned[row];
            f[(1 + row, 3)] = way[row];
            self.x[1 + row] += scaled[row];
        }
        self.x[0] += dtheta;
        let after = rotation(self.x[0]);
        let noise = after * q_body.fixed_view::<2, 2>(1, 1) * after.transpose();
        let mut q = DMatrix::identity(6, 6) * (walk * walk);
        q[(0, 0)] = q_body[(0, 0)];
        q.view_mut((1, 1), (2, 2)).copy_from(&noise);
        self.p = &f * &self.p * f.transpose() + q;
    }

    fn correct(&mut self, seen: [Vector2<f64>; 2], sigma: f64) {
        let (sin, cos) = self.x[5].sin_cos();
        let (x, y) = (self.x[1], self.x[2]);
        let scale = 1.0 + self.x[4];
        let expected = [cos * x + sin * y, -sin * x + cos * y, scale * x, scale * y];
        #[rustfmt::skip]
        let h = DMatrix::from_row_slice(4, 6, &[
            0.0, cos, sin, 0.0, 0.0, expected[1],
            0.0, -sin, cos, 0.0, 0.0, -expected[0],
            0.0, scale, 0.0, 0.0, x, 0.0,
            0.0, 0.0, scale, 0.0, y, 0.0,
        ]);
        let z = DVector::from_fn(4, |i, _| seen[i / 2][i % 2] - expected[i]);
        let n = DMatrix::identity(4, 4) * (sigma * sigma);
        let s = &h * &self.p * h.transpose() + &n;
        let k = &self.p * h.transpose() * s.try_inverse().expect("regular");
        let kept = DMatrix::identity(6, 6) - &k * &h;
        self.x += &k * z;
        self.p = &kept * &self.p * kept.transpose() + &k * n * k.transpose();
    }
}

const THREE: ([ProcessMismatch; 1], [OutputMismatch; 2]) =
    ([ProcessMismatch::OdometryScale], PLANAR_OUTPUTS);

fn variances() -> SVector<f64, 6> {
    let pose = start_variances();
    SVector::from_column_slice(&[pose.x, pose.y, pose.z, 0.0064, 0.0036, 0.0009])
}

fn noise(walk: f64) -> SMatrix<f64, 6, 6> {
    let mut q = SMatrix::<f64, 6, 6>::from_diagonal_element(walk * walk);
    q.fixed_view_mut::<3, 3>(0, 0).copy_from(&odometry_noise());
    q
}

#[test]
fn on_the_additive_error_it_is_an_ordinary_ekf() {
    const WALK: f64 = 0.01;
    let unknowns = Unknowns::new::<2, 3>(&THREE.0, &THREE.1).expect("three");
    for seed in 0..5 {
        let run = Run::draw(seed, Law::Constant);
        let mean = Augmented::<SE2, 3, 3, 6>::new(run.start, Vector3::zeros());
        let mut belief =
            Belief::<_, Additive, 6>::new(mean, Covariance::from_variances(&variances()));
        let mut ekf = Ekf {
            x: DVector::from_column_slice(&[
                run.start.rotation.angle_rad(),
                run.start.position.x,
                run.start.position.y,
                0.0,
                0.0,
                0.0,
            ]),
            p: DMatrix::from_diagonal(&DVector::from_column_slice(variances().as_slice())),
        };
        for (step, pair) in run.steps.iter().zip(&run.pairs) {
            assert_eq!(step.dt_s, DT_S);
            belief = propagate_augmented(&belief, &unknowns, step, &noise(WALK));
            update(&mut belief, &unknowns.observe(*pair), &UpdateOptions::PLAIN)
                .expect("an update");
            let kappa = step.kappa;
            ekf.predict(
                kappa.rotation.angle_rad(),
                kappa.position,
                &odometry_noise(),
                WALK,
            );
            ekf.correct(pair.fixes.map(|fix| fix.position_w), 3.0);
        }
        let theta = belief.mean.pose.rotation.angle_rad();
        assert!(((theta - ekf.x[0] + PI).rem_euclid(TAU) - PI).abs() < 1e-9);
        let position = Vector2::new(ekf.x[1], ekf.x[2]);
        assert_within("position", &belief.mean.pose.position, &position, 1e-8);
        let parameters = Vector3::new(ekf.x[3], ekf.x[4], ekf.x[5]);
        assert_within("parameters", &belief.mean.parameters, &parameters, 1e-10);
        let p = SMatrix::<f64, 6, 6>::from_column_slice(ekf.p.as_slice());
        assert_within("P", belief.covariance.matrix(), &p, 1e-9 * p.amax());
    }
}

#[test]
fn one_correction_on_the_left_and_on_the_right() {
    let unknowns = Unknowns::new::<2, 3>(&THREE.0, &THREE.1).expect("three");
    let run = Run::draw(7, Law::Constant);
    let mean = Augmented::<SE2, 3, 3, 6>::new(run.start, Vector3::zeros());
    let mut left = Belief::<_, Left, 6>::new(mean, Covariance::from_variances(&variances()));
    for (step, pair) in run.steps.iter().zip(&run.pairs).take(100) {
        left = propagate_augmented(&left, &unknowns, step, &noise(0.01));
        let seen = unknowns.observe(*pair);
        let mut right: Belief<_, Right, 6> = left.to_right();
        update(&mut left, &seen, &UpdateOptions::PLAIN).expect("an update");
        update(&mut right, &seen, &UpdateOptions::PLAIN).expect("an update");
        assert_within(
            "parameters",
            &right.mean.parameters,
            &left.mean.parameters,
            1e-12,
        );
        // exp(Ad xi) chi = chi exp(xi): one estimate, whichever side the step is written on.
        assert_within(
            "position",
            &right.mean.pose.position_w(),
            &left.mean.pose.position_w(),
            1e-10,
        );
    }
}

/// Schmidt's filter, written out: the gain's rows of the parameters are zero, and P follows Joseph.
#[test]
fn what_is_considered_does_not_move() {
    let mut rng = seeded(403);
    let unknowns = Unknowns::new::<2, 5>(&PLANAR_PROCESS, &PLANAR_OUTPUTS).expect("five");
    for _ in 0..20 {
        let state = planar(&mut rng);
        let sigmas =
            SVector::<f64, 8>::from_column_slice(&[0.05, 2.0, 2.0, 0.1, 0.1, 0.01, 0.1, 0.05]);
        let prior = Belief::<Planar, Left, 8>::new(state, covariance_of_scale(&sigmas, &mut rng));
        let pair = PlanarPair::new([any_fix(&mut rng), any_fix(&mut rng)]);
        let seen = unknowns.observe(pair);
        let mut posterior = prior;
        let rule = Consider { first: 3 };
        let correction =
            update_with(&mut posterior, &seen, &rule, &UpdateOptions::PLAIN).expect("an update");
        assert_eq!(posterior.mean.parameters, state.parameters);
        let (p, after) = (prior.covariance.matrix(), posterior.covariance.matrix());
        let of_parameters = p.fixed_view::<5, 5>(3, 3).into_owned();
        assert_within(
            "P_mm",
            &after.fixed_view::<5, 5>(3, 3).into_owned(),
            &of_parameters,
            1e-15,
        );
        let h = Observation::<Planar, 8, 4>::left_jacobian(&seen, &state);
        let s = h * p * h.transpose() + Observation::<Planar, 8, 4>::noise(&seen);
        let k = (p * h.transpose() * s.try_inverse().expect("regular"))
            .fixed_rows::<3>(0)
            .into_owned();
        let z = Observation::<Planar, 8, 4>::residual(&seen, &state);
        assert_close(
            "xi",
            &correction.xi.fixed_rows::<3>(0).into_owned(),
            &(k * z),
            1e-12,
        );
        // P_xx - K S K^T and P_xm - K H P_m: Schmidt's two equations.
        let of_pose = p.fixed_view::<3, 3>(0, 0) - k * s * k.transpose();
        assert_close(
            "P_xx",
            &after.fixed_view::<3, 3>(0, 0).into_owned(),
            &of_pose,
            1e-12,
        );
        let crossed = p.fixed_view::<3, 5>(0, 3) - k * h * p.fixed_view::<8, 5>(0, 3);
        assert_close(
            "P_xm",
            &after.fixed_view::<3, 5>(0, 3).into_owned(),
            &crossed,
            1e-12,
        );
    }
}

/// Considering tells the truth about what the plain filter hides: its errors are within its own covariance.
#[test]
fn a_considered_mismatch_keeps_the_filter_honest() {
    let unknowns = Unknowns::new::<2, 3>(&THREE.0, &THREE.1).expect("three");
    let (mut plain_nees, mut considered_nees) = (0.0, 0.0);
    const RUNS: u64 = 50;
    for seed in 0..RUNS {
        let run = Run::draw(seed, Law::Constant);
        let mean = Augmented::<SE2, 3, 3, 6>::new(run.start, Vector3::zeros());
        let mut considered =
            Belief::<_, Left, 6>::new(mean, Covariance::from_variances(&variances()));
        let prior = Covariance::from_variances(&start_variances());
        let mut plain = Belief::<SE2, Left, 3>::new(run.start, prior);
        for (step, pair) in run.steps.iter().zip(&run.pairs) {
            considered = propagate_augmented(&considered, &unknowns, step, &noise(0.0));
            let rule = Consider { first: 3 };
            update_with(
                &mut considered,
                &unknowns.observe(*pair),
                &rule,
                &UpdateOptions::PLAIN,
            )
            .expect("an update");
            plain = propagate_odometry(&plain, step, &odometry_noise());
            update(&mut plain, pair, &UpdateOptions::PLAIN).expect("an update");
        }
        let truth = run.truth.last().expect("steps");
        let nees = |pose: &SE2, p: Matrix3<f64>| {
            let xi = pose.inverse().compose(truth).log();
            (xi.transpose() * p.try_inverse().expect("regular") * xi).x / 3.0
        };
        plain_nees += nees(&plain.mean, *plain.covariance.matrix()) / RUNS as f64;
        let of_pose = considered
            .covariance
            .matrix()
            .fixed_view::<3, 3>(0, 0)
            .into_owned();
        considered_nees += nees(&considered.mean.pose, of_pose) / RUNS as f64;
    }
    println!("NEES: plain {plain_nees:.1}, considered {considered_nees:.2}");
    assert!(plain_nees > 100.0, "{plain_nees}");
    assert!(considered_nees < 3.0, "{considered_nees}");
}
