//! Every command that the documentation prints is run.
//!
//! The blocks of one page that begin with `sh` or `console` are run by bash, one after the other, as they are printed: in
//! a folder of its own that looks like the project after `cargo build --release` (the programs of this test stand for
//! those in `target/release`), with shared memory of its own. What a page takes for granted (a daemon that runs, a
//! recording) is made before, see [`SETTINGS`]. A block that is not run is named in [`NOT_RUN`], with the reason.
//!
//! Of what cargo is asked for anywhere in the text, packages, tests and examples have to be there.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::thread;

use inekf_service::config::Config;
use inekf_tests::folder::Folder;
use inekf_tests::memory::Memory;
use inekf_tests::process::{Ended, Running};
use inekf_tests::programs::{bench, c_library, example, programs};
use inekf_tests::tools;

/// A block of commands that is not run: its page, how its first line begins, and why not.
const NOT_RUN: [(&str, &str, &str); 9] = [
    (
        "README.md",
        "cargo test --workspace",
        "this test is one of them",
    ),
    (
        "docs/guides/run-it-for-real.md",
        "sudo install",
        "wants root and systemd; supervisor.rs plays systemd's part",
    ),
    (
        "docs/guides/write-a-feeder.md",
        "cmake -S client/examples/cpp",
        "wants iceoryx2's C++ bindings; languages.rs runs it where they are",
    ),
    (
        "docs/faults.md",
        "cargo run --release -p inekf-tests -- faults",
        "takes an hour; tests/faults runs each row in its short form",
    ),
    (
        "docs/adaptive-mismatch.md",
        "cargo test -p inekf --test adaptive_section7",
        "tests of their own",
    ),
    (
        "docs/adaptive-mismatch.md",
        "INEKF_DATASETS=... cargo test",
        "a test of its own, on recordings that are not part of the project",
    ),
    (
        "docs/guides/several-machines.md",
        "cargo install iceoryx2-integrations",
        "builds zenoh, which takes half an hour; two_hosts.rs runs the tunnel where it is there",
    ),
    (
        "docs/guides/several-machines.md",
        "iox2-link-tunnel-zenoh",
        "two_hosts.rs runs it, between two hosts",
    ),
    (
        "docs/smoothing.md",
        "cargo build --release -p inekf-bench",
        "builds, and does nothing else",
    ),
];

/// What a block takes for granted.
struct Setting {
    page: &'static str,
    /// How its first line begins.
    first: &'static str,
    /// Commands before it.
    before: &'static str,
    /// What is not done as printed, and what in its place: shorter, or smaller.
    instead: &'static [(&'static str, &'static str)],
}

const SETTINGS: [Setting; 5] = [
    Setting {
        page: "README.md",
        first: "inekf-service --config my.toml --instance car",
        // The README's own least configuration, as it lies in the folder; to be recorded a daemon has to keep a journal.
        before: "cp README.1.toml my.toml; printf '[journal]\\npublish = true\\n' >> my.toml\n",
        instead: &[("car-{0..99}", "car-{0..3}")],
    },
    Setting {
        page: "docs/recording.md",
        first: "inekf-client record",
        before: "cp $CONFIG/drone.toml my.toml; printf '[journal]\\npublish = true\\n' >> my.toml
(sleep 1; timeout 5 inekf-service --config my.toml --instance drone-7 || true) > daemon.log &
(until grep -q ready daemon.log; do sleep 0.1; done
 inekf-client simulate drone-loops --duration 2 --instance drone-7) > simulate.log &\n",
        instead: &[("--out flight.rec", "--out flight.rec --duration 5")],
    },
    Setting {
        page: "docs/recording.md",
        first: "inekf-client control pause",
        before: "kill $(jobs -p) 2> /dev/null || true; wait
inekf-service --config my.toml --instance drone-7 > daemon.log &
until grep -q ready daemon.log; do sleep 0.1; done
inekf-client simulate drone-loops --duration 60 --instance drone-7 > simulate.log &
sleep 2\n",
        instead: &[],
    },
    Setting {
        page: "docs/guides/look-and-exchange.md",
        first: "inekf-client import MH_01_easy",
        before: "mkdir -p MH_01_easy/mav0/imu0
echo '#timestamp [ns],w_x,w_y,w_z [rad s^-1],a_x,a_y,a_z [m s^-2]' > MH_01_easy/mav0/imu0/data.csv
for i in 1 2 3; do echo ${i}000000,0,0,0,9.81,0,0 >> MH_01_easy/mav0/imu0/data.csv; done
for i in 1 2 3; do echo $i.5 0 0 $i 0 0 0 1 >> groundtruth.txt; done\n",
        instead: &[],
    },
    Setting {
        page: "docs/guides/write-a-feeder.md",
        first: "cargo build --release -p inekf-c",
        before: "inekf-service --config imu.toml --instance car > car.log &
until grep -q ready car.log; do sleep 0.1; done\n",
        instead: &[],
    },
];

/// Commands that run until somebody stops them.
const UNTIL_STOPPED: [&str; 4] = [
    "inekf-service --config",
    "inekf-client simulate road-circuit --instance",
    "inekf-client monitor",
    "inekf-client record",
];

/// Before the blocks of a page. What cargo builds has been built; what is left running is stopped, and has to have been
/// running, or to have ended well.
const PRELUDE: &str = r#"
trap 'kill $(jobs -p) 2> /dev/null || true' EXIT
cargo() { test "$1" = build; }
stop_all() {
    sleep 1
    for job in $(jobs -p); do
        kill -TERM $job 2> /dev/null || true
        wait $job && ended=0 || ended=$?
        test $ended = 0 -o $ended = 143
    done
}
"#;

/// What takes minutes is asked how it is used, with all its arguments: those that it does not know are refused.
const TAKES_MINUTES: &str = "target/release/inekf-bench";

fn project() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    folder.canonicalize().expect("the project's folder")
}

/// A block of a page: what follows the three ticks, and the text.
struct Block {
    kind: String,
    text: String,
}

impl Block {
    /// Its commands, if it is made of them: of `console` the lines that a person types.
    fn commands(&self) -> Option<String> {
        match self.kind.split_whitespace().next() {
            Some("sh" | "bash" | "shell") => Some(self.text.clone()),
            Some("console") => Some(
                self.text
                    .lines()
                    .filter_map(|line| line.strip_prefix("$ "))
                    .fold(String::new(), |text, line| text + line + "\n"),
            ),
            None if self.text.starts_with("cargo ") => Some(self.text.clone()),
            _ => None,
        }
    }
}

/// A page of the documentation.
struct Page {
    /// Its path in the project.
    name: String,
    text: String,
}

impl Page {
    fn blocks(&self) -> Vec<Block> {
        let mut blocks = Vec::new();
        let mut open: Option<Block> = None;
        for line in self.text.lines() {
            match (line.strip_prefix("```"), open.take()) {
                (Some(kind), None) => {
                    open = Some(Block {
                        kind: kind.trim().to_owned(),
                        text: String::new(),
                    });
                }
                (Some(_), Some(block)) => blocks.push(block),
                (None, Some(block)) => {
                    open = Some(Block {
                        text: block.text + line + "\n",
                        ..block
                    });
                }
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{}: a block is not closed", self.name);
        blocks
    }

    /// The bash script of its blocks, and how many they are.
    fn script(&self) -> (String, usize) {
        let mut script = PRELUDE.to_owned();
        let mut count = 0;
        for commands in self.blocks().iter().filter_map(Block::commands) {
            let is_at = |page: &str, first: &str| page == self.name && commands.starts_with(first);
            if NOT_RUN.iter().any(|(page, first, _)| is_at(page, first)) {
                continue;
            }
            count += 1;
            let setting = SETTINGS
                .iter()
                .find(|setting| is_at(setting.page, setting.first));
            script += setting.map_or("", |setting| setting.before);
            let instead = setting.map_or(&[][..], |setting| setting.instead);
            let mut waits = false;
            for line in commands.lines() {
                let line = instead.iter().fold(line.to_owned(), |line, (from, to)| {
                    assert!(commands.contains(from), "{}: {from}", self.name);
                    line.replace(from, to)
                });
                let command = line.split("  #").next().unwrap_or_default().trim_end();
                if command.starts_with(TAKES_MINUTES) {
                    writeln!(script, "{command} --help > help.txt").unwrap();
                } else if UNTIL_STOPPED.iter().any(|start| command.starts_with(start))
                    && !command.ends_with('&')
                    && !command.contains("--duration")
                {
                    // A daemon is waited for: what comes next may need it.
                    writeln!(script, "{command} > stopped.log &").unwrap();
                    if command.starts_with("inekf-service") {
                        script += "until grep -q ^ready stopped.log; do sleep 0.1; done\n";
                    }
                    waits = true;
                } else {
                    writeln!(script, "{line}").unwrap();
                }
            }
            script += if waits { "stop_all\n" } else { "" };
        }
        (script, count)
    }

    /// Runs a script of it in a folder that looks like the project after a release build.
    fn run(&self, script: &str) -> (Folder, Ended) {
        let (memory, folder) = (Memory::new(), Folder::new());
        let release = folder.path().join("target/release");
        fs::create_dir_all(&release).unwrap();
        for part in ["client", "service", "docs"] {
            symlink(project().join(part), folder.path().join(part)).unwrap();
        }
        let built = [
            programs().service.clone(),
            programs().client.clone(),
            example("feed_lines"),
            c_library(),
            bench(),
        ];
        for file in built {
            symlink(&file, release.join(file.file_name().unwrap())).unwrap();
        }
        for (index, text) in self.configurations().iter().enumerate() {
            let stem = Path::new(&self.name).file_stem().unwrap().to_string_lossy();
            let file = folder.path().join(format!("{stem}.{}.toml", index + 1));
            fs::write(file, text).unwrap();
        }
        let before = env::var_os("PATH").unwrap_or_default();
        let path = [release].into_iter().chain(env::split_paths(&before));
        let mut command = memory.command(Path::new("bash"));
        command
            .args(["-euo", "pipefail", "-c", script])
            .current_dir(folder.path())
            .env("PATH", env::join_paths(path).unwrap())
            .env("CONFIG", project().join("service/config"));
        let ended = tools::finish(Running::start(command));
        (folder, ended)
    }

    /// Whole configurations that it shows: those that name a model.
    fn configurations(&self) -> Vec<String> {
        self.blocks()
            .into_iter()
            .filter(|block| block.kind == "toml" && block.text.contains("model ="))
            .map(|block| block.text)
            .collect()
    }
}

/// All pages of the project.
fn pages() -> Vec<Page> {
    let mut pages = Vec::new();
    for folder in ["", "docs", "docs/guides", "service"] {
        let entries = fs::read_dir(project().join(folder)).expect("the folder");
        let paths = entries.map(|entry| entry.expect("an entry").path());
        for path in paths.filter(|path| path.extension().is_some_and(|kind| kind == "md")) {
            pages.push(Page {
                name: path.strip_prefix(project()).unwrap().display().to_string(),
                text: read(&path),
            });
        }
    }
    pages.sort_by(|one, other| one.name.cmp(&other.name));
    pages
}

fn page(name: &str) -> Page {
    let mut pages = pages().into_iter();
    pages.find(|page| page.name == name).expect("the page")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn every_command_of_the_documentation_runs() {
    let pages = pages();
    let scripts: Vec<_> = pages.iter().map(|page| (page, page.script())).collect();
    let run: usize = scripts.iter().map(|(_, (_, count))| count).sum();
    let all = pages
        .iter()
        .flat_map(Page::blocks)
        .filter(|block| block.commands().is_some());
    // What is listed is there: a line for a block that has gone, or that begins otherwise now, is found here.
    assert_eq!(run + NOT_RUN.len(), all.count());
    println!("{run} blocks are run, {} are not", NOT_RUN.len());
    // Side by side: they run in real time, and mostly wait.
    thread::scope(|scope| {
        for (page, (script, count)) in &scripts {
            if *count > 0 {
                scope.spawn(move || {
                    let (folder, ended) = page.run(script);
                    assert!(ended.status.success(), "{}: {ended:#?}", page.name);
                    if page.name == "README.md" {
                        assert!(folder.path().join("demo-report/report.html").is_file());
                        assert_demo_prints_what_is_shown(page, &ended);
                    }
                });
            }
        }
    });
}

/// The first words of the lines of the output that the README shows, and of what was printed.
fn assert_demo_prints_what_is_shown(readme: &Page, ended: &Ended) {
    let blocks = readme.blocks();
    let shown = blocks.iter().find(|block| block.kind == "text");
    let labels = |text: &str| -> Vec<String> {
        text.lines()
            .filter_map(|line| Some(line.split_whitespace().next()?.to_owned()))
            .collect()
    };
    let shown = labels(&shown.expect("the demo's output").text);
    let printed = labels(&ended.stdout);
    assert!(printed.starts_with(&shown), "{shown:?}, {printed:?}");
}

#[test]
fn what_the_documentation_assumes_of_a_block_belongs_to_a_block() {
    for Setting {
        page: name, first, ..
    } in &SETTINGS
    {
        let found = page(name)
            .blocks()
            .iter()
            .filter_map(Block::commands)
            .any(|commands| commands.starts_with(first));
        assert!(found, "{name}: no block begins with {first:?}");
    }
}

#[test]
fn a_wrong_command_in_a_page_is_found() {
    for wrong in [
        "```sh\ninekf-client replay --no-such-option\n```\n",
        "```sh\ninekf-service --config no-such.toml\n```\n",
        "```console\n$ inekf-client no-such-command\nsaid\n```\n",
        "```sh\ntarget/release/inekf-bench experiment no-such-experiment --out x\n```\n",
    ] {
        let page = Page {
            name: "wrong.md".to_owned(),
            text: wrong.to_owned(),
        };
        let (script, count) = page.script();
        assert_eq!(count, 1);
        // A daemon that never gets ready is waited for in vain.
        let script = script
            .replace("until grep", "sleep 1; grep")
            .replace("; do sleep 0.1; done", "");
        assert!(!page.run(&script).1.status.success(), "{wrong}");
    }
}

#[test]
fn the_configurations_in_the_documentation_are_accepted() {
    let mut count = 0;
    for page in pages() {
        for text in page.configurations() {
            Config::from_toml_str(&text, &page.name).unwrap_or_else(|faults| panic!("{faults}"));
            count += 1;
        }
    }
    assert!(count >= 2, "{count}");
}

/// What follows `flag` in the words of a command.
fn value<'a>(words: &[&'a str], flag: &str) -> Option<&'a str> {
    let at = words.iter().position(|word| *word == flag)?;
    words.get(at + 1).copied()
}

#[test]
fn what_the_documentation_asks_cargo_for_is_there() {
    let folders = [
        ("inekf", "service/estimator"),
        ("inekf-service", "service"),
        ("inekf-client", "client"),
        ("inekf-c", "client/c"),
        ("inekf-shared", "shared"),
        ("inekf-tests", "tests"),
        ("inekf-bench", "bench"),
    ];
    let mut count = 0;
    for Page { name, text } in pages() {
        for command in text.split("cargo ").skip(1) {
            let command = command
                .split(['`', '\n', '#', ')'])
                .next()
                .unwrap_or_default();
            let words: Vec<&str> = command.split_whitespace().collect();
            let Some(package) = value(&words, "-p") else {
                continue;
            };
            let folder = folders.iter().find(|(known, _)| *known == package);
            let (_, folder) = folder.unwrap_or_else(|| panic!("{name}: no package {package}"));
            for (flag, kind) in [
                ("--test", "tests"),
                ("--bench", "benches"),
                ("--example", "examples"),
            ] {
                let Some(target) = value(&words, flag) else {
                    continue;
                };
                let place = project().join(folder).join(kind);
                let files = [
                    place.join(target).join("main.rs"),
                    place.join(format!("{target}.rs")),
                ];
                let found = files.iter().any(|file| file.is_file());
                assert!(found, "{name}: {package} has no {kind}/{target}");
                count += 1;
            }
        }
    }
    assert!(count >= 6, "{count}");
}

#[test]
fn the_commands_for_contributors_are_those_of_ci_or_are_listed() {
    // What CI does not do, with the reason.
    let others = [
        ("cargo build --release", "CI tests a debug build"),
        ("bash .ci/run", "CI itself"),
        ("cargo fmt --all", "changes files; CI checks"),
        ("cargo bench", "measures"),
        ("cargo test --release", "measures"),
        ("cargo test -p", "part of the whole"),
    ];
    let ci = read(&project().join(".ci/run"));
    let text = page("CONTRIBUTING.md").text;
    let rows = text
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains('`'));
    let mut count = 0;
    for row in rows {
        let command = row.split('`').nth(1).unwrap_or_default();
        let script = command
            .split("bash ")
            .nth(1)
            .and_then(|rest| rest.split(')').next());
        let is_listed = others.iter().any(|(start, _)| command.starts_with(start));
        // CI adds `--quiet`.
        let is_of_ci = ci.replace(" --quiet", "").contains(command)
            || script.is_some_and(|script| ci.contains(script) && project().join(script).is_file());
        assert!(is_listed || is_of_ci, "{command}");
        count += 1;
    }
    assert!(count >= 10, "{count}");
}

#[test]
fn the_feeder_in_the_guide_is_the_example() {
    let code = read(&project().join("client/examples/feed_lines.rs"));
    let shown = page("docs/guides/write-a-feeder.md")
        .blocks()
        .into_iter()
        .find(|block| block.kind == "rust");
    assert_eq!(
        shown.map(|block| block.text).as_deref(),
        Some(code.as_str())
    );
    assert!(code.lines().count() < 40);
}

#[test]
fn links_lead_to_files() {
    for Page { name, text } in pages() {
        let file = project().join(&name);
        for link in text.split("](").skip(1) {
            let target = link.split([')', '#']).next().unwrap_or_default();
            if target.is_empty() || target.starts_with("http") {
                continue;
            }
            let target = file.parent().unwrap().join(target);
            assert!(target.exists(), "{name}: {}", target.display());
        }
    }
}
