//! Frames of the codec.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| inekf_tests::fuzz::frames::run(bytes));
