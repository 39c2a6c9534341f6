//! Control requests as raw bytes.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| inekf_tests::fuzz::control::run(bytes));
