//! The columns themselves: against numerical derivatives, through stops, and at start-up.

use inekf::filter::{
    Belief, Constrained, Covariance, GainRule, Kalman, Left, UpdateError, UpdateOptions,
    update_with,
};
use inekf::lie::{LieGroup, SE23};
use inekf::model::{
    Declared, Discretisation, ImuIncrement, ImuInput, ImuNoise, ImuStep, InertialMismatch,
    InertialScale, InertialState, Motion, NavState, Observation, OutputMismatch, PathNoise,
    ProcessColumns, SpatialPair,
};
use nalgebra::{SVector, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::common::{
    GRAVITY_W, NOISE, any_belief, any_input, any_pose, any_state, assert_close, assert_within,
    derivative_at_zero, normal, seeded,
};
use crate::drive::{DT_S, LEVER_ARMS_B, SILENT, ZOH, fix_of_origin, fixes_of, linearised, sampled};
use crate::fault::{ACCEL_SCALE, Fault, GYRO_SCALE, SCALE, accel_bias, every_kind, gyro_bias};

const SCHEMES: [Discretisation; 2] = [ZOH, Discretisation::Euler];
/// The column over several steps against the error that a wrong input makes.
fn assert_column<G, T, const D: usize>(start: G, mismatch: T, rng: &mut ChaCha8Rng)
where
    G: InertialState<D>,
    T: Fault,
    ImuIncrement: Motion<D, 3, Mismatch = T, Noise = ImuNoise>,
{
    for scheme in SCHEMES {
        let samples: [(ImuInput, f64); 4] =
            [0.02, 0.3, 0.0, 0.1].map(|dt_s| (any_input(rng), dt_s));
        let mut columns = ProcessColumns::new(&[Declared::hard(mismatch)]).expect("room");
        let mut assumed = start;
        for (measured, dt_s) in &samples {
            let increment = assumed.increment(measured, &GRAVITY_W, *dt_s, scheme);
            columns.advance(&increment, &SILENT);
            assumed = assumed.moved(&increment);
        }
        let numerical = derivative_at_zero(|m: &SVector<f64, 1>| {
            let truth = samples.iter().fold(start, |chi, (measured, dt_s)| {
                let without_bias = ImuInput {
                    omega_b: measured.omega_b - chi.gyro_bias(),
                    force_b: measured.force_b - chi.accel_bias(),
                };
                let actual = mismatch.actual(&without_bias, m.x);
                let step = ImuStep::new(&actual, &GRAVITY_W, *dt_s, scheme);
                G::from_parts(
                    step.step.apply(chi.pose()),
                    chi.gyro_bias(),
                    chi.accel_bias(),
                )
            });
            assumed.inverse().compose(&truth).log()
        });
        let (_, column) = columns.active().next().expect("one column");
        assert!(numerical.amax() > 0.1, "a mismatch moves something");
        assert_close("d", &column, &numerical, 1e-8);
        columns.reset();
        assert_eq!(columns.active().next().expect("no gate").1.amax(), 0.0);
    }
}

#[test]
fn a_wrong_imu_moves_the_state_along_its_column() {
    let mut rng = seeded(501);
    for _ in 0..10 {
        for mismatch in every_kind() {
            assert_column::<SE23, _, 9>(any_pose(&mut rng), mismatch, &mut rng);
        }
        for scale in [InertialScale::Gyro, InertialScale::Accel] {
            assert_column::<NavState, _, 15>(any_state(&mut rng), scale, &mut rng);
        }
    }
}

#[test]
fn an_error_and_a_wrong_input_move_as_the_dense_products_say() {
    let mut rng = seeded(502);
    for scheme in SCHEMES {
        for _ in 0..50 {
            let state = any_state(&mut rng);
            let increment = state.increment(&any_input(&mut rng), &GRAVITY_W, 0.2, scheme);
            let step = ImuStep::from(&increment);
            let off = any_input(&mut rng);
            let disturbance = SVector::<f64, 6>::from_fn(|i, _| {
                if i < 3 {
                    off.omega_b[i]
                } else {
                    off.force_b[i - 3]
                }
            });
            let by_input = step.input_jacobian * disturbance;
            let transition = increment.left_transition();

            let xi = normal::<9, 1>(&mut rng);
            let dense = state.pose.transition(&step).1 * xi + by_input;
            assert_close("9", &transition.moved(&xi, &off), &dense, 1e-13);

            let xi = normal::<15, 1>(&mut rng);
            let mut dense = state.transition(&step).1 * xi;
            for row in 0..9 {
                dense[row] += by_input[row];
            }
            assert_close("15", &transition.moved(&xi, &off), &dense, 1e-13);
        }
    }
}

#[test]
fn white_noise_is_integrated_over_steps_of_any_length() {
    let mut path = PathNoise::default();
    let mut rng = seeded(503);
    let mut time_s = 0.0;
    for dt_s in [0.1, 0.02, 0.4, 0.0, 0.005] {
        let step = ImuIncrement::new(&any_input(&mut rng), &GRAVITY_W, dt_s, ZOH);
        Motion::<9, 3>::lengthen(&step, &mut path, &NOISE);
        time_s += dt_s;
    }
    let expected = [
        (path.turn, NOISE.gyro_psd * time_s),
        (path.velocity, NOISE.accel_psd * time_s),
        (path.velocity_way, NOISE.accel_psd * time_s.powi(2) / 2.0),
        (path.way, NOISE.accel_psd * time_s.powi(3) / 3.0),
    ];
    for (actual, expected) in expected {
        assert!((actual - expected).abs() < 1e-14 * expected);
    }
}

#[test]
fn a_push_that_no_position_shows_yet_waits() {
    let mut rng = seeded(532);
    let euler = Discretisation::Euler;
    let mut belief: Belief<SE23, Left, 9> = any_belief(any_pose(&mut rng), 0.1, &mut rng);
    let fix = fix_of_origin();
    let axis_b = Vector3::new(0.36, 0.48, -0.8);
    let mut columns = ProcessColumns::new(&[Declared::hard(accel_bias(axis_b))]).expect("room");
    let steps = [(); 2].map(|()| ImuIncrement::new(&any_input(&mut rng), &GRAVITY_W, 0.1, euler));

    // The paper's scheme moves the velocity first: after one step no gain takes it back from a position.
    columns.advance(&steps[0], &NOISE);
    let before = belief;
    let rule = Constrained::new(&belief, &columns, &[], &fix);
    let refused = update_with(&mut belief, &fix, &rule, &UpdateOptions::PLAIN);
    assert_eq!(refused, Err(UpdateError::UnsolvableConstraints));
    assert_eq!(belief, before);

    columns.hide_unseen::<SE23, 3, 3>(&fix.left_jacobian(&belief.mean));
    assert_eq!(columns.active_bits(), 0);
    let at = linearised(&belief, &fix);
    let gain = Constrained::new(&belief, &columns, &[], &fix).gain(&belief.covariance, &at);
    let kalman = Kalman.gain(&belief.covariance, &at).expect("regular");
    assert_within(
        "gain",
        &gain.expect("solvable"),
        &kalman,
        1e-14 * kalman.amax(),
    );
    columns.reset();

    columns.advance(&steps[1], &NOISE);
    columns.hide_unseen::<SE23, 3, 3>(&fix.left_jacobian(&belief.mean));
    let (_, column) = columns.active().next().expect("it is seen now");
    let step = steps.each_ref().map(ImuStep::from);
    let pushed = SVector::<f64, 6>::from_fn(|i, _| if i < 3 { 0.0 } else { axis_b[i - 3] });
    let both = step[1].step.left_jacobian() * step[0].input_jacobian * pushed
        + step[1].input_jacobian * pushed;
    assert_close("of both steps", &column, &both, 1e-14);
    columns.reset();
    assert_eq!(columns.active().next().expect("no gate").1.amax(), 0.0);
}

#[test]
fn standing_still_a_turn_is_seen_by_a_lever_arm_alone() {
    let mut rng = seeded(533);
    let belief = Belief::<SE23, Left, 9>::new(
        SE23::identity(),
        Covariance::from_variances(&SVector::zeros()),
    );
    let still = ImuInput {
        omega_b: Vector3::zeros(),
        force_b: -GRAVITY_W,
    };
    let declared = [gyro_bias(Vector3::z()), GYRO_SCALE, ACCEL_SCALE].map(Declared::hard);
    let mut columns = ProcessColumns::new(&declared).expect("room");
    let pair: SpatialPair = fixes_of(LEVER_ARMS_B);
    for second in 0..10 {
        for _ in 0..20 {
            let input = sampled(&still, 1.0, &mut rng);
            columns.advance(&ImuIncrement::new(&input, &GRAVITY_W, DT_S, ZOH), &NOISE);
        }
        // The scale of the turn is noise, that of gravity is not; the bias turns the body about itself.
        let mut seen = columns;
        seen.hide_unseen::<SE23, 3, 6>(&pair.left_jacobian(&belief.mean));
        assert_eq!(seen.active_bits(), 0b101, "second {second}");
        columns.hide_unseen::<SE23, 3, 3>(&fix_of_origin().left_jacobian(&belief.mean));
        assert_eq!(columns.active_bits(), 0b100, "second {second}");
        columns.reset();
    }
    // What has waited is all there: 10 s of turning.
    let (_, column) = columns
        .active()
        .next()
        .expect("after the reset, until it is hidden");
    assert!((column[2] - 10.0).abs() < 1e-3, "{column}");
}

#[test]
fn at_start_up_what_the_sources_cannot_tell_apart_is_refused() {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let check = |declared: &[InertialMismatch], outputs: &[OutputMismatch], is_pair: bool| {
        let declared: Vec<_> = declared.iter().copied().map(Declared::hard).collect();
        let outputs: Vec<_> = outputs.iter().copied().map(Declared::hard).collect();
        let columns =
            ProcessColumns::<9, _>::in_general_motion::<ImuIncrement, 3>(&declared).expect("room");
        if is_pair {
            let pair: SpatialPair = fixes_of(LEVER_ARMS_B);
            Constrained::check::<SE23>(&columns, &outputs, &pair)
        } else {
            Constrained::check::<SE23>(&columns, &outputs, &fix_of_origin())
        }
    };
    let refused = Err(UpdateError::UnsolvableConstraints);
    let [g_x, g_y, g_z] = axes.map(gyro_bias);
    let [a_x, a_y, a_z] = axes.map(accel_bias);
    for mismatch in every_kind() {
        assert_eq!(check(&[mismatch], &[], false), Ok(1));
    }
    assert_eq!(check(&[a_x, a_y, a_z], &[], false), Ok(3));
    assert_eq!(check(&[a_x, a_y, a_z, GYRO_SCALE], &[], false), refused);
    // One column that follows from others is none; one that differs in T is.
    assert_eq!(check(&[g_x, gyro_bias(-2.0 * axes[0])], &[], false), Ok(1));
    // Two points at a known distance see five dimensions, a wrong scale of theirs is in the sixth.
    assert_eq!(check(&[g_x, g_y, g_z, a_x, a_y], &[], true), Ok(5));
    assert_eq!(check(&[g_x, g_y, g_z, a_x, a_y], &[SCALE], true), Ok(6));
    let both = [OutputMismatch::MeasurementScale { source: 0 }, SCALE];
    assert_eq!(check(&[g_x, g_y, g_z, a_x, a_y], &both, true), refused);
    assert!(ProcessColumns::<9, _>::new(&[Declared::hard(g_x); 6]).is_none());

    // A state with biases has scales to declare, and nothing else.
    let scales = [InertialScale::Gyro, InertialScale::Accel].map(Declared::hard);
    let columns =
        ProcessColumns::<15, _>::in_general_motion::<ImuIncrement, 3>(&scales).expect("room");
    let single = fix_of_origin();
    assert_eq!(
        Constrained::check::<NavState>(&columns, &[], &single),
        Ok(2)
    );
}
