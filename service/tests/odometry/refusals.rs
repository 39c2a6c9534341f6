//! Constraints that no gain can meet are refused at the start, with the reason.

use std::process::Command;

use inekf::filter::UpdateError;
use inekf_service::config::{Config, Mismatched, Wrong};
use inekf_service::engine::{Engine, History, Model, Use, build};

use super::harness::parse;

const SINGLE: &str = "model = \"odometry2d\"\nestimator = \"lc-inekf\"\nmismatch = \"hard\"\n[noise]\n\
                      rotation_density = 0.01\ntranslation_density = 0.02\n[[position_source]]\nid = 0\n";

fn table(what: &str) -> String {
    format!("[[mismatched]]\nwhat = \"{what}\"\n")
}

struct Nothing;

impl Use for Nothing {
    type Output = ();

    fn with<M: Model + 'static, H: History<M> + 'static>(self, _engine: Engine<M, H>) {}
}

#[test]
fn three_hard_mismatches_on_one_source_are_refused_by_the_file_and_by_the_check() {
    let three = [
        table("odometry_scale"),
        table("odometry_turn_scale"),
        table("odometry_rotation_bias"),
    ];
    let text = format!("{SINGLE}{}", three.concat());
    let faults = Config::from_toml_str(&text, "three.toml")
        .unwrap_err()
        .to_string();
    assert!(
        faults.contains("3 hard constraints have no solution on the 2 outputs"),
        "{faults}"
    );

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("three.toml");
    std::fs::write(&path, text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_inekf-service"))
        .arg("check")
        .arg(&path)
        .output()
        .unwrap();
    assert!(!output.status.success());
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("3 hard constraints have no solution"),
        "{said}"
    );
}

#[test]
fn the_engine_itself_refuses_what_a_file_would_not_have_let_through() {
    let mut config = parse(&format!(
        "{SINGLE}{}{}",
        table("odometry_scale"),
        table("odometry_turn_scale")
    ));
    assert!(build(&config, Nothing).is_ok());
    let third = Mismatched {
        what: Wrong::MeasurementScale { source: 0 },
        ..config.mismatched[0]
    };
    config.mismatched.push(third);
    let error = build(&config, Nothing).unwrap_err();
    assert_eq!(error, UpdateError::UnsolvableConstraints);
    let said = error.to_string();
    assert!(
        said.contains("declare fewer, add a position source"),
        "{said}"
    );
}

#[test]
fn each_single_hard_mismatch_of_odometry_starts() {
    for what in [
        "odometry_scale",
        "odometry_turn_scale",
        "odometry_rotation_bias",
    ] {
        let config = parse(&format!("{SINGLE}{}", table(what)));
        assert!(build(&config, Nothing).is_ok(), "{what}");
    }
}
