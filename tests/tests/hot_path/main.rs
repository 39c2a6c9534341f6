//! What the daemon does between a sample and its estimate, seen from outside: the system calls of a real process, and
//! the allocations of the real loop between real ports.

#[path = "../../../service/estimator/tests/common/counting.rs"]
mod counting;

mod allocations;
mod system_calls;
mod tracer;

use std::ops::RangeInclusive;
use std::time::Instant;

use inekf_client::dataset::{Event, ImuRow, PositionRow};
use inekf_shared::message::{ESTIMATE_PROPAGATED, ESTIMATE_UPDATED};
use inekf_tests::link::Link;
use inekf_tests::memory::Memory;
use inekf_tests::process::PATIENCE;

const INSTANCE: &str = "hot";

/// Spinning, with one health message at the start and none after it within a test.
const CONFIG: &str = "\
model = 'imu'
[noise]
gyro_density = 1e-3
accel_density = 1e-2
[initial]
level_window_s = 0.01
[health]
period_s = 3600.0
[runtime]
wait = 'spin'
";

const PERIOD_NS: u64 = 1_000_000;
/// Samples from one fix to the next.
const FIX_EVERY: u64 = 10;

/// Steps before anything is counted: the first state, and everything that is done once.
const WARM_UP: u64 = 300;

/// A daemon's ports, warm.
fn warm_link(memory: &Memory) -> Link {
    let mut link = Link::open(memory, INSTANCE);
    // In two parts, the second one sample at a time as what is counted.
    let first = (1..=WARM_UP / 2).flat_map(events);
    let estimates = link.feed(first);
    assert!(!estimates.is_empty(), "the daemon is initialised");
    feed(&mut link, WARM_UP / 2 + 1..=WARM_UP);
    link
}

/// Feeds the events of these steps, one step at a time: each begins when the last estimate of the one before has come.
/// Returns how many estimates came.
fn feed(link: &mut Link, steps: RangeInclusive<u64>) -> u64 {
    let mut count = 0;
    for step in steps {
        for event in events(step) {
            link.feeder.send(&event).expect("it can be sent");
        }
        let last_flag = if has_fix(step) {
            ESTIMATE_UPDATED
        } else {
            ESTIMATE_PROPAGATED
        };
        let sent = Instant::now();
        loop {
            let next = link.reader.borrow_next().expect("it can be received");
            count += u64::from(next.is_some());
            let head = next.map(|estimate| estimate.head);
            if head.is_some_and(|it| it.stamp_ns == step * PERIOD_NS && it.flags & last_flag != 0) {
                break;
            }
            assert!(sent.elapsed() < PATIENCE, "no estimate of step {step}");
            std::hint::spin_loop();
        }
    }
    count
}

fn has_fix(step: u64) -> bool {
    step.is_multiple_of(FIX_EVERY)
}

/// A sample of a body at rest at the origin, and before it a fix in every tenth step.
fn events(step: u64) -> impl Iterator<Item = Event> {
    let stamp_ns = step * PERIOD_NS;
    let fix = has_fix(step).then(|| fix(stamp_ns));
    fix.into_iter().chain([at_rest(stamp_ns)])
}

fn at_rest(stamp_ns: u64) -> Event {
    Event::Imu(ImuRow {
        stamp_ns,
        gyro_rps: [0.0, 0.0, 0.01],
        accel_mps2: [0.0, 0.0, 9.80665],
    })
}

fn fix(stamp_ns: u64) -> Event {
    Event::Position(PositionRow {
        stamp_ns,
        source: 0,
        dimension: 3,
        position_w_m: [0.0; 3],
        sigma_m: [1.0; 3],
    })
}
