//! Checkpoints of real daemons: one that is killed is continued by the next, one that is stopped leaves its last state,
//! and whatever is wrong with the file, the next starts as configured and says why.

use std::fs;
use std::path::Path;

use inekf_client::dataset::{Dataset, Event, TruthRow};
use inekf_service::checkpoint::file::{self, Identity};
use inekf_shared::message::{
    ESTIMATE_RESUMED, EstimateSe23, HEALTH_NOT_RESUMED, HEALTH_RESUMED, MODEL_IMU, StateVector,
};
use inekf_tests::consistency::{Z_ONE_IN_A_MILLION, chi_square_quantile, normalised};
use inekf_tests::drive::{CONFIG, config, drive};
use inekf_tests::in_process;
use inekf_tests::link::{HealthReader, Link};
use inekf_tests::memory::Memory;
use inekf_tests::process::{Daemon, eventually};
use inekf_tests::score::{SECOND_NS, assert_same, bits};
use rustix::process::Signal;
use tempfile::TempDir;

use super::{stop_quickly, truth, with_fast_health};

/// A drive that does not begin at zero, so that there are stamps before it.
fn later_drive(seed: u64) -> Dataset {
    in_process::shifted(&drive(seed, 10.0), 100 * SECOND_NS)
}

fn with_checkpoint(config: &str, path: &Path, period_s: f64) -> String {
    let path = path.display();
    let table = format!("[checkpoint]\npath = '{path}'\nperiod_s = {period_s:?}\n");
    format!("{}\n{table}", with_fast_health(config))
}

fn identity(estimator: &str) -> Identity {
    Identity {
        instance: "car".to_owned(),
        estimator: estimator.to_owned(),
        model: MODEL_IMU,
        dimension: 15,
        mismatches: String::new(),
    }
}

fn load(path: &Path, estimator: &str) -> Option<StateVector> {
    file::load(path, &identity(estimator)).unwrap_or_else(|reason| panic!("{reason}"))
}

fn assert_is_state_of(estimate: &EstimateSe23, state: &StateVector) {
    assert_eq!(estimate.head.stamp_ns, state.stamp_ns);
    assert_eq!(estimate.p_w_m, state.p_w_m);
    assert_eq!(estimate.q_wb, state.q_wb);
    assert_eq!(estimate.covariance, state.covariance);
}

/// The rows of a dataset between two times, seconds from its beginning.
fn between(dataset: &Dataset, from_s: u64, to_s: u64) -> Vec<Event> {
    let first_ns = dataset.imu[0].stamp_ns;
    let range = first_ns + from_s * SECOND_NS..first_ns + to_s * SECOND_NS;
    let rows = dataset.events();
    rows.filter(|row| range.contains(&row.stamp_ns())).collect()
}

fn assert_consistent(name: &str, estimates: &[EstimateSe23], dataset: &Dataset) {
    let bound = chi_square_quantile(15.0, Z_ONE_IN_A_MILLION);
    let by_ns = dataset.imu[0].stamp_ns;
    for estimate in estimates {
        let rows = truth(dataset);
        let found =
            rows.binary_search_by_key(&(estimate.head.stamp_ns - by_ns), |row| row.stamp_ns);
        let Ok(index) = found else { continue };
        let stamp_ns = estimate.head.stamp_ns;
        let nees = normalised(
            estimate,
            &TruthRow {
                stamp_ns,
                ..rows[index]
            },
        );
        assert!(nees < bound, "{name}, at {stamp_ns} ns: NEES {nees}");
    }
}

#[test]
fn a_daemon_that_is_killed_is_continued_by_the_next_with_what_it_knew() {
    let smoother = config("estimator = 'smoother'", "event");
    let smoother = smoother.replace("[[heading_source]]\nid = 0\n", "");
    for (estimator, config) in [("inekf", CONFIG.to_owned()), ("smoother", smoother)] {
        let folder = TempDir::new().expect("a folder");
        let path = folder.path().join("car.checkpoint");
        let memory = Memory::new();
        // Without a gate: its verdict would cut the errors' distribution.
        let config = config.replace("gate_probability = 0.9999", "");
        let config = with_checkpoint(&config, &path, 0.01);
        let dataset = later_drive(21);

        let daemon = Daemon::start(&memory, "car", &config);
        let mut link = Link::open(&memory, "car");
        let before = link.feed(between(&dataset, 0, 6));
        let last = *before.last().expect("estimates");
        let state = eventually("the last state on disk", || {
            let state = path.exists().then(|| load(&path, estimator)).flatten();
            state.filter(|state| state.stamp_ns == last.head.stamp_ns && state.p_w_m == last.p_w_m)
        });
        assert_is_state_of(&last, &state);
        drop(link);
        assert!(!daemon.stop_with(Signal::KILL).status.success());

        // A second later.
        let daemon = Daemon::start(&memory, "car", &config);
        let health = HealthReader::open(&memory, "car");
        let mut link = Link::open(&memory, "car");
        let after = link.feed(between(&dataset, 7, 10));
        let resumed: Vec<bool> = after
            .iter()
            .map(|estimate| estimate.head.flags & ESTIMATE_RESUMED != 0)
            .collect();
        assert!(resumed[0] && !resumed[1..].contains(&true));
        // At once, without levelling: from the second sample on.
        assert_eq!(after[0].head.seq, 1);
        assert_consistent(estimator, &after, &dataset);
        // What took the first one seconds and fixes to find out is still known: the biases, to half of their first sigma.
        let sigma = |estimate: &EstimateSe23, i: usize| {
            estimate.covariance[inekf_shared::message::triangle_index(i, i, 15).unwrap()].sqrt()
        };
        assert!(sigma(&last, 14) < 0.025, "{}", sigma(&last, 14));
        assert!(sigma(&after[0], 14) < 1.1 * sigma(&last, 14));
        health.wait_until("a resumed daemon", |health| health.flags == HEALTH_RESUMED);
        drop((link, health));
        let ended = daemon.stop();
        assert!(
            ended.stderr.contains("resumed from the checkpoint"),
            "{ended:?}"
        );
        memory.assert_nothing_left();
    }
}

#[test]
fn a_daemon_that_is_stopped_leaves_its_last_state() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("car.checkpoint");
    let memory = Memory::new();
    let config = with_checkpoint(CONFIG, &path, 3600.0);
    let daemon = Daemon::start(&memory, "car", &config);
    let mut link = Link::open(&memory, "car");
    let dataset = later_drive(22);
    let estimates = link.feed(between(&dataset, 0, 2));
    drop(link);
    stop_quickly(daemon, Signal::TERM);
    let last = load(&path, "inekf").expect("a checkpoint");
    assert_is_state_of(estimates.last().expect("estimates"), &last);
    // One that never had a state leaves the file alone.
    let daemon = Daemon::start(&memory, "car", &config);
    stop_quickly(daemon, Signal::TERM);
    assert_eq!(load(&path, "inekf"), Some(last));
    memory.assert_nothing_left();
}

/// What is done to the file, and what the log says of it.
type Fault = (
    &'static str,
    fn(&[u8], &StateVector) -> Vec<u8>,
    &'static str,
);

#[test]
fn a_checkpoint_of_no_use_is_as_if_there_were_none_and_the_log_says_why() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("car.checkpoint");
    let dataset = later_drive(23);
    let rows = between(&dataset, 0, 2);
    let mut expected = Vec::new();
    let mut fed = dataset.clone();
    let end_ns = dataset.imu[0].stamp_ns + 2 * SECOND_NS;
    fed.imu.retain(|row| row.stamp_ns < end_ns);
    fed.position.retain(|row| row.stamp_ns < end_ns);
    fed.velocity.retain(|row| row.stamp_ns < end_ns);
    fed.heading.retain(|row| row.stamp_ns < end_ns);
    in_process::run(&fed, CONFIG, &mut expected);
    let state = StateVector {
        model: MODEL_IMU,
        dimension: 15,
        q_wb: [0.0, 0.0, 0.0, 1.0],
        p_w_m: [1e3; 3],
        stamp_ns: dataset.imu[0].stamp_ns - SECOND_NS,
        ..StateVector::default()
    };
    let faults: [Fault; 7] = [
        (
            "torn",
            |bytes, _| bytes[..bytes.len() / 2].to_vec(),
            "cut short",
        ),
        (
            "flipped",
            |bytes, _| {
                let mut bytes = bytes.to_vec();
                bytes[200] ^= 1;
                bytes
            },
            "damaged",
        ),
        ("empty", |_, _| Vec::new(), "cut short"),
        (
            "another instance",
            |_, state| {
                let identity = Identity {
                    instance: "van".to_owned(),
                    ..identity("inekf")
                };
                file::encode(&identity, state).expect("it can be encoded")
            },
            "instance van",
        ),
        (
            "no state",
            |_, state| {
                let state = StateVector {
                    q_wb: [0.0; 4],
                    ..*state
                };
                file::encode(&identity("inekf"), &state).expect("it can be encoded")
            },
            "quaternion",
        ),
        (
            "old",
            |_, state| {
                let state = StateVector {
                    stamp_ns: state.stamp_ns - 20 * SECOND_NS,
                    ..*state
                };
                file::encode(&identity("inekf"), &state).expect("it can be encoded")
            },
            "older than max_age_s",
        ),
        (
            "of the future",
            |_, state| {
                let state = StateVector {
                    stamp_ns: state.stamp_ns + 20 * SECOND_NS,
                    ..*state
                };
                file::encode(&identity("inekf"), &state).expect("it can be encoded")
            },
            "ahead of the first sample",
        ),
    ];
    let good = file::encode(&identity("inekf"), &state).expect("it can be encoded");
    for (name, fault, word) in faults {
        let memory = Memory::new();
        fs::write(&path, fault(&good, &state)).expect("a checkpoint");
        let daemon = Daemon::start(&memory, "car", &with_checkpoint(CONFIG, &path, 3600.0));
        let health = HealthReader::open(&memory, "car");
        let mut link = Link::open(&memory, "car");
        let estimates = link.feed(rows.iter().copied());
        println!("{name}");
        assert_same(&estimates, &expected);
        health.wait_until(name, |health| health.flags == HEALTH_NOT_RESUMED);
        drop((link, health));
        let ended = daemon.stop();
        assert!(
            ended.stderr.contains("starting as configured"),
            "{name}: {ended:?}"
        );
        assert!(ended.stderr.contains(word), "{name}: {ended:?}");
    }
    // The good one, to see that it is the faults that decide.
    let memory = Memory::new();
    fs::write(&path, good).expect("a checkpoint");
    let daemon = Daemon::start(&memory, "car", &with_checkpoint(CONFIG, &path, 3600.0));
    let mut link = Link::open(&memory, "car");
    let estimates = link.feed(rows.iter().copied());
    assert!(bits(&estimates[0]) != bits(&expected[0]));
    assert!(estimates[0].head.flags & ESTIMATE_RESUMED != 0);
    drop(link);
    daemon.stop();
}

#[test]
fn a_disk_that_takes_no_checkpoint_is_counted_and_said_once_and_the_estimate_goes_on() {
    let memory = Memory::new();
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("no such folder/car.checkpoint");
    let daemon = Daemon::start(&memory, "car", &with_checkpoint(CONFIG, &path, 0.01));
    let health = HealthReader::open(&memory, "car");
    let mut link = Link::open(&memory, "car");
    let dataset = drive(24, 5.0);
    let mut expected = Vec::new();
    in_process::run(&dataset, CONFIG, &mut expected);
    let rows: Vec<Event> = dataset.events().collect();
    let (first, second) = rows.split_at(rows.len() / 2);
    let mut estimates = link.feed(first.iter().copied());
    health.wait_until("a failure", |health| health.checkpoint_failures >= 1);
    estimates.extend(link.feed(second.iter().copied()));
    let after = health.wait_until("another", |health| health.checkpoint_failures >= 2);
    assert_eq!((after.checkpoints, after.flags), (0, 0));
    assert_same(&estimates, &expected);
    drop((link, health));
    let stderr = daemon.stop().stderr;
    let said = stderr.matches("checkpoints cannot be written").count();
    assert_eq!(said, 1, "{stderr}");
    memory.assert_nothing_left();
}
