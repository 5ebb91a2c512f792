//! SAM's masks against the reference generator's, and parts of whole views.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use gprop::evaluate::masks::{Comparison, Reference, compare};
use gprop::progress::Progress;
use gprop::scene::Photo;
use gprop::segment::{GeneratorOptions, Options, SegmentError, Segmenter, ViewSegments, segment_views};
use gprop::setup::ModelFiles;
use image::{GrayImage, Luma, Rgb, RgbImage};

use crate::support;

fn segmenter(files: &ModelFiles) -> Segmenter {
    Segmenter::new(files, 2).unwrap()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The reference masks, which are not gprop's to ship.
fn references(test: &str) -> Option<PathBuf> {
    let folder = root().join("../shared/reference/sam");
    let folder = folder.is_dir().then_some(folder).or_else(|| std::env::var_os("GPROP_SAM_REFERENCE").map(Into::into));
    if folder.is_none() {
        support::skipped(test, "there is no folder of reference masks; GPROP_SAM_REFERENCE may name one");
    }
    folder
}

/// The same count within 2%, overlaps of 0.98 in the mean and none under 0.90, scores alike.
fn assert_conforms(list: &str, comparison: &Comparison) {
    let slack = 0.02 * comparison.reference_count as f64;
    assert!(comparison.count.abs_diff(comparison.reference_count) as f64 <= slack, "{list}: {comparison:?}");
    assert!(comparison.unmatched as f64 <= slack, "{list}: {comparison:?}");
    assert!(comparison.matched_mean_iou >= 0.98, "{list}: {comparison:?}");
    assert!(comparison.matched_min_iou >= 0.90, "{list}: {comparison:?}");
    assert!(comparison.predicted_iou_max_difference <= 1e-3, "{list}: {comparison:?}");
    assert!(comparison.stability_max_difference <= 0.01, "{list}: {comparison:?}");
}

fn check_reference(name: &str, folder: &Path, files: &ModelFiles) {
    let picture = image::open(folder.join(format!("{name}.png"))).unwrap().into_rgb8();
    let json = fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
    let reference = Reference::from_json(&json).unwrap();
    let started = std::time::Instant::now();
    let comparisons = compare(segmenter(files).sam(), &picture, &reference, &()).unwrap();
    println!("{name}: {:.1} s", started.elapsed().as_secs_f64());
    for (list, comparison) in &comparisons {
        println!("  {list}: {comparison:?}");
    }
    for (list, comparison) in &comparisons {
        assert_conforms(list, comparison);
    }
}

#[test]
fn masks_are_the_reference_generators() {
    let test = "masks_are_the_reference_generators";
    let (Some(folder), Some(files)) = (references(test), support::models(test)) else { return };
    check_reference("mug_002", &folder, &files);
}

#[test]
#[ignore = "takes minutes: the large reference pictures, one with crops"]
fn masks_of_large_pictures_are_the_reference_generators() {
    let test = "masks_of_large_pictures_are_the_reference_generators";
    let (Some(folder), Some(files)) = (references(test), support::models(test)) else { return };
    for name in ["hammer", "doll", "picture3_crops"] {
        check_reference(name, &folder, &files);
    }
}
