//! Label maps: PNG and NumPy arrays.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    use gprop::segment::{LabelMap, Level};
    let _ = LabelMap::from_png(bytes).map(|map| map.renumbered());
    for level in [Level::Small, Level::Middle, Level::Large] {
        let _ = LabelMap::from_npy(bytes, level);
    }
});
