//! The live view of a real daemon, a line a second.

use std::time::{Duration, Instant};

use inekf_client::dataset::Event;
use inekf_client::feed::Feeder;
use inekf_tests::drive;
use inekf_tests::link::instance;
use inekf_tests::memory::Memory;
use inekf_tests::process::{Daemon, PATIENCE, eventually, start_client};

#[test]
fn the_monitor_says_what_a_daemon_is_at() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", drive::CONFIG);
    let mut monitor = start_client(&memory, ["monitor", "--instance", "car", "--plain"]);
    eventually("a line about a daemon that waits", || {
        monitor.stdout().contains("waiting for imu").then_some(())
    });
    let mut feeder = Feeder::open_on(memory.node(), &instance("car")).expect("a feeder");
    // In real time, for as long as anybody waits.
    let dataset = drive::drive(1, PATIENCE.as_secs_f64());
    let mut events = dataset.events().peekable();
    let started = Instant::now();
    let line = eventually("a line about a daemon that estimates", || {
        let due = |event: &Event| Duration::from_nanos(event.stamp_ns()) <= started.elapsed();
        while let Some(event) = events.next_if(due) {
            feeder.send(&event).expect("it can be sent");
        }
        assert!(monitor.is_running(), "{}", monitor.stderr());
        let said = monitor.stdout();
        let mut lines = said.lines();
        lines
            .find(|line| line.starts_with("running") && line.contains("nis[0]"))
            .map(str::to_owned)
    });
    for word in [
        "samples",
        "estimates",
        "age",
        "position",
        "sigma",
        "accepted",
        "latency p50",
    ] {
        assert!(line.contains(word), "{word}: {line}");
    }
    daemon.stop();
}

#[test]
fn a_monitor_without_a_daemon_says_so() {
    let memory = Memory::new();
    let monitor = start_client(&memory, ["monitor", "--instance", "car", "--plain"]);
    let ended = monitor.wait();
    assert!(
        ended
            .failed_with_one_line(1)
            .contains("no daemon of instance car")
    );
}
