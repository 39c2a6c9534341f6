//! `inekf-bench latency` as a user runs it, with the real daemon: every row is there, and its
//! figures agree with each other. No time is asserted.

use std::fs;
use std::path::Path;

use inekf_tests::memory::Memory;
use inekf_tests::process::{Ended, Running};
use inekf_tests::programs::programs;
use serde_json::Value;

const ROUNDS: u64 = 400;
const SECONDS: f64 = 0.05;
const SPIN: [&str; 12] = [
    "raw cache line",
    "iceoryx2 blackboard",
    "pre-loaned iceoryx2 echo",
    "plain iceoryx2 echo",
    "estimate, 15 states",
    "estimate, 9 states",
    "estimate, 15 states, fixes",
    "smoother, 15 states, fixes",
    "LC-InEKF, odometry2d",
    "LC-InEKF, odometry2d + fix",
    "Unix-domain socket",
    "UDP socket",
];
const EVENT: [&str; 7] = [
    "raw futex wake-up",
    "plain iceoryx2 echo",
    "estimate, 15 states",
    "estimate, 9 states",
    "LC-InEKF, odometry2d",
    "Unix-domain socket",
    "UDP socket",
];
const RATES_HZ: [u64; 3] = [200, 1000, 8000];

fn bench(memory: &Memory, arguments: &[&str]) -> Ended {
    let mut command = memory.command(Path::new(env!("CARGO_BIN_EXE_inekf-bench")));
    command
        .env("INEKF_SERVICE", &programs().service)
        .args(arguments);
    Running::start(command).wait()
}

/// The rows of a mechanism; several if the processors were moved between chunks.
fn find<'a>(report: &'a Value, name: &str, wait: &str, rate: Option<u64>) -> Vec<&'a Value> {
    let rows = report["rows"].as_array().expect("rows");
    let is_it = |row: &&Value| {
        row["name"] == name && row["wait"] == wait && row["rate_hz"] == Value::from(rate)
    };
    rows.iter().filter(is_it).collect()
}

fn whole(row: &Value, key: &str) -> u64 {
    row[key]
        .as_u64()
        .unwrap_or_else(|| panic!("{key} of {row}"))
}

/// Checks a row whose rounds should be `planned`, unless its one chunk was left out.
fn check(rows: &[&Value], planned: u64) {
    assert_eq!(rows.len(), 1, "one chunk has one placement");
    let row = rows[0];
    if row["placement"].is_null() {
        assert_eq!((whole(row, "count"), whole(row, "chunks_left_out")), (0, 1));
        return;
    }
    assert_eq!(
        (whole(row, "chunks"), whole(row, "chunks_left_out")),
        (1, 0)
    );
    assert_eq!(whole(row, "count") + whole(row, "missed"), planned, "{row}");
    let keys = ["p50_ns", "p99_ns", "p999_ns", "p9999_ns", "max_ns"];
    let figures = keys.map(|key| whole(row, key));
    assert!(figures[0] > 0 && figures.is_sorted(), "{row}");
    // One chunk: its ratio is that of the two medians beside it.
    let expected = figures[0] as f64 / whole(row, "cache_line_p50_ns") as f64;
    let ratio = row["ratio_p50_cache_line"].as_f64().expect("a ratio");
    assert!((ratio / expected - 1.0).abs() < 1e-12, "{row}");
    // Too few rounds for one in ten thousand, whatever the machine does.
    assert_eq!(row["noise"]["p9999"], "few rounds beyond it");
    if row["name"] == "plain iceoryx2 echo" {
        assert_eq!(row["ratio_p50"], 1.0);
    }
}

#[test]
fn every_row_is_measured_and_nothing_is_left() {
    if std::thread::available_parallelism().is_ok_and(|processors| processors.get() < 2) {
        println!("skipped: it takes two processors");
        return;
    }
    let memory = Memory::new();
    let out = tempfile::tempdir().expect("a folder");
    let [json, svg] = ["latency.json", "latency.svg"].map(|name| out.path().join(name));
    let [json_name, svg_name] = [&json, &svg].map(|file| file.to_str().expect("UTF-8"));
    let (rounds, seconds) = (ROUNDS.to_string(), SECONDS.to_string());
    let ended = bench(
        &memory,
        &[
            "latency",
            "--turns",
            "1",
            "--rounds",
            &rounds,
            "--seconds",
            &seconds,
            "--json",
            json_name,
            "--svg",
            svg_name,
        ],
    )
    .succeeded();
    memory.assert_nothing_left();

    let text = fs::read_to_string(json).expect("the JSON");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    for (names, wait, rounds) in [
        (&SPIN[..], "spin", ROUNDS),
        (&EVENT[..], "event", ROUNDS / 20),
    ] {
        for name in names {
            check(&find(&report, name, wait, None), rounds);
            for rate_hz in RATES_HZ {
                let planned = (SECONDS * rate_hz as f64) as u64;
                check(&find(&report, name, wait, Some(rate_hz)), planned);
            }
        }
    }
    assert_eq!(report["rows"].as_array().map(Vec::len), Some(19 * 4));
    assert_eq!(report["chunks"], 19 * 4);

    // The ratios on top are those of two rows, if both are of one placement.
    let p50 = |name| find(&report, name, "spin", None)[0]["p50_ns"].as_f64();
    match report["ratio_p50"].as_f64() {
        Some(ratio) => {
            let ours = p50("estimate, 15 states").expect("a median");
            let echo = p50("plain iceoryx2 echo").expect("a median");
            assert!((ratio / (ours / echo) - 1.0).abs() < 1e-12);
            assert!(report["ratio_p999"].is_f64());
        }
        None => assert!(report["ratio_placement"].is_null()),
    }
    let machine = &report["machine"];
    assert!(machine["cpu_model"].is_string() && machine["hypervisor"].is_boolean());
    assert!(whole(machine, "processors") >= 2);
    assert!(
        machine["kernel"]
            .as_str()
            .is_some_and(|kernel| !kernel.is_empty())
    );
    assert!(machine["load_average_end"].is_f64());

    assert!(ended.stdout.contains("chunks left out"), "{}", ended.stdout);
    let svg = fs::read_to_string(svg).expect("the SVG");
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
    assert_eq!(svg.matches("<svg ").count(), svg.matches("</svg>").count());
}

#[test]
fn options_out_of_range_are_refused_in_one_line() {
    let memory = Memory::new();
    for (option, value) in [("--turns", "0"), ("--rounds", "1"), ("--seconds", "0")] {
        let ended = bench(&memory, &["latency", option, value]);
        let line = ended.failed_with_one_line(1);
        assert!(line.contains(option), "{line}");
    }
}
