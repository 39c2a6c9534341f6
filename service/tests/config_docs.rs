//! The reader, `CONFIG.md` and the files in `config/` say the same: every key, unit, default and range.

use std::fs;
use std::path::{Path, PathBuf};

use inekf_service::config::{
    Config, Discretisation, Estimator, GapPolicy, HeadingSource, Health, Hold, Imu, Initial,
    Invariance, KeySpec, Late, Level, Model, Noise, PositionSource, Runtime, Transport, Update,
    VelocitySource, WaitMode, WhiteNoise, schema,
};

const MINIMAL: &str = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";

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

/// A key line of the example file.
struct ExampleKey {
    header: String,
    name: String,
    value: String,
    enabled: bool,
}

/// Every key line of the example file, those behind a `#` too.
fn example_keys() -> Vec<ExampleKey> {
    let mut header = String::new();
    let mut keys = Vec::new();
    for line in text_of("config/example.toml").lines() {
        let code = line.split(" #").next().unwrap_or("").trim();
        if code.starts_with('[') {
            header = code.to_owned();
        } else if let Some((name, value)) = code.split_once(" = ")
            && !name.starts_with("# ")
        {
            keys.push(ExampleKey {
                header: header.clone(),
                name: name.trim_start_matches('#').to_owned(),
                value: value.to_owned(),
                enabled: !name.starts_with('#'),
            });
        }
    }
    keys
}

#[test]
fn the_example_names_every_key_with_its_default() {
    let specs = schema();
    let keys = example_keys();
    let in_example: Vec<(&str, &str)> = keys.iter().map(|key| (&*key.header, &*key.name)).collect();
    let in_schema: Vec<(&str, &str)> = specs
        .iter()
        .map(|spec| (&*spec.header, spec.name))
        .collect();
    assert_eq!(in_example, in_schema);
    for (key, spec) in keys.iter().zip(&specs) {
        if !["none", "required"].contains(&&*spec.default) {
            assert_eq!(key.value, spec.default, "{} {}", key.header, key.name);
        }
    }
}

#[test]
fn the_example_is_the_minimal_file_written_out() {
    let example = Config::load(service_file("config/example.toml")).unwrap();
    let minimal = Config::from_toml_str(MINIMAL, "minimal").unwrap();
    assert_eq!(example, minimal);
}

#[test]
fn what_the_example_switches_off_can_be_switched_on() {
    let text = text_of("config/example.toml");
    let lines = text.lines().filter(|line| !line.contains("_density = "));
    let all_on: String = lines
        .map(|line| {
            let disabled = line.starts_with('#') && !line.starts_with("# ") && line.len() > 1;
            if disabled {
                line[1..].to_owned() + "\n"
            } else {
                line.to_owned() + "\n"
            }
        })
        .collect::<String>()
        .replace("level = \"accelerometer\"", "level = \"given\"");
    let config = Config::from_toml_str(&all_on, "all on").unwrap();
    assert_eq!(
        config.noise.white,
        WhiteNoise::PerSample {
            gyro: 3e-3,
            accel: 0.2
        }
    );
    assert_eq!(config.initial.level, Level::Given);
    assert_eq!(config.initial.position_m, Some([0.0; 3]));
    assert_eq!(config.update.gate_probability, Some(0.9999));
    assert!(example_keys().iter().any(|key| !key.enabled));
}

#[test]
fn a_minimal_file_takes_the_documented_defaults() {
    let expected = Config {
        model: Model::Imu,
        estimator: Estimator::Inekf,
        invariance: Invariance::Left,
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
        noise: Noise {
            white: WhiteNoise::Density {
                gyro: 3e-4,
                accel: 2e-2,
            },
            gyro_bias_walk: 0.0,
            accel_bias_walk: 0.0,
        },
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
        }],
        velocity_sources: vec![VelocitySource {
            id: 0,
            sigma_scale: 1.0,
        }],
        heading_sources: vec![HeadingSource {
            id: 0,
            sigma_scale: 1.0,
        }],
        late: Late {
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
        },
    };
    assert_eq!(Config::from_toml_str(MINIMAL, "minimal").unwrap(), expected);

    let tables = (
        Imu::default(),
        Initial::default(),
        Update::default(),
        Late::default(),
    );
    assert_eq!(
        tables,
        (
            expected.imu,
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
    assert_eq!(VelocitySource::default(), expected.velocity_sources[0]);
    assert_eq!(HeadingSource::default(), expected.heading_sources[0]);
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
        assert_eq!(config.gravity_mps2, gravity, "{name}");
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

        let rows = fs::read_to_string(folder.join(truth)).unwrap();
        let row: Vec<f64> = rows
            .lines()
            .nth(1)
            .unwrap()
            .split(',')
            .map(|x| x.parse().unwrap())
            .collect();
        let (w, x, y, z) = (row[1], row[2], row[3], row[4]);
        let (r00, r10) = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z));
        let heading = r10.atan2(r00);
        let off = (config.initial.heading_rad() - heading).abs().to_degrees();
        assert!(off < 0.01, "{name}: heading is off by {off} deg");
    }
}
