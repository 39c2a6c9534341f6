//! Several vehicles in one daemon, on one thread or on several, asleep between samples or spinning: they do not mix, and
//! all of them go on when their files in shared memory are deleted.

use std::fs;

use inekf_shared::clock::monotonic_ns;
use inekf_tests::drive::{CONFIG, drive};
use inekf_tests::faults::scene::{self, rest};
use inekf_tests::in_process;
use inekf_tests::link::Link;
use inekf_tests::memory::Memory;
use inekf_tests::process::{Daemon, eventually};
use inekf_tests::score::assert_same;

const VEHICLES: &str = "car-{0..2}";
const NAMES: [&str; 3] = ["car-0", "car-1", "car-2"];

/// How a fleet is served.
const RUNTIMES: [&str; 3] = [
    "[runtime]\nwait = 'event'\n",
    "[runtime]\nwait = 'spin'\n[fleet]\nthreads = 1\n",
    "[runtime]\nwait = 'spin'\n[fleet]\nthreads = 2\n",
];

#[test]
fn vehicles_of_one_daemon_do_not_mix() {
    for runtime in RUNTIMES {
        let memory = Memory::new();
        let config = format!("{CONFIG}\n{runtime}");
        let daemon = Daemon::start(&memory, VEHICLES, &config);
        let mut links = NAMES.map(|name| Link::open(&memory, name));
        let datasets = [21, 22, 23].map(|seed| drive(seed, 1.0));
        let mut estimates = [const { Vec::new() }; 3];
        let mut streams = datasets.each_ref().map(|dataset| dataset.events());
        // In turn, so that anything that mixed would.
        while let [Some(one), Some(two), Some(three)] = streams.each_mut().map(Iterator::next) {
            for (index, event) in [one, two, three].iter().enumerate() {
                links[index].feeder.send(event).unwrap();
                links[index].settle(&mut estimates[index]);
            }
        }
        for (dataset, estimates) in datasets.iter().zip(&estimates) {
            let mut expected = Vec::new();
            in_process::run(dataset, CONFIG, &mut expected);
            assert_same(estimates, &expected);
        }
        assert_ne!(estimates[0][0].p_w_m, estimates[1][0].p_w_m);
        drop(links);
        daemon.stop();
        memory.assert_nothing_left();
    }
}

#[test]
fn a_fleet_whose_files_were_deleted_goes_on() {
    for runtime in RUNTIMES {
        let memory = Memory::new();
        let config = format!("{}{runtime}", scene::CONFIG);
        let daemon = Daemon::start(&memory, VEHICLES, &config);
        let mut links = NAMES.map(|name| Link::open(&memory, name));
        let last = links.each_mut().map(|link| {
            let mut estimates = Vec::new();
            for _ in 0..10 {
                link.feeder.imu(&rest(monotonic_ns())).unwrap();
                link.settle(&mut estimates);
            }
            *estimates.last().unwrap()
        });
        for path in [memory.shared_paths(), memory.root_files()].concat() {
            // Some go by themselves.
            let _ = fs::remove_file(path);
        }
        let at_ns = monotonic_ns();
        for (link, last) in links.iter_mut().zip(&last) {
            let estimate = eventually("an estimate that goes through all of them again", || {
                link.feeder.imu(&rest(monotonic_ns())).unwrap();
                let mut newest = None;
                while let Some(estimate) = link.reader.next_estimate().unwrap() {
                    newest = Some(estimate);
                }
                // What is on its way through the old files does not count.
                newest.filter(|_| link.reader.reattached() > 0 && link.feeder.reattached() > 0)
            });
            assert!(estimate.head.sent_ns > at_ns);
            // The same estimate goes on: it was neither restarted nor reset.
            assert_eq!(estimate.head.reset_count, last.head.reset_count);
            assert!(estimate.head.estimate_seq > last.head.estimate_seq);
        }
        drop(links);
        let ended = daemon.stop();
        assert!(
            ended.stderr.contains("the ports are open again"),
            "{ended:#?}"
        );
        memory.assert_nothing_left();
    }
}
