//! The examples in Rust, Python and C++, and the layouts that they are given.
//!
//! ctypes and the C compilers lay structs out by rules of their own: that what they make of the generated files has the
//! daemon's sizes and offsets is checked by the files themselves, and here that they do check it.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use inekf_client::dataset::ImuRow;
use inekf_client::feed::Feeder;
use inekf_client::layout;
use inekf_tests::folder::Folder;
use inekf_tests::link::{Link, instance};
use inekf_tests::memory::Memory;
use inekf_tests::process::{Daemon, Ended, Running, client, eventually};
use inekf_tests::programs::{c_library, example};
use inekf_tests::tools;

const CONFIG: &str = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";

/// A position to start from: no fix is needed.
const PLACED: &str = "\
model = 'imu'
[noise]
gyro_density = 3e-4
accel_density = 2e-2
[initial]
position_m = [0.0, 0.0, 0.0]
";

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/examples")
}

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

fn run(memory: &Memory, program: &OsString, arguments: &[&str], folder: &Path) -> Running {
    let mut command = memory.command(Path::new(program));
    command.args(arguments).current_dir(folder);
    Running::start(command)
}

#[test]
fn the_files_in_the_examples_are_what_the_program_writes() {
    let memory = Memory::new();
    for (flag, file) in [
        ("--python", "python/inekf_messages.py"),
        ("--c", "../c/include/inekf_messages.h"),
    ] {
        let written = client(&memory, ["layout", flag]).succeeded().stdout;
        let kept = read(&examples().join(file));
        assert!(
            written == kept,
            "{file} is old: write it anew with `inekf-client layout {flag}`"
        );
    }
    let json = client(&memory, ["layout", "--json"]).succeeded().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let messages = json["messages"].as_array().unwrap();
    assert_eq!(messages.len(), layout::LAYOUTS.len());
    let estimate = messages
        .iter()
        .find(|message| message["name"] == "EstimateSe23")
        .unwrap();
    // The contract, by hand.
    assert_eq!(estimate["size"], 1288);
    assert_eq!(estimate["fields"][6]["offset"], 328);
    assert_eq!(estimate["fields"][6]["counts"][0], 120);
}

#[test]
fn python_lays_the_messages_out_as_the_daemon_does_and_notices_if_not() {
    let Some(python) = tools::python_with(&["ctypes"]) else {
        return;
    };
    let folder = Folder::new();
    let memory = Memory::new();
    let imports = |text: &str| {
        fs::write(folder.path().join("inekf_messages.py"), text).unwrap();
        let arguments = ["-B", "-c", "import inekf_messages"];
        run(&memory, &python, &arguments, folder.path()).wait()
    };
    imports(&layout::python()).succeeded();
    // A field that is moved, or a size that is another one.
    for (right, wrong) in [
        ("(\"covariance\", 328)", "(\"covariance\", 336)"),
        ("SIZE, ALIGN = 1288, 8", "SIZE, ALIGN = 1296, 8"),
        ("(\"seq\", ctypes.c_uint64)", "(\"seq\", ctypes.c_uint32)"),
    ] {
        let text = layout::python().replacen(right, wrong, 1);
        assert_ne!(text, layout::python(), "{right}");
        let ended = imports(&text);
        assert!(ended.stderr.contains("AssertionError"), "{ended:#?}");
    }
}

#[test]
fn c_and_cpp_lay_the_messages_out_as_the_daemon_does_and_notice_if_not() {
    let folder = Folder::new();
    let header = folder.path().join("inekf_messages.h");
    let source = folder.path().join("use.c");
    fs::write(&source, "#include \"inekf_messages.h\"\n").unwrap();
    for (compiler, arguments) in [
        ("gcc", ["-std=c11", "-xc"]),
        ("g++", ["-std=c++17", "-xc++"]),
    ] {
        let Some(compiler) = tools::program(compiler) else {
            continue;
        };
        let compiles = |text: &str| {
            fs::write(&header, text).unwrap();
            let mut command = Command::new(compiler);
            command
                .args(arguments)
                .args(["-Wall", "-Wextra", "-Werror", "-fsyntax-only"])
                .arg(&source);
            Running::start(command).wait()
        };
        compiles(&layout::c()).succeeded();
        let text = layout::c().replacen("covariance[120]", "covariance[121]", 1);
        let ended = compiles(&text);
        assert!(ended.stderr.contains("the layout is not the daemon's"));
    }
}

/// Feeds a daemon with an IMU at rest until a program has ended, however long that takes to start.
fn feed_until_ended(memory: &Memory, mut running: Running) -> Ended {
    let mut feeder = Feeder::open_on(memory.node(), &instance("car")).expect("a feeder");
    let mut stamp_ns = 0;
    eventually("the end of the example", || {
        stamp_ns += 10_000_000;
        let row = ImuRow {
            stamp_ns,
            gyro_rps: [0.0; 3],
            accel_mps2: [0.0, 0.0, 9.80665],
        };
        feeder.imu(&row).expect("it can be sent");
        (!running.is_running()).then_some(())
    });
    running.wait().succeeded()
}

/// Whether it is five lines with a stamp and a position.
fn assert_reads(ended: &Ended) {
    let lines: Vec<&str> = ended.stdout.lines().collect();
    assert_eq!(lines.len(), 5, "{ended:#?}");
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        assert!(words[0].parse::<u64>().is_ok(), "{line}");
        assert!(words[2].parse::<f64>().is_ok(), "{line}");
    }
}

#[test]
fn the_rust_example_feeds_and_reads() {
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let program = example("in_process").into_os_string();
    let ended = run(&memory, &program, &["car"], &examples())
        .wait()
        .succeeded();
    assert!(ended.stdout.starts_with("400 samples heard"), "{ended:#?}");
    assert!(
        ended.stdout.contains("now at 1.00 2.00 3.00 m"),
        "{ended:#?}"
    );
    daemon.stop();
}

#[test]
fn the_python_reader_reads_a_running_daemon() {
    let text = read(&examples().join("python/reader.py"));
    assert!(text.lines().count() < 40);
    let Some(python) = tools::python_with(&["iceoryx2"]) else {
        return;
    };
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", PLACED);
    let arguments = ["-B", "reader.py", "car", "5"];
    let reader = run(&memory, &python, &arguments, &examples().join("python"));
    assert_reads(&feed_until_ended(&memory, reader));
    daemon.stop();
}

#[test]
fn the_python_feeder_is_heard_and_loses_nothing() {
    let Some(python) = tools::python_with(&["iceoryx2"]) else {
        return;
    };
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let mut link = Link::open(&memory, "car");
    let arguments = ["-B", "feeder.py", "car", "1"];
    let feeder = run(&memory, &python, &arguments, &examples().join("python"));
    let ended = feeder.wait().succeeded();
    assert_eq!(
        ended.stdout.trim(),
        "sent 200 samples, 200 of them heard by a daemon"
    );
    let mut estimates = Vec::new();
    let answer = link.settle(&mut estimates);
    // A fix every fifth of a second: the first gives the position, the others are fused.
    assert_eq!((answer.counters.lost, answer.counters.rejected), (0, 0));
    assert!(answer.counters.accepted >= 3, "{answer:?}");
    let last = estimates.last().expect("estimates came");
    assert!(last.p_w_m.iter().all(|p| p.abs() < 0.1), "{last:?}");
    daemon.stop();
}

#[test]
fn the_c_interface_feeds_and_reads_from_c_and_from_cpp() {
    let memory = Memory::new();
    let interface = examples().join("../c");
    let library = c_library();
    let folder = Folder::new();
    let program = folder.path().join("rest");
    for (compiler, language) in [("gcc", "-xc"), ("g++", "-xc++")] {
        let Some(compiler) = tools::program(compiler) else {
            continue;
        };
        let mut command = Command::new(compiler);
        command
            .args(["-Wall", "-Wextra", "-Werror", language])
            .arg(interface.join("example/rest.c"))
            .arg("-I")
            .arg(interface.join("include"))
            .args(["-xnone"])
            .arg(&library)
            .arg("-o")
            .arg(&program);
        tools::finish(Running::start(command)).succeeded();
        let start = |instance: &str| {
            let mut command = memory.command(&program);
            let beside = library.parent().expect("the library's folder");
            command.arg(instance).env("LD_LIBRARY_PATH", beside);
            Running::start(command).wait()
        };
        let refused = start("no/name");
        let line = refused.failed_with_one_line(1);
        assert!(
            line.contains("instance name \"no/name\" contains '/'"),
            "{line}"
        );
        let daemon = Daemon::start(&memory, "car", CONFIG);
        assert_eq!(
            start("car").succeeded().stdout.trim(),
            "200 samples heard, estimates came; now at 1.00 2.00 3.00 m"
        );
        daemon.stop();
    }
}

#[test]
fn the_cpp_reader_reads_a_running_daemon() {
    let (Some(bindings), Some(cmake)) = (tools::cxx_bindings(), tools::program("cmake")) else {
        return;
    };
    let folder = Folder::new();
    let build = folder.path().join("build");
    let mut configure = Command::new(cmake);
    configure
        .arg("-S")
        .arg(examples().join("cpp"))
        .arg("-B")
        .arg(&build)
        .arg(format!("-DCMAKE_PREFIX_PATH={}", bindings.display()));
    tools::finish(Running::start(configure)).succeeded();
    let mut compile = Command::new(cmake);
    compile.arg("--build").arg(&build);
    tools::finish(Running::start(compile)).succeeded();

    let memory = Memory::new();
    let program = build.join("reader").into_os_string();
    let nobody = run(&memory, &program, &["nobody", "1"], &build).wait();
    let line = nobody.failed_with_one_line(1);
    assert!(line.contains("no daemon of instance nobody runs"), "{line}");
    let daemon = Daemon::start(&memory, "car", PLACED);
    let reader = run(&memory, &program, &["car", "5"], &build);
    assert_reads(&feed_until_ended(&memory, reader));
    daemon.stop();
}
