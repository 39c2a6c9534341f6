//! After construction and warm-up the engine allocates nothing, whatever it is fed: it cannot grow.

mod common;
#[path = "../estimator/tests/common/counting.rs"]
mod counting;

use common::{
    Engine, Input, PERIOD_NS, assert_refused, feed, heading, imu, isotropic, lively_imu, position,
    settings, stamp, state_on_circle, velocity,
};
use counting::allocations;
use inekf::filter::Left;
use inekf::lie::SE23;
use inekf_service::checkpoint::handover;
use inekf_service::config::{Checkpoint, LateMethod};
use inekf_service::engine::resume::{ResumeSettings, Resumption};
use inekf_service::engine::settings::{LevelSource, PositionSource};
use inekf_service::engine::tally::Refusal;
use inekf_service::engine::{InertialEngine, Outbox};
use inekf_shared::message::{
    EstimateSe23, Header, INPUT_ODOMETRY_2D, ProcessNoise, REASON_BAD_COVARIANCE,
    REASON_BUFFER_FULL, REASON_NOT_FINITE, REASON_NOT_READY, REASON_OUT_OF_RANGE,
    REASON_STAMP_NOT_AFTER, REASON_WRONG_MODEL, StateVector, Zero,
};

/// Keeps the last estimate, as a latest-value slot does.
struct Latest(EstimateSe23);

impl Outbox<EstimateSe23> for Latest {
    fn publish(&mut self, estimate: &mut EstimateSe23) {
        self.0 = *estimate;
    }
}

/// Everything that can come with sample `k`: fixes ahead, on time, late, too late, gated and bad.
fn one_of_everything(engine: &mut Engine, k: u64, outbox: &mut Latest) {
    let now_ns = stamp(k);
    feed(
        engine,
        &Input::Velocity(velocity(now_ns - 3_333_333, k)),
        outbox,
    );
    feed(engine, &Input::Heading(heading(now_ns - 1, k)), outbox);
    feed(engine, &Input::Imu(imu(k)), outbox);
    feed(engine, &Input::Position(position(now_ns, k, 0)), outbox);
    if k.is_multiple_of(5) {
        let back_ns = (k % 90) * PERIOD_NS;
        feed(
            engine,
            &Input::Position(position(now_ns - back_ns - 1, k, 1)),
            outbox,
        );
        feed(
            engine,
            &Input::Position(position(now_ns - 150 * PERIOD_NS, k, 1)),
            outbox,
        );
        feed(
            engine,
            &Input::Position(position(now_ns + 7 * PERIOD_NS, k, 1)),
            outbox,
        );
        let mut far = position(now_ns, k, 0);
        far.position_w_m[0] += 500.0;
        feed(engine, &Input::Position(far), outbox);
        let mut bad = velocity(now_ns, k);
        bad.covariance_w = isotropic(0.0);
        feed(engine, &Input::Velocity(bad), outbox);
        let mut bad = heading(now_ns, k);
        bad.heading_rad = f64::NAN;
        feed(engine, &Input::Heading(bad), outbox);
        feed(engine, &Input::Imu(imu(k)), outbox);
        let mut bad = imu(k + 1);
        bad.gyro_rps[2] = 1e3;
        feed(engine, &Input::Imu(bad), outbox);
        engine.refuse(
            INPUT_ODOMETRY_2D,
            &Header::ZERO,
            Refusal(REASON_WRONG_MODEL),
        );
    }
}

#[test]
fn the_counter_counts() {
    assert!(allocations(|| drop(std::hint::black_box(vec![1u8; 100]))) >= 2);
    assert_eq!(allocations(|| {}), 0);
}

#[test]
fn nothing_is_allocated_where_late_fixes_are_carried() {
    let mut settings = settings();
    settings.initial.wait_for_request = true;
    assert_eq!(settings.fusion.late_method, LateMethod::Carry);
    let mut engine = InertialEngine::<SE23, Left, 9>::new(settings);
    let outbox = &mut Latest(EstimateSe23::ZERO);
    engine
        .set_state(&state_on_circle(stamp(1000), 0.7))
        .unwrap();
    let allocated = allocations(|| {
        for k in 1000..4000 {
            feed(&mut engine, &Input::Imu(imu(k)), outbox);
            // One with every sample, more than are remembered; now and then one that goes back to the middle of them.
            if k >= 1100 {
                let fix = Input::Position(position(stamp(k) - 99 * PERIOD_NS, k, 0));
                feed(&mut engine, &fix, outbox);
            }
            if k.is_multiple_of(97) {
                let fix = Input::Velocity(velocity(stamp(k) - 30 * PERIOD_NS, k));
                feed(&mut engine, &fix, outbox);
            }
        }
    });
    assert_eq!(allocated, 0);
    assert_refused(engine.tally(), &[]);
    assert!(engine.tally().counters.accepted > 2900);
}

#[test]
fn nothing_is_allocated_on_any_path() {
    let mut settings = settings();
    settings.fusion.late_capacity = 300;
    let mut engine = Engine::new(settings);
    let outbox = &mut Latest(EstimateSe23::ZERO);
    let allocated = allocations(|| {
        // Long enough to fill the ring, and to run over it many times.
        assert!(engine.set_state(&state_on_circle(stamp(1000), 0.7)).is_ok());
        feed(&mut engine, &Input::Imu(imu(1000)), outbox);
        for k in 1001..3000 {
            one_of_everything(&mut engine, k, outbox);
        }
    });
    assert_eq!(allocated, 0);
    let counters = engine.tally().counters;
    assert_eq!(counters.gated, 399);
    assert!(counters.accepted > 6000 && counters.late >= 399);
    assert_refused(
        engine.tally(),
        &[
            (REASON_BAD_COVARIANCE, 399),
            (REASON_NOT_FINITE, 399),
            (REASON_STAMP_NOT_AFTER, 399),
            (REASON_OUT_OF_RANGE, 399),
            (REASON_WRONG_MODEL, 399),
        ],
    );
}

#[test]
fn requests_allocate_nothing() {
    let mut engine = Engine::new(settings());
    let outbox = &mut Latest(EstimateSe23::ZERO);
    let allocated = allocations(|| {
        for k in 100..600 {
            one_of_everything(&mut engine, k, outbox);
            if k.is_multiple_of(50) {
                let state = state_on_circle(stamp(k), 1.0);
                assert!(engine.set_state(&state).is_ok());
                assert!(engine.set_state(&state_on_circle(1, 1.0)).is_err());
                assert!(engine.snapshot().is_some());
            }
            if k.is_multiple_of(130) {
                engine.reset();
                assert!(engine.snapshot().is_none());
                assert!(engine.set_state(&state_on_circle(0, 1.0)).is_ok());
            }
            let _ = std::hint::black_box((engine.state(), engine.last_sample_ns()));
        }
    });
    assert_eq!(allocated, 0);
    assert_eq!(outbox.0.head.reset_count, 10 + 4);
}

#[test]
fn a_checkpoint_is_handed_over_and_an_earlier_state_continued_without_allocation() {
    let (mut giver, mut taker) = handover::pair(StateVector::ZERO);
    let earlier = state_on_circle(stamp(0), 1.0);
    let resume = ResumeSettings::new(&Checkpoint::default());
    let mut engine = Engine::new(settings());
    let outbox = &mut Latest(EstimateSe23::ZERO);
    let allocated = allocations(|| {
        assert!(engine.resume_from(&earlier, resume).is_ok());
        for k in 100..600 {
            one_of_everything(&mut engine, k, outbox);
            giver.give(&engine.snapshot().unwrap());
            if k == 300 {
                engine.pause();
            }
            if k == 320 {
                engine.unpause();
            }
            assert!(engine.reload_noise(&ProcessNoise::UNGIVEN).is_err());
        }
    });
    assert_eq!(allocated, 0);
    assert_eq!(
        engine.resumption(),
        Resumption::Resumed {
            age_ns: 100 * PERIOD_NS
        }
    );
    let newest = taker.take().unwrap();
    assert_eq!(newest.stamp_ns, engine.snapshot().unwrap().stamp_ns);
}

#[test]
fn a_full_buffer_and_a_full_window_allocate_nothing() {
    let mut settings = settings();
    settings.fusion.late_window_ns = 60_000_000_000;
    let mut engine = Engine::new(settings);
    let outbox = &mut Latest(EstimateSe23::ZERO);
    let allocated = allocations(|| {
        feed(&mut engine, &Input::Imu(imu(0)), outbox);
        for n in 0..3000 {
            feed(
                &mut engine,
                &Input::Position(position(stamp(n) + 1, n, 0)),
                outbox,
            );
        }
        for k in 1..6000 {
            feed(&mut engine, &Input::Imu(imu(k)), outbox);
            feed(&mut engine, &Input::Velocity(velocity(stamp(k), k)), outbox);
        }
    });
    assert_eq!(allocated, 0);
    assert!(engine.tally().rejected_by_reason[REASON_BUFFER_FULL as usize] >= 3000 - 1024);
}

#[test]
fn starting_and_jumps_of_time_allocate_nothing() {
    let mut settings = settings();
    settings.initial.position = PositionSource::FirstFix;
    settings.initial.level = LevelSource::Accelerometer {
        window_ns: 60_000_000_000,
    };
    let mut engine = Engine::new(settings);
    let outbox = &mut Latest(EstimateSe23::ZERO);
    let allocated = allocations(|| {
        // More samples than the levelling window keeps, then an hour back by another sender, twice.
        for hour in [2u64, 1, 0] {
            for k in 0..6020 {
                let mut sample = lively_imu(k);
                sample.header.stamp_ns += hour * 3_600_000_000_000;
                sample.header.epoch = hour;
                feed(&mut engine, &Input::Imu(sample), outbox);
                let mut fix = position(sample.header.stamp_ns, k, 0);
                fix.header.epoch = hour;
                feed(&mut engine, &Input::Position(fix), outbox);
            }
        }
    });
    assert_eq!(allocated, 0);
    assert_eq!(outbox.0.head.reset_count, 2);
    assert!(engine.tally().rejected_by_reason[REASON_NOT_READY as usize] > 0);
}
