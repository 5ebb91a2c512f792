//! The 32-byte rows of a .splat.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = gprop::scene::splat::parse(bytes);
});
