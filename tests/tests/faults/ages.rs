//! Two ages, told apart: of the observation (its stamp), and of its delivery (its sending and its taking).

use std::thread::sleep;
use std::time::Duration;

use inekf_shared::clock::monotonic_ns;
use inekf_tests::faults::scene::{Scene, rest};
use inekf_tests::link::Link;
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
