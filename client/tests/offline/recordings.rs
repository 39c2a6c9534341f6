//! Every recording in the folder named by `INEKF_DATASETS` loads, and comes back from a save.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use inekf_client::dataset::{Dataset, Initial, LoadOptions, Odometry, Truth};
use tempfile::TempDir;

/// The dataset folders below `dir`: those with a `meta.json`.
fn folders_below(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.join("meta.json").is_file() {
            found.push(path);
        } else if path.is_dir() {
            found.extend(folders_below(&path));
        }
    }
    found.sort();
    found
}

#[test]
fn every_recording_loads_in_order_and_survives_a_save() {
    let Some(root) = env::var_os("INEKF_DATASETS") else {
        println!("skipped: INEKF_DATASETS is not set");
        return;
    };
    let folders = folders_below(Path::new(&root));
    assert!(!folders.is_empty(), "no dataset below {root:?}");
    for folder in folders {
        let dataset = Dataset::load(&folder).unwrap_or_else(|error| panic!("{error}"));
        let stamps: Vec<u64> = dataset.events().map(|event| event.stamp_ns()).collect();
        assert!(
            stamps.is_sorted() && stamps.len() > 300,
            "{}",
            folder.display()
        );
        assert!(!dataset.position.is_empty(), "{}", folder.display());

        let copy = TempDir::new().unwrap();
        dataset.save(copy.path()).unwrap();
        assert_eq!(
            Dataset::load(copy.path()).unwrap(),
            dataset,
            "{}",
            folder.display()
        );

        for (position, truth) in [
            ("position_noisy.csv", "truth.csv"),
            ("position.csv", "reference.csv"),
        ] {
            if folder.join(position).exists() && folder.join(truth).exists() {
                let options = LoadOptions {
                    position_file: position.to_owned(),
                    truth_file: truth.to_owned(),
                };
                let other = Dataset::load_with(&folder, &options).unwrap();
                assert_eq!(other.imu, dataset.imu);
                assert!(!other.position.is_empty() && other.truth != Truth::None);
            }
        }
    }
}

#[test]
fn planar_recordings_have_two_sources_and_an_initial_state() {
    let Some(root) = env::var_os("INEKF_DATASETS") else {
        println!("skipped: INEKF_DATASETS is not set");
        return;
    };
    let dataset = Dataset::load(Path::new(&root).join("planar_clean/run00")).unwrap();
    assert!(
        dataset
            .position
            .iter()
            .any(|row| row.source == 1 && row.dimension == 2)
    );
    assert!(matches!(&dataset.odometry, Odometry::Planar(rows) if rows.len() == 330));
    assert!(matches!(&dataset.truth, Truth::Planar(_)));
    assert!(matches!(
        dataset.meta.initial,
        Some(Initial::Planar { stamp_ns: 0, .. })
    ));
    assert_eq!(dataset.meta.p0_diag.as_ref().map(Vec::len), Some(3));
    assert_eq!(dataset.meta.lever_arms_m.len(), 2);
}
