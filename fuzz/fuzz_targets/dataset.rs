//! A file of a dataset folder.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| inekf_tests::fuzz::text::dataset(bytes));
