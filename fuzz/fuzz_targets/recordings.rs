//! Recordings of answers, with their masks.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    use gprop::query::recorded::Recording;
    if let Ok(recording) = serde_json::from_slice::<Recording>(bytes) {
        let mask = &recording.asked.mask;
        assert!((0.0..=1.0).contains(&mask.iou(mask)));
        let _ = recording.asked.content_sha256();
    }
});
