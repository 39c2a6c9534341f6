//! `inekf-client replay` with a daemon of its own: it loses nothing, and folder and configuration alone decide every
//! byte. The oracle is the same engine in this process, fed row by row.

#[path = "replay/journal.rs"]
mod journal;

use std::collections::BTreeSet;

use inekf_client::dataset::{Dataset, Event, Initial, PositionRow};
use inekf_client::simulate::{InitialOptions, PositionOptions, SimulationOptions};
use inekf_client::table::EstimateState;
use inekf_tests::drive::{CONFIG, config, drive, options, simulated};
use inekf_tests::folder::Folder;
use inekf_tests::in_process::{self, shifted};
use inekf_tests::memory::Memory;
use inekf_tests::process::{client, config_file};
use inekf_tests::replay::{Replayed, replay, replay_smoothed};
use inekf_tests::score::SECOND_NS;

/// Replays at full speed and asserts that every byte is the oracle's; returns the replay.
fn assert_as_in_process(name: &str, folder: &Folder, config: &str) -> Replayed {
    println!("{name}");
    let replayed = replay(folder.path(), config, &["--covariance"]);
    let dataset = Dataset::load(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    assert!(
        replayed.csv == in_process::csv(&dataset, config, true),
        "{name}"
    );
    assert!(
        replayed.ended.stdout.contains("; 0 lost\n"),
        "{name}: {:?}",
        replayed.ended
    );
    replayed
}

#[test]
fn the_same_folder_and_configuration_give_the_same_bytes_however_fast_and_however_the_daemon_waits()
{
    let folder = Folder::of(&drive(1, 15.0));
    let dataset = Dataset::load(folder.path()).unwrap();
    for covariance in [&[][..], &["--covariance"]] {
        let expected = in_process::csv(&dataset, CONFIG, !covariance.is_empty());
        for (wait, speed) in [
            ("event", "max"),
            ("event", "max"),
            ("spin", "max"),
            ("event", "50"),
            ("spin", "50"),
        ] {
            let arguments = [&["--speed", speed], covariance].concat();
            let replayed = replay(folder.path(), &config("", wait), &arguments);
            assert!(
                replayed.csv == expected,
                "{wait}, speed {speed}, {covariance:?}"
            );
        }
    }
}

#[test]
fn smoothed_states_are_the_same_bytes_however_fast_one_row_for_each_fix() {
    let folder = Folder::of(&drive(1, 15.0));
    let dataset = Dataset::load(folder.path()).unwrap();
    let smoother = |wait| {
        let config = config("estimator = 'smoother'", wait);
        config.replace("[[heading_source]]\nid = 0\n", "[smoother]\nwindow = 5\n")
    };
    let expected = in_process::csv(&dataset, &smoother("event"), true);
    let mut states: Option<Vec<u8>> = None;
    for (wait, speed) in [("event", "max"), ("spin", "max"), ("event", "50")] {
        let arguments = ["--covariance", "--speed", speed];
        let (replayed, csv, rows) = replay_smoothed(folder.path(), &smoother(wait), &arguments);
        assert!(replayed.csv == expected, "{wait}, speed {speed}");
        let first = states.get_or_insert_with(|| csv.clone());
        assert!(*first == csv, "{wait}, speed {speed}");

        let positions = dataset.position.iter().map(|fix| fix.stamp_ns);
        let velocities = dataset.velocity.iter().map(|fix| fix.stamp_ns);
        let fixes: BTreeSet<u64> = positions.chain(velocities).collect();
        assert!(rows.len() > 10 && rows.len() <= fixes.len());
        assert!(rows.iter().all(|row| fixes.contains(&row.stamp_ns)));
        let is_sound = |triangle: &[f64]| triangle.len() == 120 && triangle[0] > 0.0;
        assert!(rows.iter().all(|row| is_sound(&row.covariance)));
    }
}

#[test]
fn a_filter_has_no_smoothed_states_and_the_replay_says_so() {
    let folder = Folder::of(&drive(1, 5.0));
    let memory = Memory::new();
    let (_config, config) = config_file(CONFIG);
    let out = folder.file("out.csv");
    let smoothed = folder.file("smoothed.csv");
    let arguments: [&std::ffi::OsStr; 8] = [
        "replay".as_ref(),
        folder.path().as_ref(),
        "--config".as_ref(),
        config.as_ref(),
        "--out".as_ref(),
        out.as_ref(),
        "--smoothed".as_ref(),
        smoothed.as_ref(),
    ];
    let ended = client(&memory, arguments);
    assert!(
        ended.failed_with_one_line(1).contains("no smoother"),
        "{ended:?}"
    );
}

#[test]
fn every_sample_from_the_start_of_the_estimate_has_a_row_and_no_more() {
    let folder = Folder::of(&drive(2, 15.0));
    let replayed = assert_as_in_process("a drive", &folder, CONFIG);
    let samples: Vec<u64> = drive(2, 15.0).imu.iter().map(|row| row.stamp_ns).collect();
    let rows: Vec<u64> = replayed.rows.iter().map(|row| row.stamp_ns).collect();
    // 0.2 s are for levelling.
    assert_eq!(rows, samples[samples.len() - rows.len()..]);
    assert!(samples.len() - rows.len() <= 21);
    assert!(replayed.ended.stdout.contains("0 gated, 0 late; 0 lost\n"));
}

/// What is odd about a dataset or its configuration, and how many rows come of it.
struct Odd {
    name: &'static str,
    dataset: Dataset,
    config: String,
    rows: usize,
}

fn odd(name: &'static str, dataset: Dataset, config: impl Into<String>, rows: usize) -> Odd {
    Odd {
        name,
        dataset,
        config: config.into(),
        rows,
    }
}

/// The configuration that needs neither fixes nor levelling to start.
fn known_start() -> String {
    CONFIG.replace(
        "level_sigma_deg = 10.0",
        "level_sigma_deg = 10.0\nlevel = 'given'\nposition_m = [0.0, 0.0, 0.0]",
    )
}

/// A dataset without the samples of a stretch of time, s.
fn silent(mut dataset: Dataset, from_s: f64, to_s: f64) -> Dataset {
    let silent = (from_s * 1e9) as u64..(to_s * 1e9) as u64;
    dataset.imu.retain(|row| !silent.contains(&row.stamp_ns));
    dataset
}

fn slow(imu_rate_hz: f64, duration_s: f64, position_rate_hz: f64) -> Dataset {
    simulated(&SimulationOptions {
        imu_rate_hz,
        duration_s,
        position: Some(PositionOptions {
            rate_hz: position_rate_hz,
            ..PositionOptions::default()
        }),
        ..SimulationOptions::default()
    })
}

fn odd_datasets() -> Vec<Odd> {
    let ten_seconds = || drive(3, 10.0);
    // 0.2 s of levelling, then every sample up to and with the last.
    let usual = 1001 - 20;
    // Where a fix has the stamp of the sample that completes the levelling, the state starts at both: nothing is
    // propagated to that sample.
    let usual_on_fix = usual - 1;
    let mut early_and_late = ten_seconds();
    let fix = early_and_late.position[10];
    let at = |stamp_ns| PositionRow { stamp_ns, ..fix };
    early_and_late = shifted(&early_and_late, 5 * SECOND_NS);
    early_and_late
        .position
        .extend([at(SECOND_NS), at(16 * SECOND_NS), at(80 * SECOND_NS)]);
    early_and_late.sort();
    let mut later_initial = simulated(&SimulationOptions {
        initial: Some(InitialOptions::default()),
        ..options(3, 10.0)
    });
    if let Some(Initial::Spatial { stamp_ns, .. }) = &mut later_initial.meta.initial {
        *stamp_ns = 4 * SECOND_NS;
    }
    vec![
        odd(
            "nothing but samples",
            Dataset {
                position: Vec::new(),
                velocity: Vec::new(),
                heading: Vec::new(),
                ..ten_seconds()
            },
            known_start(),
            1000,
        ),
        odd(
            "no positions",
            Dataset {
                position: Vec::new(),
                ..ten_seconds()
            },
            known_start(),
            1000,
        ),
        odd(
            "fixes at the very stamps of samples",
            simulated(&SimulationOptions {
                position: Some(PositionOptions {
                    rate_hz: 100.0,
                    offset_s: 0.0,
                    ..PositionOptions::default()
                }),
                ..options(3, 10.0)
            }),
            CONFIG,
            usual_on_fix,
        ),
        odd(
            "fixes before the first sample and after the last",
            early_and_late,
            CONFIG,
            usual,
        ),
        odd(
            "stamps of this century",
            shifted(&ten_seconds(), 1_763_780_000_123_456_789),
            CONFIG,
            usual,
        ),
        odd(
            "a silence that is bridged",
            silent(ten_seconds(), 4.0, 9.0),
            CONFIG,
            usual - 500,
        ),
        odd(
            "a silence after which it starts anew",
            silent(drive(3, 30.0), 5.0, 25.0),
            CONFIG,
            // Ten samples confirm that the time has jumped, twenty are for levelling.
            500 - 20 + 501 - 9 - 20,
        ),
        odd(
            "one sample a second, one fix in five",
            slow(1.0, 300.0, 0.2),
            CONFIG,
            300,
        ),
        odd(
            "one sample in four seconds, two fixes a second",
            slow(0.25, 300.0, 2.0),
            CONFIG,
            75,
        ),
        odd(
            "an initial state later than the first samples",
            later_initial,
            CONFIG,
            600,
        ),
        odd(
            "nine states",
            ten_seconds(),
            CONFIG
                .replace("model", "biases = false\nmodel")
                .replace(
                    "gyro_bias_sigma_rps = 2e-3\naccel_bias_sigma_mps2 = 0.05\n",
                    "",
                )
                .replace("gyro_bias_walk = 1e-5\naccel_bias_walk = 1e-4\n", ""),
            usual,
        ),
        odd(
            "samples that speak for the interval after them, in Euler's steps",
            ten_seconds(),
            config("hold = 'forward'\ndiscretisation = 'euler'", "event"),
            usual,
        ),
    ]
}

#[test]
fn odd_datasets_are_replayed_as_in_process_too() {
    for odd in odd_datasets() {
        let folder = Folder::of(&odd.dataset);
        let replayed = assert_as_in_process(odd.name, &folder, &odd.config);
        assert_eq!(replayed.rows.len(), odd.rows, "{}", odd.name);
    }
}

#[test]
fn columns_are_found_by_name_wherever_they_are() {
    let folder = Folder::of(&drive(4, 5.0));
    let expected = assert_as_in_process("as saved", &folder, CONFIG).csv;
    let text = folder.read("imu.csv");
    // t_ns,gx,gy,gz,ax,ay,az: turned round, with one more column, and with line ends of another system.
    let turned: String = text
        .lines()
        .enumerate()
        .map(|(line, row)| {
            let mut cells: Vec<&str> = row.split(',').rev().collect();
            cells.insert(2, if line == 0 { "temperature" } else { "21.5" });
            cells.join(",") + "\r\n"
        })
        .collect();
    folder.write("imu.csv", &turned);
    std::fs::remove_file(folder.file("meta.json")).unwrap();
    assert!(replay(folder.path(), CONFIG, &["--covariance"]).csv == expected);
}

#[test]
fn the_initial_state_of_the_dataset_is_sent_before_the_first_sample() {
    let mut dataset = simulated(&SimulationOptions {
        initial: Some(InitialOptions::default()),
        ..options(5, 5.0)
    });
    // The first row shows the state alone if no fix comes before it.
    dataset.position.retain(|row| row.stamp_ns > SECOND_NS);
    dataset.velocity.retain(|row| row.stamp_ns > SECOND_NS);
    dataset.heading.retain(|row| row.stamp_ns > SECOND_NS);
    let replayed = assert_as_in_process("initial", &Folder::of(&dataset), CONFIG);
    let Some(Initial::Spatial {
        q_wb,
        v_w_mps,
        p_w_m,
        ..
    }) = dataset.meta.initial
    else {
        panic!("the dataset has no initial state");
    };
    let variances = dataset.meta.p0_diag.as_ref().unwrap();
    // The first sample comes with the state, the second moves it by 10 ms.
    let first = &replayed.rows[0];
    assert_eq!(first.stamp_ns, dataset.imu[1].stamp_ns);
    assert_eq!(replayed.rows.len(), dataset.imu.len() - 1);
    let EstimateState::Navigation {
        q_wb: q,
        v_w_mps: v,
        p_w_m: p,
        ..
    } = first.state
    else {
        panic!("a navigation state");
    };
    for axis in 0..3 {
        // Less than 1 rad/s, 20 m/s^2 and 40 m/s over 10 ms.
        assert!((q[axis] - q_wb[axis]).abs() < 0.01);
        assert!((v[axis] - v_w_mps[axis]).abs() < 0.2);
        assert!((p[axis] - p_w_m[axis]).abs() < 0.4);
    }
    for (i, variance) in variances.iter().enumerate() {
        let entry = i * 15 - i * (i + 1) / 2 + i;
        let ratio = first.covariance[entry] / variance;
        assert!((0.99..1.01).contains(&ratio), "{i}: {ratio}");
    }
}

#[test]
fn fixes_and_samples_come_in_one_order_of_time() {
    // Guards the oracle: what it is fed is what the client sends.
    let dataset = drive(6, 5.0);
    let events: Vec<Event> = dataset.events().collect();
    assert!(events.iter().map(Event::stamp_ns).is_sorted());
    assert_eq!(
        events.len(),
        dataset.imu.len() + dataset.position.len() + dataset.velocity.len() + dataset.heading.len()
    );
}
