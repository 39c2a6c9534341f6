//! Requests to a real daemon, and the newest estimate on its blackboard.

use inekf_client::control::ControlError;
use inekf_client::simulate::{InitialOptions, SimulationOptions};
use inekf_shared::message::{
    CONTROL_TAKE, ControlRequest, ESTIMATE_RESET, EstimateSe23, MODEL_ODOMETRY_2D,
    REASON_NOT_READY, STATE_ALIGNING, STATE_PAUSED, STATE_RUNNING, STATE_WAITING, StateVector,
    WAITING_FOR_IMU, WAITING_FOR_LEVEL, WAITING_FOR_POSITION, WAITING_FOR_REQUEST, triangle_index,
};
use inekf_tests::drive::{CONFIG, drive, options, simulated};
use inekf_tests::in_process::{self, initial_state, shifted};
use inekf_tests::link::{Link, latest};
use inekf_tests::memory::Memory;
use inekf_tests::process::{Daemon, client, config_file};
use inekf_tests::score::{SECOND_NS, assert_same, assert_same_states, bits};

/// A state as a snapshot gives it, as an estimate has it.
fn assert_is_snapshot_of(state: &StateVector, estimate: &EstimateSe23) {
    let as_estimate = EstimateSe23 {
        head: inekf_shared::message::EstimateHead {
            stamp_ns: state.stamp_ns,
            ..estimate.head
        },
        q_wb: state.q_wb,
        v_w_mps: state.v_w_mps,
        p_w_m: state.p_w_m,
        gyro_bias_rps: state.gyro_bias_rps,
        accel_bias_mps2: state.accel_bias_mps2,
        covariance: state.covariance,
    };
    assert!(bits(&as_estimate) == bits(estimate));
    assert_eq!(state.dimension, estimate.head.dimension);
}

fn refusal(outcome: Result<impl core::fmt::Debug, ControlError>) -> String {
    match outcome {
        Err(ControlError::Refused { reason, .. }) => reason,
        other => panic!("it was not refused: {other:?}"),
    }
}

#[test]
fn a_daemon_says_what_it_waits_for_until_it_runs() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let dataset = drive(1, 2.0);
    let mut state = |rows: usize| {
        link.feed(dataset.events().skip(rows).take(1));
        let answer = link.controller.barrier().unwrap();
        (answer.state_code, answer.waiting_for)
    };
    // The first sample is at 0, the first fixes at 3.3 ms, 0.2 s are for levelling.
    assert_eq!(state(0), (STATE_WAITING, WAITING_FOR_POSITION));
    assert_eq!(
        state(1),
        (STATE_WAITING, WAITING_FOR_POSITION),
        "a fix waits for its sample"
    );
    assert_eq!(state(4), (STATE_ALIGNING, WAITING_FOR_LEVEL));
    for row in 5..40 {
        state(row);
    }
    assert_eq!(state(40).0, STATE_RUNNING);
    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn snapshot_and_blackboard_are_the_newest_estimate() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let latest = latest(&memory, "car");
    assert_eq!(
        latest.read().head.estimate_seq,
        0,
        "nothing has been estimated yet"
    );
    let reason = refusal(link.controller.snapshot());
    assert!(reason.contains("not initialised"), "{reason}");

    let dataset = drive(2, 5.0);
    let rows: Vec<_> = dataset.events().collect();
    for part in rows.chunks(97) {
        let estimates = link.feed(part.iter().copied());
        if let Some(newest) = estimates.last() {
            let read = latest.read();
            // As text: a NIS that does not exist yet is NaN, which equals nothing.
            assert_eq!(format!("{:?}", read.head), format!("{:?}", newest.head));
            assert!(bits(&read) == bits(newest));
            assert_is_snapshot_of(&link.controller.snapshot().unwrap(), newest);
        }
    }
    assert!(latest.read().head.estimate_seq > 400);
    drop((link, latest));
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn a_reset_forgets_and_a_reset_daemon_starts_as_a_new_one() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let before = link.feed_all(&drive(3, 5.0));
    let answer = link.controller.reset().unwrap();
    assert_eq!(
        (answer.state_code, answer.waiting_for),
        (STATE_WAITING, WAITING_FOR_IMU)
    );
    refusal(link.controller.snapshot());

    // Earlier stamps than before, too: the clock is forgotten with the rest.
    let dataset = drive(4, 5.0);
    let after = link.feed_all(&dataset);
    let mut expected = Vec::new();
    in_process::run(&dataset, CONFIG, &mut expected);
    assert_same_states(&after, &expected);
    assert_eq!(before.last().unwrap().head.reset_count, 0);
    assert!(after.iter().all(|estimate| estimate.head.reset_count == 1));
    let announced = after
        .iter()
        .filter(|estimate| estimate.head.flags & ESTIMATE_RESET != 0);
    assert_eq!(announced.count(), 1);
    assert!(after[0].head.flags & ESTIMATE_RESET != 0);
    assert!(after[0].head.reset_jump_m > 0.0);
    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn a_set_state_that_makes_no_sense_is_refused_with_the_reason_and_changes_nothing() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let dataset = shifted(&drive(5, 5.0), SECOND_NS);
    let rows: Vec<_> = dataset.events().collect();
    let (first, second) = rows.split_at(rows.len() / 2);
    let mut estimates = link.feed(first.iter().copied());
    let good = link.controller.snapshot().unwrap();

    let with = |change: &dyn Fn(&mut StateVector)| {
        let mut state = good;
        change(&mut state);
        state
    };
    let diagonal = |i: usize| triangle_index(i, i, 15).unwrap();
    for (bad, word) in [
        (with(&|state| state.p_w_m[1] = f64::NAN), "not finite"),
        (
            with(&|state| state.covariance[3] = f64::INFINITY),
            "not finite",
        ),
        (with(&|state| state.q_wb = [0.0; 4]), "quaternion"),
        (with(&|state| state.q_wb[3] += 0.5), "quaternion"),
        (
            with(&|state| state.covariance[diagonal(4)] = -1.0),
            "positive semidefinite",
        ),
        (with(&|state| state.dimension = 12), "9 or 15"),
        (
            with(&|state| state.model = MODEL_ODOMETRY_2D),
            "another model",
        ),
        (with(&|state| state.model = 77), "unknown"),
        (with(&|state| state.stamp_ns -= 1), "older"),
        (
            with(&|state| state.stamp_ns += 1000 * SECOND_NS),
            "too far ahead",
        ),
    ] {
        let reason = refusal(link.controller.set_state(bad));
        assert!(reason.contains(word), "{word:?} is not in {reason:?}");
    }
    assert_eq!(link.controller.snapshot().unwrap(), good);
    estimates.extend(link.feed(second.iter().copied()));
    let mut expected = Vec::new();
    in_process::run(&dataset, CONFIG, &mut expected);
    assert_same(&estimates, &expected);
    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn a_daemon_that_waits_for_a_state_starts_from_the_one_it_is_given() {
    let memory = Memory::new();
    let config = CONFIG.replace("[initial]", "[initial]\nwait_for_request = true");
    let daemon = Daemon::start(&memory, "car", &config);
    let mut link = Link::open(&memory, "car");
    let dataset = simulated(&SimulationOptions {
        initial: Some(InitialOptions::default()),
        ..options(6, 5.0)
    });
    let earlier = drive(6, 1.0);
    assert_eq!(link.feed_all(&earlier).len(), 0);
    let answer = link.controller.barrier().unwrap();
    assert_eq!(
        (answer.state_code, answer.waiting_for),
        (STATE_WAITING, WAITING_FOR_REQUEST)
    );

    let dataset = shifted(&dataset, 2 * SECOND_NS);
    let mut initial = initial_state(&dataset.meta).unwrap();
    initial.stamp_ns = 2 * SECOND_NS;
    let answer = link.controller.set_state(initial).unwrap();
    assert_eq!(answer.state_code, STATE_RUNNING);
    let estimates = link.feed_all(&dataset);
    let mut expected = Vec::new();
    in_process::run(&dataset, &config, &mut expected);
    assert_same(&estimates, &expected);
    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
}

#[test]
fn a_pause_is_said_and_counted_and_other_noise_is_checked_like_the_configuration() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let dataset = drive(7, 6.0);
    let rows: Vec<_> = dataset.events().collect();
    let mut parts = rows.chunks(rows.len().div_ceil(3));
    let mut next = |link: &mut Link| link.feed(parts.next().unwrap().iter().copied());
    let ask = |action: &[&str]| {
        client(
            &memory,
            [&["control", "--instance", "car"], action].concat(),
        )
    };

    assert!(!next(&mut link).is_empty());
    let ended = ask(&["pause"]).succeeded();
    assert_eq!(ended.stdout, "ok       the daemon is paused\n");
    assert_eq!(next(&mut link).len(), 0);
    let answer = link.controller.barrier().unwrap();
    assert_eq!(answer.state_code, STATE_PAUSED);
    assert!(answer.rejected_by_reason[REASON_NOT_READY as usize] > 200);
    assert!(ask(&["snapshot"]).succeeded().stdout.contains("p_w_m"));
    let ended = ask(&["resume"]).succeeded();
    assert_eq!(ended.stdout, "ok       the daemon is running\n");

    let file = |text: &str| {
        let (folder, file) = config_file(text);
        (folder, file.to_str().unwrap().to_owned())
    };
    let (_kept, good) = file("[noise]\ngyro_density = 1e-3\naccel_density = 1e-2\n");
    ask(&["reload-noise", &good]).succeeded();
    for (text, word) in [
        (
            "[noise]\ngyro_density = 11.0\naccel_density = 1e-2\n",
            "gyroscope",
        ),
        (
            "[noise]\nrotation_density = 1.0\ntranslation_density = 1.0\nlateral_density = 1.0\n",
            "other kind",
        ),
        ("[noise]\ngyro_density = 1e-3\n", "both densities"),
        ("[nose]\n", "no table [noise]"),
    ] {
        let (_kept, bad) = file(text);
        let ended = ask(&["reload-noise", &bad]);
        assert!(ended.failed_with_one_line(1).contains(word), "{ended:?}");
    }
    assert_eq!(ask(&["reload-noise"]).status.code(), Some(2));
    // Samples are taken again: after two seconds of silence, as after any gap.
    assert!(!next(&mut link).is_empty());
    let reason = refusal(link.controller.send(ControlRequest {
        kind: CONTROL_TAKE,
        argument: 1,
        ..ControlRequest::default()
    }));
    assert!(reason.contains("--stepped"), "{reason}");
    assert!(ask(&["reset"]).succeeded().stdout.contains("waiting"));
    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
}
