//! Every fault is found, named by its key, and found together with the others. Here those of files in general and of
//! inertial navigation; in [`odometry`] those of the odometry models, of the estimators and of mismatches.

mod odometry;

use std::fs;

use inekf_service::config::{
    Config, ConfigFaults, Fault, InertialNoise, MAX_FILE_BYTES, Motion, WhiteNoise,
};

/// A sound text: the table of cases adds one fault to it at a time.
const TOP: &str = "model = \"imu\"\n";
const NOISE: &str = "[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";

/// `top` before the first table, then the noise, then `tables`.
fn text(top: &str, tables: &str) -> String {
    format!("{TOP}{top}\n{NOISE}{tables}\n")
}

/// The noise of inertial navigation.
fn inertial_noise(config: &Config) -> &InertialNoise {
    match &config.motion {
        Motion::Inertial(inertial) => &inertial.noise,
        Motion::Odometry(_) => panic!("{config:?}"),
    }
}

fn faults_of(text: &str) -> Vec<Fault> {
    match Config::from_toml_str(text, "test") {
        Ok(_) => Vec::new(),
        Err(ConfigFaults { faults, .. }) => faults,
    }
}

fn keys(faults: &[Fault]) -> Vec<&str> {
    faults.iter().map(|fault| &*fault.key).collect()
}

/// Asserts that `text` has exactly one fault, of `key`, whose line of print contains all of `words`.
fn assert_single(text: &str, key: &str, words: &[&str]) {
    let faults = faults_of(text);
    assert_eq!(keys(&faults), [key], "{text}");
    let printed = faults[0].to_string();
    for word in words {
        assert!(printed.contains(word), "`{word}` is not in `{printed}`");
    }
}

#[test]
fn each_fault_at_the_top_of_the_file() {
    let cases: [(&str, &str, &[&str]); 18] = [
        (
            "gravity_mps2 = 30.1",
            "gravity_mps2",
            &["30.1", "out of range", "0 to 30 m/s^2", "line 2"],
        ),
        ("gravity_mps2 = -1", "gravity_mps2", &["-1", "out of range"]),
        (
            "gravity_mps2 = nan",
            "gravity_mps2",
            &["nan", "not a finite number"],
        ),
        (
            "gravity_mps2 = -inf",
            "gravity_mps2",
            &["-inf", "not a finite number"],
        ),
        (
            "gravity_mps2 = 1e999",
            "gravity_mps2",
            &["1e999", "not a finite number"],
        ),
        (
            "gravity_mps2 = \"9.8\"",
            "gravity_mps2",
            &["must be a number", "a string"],
        ),
        (
            "gravity_mps2 = 1979-05-27",
            "gravity_mps2",
            &["must be a number", "a date"],
        ),
        (
            "biases = 1",
            "biases",
            &["must be true or false", "a whole number"],
        ),
        (
            "hold = 3.5",
            "hold",
            &["a name in quotes", "a fractional number", "\"midpoint\""],
        ),
        (
            "hold = \"bakward\"",
            "hold",
            &["did you mean \"backward\"?"],
        ),
        (
            "hold = \"Zebra\"",
            "hold",
            &["unknown name", "\"backward\", \"forward\", \"midpoint\""],
        ),
        (
            "estimator = \"lc-inekf\"",
            "estimator",
            &[
                "not built for model \"imu\"",
                "\"inekf\" and \"smoother\" only",
            ],
        ),
        (
            "estimator = \"smother\"",
            "estimator",
            &["did you mean \"smoother\"?"],
        ),
        (
            "estimator = \"smoother\"\ninvariance = \"right\"",
            "invariance",
            &["parametrisation = \"right\""],
        ),
        (
            "mismatch = \"consider\"",
            "mismatch",
            &["not built for model \"imu\"", "\"none\" only"],
        ),
        (
            "gravity = 9.81",
            "gravity",
            &["unknown key", "did you mean gravity_mps2?"],
        ),
        (
            "heading_deg = 1",
            "heading_deg",
            &["unknown key", "belongs in [initial]"],
        ),
        ("colour = \"red\"", "colour", &["unknown key"]),
    ];
    for (top, key, words) in cases {
        assert_single(&text(top, ""), key, words);
    }
}

#[test]
fn each_fault_in_a_table() {
    let cases: [(&str, &str, &[&str]); 38] = [
        (
            "[imu]\nmax_gap_s = 0",
            "imu.max_gap_s",
            &["above 0, at most 60 s", "line 7"],
        ),
        (
            "[imu]\non_gap = \"ignore\"",
            "imu.on_gap",
            &["\"inflate\", \"reinitialise\""],
        ),
        (
            "[imu]\nmax_gyro_rsp = 1",
            "imu.max_gyro_rsp",
            &["did you mean max_gyro_rps?"],
        ),
        (
            "[imu]\nmodel = \"imu\"",
            "imu.model",
            &["belongs at the top, before the first table"],
        ),
        (
            "[intial]\nheading_deg = 1",
            "intial",
            &["did you mean initial?"],
        ),
        (
            "[[initial]]\nheading_deg = 1",
            "initial",
            &["write [initial] once"],
        ),
        (
            "[initial]\nheading_deg = 361",
            "initial.heading_deg",
            &["361", "-360 to 360 deg"],
        ),
        (
            "[initial]\nheading_sigma_deg = 180.001",
            "initial.heading_sigma_deg",
            &["0 to 180 deg"],
        ),
        (
            "[initial]\nroll_deg = 0.0",
            "initial.roll_deg",
            &["contradicts level", "given"],
        ),
        (
            "[initial]\nlevel = \"accelerometer\"\npitch_deg = 2",
            "initial.pitch_deg",
            &["contradicts"],
        ),
        (
            "[initial]\nlevel = \"given\"\npitch_deg = 91",
            "initial.pitch_deg",
            &["-90 to 90 deg"],
        ),
        (
            "[initial]\nposition_sigma_m = 1.0",
            "initial.position_sigma_m",
            &["needs position_m"],
        ),
        (
            "[initial]\nposition_m = [1, 2]",
            "initial.position_m",
            &["must have 3 numbers, has 2"],
        ),
        (
            "[initial]\nposition_m = 1",
            "initial.position_m",
            &["an array of 3 numbers", "a whole number"],
        ),
        (
            "[initial]\nposition_m = [1, 2,\n\n\"x\"]",
            "initial.position_m[2]",
            &["must be a number", "line 9"],
        ),
        (
            "[initial]\nvelocity_mps = [1, inf, 3]",
            "initial.velocity_mps[1]",
            &["not a finite number", "m/s"],
        ),
        (
            "[initial]\nwait_for_request = \"no\"",
            "initial.wait_for_request",
            &["true or false"],
        ),
        (
            "[update]\niterations = 0",
            "update.iterations",
            &["1 to 50"],
        ),
        (
            "[update]\niterations = 10.0",
            "update.iterations",
            &["must be a whole number"],
        ),
        (
            "[update]\niterations = 99999999999999999999999999999999999999999",
            "update.iterations",
            &["out of range"],
        ),
        (
            "[update]\ngate_probability = 1.0",
            "update.gate_probability",
            &["above 0, below 1"],
        ),
        (
            "[update]\nrecover_after = -1",
            "update.recover_after",
            &["0 to 1000000"],
        ),
        (
            "[position_source]\nid = 0",
            "position_source",
            &["write [[position_source]]"],
        ),
        (
            "[[position_source]]\nid = 8",
            "position_source[0].id",
            &["0 to 7"],
        ),
        (
            "[[position_source]]\n[[position_source]]\nid = 1\nlever_arm_m = [0, 0, 1001.0]",
            "position_source[1].lever_arm_m[2]",
            &["1001.0", "-1000 to 1000 m", "line 9"],
        ),
        (
            "[[position_source]]\n[[position_source]]",
            "position_source[1].id",
            &["id 0 is taken", "line 7"],
        ),
        (
            "[[velocity_source]]\nid = 3\n[[velocity_source]]\nid = 3",
            "velocity_source[1].id",
            &["id 3 is taken"],
        ),
        (
            "[[heading_source]]\nsigma_scale = 0",
            "heading_source[0].sigma_scale",
            &["above 0"],
        ),
        (
            "[[heading_source]]\nlever_arm_m = [0, 0, 0]",
            "heading_source[0].lever_arm_m",
            &["[[position_source]]"],
        ),
        (
            "[late]\ncapacity = 0x10001",
            "late.capacity",
            &["0x10001", "1 to 65536 samples"],
        ),
        (
            "[health]\nperiod_s = 0",
            "health.period_s",
            &["0.01 to 3600 s"],
        ),
        (
            "[runtime]\nwait = \"poll\"",
            "runtime.wait",
            &["\"event\", \"spin\""],
        ),
        (
            "[runtime]\nevent_timeout_ms = 51",
            "runtime.event_timeout_ms",
            &["1 to 50 ms"],
        ),
        ("[runtime]\ncpu = -1", "runtime.cpu", &["0 to 1023"]),
        (
            "[runtime]\npriority = 100",
            "runtime.priority",
            &["1 to 99"],
        ),
        (
            "[runtime]\nlock_memory = 1",
            "runtime.lock_memory",
            &["true or false"],
        ),
        ("[fleet]\nthreads = 0", "fleet.threads", &["1 to 256"]),
        (
            "[fleet]\ninstances = 'a,b,a'",
            "fleet.instances",
            &["names \"a\" twice"],
        ),
    ];
    for (tables, key, words) in cases {
        assert_single(&text("", tables), key, words);
    }
}

#[test]
fn each_fault_of_what_must_be_given() {
    let noise = |keys: &str| format!("{TOP}[noise]\n{keys}\n");
    assert_single(NOISE, "model", &["required, but missing", "\"imu\""]);
    assert_single(TOP, "noise", &["[noise] is required"]);
    assert_single(
        "model = \"imu\"\nnoise = 3\n",
        "noise",
        &["must be a table", "a whole number"],
    );
    assert_single(
        &noise("gyro_density = 1e-3"),
        "noise.accel_density",
        &["missing", "line 2"],
    );
    assert_single(
        &noise("accel_sigma_per_sample = 1"),
        "noise.gyro_sigma_per_sample",
        &["missing"],
    );
    assert_single(
        &noise("gyro_density = 1e-3\naccel_density = 1e-2\ngyro_sigma_per_sample = 1e-2"),
        "noise.gyro_sigma_per_sample",
        &["contradicts gyro_density", "not both"],
    );
    assert_single(
        &noise("gyro_density = 1e-3\naccel_sigma_per_sample = 1e-2"),
        "noise.accel_sigma_per_sample",
        &["contradicts gyro_density"],
    );
    assert_single(
        &noise("gyro_density = -1\naccel_density = 1"),
        "noise.gyro_density",
        &["-1", "out of range"],
    );
    assert_eq!(
        keys(&faults_of(&noise(""))),
        ["noise.gyro_density", "noise.accel_density"]
    );
    assert_eq!(keys(&faults_of("")), ["model", "noise"]);
}

#[test]
fn a_bias_contradicts_a_filter_without_biases() {
    let biased = "[initial]\ngyro_bias_rps = [0, 0, 0.1]\naccel_bias_mps2 = [0, 0, 0]";
    assert_single(
        &text("biases = false", biased),
        "initial.gyro_bias_rps",
        &["biases = false"],
    );
    assert_eq!(faults_of(&text("biases = true", biased)), []);
}

#[test]
fn one_fault_does_not_draw_another() {
    let level = "[initial]\nlevel = \"givn\"\nroll_deg = 2.0";
    assert_single(
        &text("", level),
        "initial.level",
        &["did you mean \"given\"?"],
    );
    let id = "[[position_source]]\n[[position_source]]\nid = 'one'";
    assert_single(
        &text("", id),
        "position_source[1].id",
        &["must be a whole number"],
    );
}

#[test]
fn the_ninth_source_is_one_too_many() {
    let sources = |count: usize| -> String {
        (0..count)
            .map(|id| format!("[[position_source]]\nid = {id}\n"))
            .collect()
    };
    assert_eq!(faults_of(&text("", &sources(8))), []);
    assert_single(
        &text("", &sources(9)),
        "position_source[8]",
        &["9 tables", "at most 8"],
    );
}

#[test]
fn ten_faults_are_reported_as_those_ten() {
    let text = "\
estimator = 'smother'
hold = 'sideways'
gravity_mps2 = inf

[noise]
gyro_density = 1e-3
accel_density = 1e-2
accel_sigma_per_sample = 0.1

[initial]
heading_deg = 400
hedaing_sigma_deg = 10
roll_deg = 1.0

[update]
iterations = 'ten'

[[position_source]]
id = 1

[[position_source]]
id = 1
lever_arm_m = [0, 0, nan]
";
    let faults = Config::from_toml_str(text, "ten.toml").unwrap_err();
    let found: Vec<(Option<usize>, &str)> = faults
        .faults
        .iter()
        .map(|fault| (fault.line, &*fault.key))
        .collect();
    let expected = [
        (None, "model"),
        (Some(1), "estimator"),
        (Some(2), "hold"),
        (Some(3), "gravity_mps2"),
        (Some(8), "noise.accel_sigma_per_sample"),
        (Some(11), "initial.heading_deg"),
        (Some(12), "initial.hedaing_sigma_deg"),
        (Some(13), "initial.roll_deg"),
        (Some(16), "update.iterations"),
        (Some(22), "position_source[1].id"),
        (Some(23), "position_source[1].lever_arm_m[2]"),
    ];
    // Ten in what is written, and the model that is not.
    assert_eq!(found, expected);

    let printed = faults.to_string();
    assert_eq!(printed.lines().next(), Some("ten.toml: 11 faults"));
    assert_eq!(printed.lines().count(), 12);
    assert!(
        printed.contains(
            "\n  line 11: initial.heading_deg = 400: out of range (allowed: -360 to 360 deg)\n"
        ),
        "{printed}"
    );

    let ten = Config::from_toml_str(&format!("model = 'imu'\n{text}"), "ten.toml").unwrap_err();
    assert_eq!(keys(&ten.faults), expected.map(|(_, key)| key)[1..]);
}

#[test]
fn a_fault_carries_its_parts() {
    let faults = faults_of(&text("", "[late]\nwindow_s = [1,\n  2]"));
    let expected = Fault {
        key: "late.window_s".to_owned(),
        line: Some(7),
        value: Some("[1, 2]".to_owned()),
        problem: "must be a number, not an array".to_owned(),
        unit: Some("s"),
        allowed: Some("0 to 60".to_owned()),
    };
    assert_eq!(faults, [expected]);
}

#[test]
fn faults_of_syntax_name_line_column_and_text() {
    let cases = [
        (
            "model = \"imu\"\ngravity_mps2 = = 9\n",
            2,
            "column 16",
            "gravity_mps2 = = 9",
        ),
        ("model = \"imu\n", 1, "column ", "model = \"imu"),
        (
            "model = \"imu\"\n[imu\nmax_gap_s = 1\n",
            2,
            "column 5",
            "[imu",
        ),
        (
            "model = \"imu\"\nmodel = \"imu\"\n",
            2,
            "column 1",
            "duplicate key",
        ),
        ("model = imu\n", 1, "column 9", "model = imu"),
        ("model = \"imu\"\nµ = 1\n", 2, "column 1", "µ = 1"),
    ];
    for (text, line, column, words) in cases {
        let faults = faults_of(text);
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert_eq!(
            (&*faults[0].key, faults[0].line),
            ("", Some(line)),
            "{faults:?}"
        );
        let printed = faults[0].to_string();
        for part in [&format!("line {line}: "), "not TOML", column, words] {
            assert!(printed.contains(part), "`{part}` is not in `{printed}`");
        }
    }
    let two = faults_of("a = = 1\nb = 2\nc = 1 2\n");
    assert_eq!(
        two.iter().map(|fault| fault.line).collect::<Vec<_>>(),
        [Some(1), Some(3)]
    );
}

#[test]
fn other_ways_to_write_the_same_are_accepted() {
    let dotted = "model = 'imu'\nnoise.gyro_sigma_per_sample = 1\nnoise.accel_sigma_per_sample = 0x2\n\
                  initial = { heading_deg = -90, position_m = [1, 2.5, 3] }\nupdate.iterations = 1_0\n\
                  velocity_source = []\nposition_source = [{ id = 3 }, { id = 1 }]\n";
    let config = Config::from_toml_str(dotted, "dotted").unwrap();
    assert_eq!(
        inertial_noise(&config).white,
        WhiteNoise::PerSample {
            gyro: 1.0,
            accel: 2.0
        }
    );
    assert_eq!(config.initial.heading_deg, -90.0);
    assert_eq!(config.initial.position_m, Some([1.0, 2.5, 3.0]));
    assert_eq!(config.update.iterations, 10);
    let Motion::Inertial(inertial) = &config.motion else {
        panic!("{config:?}")
    };
    assert_eq!(inertial.velocity_sources, []);
    assert_eq!(inertial.heading_sources.len(), 1);
    assert_eq!(
        config
            .position_sources
            .iter()
            .map(|source| source.id)
            .collect::<Vec<_>>(),
        [3, 1]
    );

    let crlf = text("", "[late]\nwindow_s = 2").replace('\n', "\r\n");
    assert_eq!(
        Config::from_toml_str(&crlf, "crlf")
            .unwrap()
            .late
            .window_ns(),
        2_000_000_000
    );
    assert!(Config::from_toml_str(&format!("\u{feff}{}", text("", "")), "byte order mark").is_ok());
}

#[test]
fn files_that_cannot_be_read_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let fault_of = |name: &str, contents: Option<&[u8]>| -> String {
        let path = folder.path().join(name);
        if let Some(contents) = contents {
            fs::write(&path, contents).unwrap();
        }
        let faults = Config::load(&path).unwrap_err();
        assert_eq!(faults.faults.len(), 1, "{faults}");
        assert!(faults.to_string().contains(name), "{faults}");
        faults.faults[0].to_string()
    };
    assert!(fault_of("missing.toml", None).contains("no such file"));
    assert!(fault_of("binary.toml", Some(b"a = 1\nb = \xff\n")).starts_with("line 2: "));
    assert!(fault_of("binary.toml", Some(b"a = 1\nb = \xff\n")).contains("not UTF-8"));
    assert!(fault_of("huge.toml", Some(&vec![b'#'; MAX_FILE_BYTES + 1])).contains("1048576 bytes"));
    let directory = Config::load(folder.path()).unwrap_err();
    assert!(directory.to_string().contains("directory"), "{directory}");

    let sound = folder.path().join("sound.toml");
    fs::write(&sound, text("", "")).unwrap();
    assert_eq!(
        Config::load(&sound),
        Config::from_toml_str(&text("", ""), "text")
    );
    let mut padded = text("", "").into_bytes();
    padded.resize(MAX_FILE_BYTES, b'#');
    fs::write(&sound, padded).unwrap();
    assert!(
        Config::load(&sound).is_ok(),
        "a file of exactly the limit is read"
    );
}

#[test]
fn each_fault_about_the_smoother() {
    let smoother = "estimator = \"smoother\"";
    let cases: [(&str, &str, &str, &[&str]); 8] = [
        (
            smoother,
            "[zero_velocity]",
            "zero_velocity",
            &["not with estimator \"smoother\""],
        ),
        (
            smoother,
            "[smoother]\nwindow = 0",
            "smoother.window",
            &["1 to 1000"],
        ),
        (
            smoother,
            "[smoother]\niterations = 11",
            "smoother.iterations",
            &["1 to 10"],
        ),
        (
            smoother,
            "[smoother]\nprior = \"linaer\"",
            "smoother.prior",
            &["did you mean \"linear\"?"],
        ),
        (
            smoother,
            "[smoother]\nparametrisation = \"left\"",
            "smoother.parametrisation",
            &["\"exponential\", \"right\", \"gtsam\", \"forster\""],
        ),
        (
            "",
            "[smoother]\nwindow = 10",
            "smoother",
            &["needs estimator = \"smoother\""],
        ),
        (
            smoother,
            "[update]\ntransport = \"none\"",
            "update.transport",
            &["[smoother] iterations"],
        ),
        (
            "estimator = \"smoother\"\nmismatch = \"consider\"",
            "",
            "mismatch",
            &["not built for model \"imu\""],
        ),
    ];
    for (top, tables, key, words) in cases {
        assert_single(&text(top, tables), key, words);
    }
}
