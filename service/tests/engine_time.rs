//! The time base: which stamps are believed, and what a gap does.

mod common;

use common::{
    Direct, EPOCH, Engine, Input, PERIOD_NS, all_bits, assert_refused, belief_bits, circle,
    engine_at, feed, imu, input_of, lively_imu, position, run, settings, stamp, state_on_circle,
    variance,
};
use inekf::model::ImuInput;
use inekf_shared::message::{
    ESTIMATE_RESET, EstimateSe23, ImuSample, REASON_GAP, REASON_NOT_READY, REASON_STAMP_NOT_AFTER,
    STATE_RUNNING, StateVector,
};

/// Samples that must agree on a jump of time before it is believed.
const CONFIRMATIONS: u64 = 10;
const SECOND_NS: u64 = 1_000_000_000;

/// Sample `k` with its stamp moved by `by_ns`, from the sender of this epoch.
fn moved(k: u64, by_ns: i64, epoch: u64) -> Input {
    let mut sample = imu(k);
    sample.header.stamp_ns = sample.header.stamp_ns.checked_add_signed(by_ns).unwrap();
    sample.header.epoch = epoch;
    Input::Imu(sample)
}

/// Sample `k` as the next one after sample `after`, however long that is.
fn next_at(k: u64, after: u64) -> Input {
    let mut sample = lively_imu(k);
    sample.header.seq = after + 1;
    Input::Imu(sample)
}

/// 100 samples, then `inputs`.
fn after_a_second(inputs: &[Input]) -> (Engine, Vec<EstimateSe23>) {
    let mut all: Vec<_> = (0..100).map(|k| Input::Imu(imu(k))).collect();
    all.extend_from_slice(inputs);
    run(settings(), &all)
}

#[test]
fn wrong_stamps_far_ahead_do_not_move_the_clock() {
    let good = circle(3);
    let (_, clean) = run(settings(), &good);
    let ahead_ns = 3600 * SECOND_NS as i64;
    // As many as do not yet confirm each other; then as many as can be that never agree.
    for (wrong, count) in [
        (
            (0..CONFIRMATIONS - 1)
                .map(|k| moved(k, ahead_ns, EPOCH))
                .collect::<Vec<_>>(),
            9,
        ),
        (
            (0..50)
                .map(|k| moved(0, ahead_ns * (1 + k % 2), EPOCH))
                .collect(),
            50,
        ),
        (
            (0..50)
                .map(|k| moved(0, ahead_ns * (1 + k), EPOCH))
                .collect(),
            50,
        ),
    ] {
        let mut inputs = good.clone();
        inputs.splice(150..150, wrong);
        let (engine, estimates) = run(settings(), &inputs);
        assert_refused(engine.tally(), &[(REASON_GAP, count)]);
        assert!(all_bits(&estimates) == all_bits(&clean));
    }
}

#[test]
fn a_good_sample_in_between_starts_the_confirmation_anew() {
    let mut inputs = Vec::new();
    for k in 100..200 {
        inputs.push(moved(k, 3600 * SECOND_NS as i64, EPOCH));
        inputs.push(Input::Imu(imu(k)));
    }
    let (engine, estimates) = after_a_second(&inputs);
    assert_refused(engine.tally(), &[(REASON_GAP, 100)]);
    assert_eq!(estimates.last().unwrap().head.reset_count, 0);
}

/// A jump that lasts: refused until confirmed, then a new start, announced once.
fn assert_believed(by_ns: i64, epoch: u64, reason: u32) {
    let inputs: Vec<_> = (100..200).map(|k| moved(k, by_ns, epoch)).collect();
    let (engine, estimates) = after_a_second(&inputs);
    assert_refused(engine.tally(), &[(reason, CONFIRMATIONS - 1)]);
    // The tenth starts, the eleventh is the first to be propagated to.
    let first = &estimates[99];
    assert_eq!(
        first.head.stamp_ns,
        stamp(100 + CONFIRMATIONS)
            .checked_add_signed(by_ns)
            .unwrap()
    );
    for (row, estimate) in estimates.iter().enumerate() {
        assert_eq!(
            estimate.head.flags & ESTIMATE_RESET != 0,
            row == 99,
            "row {row}"
        );
        assert_eq!(estimate.head.reset_count, u64::from(row >= 99));
    }
    let last = estimates.last().unwrap();
    assert_eq!(
        last.head.stamp_ns,
        stamp(199).checked_add_signed(by_ns).unwrap()
    );
    assert_eq!(last.head.state, STATE_RUNNING);
}

#[test]
fn a_restarted_sender_with_an_earlier_clock_is_believed_after_the_confirmations() {
    assert_believed(-3600 * SECOND_NS as i64, EPOCH + 1, REASON_STAMP_NOT_AFTER);
    // However little earlier.
    assert_believed(-2 * SECOND_NS as i64, EPOCH + 1, REASON_STAMP_NOT_AFTER);
}

#[test]
fn a_clock_that_was_set_is_believed_after_the_confirmations() {
    assert_believed(3600 * SECOND_NS as i64, EPOCH, REASON_GAP);
    assert_believed(3600 * SECOND_NS as i64, EPOCH + 1, REASON_GAP);
    assert_believed(-3600 * SECOND_NS as i64, EPOCH, REASON_STAMP_NOT_AFTER);
}

#[test]
fn a_small_step_back_of_the_same_sender_is_waited_out() {
    // Half a second: 50 samples are refused, the next one continues.
    let inputs: Vec<_> = (100..200)
        .map(|k| moved(k, -(SECOND_NS as i64) / 2, EPOCH))
        .collect();
    let (engine, estimates) = after_a_second(&inputs);
    assert_refused(engine.tally(), &[(REASON_STAMP_NOT_AFTER, 50)]);
    let last = estimates.last().unwrap();
    assert_eq!(last.head.stamp_ns, stamp(149));
    assert_eq!(last.head.reset_count, 0);
}

#[test]
fn a_wrong_first_stamp_does_not_lock_the_sensor_out() {
    for first_ns in [u64::MAX, stamp(0) + 3600 * SECOND_NS, 0, 1] {
        let mut wrong = imu(0);
        wrong.header.stamp_ns = first_ns;
        let mut inputs = vec![Input::Imu(wrong)];
        inputs.extend((1..100).map(|k| Input::Imu(imu(k))));
        let (engine, estimates) = run(settings(), &inputs);
        let reason = if first_ns < stamp(0) {
            REASON_GAP
        } else {
            REASON_STAMP_NOT_AFTER
        };
        assert_refused(engine.tally(), &[(reason, CONFIRMATIONS - 1)]);
        assert_eq!(estimates.last().unwrap().head.stamp_ns, stamp(99));
    }
}

#[test]
fn clocks_at_the_end_of_time_work() {
    let mut settings = settings();
    settings.initial.level = inekf_service::engine::settings::LevelSource::Accelerometer {
        window_ns: SECOND_NS / 5,
    };
    let shift_ns = u64::MAX - stamp(100);
    let inputs: Vec<_> = (0..=100)
        .map(|k| {
            let mut sample = imu(k);
            sample.header.stamp_ns += shift_ns;
            Input::Imu(sample)
        })
        .collect();
    let (engine, estimates) = run(settings, &inputs);
    assert_refused(engine.tally(), &[]);
    assert_eq!(estimates.last().unwrap().head.stamp_ns, u64::MAX);
    assert_eq!(estimates.len(), 80);
}

/// The state after a sample that comes `gap_ns` after sample 0.
fn over_a_gap(gap_ns: u64) -> (Engine, Vec<EstimateSe23>) {
    let mut engine = engine_at(settings(), &state_on_circle(stamp(0), 0.7));
    let mut estimates = Vec::new();
    feed(&mut engine, &Input::Imu(lively_imu(0)), &mut estimates);
    feed(&mut engine, &next_at(gap_ns / PERIOD_NS, 0), &mut estimates);
    (engine, estimates)
}

#[test]
fn up_to_the_largest_gap_nothing_is_special() {
    let gap_ns = SECOND_NS / 2;
    let (_, estimates) = over_a_gap(gap_ns);
    let mut direct = Direct::new(&state_on_circle(stamp(0), 0.7));
    direct.propagate(&input_of(&lively_imu(50)), gap_ns);
    assert!(belief_bits(&estimates[0]) == direct.bits());
}

/// One standard deviation of doubt about the mean rate (rad/s) and force (m/s^2) over a gap.
const GAP_DOUBT: (f64, f64) = (0.2, 2.0);

#[test]
fn over_a_gap_the_mean_of_both_ends_is_taken_and_doubted() {
    for gap_ns in [SECOND_NS / 2 + PERIOD_NS, SECOND_NS, 10 * SECOND_NS] {
        let (engine, estimates) = over_a_gap(gap_ns);
        assert_refused(engine.tally(), &[]);
        let (before, after) = (
            input_of(&lively_imu(0)),
            input_of(&lively_imu(gap_ns / PERIOD_NS)),
        );
        let mean = ImuInput {
            omega_b: 0.5 * (before.omega_b + after.omega_b),
            force_b: 0.5 * (before.force_b + after.force_b),
        };
        let gap_s = gap_ns as f64 * 1e-9;
        let mut noise = Direct::noise();
        noise.gyro_psd += GAP_DOUBT.0 * GAP_DOUBT.0 * gap_s;
        noise.accel_psd += GAP_DOUBT.1 * GAP_DOUBT.1 * gap_s;
        let mut direct = Direct::new(&state_on_circle(stamp(0), 0.7));
        direct.propagate_with(&mean, gap_ns, &noise);
        assert!(belief_bits(&estimates[0]) == direct.bits());
    }
}

#[test]
fn over_a_gap_the_variances_grow_by_what_is_doubted() {
    let trace = |state: &StateVector, first: usize| -> f64 {
        (first..first + 3).map(|i| variance(state, i)).sum()
    };
    let gap_s = 1.0;
    let start = state_on_circle(stamp(0), 0.7);
    let (engine, _) = over_a_gap(SECOND_NS);
    let after = engine.snapshot().unwrap();
    let (rate, force) = (GAP_DOUBT.0 * gap_s, GAP_DOUBT.1 * gap_s);
    assert!(trace(&after, 0) > trace(&start, 0) + 2.9 * rate * rate);
    assert!(trace(&after, 3) > trace(&start, 3) + 2.9 * force * force);
    // Attitude: the doubt, a bias of 0.01 rad/s for a second, and hardly anything else.
    assert!(trace(&after, 0) < trace(&start, 0) + 3.2 * rate * rate);
}

#[test]
fn a_fix_within_a_gap_splits_it() {
    let mut engine = engine_at(settings(), &state_on_circle(stamp(0), 0.7));
    let mut estimates = Vec::new();
    let fix = position(stamp(40), 0, 0);
    feed(&mut engine, &Input::Imu(lively_imu(0)), &mut estimates);
    feed(&mut engine, &Input::Position(fix), &mut estimates);
    feed(&mut engine, &next_at(100, 0), &mut estimates);
    let stamps: Vec<_> = estimates.iter().map(|row| row.head.stamp_ns).collect();
    assert_eq!(stamps, [stamp(40), stamp(100)]);
}

#[test]
fn beyond_the_longest_gap_the_state_starts_anew() {
    let far = 100 + 1001;
    // A fix that waits for the samples is lost with the state, and counted.
    let mut inputs = vec![Input::Position(position(stamp(101), 0, 0))];
    inputs.extend((0..20).map(|n| next_at(far + n, 99 + n)));
    let (engine, estimates) = after_a_second(&inputs);
    assert_refused(
        engine.tally(),
        &[(REASON_GAP, CONFIRMATIONS - 1), (REASON_NOT_READY, 1)],
    );
    let first = &estimates[99];
    assert_eq!(first.head.stamp_ns, stamp(far + CONFIRMATIONS));
    assert_eq!(first.head.flags & ESTIMATE_RESET, ESTIMATE_RESET);
    assert_eq!(first.head.reset_count, 1);
}

#[test]
fn if_so_configured_any_gap_starts_the_state_anew() {
    let mut strict = settings();
    strict.imu.restart_gap_ns = strict.imu.max_gap_ns;
    let samples = |gap: u64| -> Vec<Input> {
        let before = (0..100).map(|k| Input::Imu(imu(k)));
        let after = (0..20).map(|n| {
            Input::Imu(ImuSample {
                header: imu(99 + gap + n).header,
                ..imu(0)
            })
        });
        before.chain(after).collect()
    };
    let (_, estimates) = run(strict, &samples(50));
    assert_eq!(estimates.last().unwrap().head.reset_count, 0);
    let (_, estimates) = run(strict, &samples(51));
    assert_eq!(estimates.last().unwrap().head.reset_count, 1);
}
