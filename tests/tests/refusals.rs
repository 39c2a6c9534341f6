//! What cannot be done is refused by exit status: 1 with one line that says why, 2 for wrong usage. Nothing is left of
//! a daemon that was started meanwhile.

use std::ffi::OsStr;
use std::path::Path;

use inekf_tests::drive::{CONFIG, drive};
use inekf_tests::folder::Folder;
use inekf_tests::memory::Memory;
use inekf_tests::process::{Ended, client, config_file, service};

/// Replays `folder` with a daemon of this configuration; the output is `out` in that folder.
fn replay(memory: &Memory, folder: &Path, config: &str, out: &str) -> Ended {
    let (_config, config) = config_file(config);
    let out = folder.join(out);
    let arguments: [&OsStr; 6] = [
        "replay".as_ref(),
        folder.as_ref(),
        "--config".as_ref(),
        config.as_ref(),
        "--out".as_ref(),
        out.as_ref(),
    ];
    client(memory, arguments)
}

/// Asserts that the replay is refused in one line with all of `words`, and that nothing is left.
fn assert_refused(folder: &Path, config: &str, out: &str, words: &[&str]) {
    let memory = Memory::new();
    let ended = replay(&memory, folder, config, out);
    let line = ended.failed_with_one_line(1);
    println!("{line}");
    for word in words {
        assert!(line.contains(word), "{word:?} is not in {line:?}");
    }
    memory.assert_nothing_left();
}

/// A good folder.
fn good() -> Folder {
    Folder::of(&drive(1, 3.0))
}

/// Replaces the cell of a table in this line (the header is line 1) and in the column of this name.
fn set_cell(folder: &Folder, file: &str, line: usize, column: &str, value: &str) {
    let text = folder.read(file);
    let header = text.lines().next().unwrap();
    let index = header.split(',').position(|name| name == column).unwrap();
    folder.edit_line(file, line, |row| {
        let mut cells: Vec<&str> = row.split(',').collect();
        cells[index] = value;
        cells.join(",")
    });
}

#[test]
fn a_table_with_a_fault_is_refused_with_file_line_and_column() {
    for (file, line, column, value) in [
        ("imu.csv", 1, "gy", "gyro_y"),
        ("position.csv", 1, "sx", "sigma"),
        ("imu.csv", 101, "gx", "NaN"),
        ("imu.csv", 101, "az", "inf"),
        ("imu.csv", 101, "t_ns", "5"),
        ("imu.csv", 101, "t_ns", "-5"),
        ("imu.csv", 101, "gz", "fast"),
        ("position.csv", 3, "sx", "-1.0"),
        ("velocity.csv", 3, "sz", "NaN"),
    ] {
        let folder = good();
        set_cell(&folder, file, line, column, value);
        let place = format!("{file} line {line}");
        assert_refused(folder.path(), CONFIG, "out.csv", &[&place, column, value]);
        assert!(!folder.file("out.csv").exists());
    }
}

#[test]
fn several_faults_in_a_folder_are_counted() {
    let folder = good();
    set_cell(&folder, "imu.csv", 5, "gx", "NaN");
    set_cell(&folder, "position.csv", 5, "sy", "-1");
    folder.write("meta.json", "{");
    assert_refused(folder.path(), CONFIG, "out.csv", &["and 2 more"]);
}

#[test]
fn a_folder_that_is_missing_or_without_samples_is_refused() {
    let missing = good().path().join("nowhere");
    assert_refused(&missing, CONFIG, "out.csv", &["nowhere", "No such file"]);

    let empty = Folder::new();
    assert_refused(
        empty.path(),
        CONFIG,
        "out.csv",
        &["imu.csv", "odometry.csv"],
    );

    let odometry = Folder::new();
    odometry.write("odometry.csv", "t_ns,dtheta,dx,dy\n0,0,0,0\n1000,0.1,1,0\n");
    assert_refused(
        odometry.path(),
        CONFIG,
        "out.csv",
        &["no imu.csv", "odometry"],
    );
}

#[test]
fn an_output_that_cannot_be_written_is_refused() {
    let folder = good();
    assert_refused(
        folder.path(),
        CONFIG,
        "no/such/folder/out.csv",
        &["no/such/folder/out.csv"],
    );
}

#[test]
fn data_of_which_no_estimate_comes_are_refused_with_what_the_daemon_waits_for() {
    let folder = good();
    std::fs::remove_file(folder.file("position.csv")).unwrap();
    let words = &["no estimate", "waiting for: position"];
    assert_refused(folder.path(), CONFIG, "out.csv", words);
}

#[test]
fn an_initial_state_that_makes_no_sense_is_refused() {
    let folder = good();
    let initial = "\"initial\": { \"t_ns\": 0, \"qw\": 1, \"qx\": 0, \"qy\": 0, \"qz\": 0, \"x\": 0, \"y\": 0, \"z\": 0 }";
    let negative = "\"P0_diag\": [1, 1, 1, 1, 1, 1, 1, 1, -1]";
    folder.write("meta.json", &format!("{{ {initial}, {negative} }}"));
    assert_refused(folder.path(), CONFIG, "out.csv", &["meta.json", "P0_diag"]);
}

#[test]
fn a_missing_daemon_is_named_as_such() {
    let memory = Memory::new();
    let folder = good();
    let out = folder.file("out.csv");
    let arguments: [&OsStr; 6] = [
        "replay".as_ref(),
        folder.path().as_ref(),
        "--out".as_ref(),
        out.as_ref(),
        "--instance".as_ref(),
        "nobody".as_ref(),
    ];
    let ended = client(&memory, arguments);
    let line = ended.failed_with_one_line(1);
    assert!(
        line.contains("no daemon of instance nobody is running"),
        "{line}"
    );
    memory.assert_nothing_left();
}

/// Ten faults, and how each is named.
const TEN_FAULTS: &str = "\
model = 'imu'
discretisation = 'runge-kutta'
gravity_mps2 = -9.81
speed_of_light = 3e8
[imu]
max_gap_s = 0.0
[noise]
gyro_density = nan
accel_density = 'small'
[initial]
heading_deg = 400.0
heading_sigma_deg = -1.0
[update]
iterations = 0
[[position_source]]
id = 8
";
const TEN_NAMES: [&str; 10] = [
    "discretisation = ",
    "gravity_mps2 = ",
    "speed_of_light",
    "imu.max_gap_s = ",
    "noise.gyro_density = ",
    "noise.accel_density = ",
    "initial.heading_deg = ",
    "initial.heading_sigma_deg = ",
    "update.iterations = ",
    "position_source[0].id = ",
];

#[test]
fn a_configuration_with_ten_faults_is_refused_with_all_ten() {
    let (_folder, file) = config_file(TEN_FAULTS);
    let memory = Memory::new();
    let checked = service(&memory, ["check".as_ref(), file.as_os_str()]);
    let served = service(&memory, ["--config".as_ref(), file.as_os_str()]);
    let replayed = replay(&memory, good().path(), TEN_FAULTS, "out.csv");
    for ended in [checked, served, replayed] {
        assert_eq!(ended.status.code(), Some(1), "{ended:#?}");
        assert!(ended.stderr.contains("10 faults"), "{ended:#?}");
        for name in TEN_NAMES {
            let line = ended.stderr.lines().find(|line| line.contains(name));
            // Every one with its line in the file.
            assert!(
                line.is_some_and(|line| line.contains("line ")),
                "{name}: {ended:#?}"
            );
        }
    }
    memory.assert_nothing_left();
}

#[test]
fn a_configuration_that_is_good_is_called_so() {
    let (_folder, file) = config_file(CONFIG);
    let ended = service(&Memory::new(), ["check".as_ref(), file.as_os_str()]).succeeded();
    assert!(
        ended
            .stdout
            .contains("good: model imu, estimator inekf, 15 states")
    );
}

#[test]
fn wrong_usage_has_its_own_status() {
    let memory = Memory::new();
    for arguments in [
        &[][..],
        &["drive"],
        &["replay", "somewhere"],
        &["replay", "somewhere", "--out", "out.csv", "--speed", "0"],
        &["replay", "somewhere", "--out", "out.csv", "--speed", "fast"],
        &[
            "replay",
            "somewhere",
            "--out",
            "out.csv",
            "--instance",
            "a/b",
        ],
        &["simulate", "moon-landing"],
        &["simulate", "road-circuit", "--rate", "often"],
        &["demo", "--no-such-option"],
    ] {
        let ended = client(&memory, arguments);
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {ended:#?}");
        assert!(!ended.stderr.is_empty(), "{arguments:?}");
    }
    for arguments in [&[][..], &["--config"], &["check"], &["--instance", "a"]] {
        let ended = service(&memory, arguments);
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {ended:#?}");
    }
    memory.assert_nothing_left();
}

#[test]
fn a_simulation_that_cannot_be_is_refused() {
    let memory = Memory::new();
    for (option, word) in [
        ("--rate=0", "imu_rate_hz"),
        ("--duration=-1", "duration_s"),
        ("--duration=NaN", "duration_s"),
    ] {
        let ended = client(&memory, ["simulate", "road-circuit", option]);
        assert!(ended.failed_with_one_line(1).contains(word), "{ended:#?}");
    }
    memory.assert_nothing_left();
}
