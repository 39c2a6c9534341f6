//! The fault table: what is done to real processes, and what comes of it.
//!
//! Every row is a fault, inflicted a number of times at moments drawn from a seed. It asserts that nothing breaks, and
//! returns what was measured. `cargo run --release -p inekf-tests -- faults` prints all rows; the tests of this crate
//! run each of them in its short form.
//!
//! * [`scene`]: a daemon and its parties; [`plan`]: how often, from which seed; [`outcome`]: what came of it, as a table
//! * [`kills`], [`early`]: SIGKILL at any moment, and in the first 25 ms; [`stop`]: SIGTERM in every state
//! * [`inputs`], [`sources`]: clocks, gaps, duplicates, bursts; position sources that freeze, lie or are late
//! * [`resources`]: full shared memory, deleted files, file descriptors
//! * [`disk`]: no room for checkpoints and recordings; [`privileges`]: real-time priority and locked memory refused

pub mod disk;
pub mod early;
pub mod inputs;
pub mod kills;
pub mod outcome;
pub mod plan;
pub mod privileges;
pub mod resources;
pub mod scene;
pub mod sources;
pub mod stop;

pub use outcome::{Balance, Outcome};
pub use plan::Plan;

/// A fault.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// How it is called on the command line.
    pub name: &'static str,
    /// What is done, in a few words.
    pub fault: &'static str,
    /// Does it; panics if anything breaks.
    pub run: fn(&Plan) -> Outcome,
}

macro_rules! rows {
    ($($name:literal, $fault:literal => $run:path;)+) => {
        /// All faults.
        pub const ROWS: &[Row] = &[$(Row { name: $name, fault: $fault, run: $run }),+];
    };
}

rows! {
    "kill-daemon", "SIGKILL of the daemon, and its restart" => kills::daemon;
    "kill-feeder", "SIGKILL of the feeder, and its restart" => kills::feeder;
    "kill-reader", "SIGKILL of a reader, and its restart" => kills::reader;
    "kill-all", "SIGKILL of all three at once; a new daemon cleans up" => kills::all_then_start;
    "kill-all-doctor", "SIGKILL of all three at once; `doctor` cleans up" => kills::all_then_doctor;
    "second-daemon", "a second daemon of the same instance" => kills::second_daemon;
    "early-daemon", "SIGKILL in the first 25 ms of the daemon" => early::daemon;
    "early-feeder", "SIGKILL in the first 25 ms of the feeder" => early::feeder;
    "early-reader", "SIGKILL in the first 25 ms of a reader" => early::reader;
    "new-rate", "feeder restarted with another rate" => inputs::another_rate;
    "clock-jumps", "clock of the samples jumps forward and back" => inputs::clock_jumps;
    "gap", "10 s without a sample" => inputs::gap;
    "duplicates", "every sample sent twice" => inputs::duplicates;
    "burst", "bursts beyond the queue of a daemon that is stopped" => inputs::bursts;
    "frozen-source", "position source that repeats itself while the body moves" => sources::frozen;
    "lying-source", "position source that lies by a kilometre" => sources::lying;
    "late-source", "position source that is 2 s late" => sources::late;
    "fast-clock", "position source with a clock 30 s ahead beside a good one" => sources::fast_clock;
    "smoother-overload", "a fix with every sample for a smoother of 100 states" => sources::smoother_overload;
    "shm-full", "too little space in /dev/shm" => resources::shared_memory_full;
    "shm-fills-up", "/dev/shm fills up while the daemon runs" => resources::shared_memory_fills_up;
    "shm-deleted", "files in shared memory deleted while in use" => resources::files_deleted;
    "descriptors", "too few file descriptors" => resources::descriptors;
    "disk-full", "full disk under the checkpoint and under a recorder" => disk::full;
    "disk-read-only", "the disk of the checkpoint becomes read-only" => disk::read_only;
    "privileges", "real-time priority and memory lock refused" => privileges::refused;
    "stop", "SIGTERM in every state" => stop::in_every_state;
}

/// The row of this name.
pub fn row(name: &str) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.name == name)
}
