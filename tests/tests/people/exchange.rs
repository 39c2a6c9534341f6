//! Estimates that leave the program, read by the tools they are for.

use std::fs;
use std::path::Path;
use std::process::Command;

use inekf_client::recording::estimates::read_estimates;
use inekf_client::recording::{Head, RECORDING_VERSION, Writer};
use inekf_shared::message::{ESTIMATE_UPDATED, EstimateSe23, MODEL_IMU};
use inekf_tests::drive;
use inekf_tests::folder::Folder;
use inekf_tests::in_process;
use inekf_tests::memory::Memory;
use inekf_tests::process::{Ended, Running, client};
use inekf_tests::replay::replay;
use inekf_tests::score::estimates;
use inekf_tests::tools;

/// A dataset folder with the estimates of it beside its files, as `estimate.csv`.
fn estimated() -> Folder {
    let folder = Folder::of(&drive::drive(3, 15.0));
    let replayed = replay(folder.path(), drive::CONFIG, &["--covariance"]);
    fs::write(folder.path().join("estimate.csv"), replayed.csv).unwrap();
    folder
}

fn run_in(folder: &Path, arguments: &[&str]) -> Ended {
    let memory = Memory::new();
    let arguments = arguments.iter().map(|argument| {
        if argument.contains('.') {
            folder.join(argument).display().to_string()
        } else {
            (*argument).to_owned()
        }
    });
    client(&memory, arguments)
}

fn export(folder: &Folder, input: &str, format: &str, out: &str) {
    let arguments = ["export", input, "--format", format, "--out", out];
    run_in(folder.path(), &arguments).succeeded();
}

/// Its program `evo_ape`, by this Python: the module was another one once.
const EVO_APE: &str = "\
try:
    from evo.cli.entry_points import ape
except ImportError:
    from evo.entry_points import ape
ape()
";

#[test]
fn evo_accepts_the_export_and_finds_the_error_that_the_report_finds() {
    let folder = estimated();
    export(&folder, "estimate.csv", "tum", "estimate.tum");
    export(&folder, "truth.csv", "tum", "truth.tum");
    let out = [
        "report",
        "estimate.csv",
        "--truth",
        "truth.csv",
        "--out",
        "report.html",
    ];
    let report = run_in(folder.path(), &out).succeeded();
    let Some(python) = tools::python_with(&["evo"]) else {
        return;
    };
    let mut command = Command::new(python);
    command
        .args(["-c", EVO_APE])
        .args(["tum", "truth.tum", "estimate.tum"])
        .current_dir(folder.path())
        .env("HOME", folder.path());
    let ended = tools::finish(Running::start(command)).succeeded();
    let rmse: f64 = ended
        .stdout
        .lines()
        .find_map(|line| line.trim().strip_prefix("rmse")?.trim().parse().ok())
        .unwrap_or_else(|| panic!("{ended:#?}"));
    // The root of the sum of the squares of the three that the report prints with three decimals.
    let numbers: Vec<f64> = report
        .stdout
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    let ours = numbers[..3]
        .iter()
        .map(|axis| axis * axis)
        .sum::<f64>()
        .sqrt();
    assert!((ours - rmse).abs() < 2e-3, "{ours} {rmse}");
}

/// Decodes with the public reader and turns the covariance by its own arithmetic: first order, in quaternions.
const DECODE: &str = r#"
import csv, sys
import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

rows = list(csv.DictReader(open("estimate.csv")))
odometry, tf = [], []
with open("estimate.mcap", "rb") as file:
    for schema, channel, message, ros in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
        (odometry if channel.topic == "/inekf/odometry" else tf).append((schema.name, message, ros))
assert len(odometry) == len(rows) and len(tf) == len(rows), (len(odometry), len(tf), len(rows))
for row, (name, message, ros), (tf_name, _, transforms) in zip(rows, odometry, tf):
    assert (name, tf_name) == ("nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage")
    stamp = int(row["t_ns"])
    assert message.log_time == stamp
    assert ros.header.stamp.sec * 10**9 + ros.header.stamp.nanosec == stamp
    assert (ros.header.frame_id, ros.child_frame_id) == ("world", "base_link")
    p, q = ros.pose.pose.position, ros.pose.pose.orientation
    assert [p.x, p.y, p.z] == [float(row[c]) for c in "xyz"]
    x, y, z, w = quaternion = [float(row["q" + c]) for c in "xyzw"]
    assert np.allclose([q.x, q.y, q.z, q.w], quaternion, atol=1e-12)
    move = transforms.transforms[0].transform
    assert [move.translation.x, move.translation.y, move.translation.z] == [p.x, p.y, p.z]
    R = np.array([[1-2*(y*y+z*z), 2*(x*y-z*w), 2*(x*z+y*w)],
                  [2*(x*y+z*w), 1-2*(x*x+z*z), 2*(y*z-x*w)],
                  [2*(x*z-y*w), 2*(y*z+x*w), 1-2*(x*x+y*y)]])
    v = np.array([float(row["v" + c]) for c in "xyz"])
    linear = ros.twist.twist.linear
    assert np.allclose([linear.x, linear.y, linear.z], R.T @ v, atol=1e-9)
    P = np.zeros((15, 15))
    for i in range(15):
        for j in range(i, 15):
            P[i, j] = P[j, i] = float(row[f"p_{i}_{j}"])
    D = np.zeros((6, 15))
    D[0:3, 6:9] = R
    D[3:6, 0:3] = R
    assert np.allclose(np.reshape(ros.pose.covariance, (6, 6)), D @ P @ D.T, rtol=1e-9, atol=1e-12)
print("good", len(rows))
"#;

#[test]
fn the_public_reader_decodes_the_mcap_and_finds_the_estimates_in_it() {
    let folder = estimated();
    export(&folder, "estimate.csv", "mcap", "estimate.mcap");
    let bytes = fs::read(folder.path().join("estimate.mcap")).unwrap();
    let magic = b"\x89MCAP0\r\n";
    assert!(bytes.starts_with(magic) && bytes.ends_with(magic));
    let Some(python) = tools::python_with(&["numpy", "mcap", "mcap_ros2"]) else {
        return;
    };
    let mut command = Command::new(python);
    command.args(["-c", DECODE]).current_dir(folder.path());
    let ended = tools::finish(Running::start(command)).succeeded();
    let rows = estimates(&folder.path().join("estimate.csv")).len();
    assert_eq!(ended.stdout.trim(), format!("good {rows}"));
}

/// A folder with a recording of what the engine makes of a drive, as `drive.rec`, the same estimates as `estimate.csv`, and
/// the truth.
fn recorded() -> (Folder, Vec<EstimateSe23>) {
    let dataset = drive::drive(5, 10.0);
    let folder = Folder::of(&dataset);
    let mut estimates = Vec::new();
    in_process::run(&dataset, drive::CONFIG, &mut estimates);
    let head = Head {
        version: RECORDING_VERSION,
        model: MODEL_IMU,
        instance: "car".to_owned(),
        began_unix_s: 0,
        config: drive::CONFIG.to_owned(),
    };
    let mut writer = Writer::create(&folder.file("drive.rec"), &head).unwrap();
    for estimate in &estimates {
        writer.estimate(estimate).unwrap();
    }
    writer.finish().unwrap();
    fs::write(
        folder.file("estimate.csv"),
        in_process::csv_of(&estimates, true),
    )
    .unwrap();
    (folder, estimates)
}

#[test]
fn a_recording_is_exported_as_its_estimate_csv_is() {
    let (folder, _) = recorded();
    for format in ["tum", "csv", "mcap"] {
        let [of_csv, of_recording] =
            [("estimate.csv", "a"), ("drive.rec", "b")].map(|(input, out)| {
                let out = format!("{out}.{format}");
                export(&folder, input, format, &out);
                fs::read(folder.file(&out)).unwrap()
            });
        assert!(of_csv.len() > 1000 && of_csv == of_recording, "{format}");
    }
    // Without its last bytes it is exported as far as it goes.
    let bytes = fs::read(folder.file("drive.rec")).unwrap();
    fs::write(folder.file("torn.rec"), &bytes[..bytes.len() - 7]).unwrap();
    export(&folder, "torn.rec", "tum", "torn.tum");
    let lines = |name: &str| {
        fs::read_to_string(folder.file(name))
            .unwrap()
            .lines()
            .count()
    };
    assert!(lines("torn.tum") >= lines("a.tum") - 1);
}

#[test]
fn a_report_on_a_recording_has_the_nis_of_its_fixes_and_one_on_a_csv_has_none() {
    let (folder, estimates) = recorded();
    let report = |input: &str, out: &str| {
        let arguments = ["report", input, "--truth", "truth.csv", "--out", out];
        let ended = run_in(folder.path(), &arguments).succeeded();
        let page = fs::read_to_string(folder.file(out)).unwrap();
        (ended.stdout.lines().next().unwrap().to_owned(), page)
    };
    let (of_recording, with) = report("drive.rec", "recording.html");
    let (of_csv, without) = report("estimate.csv", "csv.html");
    assert_eq!(of_recording, of_csv);
    assert!(with.contains(">NIS<") && !without.contains(">NIS<"));
    // One for each position fix that was judged: as many as the filter counted, with velocities and headings beside.
    let nis = read_estimates(&folder.file("drive.rec")).unwrap().nis;
    let updated = |estimate: &&EstimateSe23| estimate.head.flags & ESTIMATE_UPDATED != 0;
    let updates = estimates.iter().filter(updated).count();
    assert!(
        !nis.is_empty() && nis.len() < updates,
        "{} of {updates}",
        nis.len()
    );
    let mean = nis.iter().map(|sample| sample.nis).sum::<f64>() / nis.len() as f64;
    assert!(
        nis.iter().all(|sample| sample.degrees == 3) && (1.0..6.0).contains(&mean),
        "{mean}"
    );
}

#[test]
fn what_cannot_be_exported_is_refused_in_one_line() {
    let folder = estimated();
    let over = [
        "export",
        "estimate.csv",
        "--format",
        "csv",
        "--out",
        "estimate.csv",
    ];
    let ended = run_in(folder.path(), &over);
    assert!(
        ended
            .failed_with_one_line(1)
            .contains("would be overwritten")
    );

    let text = fs::read_to_string(folder.path().join("estimate.csv")).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines.swap(2, 3);
    fs::write(folder.path().join("unsorted.csv"), lines.join("\n")).unwrap();
    let unsorted = [
        "export",
        "unsorted.csv",
        "--format",
        "tum",
        "--out",
        "unsorted.tum",
    ];
    let ended = run_in(folder.path(), &unsorted);
    assert!(ended.failed_with_one_line(1).contains("is not after"));
    assert!(!folder.path().join("unsorted.tum").exists());
}
