//! PLY of every encoding and the compressed PLY: an error or a cloud, never a panic nor memory beyond the file's size.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = gprop::scene::ply::parse(bytes);
});
