//! Whatever bytes come in: no panic, nothing that is not finite, and what is refused changes nothing.
//!
//! Each target takes bytes and panics if something does not hold. The folder `fuzz` of the project runs them under
//! libFuzzer; [`seeded`] runs them in this process on inputs made from a seed ([`inputs`]): valid ones with bits, numbers
//! and pieces changed, and pure chance. The tests of this crate run some thousand of each, and
//! `cargo run --release -p inekf-tests -- fuzz` as many as wanted.

pub mod control;
pub mod frames;
pub mod inputs;
pub mod messages;
pub mod raw;
pub mod text;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Something that takes bytes from outside.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// How it is called on the command line, and in the folder `fuzz`.
    pub name: &'static str,
    /// What the bytes are.
    pub takes: &'static str,
    /// Takes them; panics if something does not hold.
    pub run: fn(&[u8]),
    /// Inputs that are valid, to be spoiled.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All targets.
pub const TARGETS: &[Target] = &[
    Target {
        name: "messages",
        takes: "input messages as raw bytes, into an engine of any model",
        run: messages::run,
        seeds: messages::seeds,
    },
    Target {
        name: "control",
        takes: "control requests as raw bytes",
        run: control::run,
        seeds: control::seeds,
    },
    Target {
        name: "config",
        takes: "the text of a configuration",
        run: text::config,
        seeds: text::config_seeds,
    },
    Target {
        name: "dataset",
        takes: "a file of a dataset folder",
        run: text::dataset,
        seeds: text::dataset_seeds,
    },
    Target {
        name: "frames",
        takes: "frames of the codec: what checkpoints and recordings are made of",
        run: frames::run,
        seeds: frames::seeds,
    },
];

/// The target of this name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}

/// Runs `count` inputs that come of `seed`. If one panics, its bytes are printed first.
pub fn seeded(target: &Target, seed: u64, count: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let seeds = (target.seeds)();
    for _ in 0..count {
        let input = inputs::make(&seeds, &mut rng);
        let told = Told(&input);
        (target.run)(&input);
        drop(told);
    }
}

/// Tells the input if it is dropped by a panic.
struct Told<'a>(&'a [u8]);

impl Drop for Told<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("the input was {:?}", self.0);
        }
    }
}
