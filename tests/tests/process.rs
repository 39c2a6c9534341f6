//! Real processes over real shared memory: a daemon, feeders that come and go or are killed, readers that sleep. The
//! estimates stay right, and nothing is left when all have gone.

#[path = "process/checkpoint.rs"]
mod checkpoint;
#[path = "process/fleet.rs"]
mod fleet;

use std::time::{Duration, Instant};

use inekf_client::dataset::{Dataset, Truth, TruthRow};
use inekf_client::read::EstimateReader;
use inekf_client::simulate::{InitialOptions, SimulationOptions};
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, EstimateSe23, INPUT_IMU, INPUT_POSITION, STATE_RUNNING, STATE_STALE,
};
use inekf_tests::consistency::{Z_ONE_IN_A_MILLION, chi_square_quantile, normalised};
use inekf_tests::drive::{CONFIG, config, drive, simulated};
use inekf_tests::folder::Folder;
use inekf_tests::in_process::{self, initial_state, shifted};
use inekf_tests::link::{HealthReader, Link, instance};
use inekf_tests::memory::Memory;
use inekf_tests::process::{
    Daemon, config_file, eventually, ignores_interrupts, service, start_client,
};
use inekf_tests::score::{SECOND_NS, assert_same};
use rustix::process::Signal;

/// A second is a long time for a daemon that is asked to stop; a busy machine gets two.
const STOPS_WITHIN: Duration = Duration::from_secs(2);

/// Health five times a second, for tests that wait for it.
fn with_fast_health(config: &str) -> String {
    format!("{config}\n[health]\nperiod_s = 0.2\n")
}

/// Stops the daemon with a signal; it has to be quick and successful.
fn stop_quickly(daemon: Daemon, signal: Signal) {
    let asked = Instant::now();
    daemon.stop_with(signal).succeeded();
    assert!(asked.elapsed() < STOPS_WITHIN, "{:?}", asked.elapsed());
}

fn truth(dataset: &Dataset) -> &[TruthRow] {
    match &dataset.truth {
        Truth::Spatial(rows) => rows,
        _ => panic!("the truth is spatial"),
    }
}

/// Takes what has come.
fn take(reader: &mut EstimateReader, estimates: &mut Vec<EstimateSe23>) {
    while let Some(estimate) = reader.next_estimate().expect("it can be received") {
        estimates.push(estimate);
    }
}

#[test]
fn a_daemon_fed_by_another_process_in_real_time_is_as_right_as_it_says_and_leaves_nothing() {
    // What `inekf-client simulate` makes of these arguments; the initial error does not change the sensors' noise.
    let dataset = simulated(&SimulationOptions {
        seed: 11,
        imu_rate_hz: 200.0,
        duration_s: 4.0,
        initial: Some(InitialOptions::default()),
        ..SimulationOptions::default()
    });
    let arguments = "simulate road-circuit --seed 11 --rate 200 --duration 4 --instance car";

    let memory = Memory::new();
    // Without a gate: its verdict would cut the errors' distribution.
    let config = with_fast_health(&CONFIG.replace("gate_probability = 0.9999", ""));
    let daemon = Daemon::start(&memory, "car", &config);
    assert!(daemon.ready_line().contains("instance car"));
    assert!(
        daemon
            .ready_line()
            .contains(&format!("process {}", daemon.id()))
    );
    let health = HealthReader::open(&memory, "car");
    let mut link = Link::open(&memory, "car");
    let initial = initial_state(&dataset.meta).expect("an initial state");
    assert_eq!(
        initial.stamp_ns, 0,
        "at the first sample's stamp, whatever that will be"
    );
    link.controller
        .set_state(initial)
        .expect("the state is good");

    let mut estimates = Vec::new();
    let mut feeder = start_client(&memory, arguments.split(' '));
    while feeder.is_running() {
        take(&mut link.reader, &mut estimates);
        std::thread::sleep(Duration::from_millis(1));
    }
    let fed = feeder.wait().succeeded();
    let answer = link.settle(&mut estimates);
    let sent = dataset.imu.len() + dataset.position.len();
    assert!(
        fed.stdout
            .contains(&format!("fed      {sent} samples to car; 0 with no daemon"))
    );
    assert_eq!(answer.received[INPUT_IMU], dataset.imu.len() as u64);
    assert_eq!(
        answer.received[INPUT_POSITION],
        dataset.position.len() as u64
    );
    assert_eq!((answer.counters.lost, answer.counters.rejected), (0, 0));
    assert_eq!((answer.counters.late, answer.counters.gated), (0, 0));

    // Every sample but the one the state was set at is answered, once and in order.
    let answers: Vec<&EstimateSe23> = estimates
        .iter()
        .filter(|estimate| estimate.head.flags & ESTIMATE_PROPAGATED != 0)
        .collect();
    let numbers: Vec<u64> = answers.iter().map(|estimate| estimate.head.seq).collect();
    assert_eq!(numbers, (1..dataset.imu.len() as u64).collect::<Vec<_>>());
    let base_ns = answers[0].head.stamp_ns - dataset.imu[1].stamp_ns;

    // One number of 15 degrees of freedom beyond this would be one in a million.
    let bound = chi_square_quantile(15.0, Z_ONE_IN_A_MILLION);
    for estimate in &answers {
        let row = &truth(&dataset)[estimate.head.seq as usize];
        let stamp_ns = row.stamp_ns + base_ns;
        let nees = normalised(estimate, &TruthRow { stamp_ns, ..*row });
        assert!(nees < bound, "sample {}: NEES {nees}", estimate.head.seq);
    }
    // Nor does it matter that the samples came from another process: no bit differs.
    let mut same = shifted(&dataset, base_ns);
    same.meta = dataset.meta.clone();
    let expected = in_process::csv(&same, &config, true);
    assert!(in_process::csv_of(&estimates, true) == expected);

    let running = health.wait_until("health after the last sample", |health| {
        health.received[INPUT_IMU] == dataset.imu.len() as u64
    });
    assert!([STATE_RUNNING, STATE_STALE].contains(&running.state));
    assert_eq!(running.instance_pid, u64::from(daemon.id()));
    assert_eq!(running.counters, answer.counters);
    assert_eq!(
        running.last_imu_stamp_ns,
        answers.last().unwrap().head.stamp_ns
    );

    stop_quickly(daemon, Signal::TERM);
    drop((link, health));
    memory.assert_nothing_left();
}

#[test]
fn health_says_running_while_samples_come_and_stale_when_they_stop() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", &with_fast_health(CONFIG));
    let health = HealthReader::open(&memory, "car");
    let mut feeder = start_client(
        &memory,
        "simulate road-circuit --rate 200 --duration 600 --instance car".split(' '),
    );
    let running = health.wait_until("running at some rate", |health| {
        health.state == STATE_RUNNING && health.imu_rate_hz > 0.0
    });
    assert!(feeder.is_running() && running.imu_rate_hz.is_finite());
    feeder.signal(Signal::TERM);
    let fed = feeder.wait().succeeded();
    assert!(fed.stdout.contains("0 with no daemon"), "{fed:?}");
    health.wait_until("stale", |health| health.state == STATE_STALE);
    daemon.stop();
    drop(health);
    memory.assert_nothing_left();
}

#[test]
fn sigint_and_sigterm_stop_a_daemon_in_either_way_of_waiting() {
    for signal in [Signal::INT, Signal::TERM] {
        for wait in ["event", "spin"] {
            let memory = Memory::new();
            let daemon = Daemon::start(&memory, "car", &config("", wait));
            let mut link = Link::open(&memory, "car");
            assert!(!link.feed_all(&drive(1, 1.0)).is_empty());
            drop(link);
            stop_quickly(daemon, signal);
            memory.assert_nothing_left();
        }
    }
}

#[test]
fn a_daemon_that_waits_without_a_sample_or_a_client_stops_too() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    assert!(!memory.shared_files().is_empty());
    stop_quickly(daemon, Signal::TERM);
    memory.assert_nothing_left();
}

#[test]
fn either_way_of_waiting_gives_the_same_estimates() {
    let dataset = drive(2, 10.0);
    let mut expected = Vec::new();
    in_process::run(&dataset, CONFIG, &mut expected);
    for wait in ["event", "spin"] {
        let memory = Memory::new();
        let daemon = Daemon::start(&memory, "car", &config("", wait));
        assert!(daemon.ready_line().contains(&format!("wait {wait}")));
        let mut link = Link::open(&memory, "car");
        assert_same(&link.feed_all(&dataset), &expected);
        drop(link);
        daemon.stop();
        memory.assert_nothing_left();
    }
}

#[test]
fn a_second_daemon_of_an_instance_is_refused_with_the_first_ones_process_id() {
    let memory = Memory::new();
    let first = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let (_folder, file) = config_file(CONFIG);
    let arguments = ["--config", file.to_str().unwrap(), "--instance", "car"];
    let second = service(&memory, arguments);
    let line = second.failed_with_one_line(1);
    assert!(line.contains(&first.id().to_string()), "{line}");
    assert_eq!(second.stdout, "", "it was never ready");

    // The first has not noticed.
    assert!(!link.feed_all(&drive(3, 2.0)).is_empty());
    drop(link);
    first.stop();
    memory.assert_nothing_left();
}

#[test]
fn two_instances_side_by_side_do_not_mix() {
    let memory = Memory::new();
    let names = ["one", "other"];
    let daemons = names.map(|name| Daemon::start(&memory, name, CONFIG));
    let mut links = names.map(|name| Link::open(&memory, name));
    let datasets = [drive(4, 5.0), drive(5, 5.0)];
    let mut estimates = [Vec::new(), Vec::new()];
    let streams = datasets.each_ref().map(|dataset| dataset.events());
    // In turn, so that anything that mixed would.
    for (one, other) in streams[0].clone().zip(streams[1].clone()) {
        links[0].feeder.send(&one).unwrap();
        links[1].feeder.send(&other).unwrap();
        for (link, estimates) in links.iter_mut().zip(&mut estimates) {
            take(&mut link.reader, estimates);
        }
    }
    for (index, link) in links.iter_mut().enumerate() {
        link.settle(&mut estimates[index]);
        let mut expected = Vec::new();
        in_process::run(&datasets[index], CONFIG, &mut expected);
        assert_same(&estimates[index], &expected);
    }
    assert_ne!(estimates[0][0].p_w_m, estimates[1][0].p_w_m);
    drop(links);
    daemons.into_iter().for_each(|daemon| drop(daemon.stop()));
    memory.assert_nothing_left();
}

#[test]
fn a_killed_feeder_is_replaced_by_the_next() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let simulate = "simulate road-circuit --rate 200 --instance car --duration";
    let start = |duration: &str| start_client(&memory, simulate.split(' ').chain([duration]));

    let first = start("600");
    let mut estimates = Vec::new();
    eventually("the first feeder's estimates", || {
        take(&mut link.reader, &mut estimates);
        (estimates.len() > 200).then_some(())
    });
    first.signal(Signal::KILL);
    assert!(!first.wait().status.success());
    let before = link.settle(&mut estimates);
    let last = *estimates.last().unwrap();
    assert_eq!(last.head.state, STATE_RUNNING);

    estimates.clear();
    start("1").wait().succeeded();
    let after = link.settle(&mut estimates);
    assert_eq!(after.state_code, STATE_RUNNING);
    // The new one counts from 0 again; nothing is taken for lost, and the clock has gone on.
    assert_eq!(after.received[INPUT_IMU], before.received[INPUT_IMU] + 201);
    assert_eq!(after.counters.lost, before.counters.lost);
    assert_eq!(after.counters.rejected, before.counters.rejected);
    assert!(after.counters.accepted > before.counters.accepted);
    let first = &estimates[0];
    assert!(first.head.stamp_ns > last.head.stamp_ns);
    assert_eq!(first.head.reset_count, last.head.reset_count);
    assert_eq!(
        estimates.iter().map(|estimate| estimate.head.seq).max(),
        Some(200)
    );

    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn a_killed_daemon_is_replaced_by_the_next_and_its_clients_go_on() {
    let memory = Memory::new();
    let first = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    assert!(!link.feed_all(&drive(6, 2.0)).is_empty());
    assert!(!first.stop_with(Signal::KILL).status.success());

    let second = Daemon::start(&memory, "car", CONFIG);
    link.controller.barrier().expect("the new daemon answers");
    let dataset = shifted(&drive(7, 2.0), 100 * SECOND_NS);
    let mut expected = Vec::new();
    in_process::run(&dataset, CONFIG, &mut expected);
    assert_same(&link.feed_all(&dataset), &expected);

    drop(link);
    second.stop();
    memory.assert_nothing_left();
}

#[test]
fn a_killed_client_takes_the_daemon_it_started_with_it() {
    let folder = Folder::of(&drive(10, 60.0));
    let (_config, config) = config_file(CONFIG);
    for signal in [Signal::KILL, Signal::TERM, Signal::INT] {
        if signal == Signal::INT && ignores_interrupts() {
            println!("skipped: SIGINT is ignored here");
            continue;
        }
        let memory = Memory::new();
        let out = folder.file("out.csv");
        let [config, out] = [&config, &out].map(|path| path.to_str().unwrap());
        let options = ["--config", config, "--speed", "1", "--out", out];
        let replay = ["replay", folder.path().to_str().unwrap()];
        let client = start_client(&memory, replay.into_iter().chain(options));
        // Past its start: a process that dies in its first moments may leave a service half made.
        eventually("the replay's first rows", || {
            std::fs::metadata(out)
                .is_ok_and(|file| file.len() > 0)
                .then_some(())
        });
        assert_eq!(memory.processes().len(), 2);
        client.signal(signal);
        assert!(!client.wait().status.success());
        eventually("the end of its daemon", || {
            memory.processes().is_empty().then_some(())
        });
        memory.assert_nothing_left();
        std::fs::remove_file(out).unwrap();
    }
}

#[test]
fn a_reader_that_sleeps_slows_nobody_and_learns_what_it_missed() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut sleeper = EstimateReader::open_on(memory.node(), &instance("car")).unwrap();
    let mut link = Link::open(&memory, "car");
    let dataset = drive(8, 20.0);
    let mut expected = Vec::new();
    in_process::run(&dataset, CONFIG, &mut expected);
    let estimates = link.feed_all(&dataset);
    assert_same(&estimates, &expected);

    let mut woken = Vec::new();
    // It learns of a gap between two estimates, so it has to have seen one before.
    take(&mut sleeper, &mut woken);
    assert!(woken.len() < estimates.len());
    let first = woken[0].head.estimate_seq as usize - 1;
    assert!(first > 0);
    assert_same(&woken, &estimates[first..]);
    assert_eq!(sleeper.missed(), 0);
    let more = link.feed_all(&shifted(&drive(9, 20.0), 20 * SECOND_NS + 5_000_000));
    let mut woken = Vec::new();
    take(&mut sleeper, &mut woken);
    assert_eq!(sleeper.missed(), (more.len() - woken.len()) as u64);
    assert!(sleeper.missed() > 0);
    assert_same(&woken, &more[more.len() - woken.len()..]);

    drop((link, sleeper));
    daemon.stop();
    memory.assert_nothing_left();
}
