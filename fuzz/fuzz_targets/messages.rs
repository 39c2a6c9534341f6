//! Input messages as raw bytes, into an engine of any model.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| inekf_tests::fuzz::messages::run(bytes));
