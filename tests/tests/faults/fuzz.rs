//! Every target of the folder `fuzz`, on some thousand inputs from a seed:
//! `cargo run --release -p inekf-tests -- fuzz --inputs 1000000` is the long form.

use inekf_tests::fuzz::{seeded, target};

fn holds(name: &str, inputs: u64) {
    let target = target(name).unwrap_or_else(|| panic!("there is no target {name}"));
    seeded(target, 6, inputs);
}

#[test]
fn messages_of_any_bytes_do_no_harm() {
    holds("messages", 3000);
}

#[test]
fn requests_of_any_bytes_are_granted_or_refused_with_a_reason() {
    holds("control", 3000);
}

#[test]
fn configurations_of_any_text_are_read_or_refused() {
    holds("config", 2000);
}

#[test]
fn dataset_files_of_any_text_are_read_or_refused() {
    holds("dataset", 1000);
}

#[test]
fn frames_of_any_bytes_are_decoded_or_refused() {
    holds("frames", 20_000);
}
