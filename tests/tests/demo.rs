//! The README's first command.

use std::fs;

use inekf_tests::folder::Folder;
use inekf_tests::memory::Memory;
use inekf_tests::process::client;

#[test]
fn the_demo_shows_error_and_latency_writes_its_report_and_leaves_nothing() {
    let memory = Memory::new();
    let folder = Folder::new();
    let out = folder.file("report");
    let arguments = ["demo", "--duration", "15", "--out", out.to_str().unwrap()];
    let ended = client(&memory, arguments).succeeded();
    let lines: Vec<&str> = ended.stdout.lines().collect();
    let starts_with = |start: &str| {
        let found = lines.iter().find(|line| line.starts_with(start));
        *found.unwrap_or_else(|| panic!("no line starts with {start:?}: {ended:#?}"))
    };
    let error = starts_with("error");
    for word in ["east", "north", "up", "heading"] {
        assert!(error.contains(word), "{error}");
    }
    let latency = starts_with("latency");
    for word in ["p50", "p99", "p99.9", "max"] {
        assert!(latency.contains(word), "{latency}");
    }
    assert!(starts_with("report").contains("report.html"));

    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.starts_with("<!DOCTYPE html>") && report.contains("</html>"));
    let mut drawings = 0;
    for entry in fs::read_dir(&out).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if name.ends_with(".svg") {
            let drawing = fs::read_to_string(entry.path()).unwrap();
            assert!(
                drawing.contains("<svg") && drawing.trim_end().ends_with("</svg>"),
                "{name}"
            );
            drawings += 1;
        }
    }
    assert!(drawings >= 3, "{drawings} drawings");
    memory.assert_nothing_left();
}

#[test]
fn a_demo_too_short_to_converge_says_so_and_leaves_nothing() {
    let memory = Memory::new();
    let folder = Folder::new();
    let out = folder.file("report");
    let arguments = ["demo", "--duration", "1", "--out", out.to_str().unwrap()];
    let ended = client(&memory, arguments);
    assert_eq!(ended.status.code(), Some(1), "{ended:#?}");
    assert!(
        ended
            .stderr
            .lines()
            .last()
            .is_some_and(|line| line.contains("too short"))
    );
    memory.assert_nothing_left();
}
