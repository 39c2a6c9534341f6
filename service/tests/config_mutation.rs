//! Whatever the text, the reader answers: a configuration or its faults, never a panic.

use inekf_service::config::{Config, MAX_FILE_BYTES};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const EXAMPLES: [&str; 2] = [
    include_str!("../config/example.toml"),
    include_str!("../config/example_odometry.toml"),
];

/// Pieces that mean something to TOML or to the schema.
const PIECES: [&str; 50] = [
    "\n",
    "=",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "\"",
    "'",
    "\"\"\"",
    "'''",
    "#",
    ",",
    ".",
    "_",
    "-",
    "+",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "0x7f",
    "9999999999999999999999999999999999999999999",
    "1979-05-27T07:32:00Z",
    "true",
    "false",
    "\\u0000",
    "\\",
    "\u{0}",
    "\u{feff}",
    "µ",
    "🚗",
    "[initial]",
    "[[position_source]]",
    "id = 0",
    "model",
    "position_source = [1, {}]",
    "[[mismatched]]",
    "mismatched = []",
    "what = 'measurement_rotation'",
    "estimator = 'lc-inekf'",
    "invariance = 'right'",
    "model = 'odometry3d'",
    "[stacking]",
    "sources = [0, 0, 1]",
    "[hinf]",
    "source = 0",
    "\r",
    "\t",
];

/// One of: a piece put in, a stretch taken out, a stretch copied elsewhere, a character changed, the end cut off.
fn mutate(text: &mut Vec<char>, rng: &mut ChaCha8Rng) {
    let at = rng.random_range(0..=text.len());
    let stretch = at..(at + rng.random_range(0..40)).min(text.len());
    match rng.random_range(0..10) {
        0..=3 => {
            let piece = PIECES.choose(rng).copied().unwrap_or("");
            text.splice(at..at, piece.chars());
        }
        4..=5 => drop(text.drain(stretch)),
        6..=7 => {
            let copied: Vec<char> = text[stretch].to_vec();
            let to = rng.random_range(0..=text.len());
            text.splice(to..to, copied);
        }
        8 => {
            if let Some(character) = text.get_mut(at) {
                *character = char::from(rng.random_range(0..128u8));
            }
        }
        _ => {
            if rng.random_bool(0.1) {
                text.truncate(at);
            }
        }
    }
}

/// Reads `text`; faults, if any, must be printable as one line each. True if the text was sound.
fn answers(text: &str) -> bool {
    match Config::from_toml_str(text, "mutated") {
        Ok(_) => true,
        Err(faults) => {
            assert!(
                !faults.faults.is_empty(),
                "refused without a reason:\n{text}"
            );
            let printed = faults.to_string();
            assert_eq!(
                printed.lines().count(),
                1 + faults.faults.len(),
                "{printed}"
            );
            let heading = format!("mutated: {} fault", faults.faults.len());
            assert!(printed.starts_with(&heading), "{printed}");
            let lines = text.matches('\n').count() + 1;
            for fault in &faults.faults {
                assert!(
                    fault.line.is_none_or(|line| (1..=lines).contains(&line)),
                    "{fault:?}"
                );
            }
            false
        }
    }
}

#[test]
fn mutated_examples_never_panic() {
    let mut rng = ChaCha8Rng::seed_from_u64(20_240);
    let mut sound = 0;
    let rounds = 6000;
    for round in 0..rounds {
        let mut text: Vec<char> = EXAMPLES[round % EXAMPLES.len()].chars().collect();
        for _ in 0..rng.random_range(1..=6) {
            mutate(&mut text, &mut rng);
        }
        sound += usize::from(answers(&text.iter().collect::<String>()));
    }
    // Both outcomes must have been met often, else the mutations were too tame or too wild to test anything.
    assert!(
        (rounds / 50..rounds * 9 / 10).contains(&sound),
        "{sound} of {rounds} were sound"
    );
}

#[test]
fn hostile_texts_are_answered() {
    let deep = 200_000;
    let many_unknown: String = (0..20_000)
        .map(|i| format!("heading_dg{i} = 1\n"))
        .collect();
    let cases = [
        String::new(),
        "\u{0}".repeat(1000),
        format!("a = {}", "[".repeat(deep)),
        format!("a = {}1{}", "[".repeat(deep), "]".repeat(deep)),
        format!("a = {}", "{b = ".repeat(deep)),
        format!("{} = 1", "a.".repeat(deep) + "b"),
        format!("[{}]", "a.".repeat(deep) + "b"),
        format!("{} = 1", "a".repeat(deep)),
        format!("model = \"{}\"", "x".repeat(deep)),
        format!("gravity_mps2 = {}", "9".repeat(deep)),
        "[[position_source]]\n".repeat(40_000),
        "[[mismatched]]\n".repeat(60_000),
        format!("[stacking]\nsources = [{}]", "0,".repeat(deep)),
        "= \n".repeat(100_000),
        many_unknown,
    ];
    for text in cases {
        assert!(
            text.len() <= MAX_FILE_BYTES,
            "the size limit would answer, not the reader"
        );
        assert!(!answers(&text));
    }
    assert!(!answers(&"#".repeat(MAX_FILE_BYTES + 1)));
}
