//! Two ages, told apart: of the observation (its stamp), and of its delivery (its sending and its taking). Of a sample
//! each estimate says both, of each source of fixes the health message does.

use std::thread::sleep;
use std::time::Duration;

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{INPUT_POSITION, STATE_DEGRADED, STATE_RUNNING, source_index};
use inekf_tests::faults::scene::{CONFIG, Scene, at_origin, rest};
use inekf_tests::link::{HealthReader, Link};
use inekf_tests::score::SECOND_NS;
use rustix::process::{Pid, Signal, kill_process};

const HELD_UP: Duration = Duration::from_millis(200);

#[test]
fn a_sample_that_was_held_up_is_late_in_delivery_and_not_older_in_itself() {
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut link = Link::open(&scene.memory, "car");
    // A sensor clock of its own, far from this machine's.
    let stamp_ns = 7_000 * SECOND_NS;
    let mut estimates = Vec::new();
    link.feeder.imu(&rest(stamp_ns)).unwrap();
    link.feeder.imu(&rest(stamp_ns + 10_000_000)).unwrap();
    link.settle(&mut estimates);

    let id = Pid::from_raw(i32::try_from(daemon.id()).unwrap()).unwrap();
    kill_process(id, Signal::STOP).unwrap();
    let sent_ns = monotonic_ns();
    link.feeder.imu(&rest(stamp_ns + 20_000_000)).unwrap();
    sleep(HELD_UP);
    kill_process(id, Signal::CONT).unwrap();
    link.settle(&mut estimates);

    let [.., prompt, held_up] = &estimates[..] else {
        panic!("{} estimates", estimates.len());
    };
    // By the sensor's clock nothing has happened.
    assert_eq!(held_up.head.stamp_ns - prompt.head.stamp_ns, 10_000_000);
    // By this machine's it has.
    let delivery_ns = held_up.head.received_ns - held_up.head.sent_ns;
    assert!(held_up.head.sent_ns >= sent_ns);
    assert!(
        u128::from(delivery_ns) >= HELD_UP.as_nanos(),
        "{delivery_ns} ns"
    );
    assert!(held_up.head.published_ns >= held_up.head.received_ns);
    drop(link);
    daemon.stop();
}

#[test]
fn each_source_has_an_age_by_its_stamps_and_another_by_its_deliveries() {
    const STEP_NS: u64 = 10_000_000;
    const BEHIND_NS: u64 = 300_000_000;
    let config = format!(
        "{CONFIG}degraded_after_s = 2.0\n[[position_source]]\nid = 0\n[[position_source]]\nid = 1\n"
    );
    let scene = Scene::with_config(&config);
    let daemon = scene.daemon();
    let mut link = Link::open(&scene.memory, "car");
    let health = HealthReader::open(&scene.memory, "car");
    let first = health.wait_until("health", |_| true);
    assert_eq!((first.last_fix_stamp_ns, first.last_delivery_ns), (0, 0));
    assert_eq!(first.fix_age_ns(first.last_fix_stamp_ns), None);
    let [zero, one] = [0, 1].map(|source| source_index(INPUT_POSITION, source).unwrap());

    // Source 0 is prompt; source 1 tells of what was 300 ms ago; nobody hears of source 2.
    let mut stamp_ns = 5_000 * SECOND_NS;
    let mut sample = |link: &mut Link, fixes: bool| {
        stamp_ns += STEP_NS;
        if fixes {
            link.feeder.position(&at_origin(stamp_ns, 0)).unwrap();
            let behind_ns = stamp_ns - BEHIND_NS;
            link.feeder.position(&at_origin(behind_ns, 1)).unwrap();
        }
        link.feeder.imu(&rest(stamp_ns)).unwrap();
        stamp_ns
    };
    let begun_ns = monotonic_ns();
    for step in 0..100 {
        sample(&mut link, step > 40);
    }
    link.settle(&mut Vec::new());
    let settled_ns = monotonic_ns();
    let both = health.wait_until("both sources", |health| health.stamp_ns > settled_ns);
    let now_ns = both.last_imu_stamp_ns;
    assert_eq!(both.fix_age_ns(both.last_fix_stamp_ns), Some(0));
    assert_eq!(both.fix_age_ns(both.fused_stamp_ns[zero]), Some(0));
    assert_eq!(both.fix_age_ns(both.fused_stamp_ns[one]), Some(BEHIND_NS));
    for source in [zero, one] {
        assert!((begun_ns..settled_ns).contains(&both.delivered_ns[source]));
    }
    assert!((begun_ns..settled_ns).contains(&both.last_delivery_ns));
    let others = (0..both.delivered_ns.len()).filter(|at| ![zero, one].contains(at));
    for at in others {
        assert_eq!((both.delivered_ns[at], both.fused_stamp_ns[at]), (0, 0));
    }
    assert_eq!(both.state, STATE_RUNNING);

    // The samples go on for three seconds of theirs, in a moment of ours: the fixes are old, their deliveries are not.
    for _ in 0..300 {
        sample(&mut link, false);
    }
    link.settle(&mut Vec::new());
    let settled_ns = monotonic_ns();
    let alone = health.wait_until("no fixes", |health| health.stamp_ns > settled_ns);
    assert_eq!(alone.last_imu_stamp_ns - now_ns, 3 * SECOND_NS);
    assert_eq!(
        alone.fix_age_ns(alone.last_fix_stamp_ns),
        Some(3 * SECOND_NS)
    );
    assert_eq!(
        alone.fix_age_ns(alone.fused_stamp_ns[one]),
        Some(3 * SECOND_NS + BEHIND_NS)
    );
    assert_eq!(alone.delivered_ns, both.delivered_ns);
    assert!(alone.last_delivery_ns > both.last_delivery_ns);
    assert_eq!(alone.state, STATE_DEGRADED);

    // Then all is silent: nothing is delivered, and by the sensors' clock no time passes.
    let later = health.wait_until("silence", |health| {
        health.delivery_age_ns(health.last_delivery_ns) > Some(200_000_000)
    });
    assert_eq!(
        later.fix_age_ns(later.last_fix_stamp_ns),
        Some(3 * SECOND_NS)
    );
    assert_eq!(later.last_delivery_ns, alone.last_delivery_ns);
    drop((link, health));
    daemon.stop();
}
