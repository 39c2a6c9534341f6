//! The first belief: what the engine waits for, in which order, and what it starts from.

mod common;

use common::{
    Engine, GRAVITY, Input, LEVER_ARM_B, PERIOD_NS, SIGMA, assert_refused, feed, header, heading,
    imu, imu_at_rest, isotropic, position, run, settings, stamp, state_on_circle, variance,
    velocity,
};
use inekf_service::engine::Settings;
use inekf_service::engine::settings::{LevelSource, PositionSource};
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, ESTIMATE_RESET, ESTIMATE_UPDATED, EstimateSe23, ImuSample, PositionFix,
    REASON_NOT_READY, STATE_ALIGNING, STATE_RUNNING, STATE_WAITING, StateVector, WAITING_FOR_IMU,
    WAITING_FOR_LEVEL, WAITING_FOR_NOTHING, WAITING_FOR_POSITION, WAITING_FOR_REQUEST,
    triangle_index,
};
use nalgebra::{Matrix3, Rotation3, Vector3};

const SECOND_NS: u64 = 1_000_000_000;
const WINDOW: u64 = 20;
const RUNNING: (u32, u32) = (STATE_RUNNING, WAITING_FOR_NOTHING);

/// Level over 20 intervals, position from the first fix.
fn unknown() -> Settings {
    let mut settings = settings();
    settings.initial.level = LevelSource::Accelerometer {
        window_ns: WINDOW * PERIOD_NS,
    };
    settings.initial.position = PositionSource::FirstFix;
    settings.initial.velocity_w = Vector3::zeros();
    settings
}

struct Bench {
    engine: Engine,
    rows: Vec<EstimateSe23>,
}

impl Bench {
    fn new(settings: Settings) -> Self {
        Self {
            engine: Engine::new(settings),
            rows: Vec::new(),
        }
    }

    fn feed(&mut self, input: Input) {
        feed(&mut self.engine, &input, &mut self.rows);
    }

    /// Samples of a body at rest.
    fn rest(&mut self, samples: impl Iterator<Item = u64>) {
        samples.for_each(|k| self.feed(Input::Imu(imu_at_rest(k))));
    }

    fn fix(&mut self, stamp_ns: u64) {
        self.feed(Input::Position(position(stamp_ns, 0, 0)));
    }

    fn assert_state(&self, expected: (u32, u32)) {
        assert_eq!(self.engine.state(), expected);
        assert_eq!(self.engine.snapshot().is_some(), expected == RUNNING);
    }

    fn state(&self) -> StateVector {
        self.engine.snapshot().unwrap()
    }
}

#[test]
fn it_waits_for_samples_then_for_a_position_then_for_the_level() {
    let mut bench = Bench::new(unknown());
    bench.assert_state((STATE_WAITING, WAITING_FOR_IMU));
    bench.rest(0..5);
    bench.assert_state((STATE_WAITING, WAITING_FOR_POSITION));
    bench.fix(stamp(4));
    bench.assert_state((STATE_ALIGNING, WAITING_FOR_LEVEL));
    bench.rest(5..WINDOW);
    bench.assert_state((STATE_ALIGNING, WAITING_FOR_LEVEL));
    assert!(bench.rows.is_empty());
    bench.rest(WINDOW..WINDOW + 1);
    bench.assert_state(RUNNING);

    // It started at the fix and was propagated to the sample at once.
    assert_eq!(bench.rows.len(), 1);
    assert_eq!(bench.rows[0].head.stamp_ns, stamp(WINDOW));
    assert_eq!(bench.rows[0].head.flags, ESTIMATE_PROPAGATED);
    assert_eq!(bench.rows[0].head.reset_count, 0);
    assert_eq!(bench.engine.tally().counters.accepted, 1);
    assert_refused(bench.engine.tally(), &[]);
}

#[test]
fn a_position_before_the_first_sample_is_kept() {
    let mut bench = Bench::new(unknown());
    bench.fix(stamp(0));
    bench.assert_state((STATE_WAITING, WAITING_FOR_IMU));
    bench.rest(0..1);
    bench.assert_state((STATE_ALIGNING, WAITING_FOR_LEVEL));
    bench.rest(1..=WINDOW);
    bench.assert_state(RUNNING);
}

#[test]
fn a_position_after_the_level_starts_at_once() {
    let mut bench = Bench::new(unknown());
    bench.rest(0..100);
    bench.assert_state((STATE_WAITING, WAITING_FOR_POSITION));
    bench.fix(stamp(99) - 1);
    bench.rest(100..101);
    bench.assert_state(RUNNING);
}

#[test]
fn a_position_ahead_of_the_samples_waits_for_them() {
    // Between two samples: the state starts there and the next sample is propagated to.
    let mut bench = Bench::new(unknown());
    bench.fix(stamp(40) + 1);
    bench.rest(0..41);
    bench.assert_state((STATE_ALIGNING, WAITING_FOR_LEVEL));
    bench.rest(41..42);
    bench.assert_state(RUNNING);
    assert_eq!(bench.rows.len(), 1);
    assert_eq!(bench.rows[0].head.stamp_ns, stamp(41));

    // At a sample: the state starts there, and there was nothing to propagate.
    let mut bench = Bench::new(unknown());
    bench.fix(stamp(40));
    bench.rest(0..41);
    bench.assert_state(RUNNING);
    assert!(bench.rows.is_empty());
    assert_eq!(bench.state().stamp_ns, stamp(40));
}

#[test]
fn the_newest_position_is_kept_and_the_others_are_counted() {
    let mut bench = Bench::new(unknown());
    for k in [0, 5, 10] {
        let mut fix = position(stamp(k), k, 0);
        fix.position_w_m = [k as f64, 0.0, 0.0];
        bench.feed(Input::Position(fix));
    }
    bench.rest(0..=WINDOW);
    assert_eq!(bench.state().p_w_m[0], 10.0);
    assert_refused(bench.engine.tally(), &[(REASON_NOT_READY, 2)]);
    assert_eq!(bench.engine.tally().counters.accepted, 1);
}

#[test]
fn an_old_position_is_no_place_to_start_from() {
    // As old as a late fix may be, and then one nanosecond more.
    for (fix_ns, starts) in [(stamp(0), true), (stamp(0) - 1, false)] {
        let mut bench = Bench::new(unknown());
        bench.rest(0..100);
        bench.fix(fix_ns);
        bench.rest(100..101);
        bench.assert_state(if starts {
            RUNNING
        } else {
            (STATE_WAITING, WAITING_FOR_POSITION)
        });
        let refused: &[_] = if starts {
            &[]
        } else {
            &[(REASON_NOT_READY, 1)]
        };
        assert_refused(bench.engine.tally(), refused);
    }
}

#[test]
fn a_given_position_starts_when_it_is_level() {
    let mut given = unknown();
    given.initial.position = PositionSource::Given {
        position_w: Vector3::new(1.0, 2.0, 3.0),
        sigma: 0.25,
    };
    let mut bench = Bench::new(given);
    bench.assert_state((STATE_WAITING, WAITING_FOR_IMU));
    bench.rest(0..1);
    bench.assert_state((STATE_ALIGNING, WAITING_FOR_LEVEL));
    // A fix is not needed and has nothing to correct.
    bench.fix(stamp(0));
    assert_refused(bench.engine.tally(), &[(REASON_NOT_READY, 1)]);
    bench.rest(1..=WINDOW);
    bench.assert_state(RUNNING);
    let state = bench.state();
    assert_eq!(state.p_w_m, [1.0, 2.0, 3.0]);
    for i in 6..9 {
        assert!((variance(&state, i) - 0.0625).abs() < 1e-15);
    }
}

#[test]
fn everything_given_starts_at_the_first_sample() {
    let mut bench = Bench::new(settings());
    bench.feed(Input::Imu(imu(0)));
    bench.assert_state(RUNNING);
    assert!(bench.rows.is_empty());
    let state = bench.state();
    assert_eq!(state.stamp_ns, stamp(0));
    assert_eq!(state.v_w_mps, [5.0, 0.0, 0.0]);
    let sigmas: Vec<f64> = (0..15).map(|i| variance(&state, i).sqrt()).collect();
    let (degree, heading) = (1f64.to_radians(), 10f64.to_radians());
    let expected = [
        degree, degree, heading, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1,
    ];
    for (i, (sigma, expected)) in sigmas.iter().zip(expected).enumerate() {
        assert!((sigma - expected).abs() < 1e-12, "component {i}: {sigma}");
    }
}

#[test]
fn a_given_attitude_is_taken() {
    let mut tilted = settings();
    tilted.initial.level = LevelSource::Given {
        roll: 0.2,
        pitch: -0.3,
    };
    tilted.initial.heading = 2.0;
    let mut bench = Bench::new(tilted);
    bench.feed(Input::Imu(imu(0)));
    assert_attitude(&bench.state(), &attitude(0.2, -0.3, 2.0));
}

/// Body to world: `Rz(heading) Ry(pitch) Rx(roll)`.
fn attitude(roll: f64, pitch: f64, heading: f64) -> Matrix3<f64> {
    let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let r_wb = turn(Vector3::z_axis(), heading)
        * turn(Vector3::y_axis(), pitch)
        * turn(Vector3::x_axis(), roll);
    *r_wb.matrix()
}

fn rotation(state: &StateVector) -> Matrix3<f64> {
    let [x, y, z, w] = state.q_wb;
    let q = nalgebra::Quaternion::new(w, x, y, z);
    *nalgebra::UnitQuaternion::from_quaternion(q)
        .to_rotation_matrix()
        .matrix()
}

fn assert_attitude(state: &StateVector, expected: &Matrix3<f64>) {
    let error = (rotation(state) - expected).amax();
    assert!(error < 1e-12, "{error}");
}

/// What a resting body of this attitude feels, with an alternating disturbance that averages out.
fn tilted_sample(k: u64, r_wb: &Matrix3<f64>) -> ImuSample {
    let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let force_b = r_wb.transpose() * Vector3::new(0.0, 0.0, GRAVITY) + Vector3::repeat(0.3 * sign);
    ImuSample {
        accel_mps2: force_b.into(),
        ..imu_at_rest(k)
    }
}

#[test]
fn the_level_is_the_mean_over_the_window_alone() {
    let mut settings = unknown();
    settings.initial.heading = -1.0;
    // 19 intervals hold 20 samples: as many of either sign.
    settings.initial.level = LevelSource::Accelerometer {
        window_ns: 19 * PERIOD_NS,
    };
    let r_wb = attitude(0.15, -0.08, -1.0);
    let mut bench = Bench::new(settings);
    // A different attitude first, which must be forgotten.
    for k in 0..200 {
        let then = attitude(-0.4, 0.5, 0.0);
        let now = if k < 100 { then } else { r_wb };
        bench.feed(Input::Imu(tilted_sample(k, &now)));
    }
    bench.fix(stamp(200));
    bench.feed(Input::Imu(tilted_sample(200, &r_wb)));
    assert_attitude(&bench.state(), &r_wb);
}

#[test]
fn in_free_fall_there_is_no_level() {
    let mut bench = Bench::new(unknown());
    bench.fix(stamp(30));
    for k in 0..50 {
        let sample = ImuSample {
            accel_mps2: [0.0, 0.0, 0.01],
            ..imu_at_rest(k)
        };
        bench.feed(Input::Imu(sample));
    }
    bench.assert_state((STATE_ALIGNING, WAITING_FOR_LEVEL));
    bench.rest(50..90);
    bench.assert_state(RUNNING);
}

/// The state that starts from a fix of source 1 in this attitude, at the fix's stamp.
fn start_with_lever_arm(r_wb: &Matrix3<f64>, heading: f64, fix: &PositionFix) -> StateVector {
    let mut settings = unknown();
    settings.initial.heading = heading;
    settings.initial.level = LevelSource::Accelerometer {
        window_ns: 19 * PERIOD_NS,
    };
    let mut bench = Bench::new(settings);
    bench.feed(Input::Position(*fix));
    for k in 0..20 {
        bench.feed(Input::Imu(tilted_sample(k, r_wb)));
    }
    bench.state()
}

#[test]
fn the_first_fix_is_the_antennas_and_the_state_the_imus() {
    let r_wb = attitude(0.15, -0.08, 0.7);
    let fix = PositionFix {
        header: header(stamp(19), 0),
        source: 1,
        dimension: 3,
        position_w_m: [100.0, -50.0, 7.0],
        covariance_w_m2: [0.04, 0.01, 0.0, 0.01, 0.09, 0.02, 0.0, 0.02, 0.25],
    };
    let state = start_with_lever_arm(&r_wb, 0.7, &fix);
    assert_attitude(&state, &r_wb);
    let lever_b = Vector3::from(LEVER_ARM_B);
    let antenna_w = Vector3::from(state.p_w_m) + r_wb * lever_b;
    assert!((antenna_w - Vector3::from(fix.position_w_m)).amax() < 1e-9);

    // The antenna is known as well as the fix says, although the attitude is not: H P H^T = N with
    // H = [-R [l]x, 0, R].
    let p = |row: usize, column: usize| {
        Matrix3::from_fn(|i, j| state.covariance[triangle_index(row + i, column + j, 15).unwrap()])
    };
    let h_rotation = -r_wb * lever_b.cross_matrix();
    let cross = h_rotation * p(0, 6) * r_wb.transpose();
    let antenna = h_rotation * p(0, 0) * h_rotation.transpose()
        + cross
        + cross.transpose()
        + r_wb * p(6, 6) * r_wb.transpose();
    let noise = Matrix3::from_row_slice(&fix.covariance_w_m2);
    assert!((antenna - noise).amax() < 1e-12);
}

#[test]
fn only_a_request_starts_where_so_configured() {
    let mut requested = unknown();
    requested.initial.wait_for_request = true;
    let mut bench = Bench::new(requested);
    bench.assert_state((STATE_WAITING, WAITING_FOR_REQUEST));
    bench.rest(0..100);
    bench.fix(stamp(99));
    bench.rest(100..110);
    bench.assert_state((STATE_WAITING, WAITING_FOR_REQUEST));
    assert_refused(bench.engine.tally(), &[(REASON_NOT_READY, 1)]);
    assert!(bench.rows.is_empty());
    let state = state_on_circle(stamp(110), 1.0);
    bench.engine.set_state(&state).unwrap();
    bench.assert_state(RUNNING);
}

#[test]
fn a_reset_initialises_anew_and_says_how_far_it_jumped() {
    let mut bench = Bench::new(unknown());
    bench.fix(stamp(0));
    bench.rest(0..100);
    let before = bench.rows.last().unwrap().p_w_m;
    bench.engine.reset();
    bench.assert_state((STATE_WAITING, WAITING_FOR_IMU));
    bench.engine.reset();

    // An earlier clock is fine after a reset.
    let mut fix = position(stamp(10), 0, 0);
    fix.position_w_m = [3.0, 4.0, 0.0];
    bench.feed(Input::Position(fix));
    let published = bench.rows.len();
    bench.rest(10..60);
    bench.assert_state(RUNNING);
    let jump = (Vector3::from(fix.position_w_m) - Vector3::from(before)).norm();
    for (n, row) in bench.rows[published..].iter().enumerate() {
        assert_eq!(row.head.flags & ESTIMATE_RESET != 0, n == 0, "row {n}");
        assert_eq!(row.head.reset_count, 1);
        assert!((row.head.reset_jump_m - jump).abs() < 1e-9);
    }
    assert_refused(bench.engine.tally(), &[]);
}

#[test]
fn a_reset_while_waiting_is_no_jump() {
    let mut bench = Bench::new(unknown());
    bench.rest(0..5);
    bench.fix(stamp(4));
    bench.engine.reset();
    bench.assert_state((STATE_WAITING, WAITING_FOR_IMU));
    assert_refused(bench.engine.tally(), &[(REASON_NOT_READY, 1)]);
    bench.fix(stamp(5));
    bench.rest(5..60);
    let first = &bench.rows[0].head;
    assert_eq!((first.reset_count, first.flags), (0, ESTIMATE_PROPAGATED));
}

#[test]
fn without_a_fix_for_long_it_is_degraded_until_the_next_one() {
    let mut bench = Bench::new(settings());
    let degraded = (inekf_shared::message::STATE_DEGRADED, WAITING_FOR_NOTHING);
    let is_degraded = |row: &EstimateSe23| {
        let flag = row.head.flags & inekf_shared::message::ESTIMATE_DEGRADED != 0;
        assert_eq!(flag, row.head.state == degraded.0);
        flag
    };
    let rest = |k| Input::Imu(imu(k));
    // Five seconds from the start, not a sample less.
    (0..=500).for_each(|k| bench.feed(rest(k)));
    assert_eq!(bench.engine.state(), RUNNING);
    bench.feed(rest(501));
    assert_eq!(bench.engine.state(), degraded);
    assert!(!is_degraded(&bench.rows[499]) && is_degraded(&bench.rows[500]));

    // A refused and a gated fix are none.
    let mut bad = position(stamp(501), 0, 0);
    bad.covariance_w_m2 = [0.0; 9];
    bench.feed(Input::Position(bad));
    let mut far = position(stamp(501), 0, 0);
    far.position_w_m[0] += 1e4;
    bench.feed(Input::Position(far));
    assert_eq!(bench.engine.tally().counters.gated, 1);
    bench.feed(rest(502));
    assert_eq!(bench.engine.state(), degraded);

    // Any kind of fix counts.
    for (k, fix) in [
        (503, Input::Position(position(stamp(503), 0, 0))),
        (1004, Input::Velocity(velocity(stamp(1004), 0))),
        (1505, Input::Heading(heading(stamp(1505), 0))),
        (2006, Input::Position(position(stamp(2006), 1, 1))),
    ] {
        let published = bench.rows.len();
        bench.feed(fix);
        bench.feed(rest(k));
        let rows = &bench.rows[published..];
        assert_eq!(rows.len(), 2);
        assert!(is_degraded(&rows[0]), "propagated, before the fix");
        assert!(!is_degraded(&rows[1]), "corrected");
        assert_eq!(rows[1].head.flags, ESTIMATE_UPDATED);
        (k + 1..=k + 500).for_each(|k| bench.feed(rest(k)));
        assert_eq!(bench.engine.state(), RUNNING);
    }
    // A late one counts from its own stamp.
    bench.feed(rest(2507));
    assert_eq!(bench.engine.state(), degraded);
    bench.feed(Input::Position(position(stamp(2507) - SECOND_NS / 2, 2, 0)));
    assert_eq!(bench.engine.state(), RUNNING);
    (2508..=2957).for_each(|k| bench.feed(rest(k)));
    assert_eq!(bench.engine.state(), RUNNING);
    bench.feed(rest(2958));
    assert_eq!(bench.engine.state(), degraded);
}

#[test]
fn a_levelled_start_converges_to_the_circle() {
    // Heading within 10 deg, speed unknown, from the accelerometer of a turning vehicle.
    let mut settings = unknown();
    settings.initial.level_sigma = 10f64.to_radians();
    settings.initial.velocity_sigma = 10.0;
    let mut inputs = common::circle(30);
    for input in &mut inputs {
        if let Input::Position(fix) = input {
            fix.covariance_w_m2 = isotropic(SIGMA);
        }
    }
    let (engine, _) = run(settings, &inputs);
    let state = engine.snapshot().unwrap();
    assert!(common::position_error(&state) < 0.3);
    let speed = Vector3::from(state.v_w_mps) - common::true_velocity(state.stamp_ns);
    assert!(speed.norm() < 0.3);
}
