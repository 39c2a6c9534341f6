//! The reader, `CONFIG.md` and the files in `config/` say the same: every key, unit, default and range.

use std::fs;
use std::path::{Path, PathBuf};

use inekf_service::config::{
    Axis, Checkpoint, Config, Discretisation, Estimator, Fleet, GapPolicy, HeadingSource, Health,
    Hinf, HinfGain, Hold, Imu, IncrementNoise, Inertial, InertialNoise, Initial, Invariance,
    Journal, KeySpec, Late, LateMethod, Level, Mismatch, Mismatched, MissingPartner, Model, Motion,
    Odometry, OdometryNoise, PositionSource, Rows, Runtime, Smoother, Stacking, Transport, Update,
    VelocitySource, WaitMode, WhiteNoise, Wrong, schema,
};

const MINIMAL: &str = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";

const MINIMAL_ODOMETRY: &str =
    "model = 'odometry2d'\n[noise]\nrotation_density = 3e-3\ntranslation_density = 1e-2\n";

/// The examples: one for each kind of motion.
const EXAMPLES: [&str; 2] = ["config/example.toml", "config/example_odometry.toml"];

fn service_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn text_of(name: &str) -> String {
    fs::read_to_string(service_file(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The rows of `CONFIG.md`'s tables, under the headings they stand under, without the last column.
fn documented_keys() -> Vec<[String; 5]> {
    let mut header = String::new();
    let mut rows = Vec::new();
    for line in text_of("CONFIG.md").lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            let in_code = heading
                .strip_prefix('`')
                .and_then(|rest| rest.strip_suffix('`'));
            header = in_code.unwrap_or("").to_owned();
        }
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let ["", key, unit, default, allowed, meaning, ""] = cells[..]
            && let Some(key) = key.strip_prefix('`').and_then(|key| key.strip_suffix('`'))
        {
            assert!(meaning.len() > 10, "{key} has no meaning");
            rows.push([&header, key, unit, default, allowed].map(str::to_owned));
        }
    }
    rows
}

#[test]
fn config_md_documents_what_the_reader_knows() {
    let known: Vec<[String; 5]> = schema()
        .into_iter()
        .map(
            |KeySpec {
                 header,
                 name,
                 unit,
                 default,
                 allowed,
             }| {
                [
                    header,
                    name.to_owned(),
                    unit.unwrap_or("-").to_owned(),
                    default,
                    allowed,
                ]
            },
        )
        .collect();
    let documented = documented_keys();
    for row in &known {
        assert!(
            documented.contains(row),
            "the reader knows {row:?}; CONFIG.md has no such row"
        );
    }
    for row in &documented {
        assert!(
            known.contains(row),
            "CONFIG.md has {row:?}; the reader knows no such key"
        );
    }
    assert_eq!(documented, known, "same rows, in another order");
}

/// A key line of an example file.
struct ExampleKey {
    header: String,
    name: String,
    value: String,
    enabled: bool,
}

/// Every key line of an example file, those behind a `#` too.
fn example_keys(file: &str) -> Vec<ExampleKey> {
    let mut header = String::new();
    let mut keys = Vec::new();
    for line in text_of(file).lines() {
        let code = line.split(" #").next().unwrap_or("").trim();
        let live = code.trim_start_matches('#');
        if live.starts_with('[') {
            header = live.to_owned();
        } else if let Some((name, value)) = live.split_once(" = ")
            && !name.starts_with(' ')
        {
            keys.push(ExampleKey {
                header: header.clone(),
                name: name.to_owned(),
                value: value.to_owned(),
                enabled: live == code,
            });
        }
    }
    keys
}

#[test]
fn the_examples_name_every_key_with_its_default() {
    let specs = schema();
    let mut named = vec![false; specs.len()];
    for file in EXAMPLES {
        let mut rest = specs.iter().enumerate();
        for key in example_keys(file) {
            let found = rest.find(|(_, spec)| key.header == spec.header && key.name == spec.name);
            let (index, spec) = found.unwrap_or_else(|| {
                panic!(
                    "{file}: {} {}: no such key, or not in the order of the schema",
                    key.header, key.name
                )
            });
            named[index] = true;
            if !["none", "required", "varies"].contains(&&*spec.default) {
                assert_eq!(
                    key.value, spec.default,
                    "{file}: {} {}",
                    key.header, key.name
                );
            }
        }
    }
    for (spec, named) in specs.iter().zip(named) {
        assert!(named, "no example names {} {}", spec.header, spec.name);
    }
}

#[test]
fn the_example_is_the_minimal_file_written_out() {
    let example = Config::load(service_file("config/example.toml")).unwrap();
    let minimal = Config::from_toml_str(MINIMAL, "minimal").unwrap();
    assert_eq!(example, minimal);
}

#[test]
fn the_example_of_odometry_is_a_minimal_file_written_out() {
    let example = Config::load(service_file("config/example_odometry.toml")).unwrap();
    let minimal = format!(
        "mismatch = 'adaptive'\n{MINIMAL_ODOMETRY}[[mismatched]]\nwhat = 'odometry_scale'\nsigma = 0.08\n"
    );
    let minimal = Config::from_toml_str(&minimal, "minimal").unwrap();
    assert_eq!(example, minimal);
}

/// An example without the lines that begin with one of `out`, and with those `on` that are switched off in it.
fn switched(file: &str, out: &[&str], on: &[&str]) -> String {
    let begins = |line: &str, names: &[&str]| names.iter().any(|name| line.starts_with(name));
    let text = text_of(file);
    let kept = text.lines().filter(|line| !begins(line, out));
    kept.map(|line| match line.strip_prefix('#') {
        Some(live) if begins(live, on) => live.to_owned() + "\n",
        _ => line.to_owned() + "\n",
    })
    .collect()
}

#[test]
fn what_the_example_switches_off_can_be_switched_on() {
    let disabled: Vec<String> = example_keys(EXAMPLES[0])
        .into_iter()
        .filter(|key| !key.enabled && key.header != "[smoother]")
        .map(|key| key.name)
        .collect();
    assert!(!disabled.is_empty());
    let names = disabled.iter().map(|name| &**name);
    let on: Vec<&str> = names.chain(["[zero_velocity]"]).collect();
    let all_on = switched(EXAMPLES[0], &["gyro_density", "accel_density"], &on)
        .replace("level = \"accelerometer\"", "level = \"given\"");
    let config = Config::from_toml_str(&all_on, "all on").unwrap();
    let Motion::Inertial(inertial) = &config.motion else {
        panic!("{config:?}")
    };
    assert_eq!(
        inertial.noise.white,
        WhiteNoise::PerSample {
            gyro: 3e-3,
            accel: 0.2
        }
    );
    assert!(inertial.zero_velocity.is_some());
    assert_eq!(config.initial.level, Level::Given);
    assert_eq!(config.initial.position_m, Some([0.0; 3]));
    assert_eq!(config.update.gate_probability, Some(0.9999));

    let smoother = [
        "[smoother]",
        "window = ",
        "iterations",
        "prior",
        "param",
        "jac",
    ];
    // What the smoother does not use of the update.
    let filters = ["iterations", "transport"];
    let text = switched(EXAMPLES[0], &filters, &smoother)
        .replace("estimator = \"inekf\"", "estimator = \"smoother\"");
    let config = Config::from_toml_str(&text, "smoother").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(config.estimator, Estimator::Smoother);
    assert_eq!(config.smoother, Some(Smoother::default()));
}

#[test]
fn what_the_example_of_odometry_switches_off_can_be_switched_on() {
    let read =
        |text: &str| Config::from_toml_str(text, "switched on").unwrap_or_else(|e| panic!("{e}"));
    let odometry = |config: &Config| match &config.motion {
        Motion::Odometry(odometry) => odometry.clone(),
        Motion::Inertial(_) => panic!("{config:?}"),
    };
    let file = EXAMPLES[1];

    let pairs = ["rotation_sigma", "translation_sigma", "lateral_sigma"];
    let densities = ["rotation_density", "translation_density"];
    let config = read(&switched(
        file,
        &densities,
        &[&pairs[..], &["position_", "gate"]].concat(),
    ));
    let expected = IncrementNoise::PerRow {
        rotation: 1e-4,
        translation: 1e-3,
        lateral: 1e-3,
    };
    assert_eq!(odometry(&config).noise.white, expected);
    assert_eq!(config.initial.position_m, Some([0.0; 3]));
    assert_eq!(config.update.gate_probability, Some(0.9999));

    let config = read(&switched(file, &[], &["lateral_density"]));
    let expected = IncrementNoise::Density {
        rotation: 3e-3,
        translation: 1e-2,
        lateral: 1e-2,
    };
    assert_eq!(odometry(&config).noise.white, expected);

    let in_space = ["level", "roll", "pitch", "axis", "source = 0"];
    let text = switched(file, &[], &in_space)
        .replace("odometry2d", "odometry3d")
        .replace(
            "what = \"odometry_scale\"",
            "what = \"measurement_rotation\"",
        );
    let config = read(&text);
    assert_eq!(config.initial.level, Level::Given);
    let what = Wrong::MeasurementRotation {
        source: 0,
        axis: Some(Axis::Z),
    };
    assert_eq!(config.mismatched[0].what, what);

    let text = switched(file, &["burst_sigma"], &["walk"])
        .replace("mismatch = \"adaptive\"", "mismatch = \"augmented\"");
    assert_eq!(read(&text).mismatched[0].walk, 0.0);

    let stacking = ["[stacking]", "sources", "tolerance", "wait_s", "missing"];
    let text = switched(file, &[], &stacking) + "[[position_source]]\nid = 1\n";
    let expected = Stacking {
        sources: [0, 1],
        tolerance_s: 0.001,
        wait_s: 0.2,
        missing: MissingPartner::Unconstrained,
    };
    assert_eq!(read(&text).stacking, Some(expected));

    let mismatched = ["mismatch", "[[mismatched", "what", "sigma = ", "burst"];
    let text = switched(
        file,
        &mismatched,
        &["[hinf]", "gamma", "gain", "noise_factor"],
    )
    .replace("estimator = \"inekf\"", "estimator = \"invariant-hinf\"");
    let expected = Hinf {
        gamma: 0.02,
        gain: HinfGain::Widened,
        noise_factor: 3.0,
    };
    assert_eq!(read(&text).hinf, Some(expected));
}

#[test]
fn a_minimal_file_takes_the_documented_defaults() {
    let expected = Config {
        model: Model::Imu,
        estimator: Estimator::Inekf,
        invariance: Some(Invariance::Left),
        mismatch: Mismatch::None,
        motion: Motion::Inertial(Inertial {
            biases: true,
            discretisation: Discretisation::Zoh,
            hold: Hold::Backward,
            gravity_mps2: 9.80665,
            imu: Imu {
                max_gap_s: 0.5,
                on_gap: GapPolicy::Inflate,
                max_gyro_rps: 50.0,
                max_accel_mps2: 500.0,
            },
            noise: InertialNoise {
                white: WhiteNoise::Density {
                    gyro: 3e-4,
                    accel: 2e-2,
                },
                gyro_bias_walk: 0.0,
                accel_bias_walk: 0.0,
            },
            velocity_sources: vec![VelocitySource {
                id: 0,
                sigma_scale: 1.0,
            }],
            heading_sources: vec![HeadingSource {
                id: 0,
                sigma_scale: 1.0,
            }],
            zero_velocity: None,
        }),
        initial: Initial {
            heading_deg: 0.0,
            heading_sigma_deg: 180.0,
            level: Level::Accelerometer,
            roll_deg: 0.0,
            pitch_deg: 0.0,
            level_sigma_deg: 5.0,
            level_window_s: 0.2,
            position_m: None,
            position_sigma_m: 10.0,
            velocity_mps: [0.0; 3],
            velocity_sigma_mps: 10.0,
            gyro_bias_rps: [0.0; 3],
            gyro_bias_sigma_rps: 0.01,
            accel_bias_mps2: [0.0; 3],
            accel_bias_sigma_mps2: 0.1,
            wait_for_request: false,
        },
        update: Update {
            iterations: 10,
            transport: Transport::Jacobian,
            gate_probability: None,
            recover_after: 10,
        },
        position_sources: vec![PositionSource {
            id: 0,
            lever_arm_m: [0.0; 3],
            sigma_scale: 1.0,
            scale_error: 0.0,
        }],
        mismatched: vec![],
        stacking: None,
        hinf: None,
        smoother: None,
        late: Late {
            method: LateMethod::Carry,
            window_s: 1.0,
            capacity: 2048,
        },
        health: Health {
            degraded_after_s: 5.0,
            stale_after_s: 0.5,
            period_s: 1.0,
        },
        runtime: Runtime {
            wait: WaitMode::Event,
            event_timeout_ms: 10,
            cpu: None,
            priority: None,
            lock_memory: false,
        },
        checkpoint: Checkpoint {
            path: None,
            period_s: 1.0,
            max_age_s: 10.0,
            turn_sigma_rps: 0.2,
            accel_sigma_mps2: 2.0,
            speed_sigma_mps: 2.0,
        },
        journal: Journal { publish: false },
        fleet: Fleet {
            instances: vec![],
            threads: 1,
        },
    };
    assert_eq!(Config::from_toml_str(MINIMAL, "minimal").unwrap(), expected);

    let Motion::Inertial(inertial) = expected.motion else {
        panic!("the model is imu")
    };
    let tables = (
        Imu::default(),
        Initial::default(),
        Update::default(),
        Late::default(),
    );
    assert_eq!(
        tables,
        (
            inertial.imu,
            expected.initial,
            expected.update,
            expected.late
        )
    );
    assert_eq!(
        (Health::default(), Runtime::default()),
        (expected.health, expected.runtime)
    );
    assert_eq!(PositionSource::default(), expected.position_sources[0]);
    assert_eq!(VelocitySource::default(), inertial.velocity_sources[0]);
    assert_eq!(HeadingSource::default(), inertial.heading_sources[0]);
}

#[test]
fn a_minimal_file_of_odometry_takes_the_documented_defaults() {
    let config = Config::from_toml_str(MINIMAL_ODOMETRY, "minimal").unwrap();
    let rows = Rows {
        max_gap_s: 1.0,
        on_gap: GapPolicy::Inflate,
        max_rotation_rad: 3.0,
        max_translation_m: 10.0,
        first_period_s: 0.1,
    };
    assert_eq!(Rows::default(), rows);
    assert_eq!(
        (rows.max_gap_ns(), rows.first_period_ns()),
        (1_000_000_000, 100_000_000)
    );
    let noise = OdometryNoise {
        white: IncrementNoise::Density {
            rotation: 3e-3,
            translation: 1e-2,
            lateral: 1e-2,
        },
        rotation_per_sqrt_m: 0.0,
        rotation_per_sqrt_rad: 0.0,
        translation_per_sqrt_m: 0.0,
    };
    let expected = Config {
        model: Model::Odometry2d,
        estimator: Estimator::Inekf,
        invariance: Some(Invariance::Left),
        mismatch: Mismatch::None,
        motion: Motion::Odometry(Odometry { rows, noise }),
        initial: Initial {
            level: Level::Given,
            ..Initial::default()
        },
        update: Update::default(),
        position_sources: vec![PositionSource::default()],
        mismatched: vec![],
        stacking: None,
        hinf: None,
        smoother: None,
        late: Late::default(),
        health: Health::default(),
        runtime: Runtime::default(),
        checkpoint: Checkpoint::default(),
        journal: Journal::default(),
        fleet: Fleet {
            instances: vec![],
            threads: 1,
        },
    };
    assert_eq!(config, expected);
}

#[test]
fn the_defaults_that_vary_are_as_documented() {
    let read = |top: &str, tables: &str| {
        Config::from_toml_str(&format!("{top}\n{MINIMAL_ODOMETRY}{tables}"), "varies")
            .unwrap_or_else(|faults| panic!("{faults}"))
    };
    let scale = "[[mismatched]]\nwhat = 'odometry_scale'\n";
    for (estimator, invariance) in [("lc-inekf", Some(Invariance::Left)), ("lc-ekf", None)] {
        let config = read(&format!("estimator = '{estimator}'"), scale);
        assert_eq!(
            (config.mismatch, config.invariance),
            (Mismatch::Hard, invariance)
        );
        let expected = Mismatched {
            what: Wrong::OdometryScale,
            sigma: f64::INFINITY,
            burst_sigma: f64::INFINITY,
            walk: 0.0,
        };
        assert_eq!(config.mismatched, [expected]);
    }
    for (estimator, invariance) in [("inekf", Some(Invariance::Left)), ("ekf", None)] {
        let config = read(&format!("estimator = '{estimator}'"), "");
        assert_eq!(
            (config.mismatch, config.invariance),
            (Mismatch::None, invariance)
        );
    }

    let tables = "[[mismatched]]\nwhat = 'odometry_rotation_bias'\nsigma = 0.5\n\
                  [[mismatched]]\nwhat = 'measurement_rotation'\nsource = 0\nsigma = 0.5\n";
    let plane = read("mismatch = 'adaptive'", tables);
    let space = plane_to_space(&format!(
        "mismatch = 'adaptive'\n{MINIMAL_ODOMETRY}{tables}"
    ));
    for (config, axis) in [(&plane, Some(Axis::Z)), (&space, None)] {
        let [bias, rotation] = config.mismatched[..] else {
            panic!("{config:?}")
        };
        assert_eq!(bias.what, Wrong::OdometryRotationBias { axis: Axis::Z });
        assert_eq!(bias.burst_sigma, 1.5, "three times sigma for odometry");
        assert_eq!(
            rotation.what,
            Wrong::MeasurementRotation { source: 0, axis }
        );
        assert_eq!(rotation.burst_sigma, 0.5, "as sigma for a measurement");
        assert_eq!(
            rotation.what.parameters(),
            if axis.is_some() { 1 } else { 3 }
        );
        assert_eq!(
            (bias.what.source(), rotation.what.source()),
            (None, Some(0))
        );
    }
    assert_eq!((plane.error_states(), space.error_states()), (3, 6));
}

/// The same text, with the model in space.
fn plane_to_space(text: &str) -> Config {
    Config::from_toml_str(&text.replace("odometry2d", "odometry3d"), "in space").unwrap()
}

#[test]
fn every_file_in_the_config_folder_is_sound_and_has_one_heading() {
    let mut names = Vec::new();
    for entry in fs::read_dir(service_file("config")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        Config::load(&path).unwrap_or_else(|faults| panic!("{faults}"));
        let text = fs::read_to_string(&path).unwrap();
        for key in ["heading_deg = ", "heading_sigma_deg = "] {
            let count = text.lines().filter(|line| line.starts_with(key)).count();
            assert_eq!(
                count,
                1,
                "{}: lines that start with `{key}`",
                path.display()
            );
        }
        names.push(path.file_stem().unwrap().to_string_lossy().into_owned());
    }
    for name in [
        "example",
        "example_odometry",
        "planar_mismatch_inekf",
        "planar_mismatch_lc-inekf",
        "planar_mismatch_adaptive",
        "planar_mismatch_ekf",
        "planar_mismatch_lc-ekf",
        "planar_mismatch_invariant-hinf",
        "wifibot_3",
        "plaza2_mower",
        "husky_outdoor",
        "kitti00_car_a",
        "euroc_mh01_mav",
        "rtk_car_boulder",
    ] {
        assert!(
            names.iter().any(|found| found == name),
            "{name} is missing: {names:?}"
        );
    }
}

/// The files for the recordings agree with the recordings: gravity and lever arm of `meta.json`, heading of the
/// first row of the truth.
#[test]
fn files_for_recordings_agree_with_them() {
    let Some(datasets) = std::env::var_os("INEKF_DATASETS").map(PathBuf::from) else {
        println!("skipped: INEKF_DATASETS is not set");
        return;
    };
    let sets = [
        ("kitti00_car_a", "truth.csv"),
        ("euroc_mh01_mav", "truth.csv"),
        ("rtk_car_boulder", "reference.csv"),
    ];
    for (name, truth) in sets {
        let folder = datasets.join(name);
        let config = Config::load(service_file(&format!("config/{name}.toml"))).unwrap();

        let meta = fs::read_to_string(folder.join("meta.json")).unwrap();
        let after = |key: &str| meta.split_once(&format!("\"{key}\":")).unwrap().1;
        let gravity: f64 = after("gravity")
            .split(',')
            .next()
            .unwrap()
            .trim()
            .parse()
            .unwrap();
        let Motion::Inertial(inertial) = &config.motion else {
            panic!("{name} is a recording of an IMU")
        };
        assert_eq!(inertial.gravity_mps2, gravity, "{name}");
        let list = after("lever_arm_flu_m").split(['[', ']']).nth(1).unwrap();
        let lever_arm: Vec<f64> = list.split(',').map(|x| x.trim().parse().unwrap()).collect();
        for (ours, theirs) in config.position_sources[0]
            .lever_arm_m
            .iter()
            .zip(&lever_arm)
        {
            assert!(
                (ours - theirs).abs() < 1e-5,
                "{name}: lever arm {ours} m, {theirs} m recorded"
            );
        }

        assert_heading(name, &config, &first_row(&folder.join(truth)));
    }
    for name in ["wifibot_3", "plaza2_mower"] {
        let config = Config::load(service_file(&format!("config/{name}.toml"))).unwrap();
        let row = first_row(&datasets.join(name).join("truth.csv"));
        assert_heading(name, &config, &row);
        let position = config.initial.position_m.unwrap();
        for (ours, theirs) in position.iter().zip(&row[8..11]) {
            assert!(
                (ours - theirs).abs() < 1e-4,
                "{name}: starts at {ours} m, recorded {theirs} m"
            );
        }
    }
    let run = fs::read_to_string(datasets.join("planar_mismatch/run00/meta.json")).unwrap();
    let variances = run.split_once("\"Q_diag_per_step\":").unwrap().1;
    let variances = variances.split(['[', ']']).nth(1).unwrap();
    let variances: Vec<f64> = variances
        .split(',')
        .map(|x| x.trim().parse().unwrap())
        .collect();
    for name in [
        "inekf",
        "lc-inekf",
        "adaptive",
        "ekf",
        "lc-ekf",
        "invariant-hinf",
    ] {
        let file = format!("config/planar_mismatch_{name}.toml");
        let config = Config::load(service_file(&file)).unwrap();
        let Motion::Odometry(odometry) = &config.motion else {
            panic!("{file} is about odometry")
        };
        let sigmas = odometry.noise.row_sigmas(0.1, 1.0, 0.1);
        let ours = [sigmas.rotation, sigmas.translation, sigmas.lateral];
        for (sigma, variance) in ours.iter().zip(&variances) {
            assert!(
                (sigma * sigma / variance - 1.0).abs() < 1e-12,
                "{file}: {sigma}"
            );
        }
    }
}

/// The numbers of the first row of a CSV file.
fn first_row(file: &Path) -> Vec<f64> {
    let rows = fs::read_to_string(file).unwrap();
    let row = rows.lines().nth(1).unwrap().split(',');
    row.map(|x| x.parse().unwrap()).collect()
}

/// Asserts that `config` starts with the heading of a row `t,qw,qx,qy,qz,...`.
fn assert_heading(name: &str, config: &Config, row: &[f64]) {
    let (w, x, y, z) = (row[1], row[2], row[3], row[4]);
    let (r00, r10) = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z));
    let heading = r10.atan2(r00);
    let off = (config.initial.heading_deg.to_radians() - heading)
        .abs()
        .to_degrees();
    assert!(off < 0.01, "{name}: heading is off by {off} deg");
}
