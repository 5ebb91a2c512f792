//! A simulation's checkpoint.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = gprop::simulate::checkpoint::Checkpoint::from_bytes(bytes);
});
