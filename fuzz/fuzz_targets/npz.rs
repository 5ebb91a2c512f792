//! NumPy archives.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    use gprop::npz::Npz;
    if let Ok(mut archive) = Npz::new(bytes.to_vec()) {
        for name in ["a", "x", "config"] {
            let _ = archive.f32s(name);
            let _ = archive.f64s(name);
            let _ = archive.i64s(name);
            let _ = archive.text(name);
        }
    }
});
