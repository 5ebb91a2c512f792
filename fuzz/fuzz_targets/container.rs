#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| gprop_fuzz::container(bytes));
