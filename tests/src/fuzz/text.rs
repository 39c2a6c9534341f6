//! Text from files: configurations and the files of a dataset folder. Read, or refused with the faults.

use std::cell::OnceCell;
use std::fs;

use inekf_client::dataset::{Dataset, LoadOptions};
use inekf_service::config::Config;
use inekf_service::engine::{Engine, History, Model, Use, build};

use crate::drive::options;
use crate::folder::Folder;
use crate::process::project_config;

/// The target: the text of a configuration. What is read must make an engine, or be refused in words.
pub fn config(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    match Config::from_toml_str(&text, "fuzz") {
        Ok(config) => {
            // The largest buffers would only measure the memory of this machine.
            if config.late.capacity <= 4096
                && config.smoother.is_none()
                && let Err(error) = build(&config, Built)
            {
                assert!(!error.to_string().is_empty());
            }
        }
        Err(faults) => assert!(!faults.to_string().is_empty()),
    }
}

struct Built;

impl Use for Built {
    type Output = ();

    fn with<M: Model, H: History<M>>(self, engine: Engine<M, H>) {
        assert!(engine.snapshot().is_none());
    }
}

/// The configurations of the project.
pub fn config_seeds() -> Vec<Vec<u8>> {
    [
        "example",
        "example_odometry",
        "planar_mismatch_adaptive",
        "kitti00_car_a_smoother",
    ]
    .iter()
    .map(|name| project_config(name).into_bytes())
    .collect()
}

/// The files of a folder; the first byte of an input chooses the one that it replaces.
const FILES: [&str; 7] = [
    "imu.csv",
    "position.csv",
    "velocity.csv",
    "heading.csv",
    "truth.csv",
    "meta.json",
    "odometry.csv",
];

thread_local! {
    /// A good folder, one file of which is replaced at a time.
    static FOLDER: OnceCell<Folder> = const { OnceCell::new() };
}

/// The target: a file of a dataset folder. What is read is finite and in order, and comes back the same from a folder
/// that it is written to.
pub fn dataset(bytes: &[u8]) {
    let Some((choice, text)) = bytes.split_first() else {
        return;
    };
    let name = FILES[usize::from(*choice) % FILES.len()];
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| Folder::of(&short()));
        let file = folder.file(name);
        let good = fs::read(&file).ok();
        fs::write(&file, text).expect("the file can be written");
        let loaded = Dataset::load_with(folder.path(), &LoadOptions::default());
        match good {
            Some(good) => fs::write(&file, good).expect("the file can be written"),
            None => fs::remove_file(&file).expect("the file can be removed"),
        }
        match loaded {
            Ok(dataset) => {
                let stamps: Vec<u64> = dataset.events().map(|event| event.stamp_ns()).collect();
                assert!(stamps.is_sorted(), "{stamps:?}");
                for row in &dataset.imu {
                    let numbers = row.gyro_rps.iter().chain(&row.accel_mps2);
                    assert!(numbers.copied().all(f64::is_finite), "{row:?}");
                }
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    });
}

fn short() -> Dataset {
    crate::drive::simulated(&inekf_client::simulate::SimulationOptions {
        imu_rate_hz: 50.0,
        ..options(1, 0.2)
    })
}

/// The files of a simulated drive.
pub fn dataset_seeds() -> Vec<Vec<u8>> {
    let folder = Folder::of(&short());
    FILES
        .iter()
        .enumerate()
        .filter_map(|(index, name)| {
            let mut bytes = vec![index as u8];
            bytes.extend(fs::read(folder.file(name)).ok()?);
            Some(bytes)
        })
        .collect()
}
