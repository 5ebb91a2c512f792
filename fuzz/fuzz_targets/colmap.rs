//! COLMAP's cameras and images, binary and text.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    use gprop::scene::cameras::colmap;
    let _ = colmap::parse_cameras_binary(bytes);
    let _ = colmap::parse_images_binary(bytes);
    let text = String::from_utf8_lossy(bytes);
    let _ = colmap::parse_cameras_text(&text);
    let _ = colmap::parse_images_text(&text);
});
