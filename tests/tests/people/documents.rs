//! Every command that the documentation prints is run.
//!
//! A block that begins with `sh runnable` is run by bash, all blocks of one page one after the other, in an empty folder
//! of its own, with the programs and the examples on the path, `CONFIG` naming the folder of configurations, and shared
//! memory of its own. A block in the guides that cannot be run here (it wants systemd, or somebody's recording) begins
//! with `sh elsewhere`; there is no other kind.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use inekf_tests::folder::Folder;
use inekf_tests::memory::Memory;
use inekf_tests::process::Running;
use inekf_tests::programs::{example, programs};
use inekf_tests::tools;

/// Whatever a page has left running ends with it, should one of its commands fail.
const STOP_ALL: &str = "trap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n";

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The blocks of a page: what follows the three ticks, and the text.
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut blocks = Vec::new();
    let mut open: Option<(String, String)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), open.take()) {
            (Some(kind), None) => open = Some((kind.trim().to_owned(), String::new())),
            (Some(_), Some(block)) => blocks.push(block),
            (None, Some((kind, text))) => open = Some((kind, text + line + "\n")),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is not closed");
    blocks
}

fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the folder of the documentation");
    let mut pages: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    pages.sort();
    pages
}

fn read(page: &Path) -> String {
    fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

#[test]
fn every_command_of_the_documentation_runs() {
    let examples = example("feed_lines");
    let folders = [&programs().client, &examples].map(|file| file.parent().unwrap().to_owned());
    let before = env::var_os("PATH").unwrap_or_default();
    let path = env::join_paths(folders.into_iter().chain(env::split_paths(&before))).unwrap();
    let config = project().join("service/config").canonicalize().unwrap();
    let mut all = pages(&project().join("docs"));
    all.extend(pages(&project().join("docs/guides")));
    all.extend(pages(&project()));
    let scripts: Vec<(PathBuf, String)> = all
        .into_iter()
        .map(|page| {
            let commands = blocks(&read(&page))
                .into_iter()
                .filter(|(kind, _)| kind == "sh runnable")
                .map(|(_, text)| text);
            (page, commands.collect::<String>())
        })
        .filter(|(_, script)| !script.is_empty())
        .collect();
    assert!(scripts.len() >= 7, "{} pages with commands", scripts.len());
    // Side by side: they run in real time, and mostly wait.
    thread::scope(|scope| {
        for (page, script) in &scripts {
            let (path, config) = (&path, &config);
            scope.spawn(move || {
                let memory = Memory::new();
                let folder = Folder::new();
                let mut command = memory.command(Path::new("bash"));
                command
                    .args(["-euo", "pipefail", "-c", &format!("{STOP_ALL}{script}")])
                    .current_dir(folder.path())
                    .env("PATH", path)
                    .env("CONFIG", config);
                let ended = tools::finish(Running::start(command));
                assert!(ended.status.success(), "{}: {ended:#?}", page.display());
            });
        }
    });
}

#[test]
fn the_guides_say_of_every_command_whether_it_can_be_run() {
    for page in pages(&project().join("docs/guides")) {
        for (kind, text) in blocks(&read(&page)) {
            let shell = kind
                .split_whitespace()
                .next()
                .is_some_and(|word| word == "sh");
            let marked = kind == "sh runnable" || kind == "sh elsewhere";
            assert!(!shell || marked, "{}: {text}", page.display());
        }
    }
}

#[test]
fn the_feeder_in_the_guide_is_the_example() {
    let page = read(&project().join("docs/guides/write-a-feeder.md"));
    let code = read(&project().join("client/examples/feed_lines.rs"));
    let shown = blocks(&page)
        .into_iter()
        .find(|(kind, _)| kind == "rust")
        .map(|(_, text)| text);
    assert_eq!(shown.as_deref(), Some(code.as_str()));
    assert!(code.lines().count() < 40);
}

#[test]
fn links_in_the_guides_lead_to_files() {
    for page in pages(&project().join("docs/guides")) {
        let text = read(&page);
        for link in text.split("](").skip(1) {
            let target = link.split([')', '#']).next().unwrap_or_default();
            if target.is_empty() || target.starts_with("http") {
                continue;
            }
            let file = page.parent().unwrap().join(target);
            assert!(file.exists(), "{}: {target}", page.display());
        }
    }
}
