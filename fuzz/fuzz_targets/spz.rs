//! SPZ of all versions, gzip and zstd streams included.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = gprop::scene::spz::parse(bytes);
});
