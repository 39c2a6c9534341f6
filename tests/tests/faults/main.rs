//! Faults, hostile bytes, and who may open what. Every row of the fault table in its short form: `cargo run --release -p inekf-tests -- faults --rounds 1000` is the
//! long one.

mod ages;
mod fuzz;
mod permissions;

use inekf_tests::faults::{self, Plan, ROWS};

fn hold(name: &str, rounds: u32) {
    let plan = Plan {
        rounds,
        seed: 6,
        party: env!("CARGO_BIN_EXE_inekf-tests").into(),
    };
    let row = faults::row(name).unwrap_or_else(|| panic!("there is no row {name}"));
    println!("{name}: {:#?}", (row.run)(&plan));
}

macro_rules! short {
    ($($(#[$attribute:meta])? $test:ident: $name:literal, $rounds:literal;)+) => {
        $(#[test]
        $(#[$attribute])?
        fn $test() {
            hold($name, $rounds);
        })+

        #[test]
        fn no_row_is_left_out() {
            let mut tested = [$($name),+];
            let mut rows: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
            tested.sort_unstable();
            rows.sort_unstable();
            assert_eq!(tested[..], rows[..]);
        }
    };
}

short! {
    a_killed_daemon_is_replaced: "kill-daemon", 10;
    a_killed_feeder_is_replaced: "kill-feeder", 10;
    a_killed_reader_is_replaced: "kill-reader", 10;
    what_all_of_them_left_is_removed_by_the_next_daemon: "kill-all", 1;
    what_all_of_them_left_is_removed_by_doctor: "kill-all-doctor", 1;
    a_second_daemon_is_refused: "second-daemon", 3;
    a_daemon_killed_at_its_start_is_replaced: "early-daemon", 16;
    a_feeder_killed_at_its_start_is_replaced: "early-feeder", 10;
    a_reader_killed_at_its_start_is_replaced: "early-reader", 10;
    a_feeder_may_come_back_with_another_rate: "new-rate", 6;
    a_clock_may_jump: "clock-jumps", 20;
    a_gap_makes_stale: "gap", 1;
    duplicates_are_refused: "duplicates", 30;
    bursts_are_counted: "burst", 3;
    a_frozen_source_is_survived: "frozen-source", 1;
    a_lying_source_is_gated: "lying-source", 1;
    a_late_source_is_replayed: "late-source", 1;
    a_fast_clock_keeps_nobody_waiting: "fast-clock", 1;
    an_overloaded_smoother_goes_on: "smoother-overload", 1;
    too_little_shared_memory_is_said_at_the_start: "shm-full", 6;
    a_feeder_without_shared_memory_says_so: "shm-fills-up", 1;
    deleted_files_are_made_anew: "shm-deleted", 3;
    too_few_descriptors_are_said_at_the_start: "descriptors", 8;
    a_full_disk_stops_no_estimate: "disk-full", 1;
    a_read_only_disk_stops_no_estimate: "disk-read-only", 1;
    what_the_system_refuses_is_said: "privileges", 2;
    every_state_is_left_by_sigterm: "stop", 1;
}
