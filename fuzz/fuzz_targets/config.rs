//! The text of a configuration.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| inekf_tests::fuzz::text::config(bytes));
