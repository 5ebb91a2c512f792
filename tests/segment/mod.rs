//! SAM's masks against the reference generator's, and segments of whole views.

// Every form of a SAM export, broken ones, kept embeddings.
pub mod models;
// Pictures of every kind, and the files written for them.
mod pictures;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use gprop::evaluate::masks::{Comparison, Reference, compare};
use gprop::scene::{ForegroundSource, Photo};
use gprop::segment::{LabelMap, Options, SegmentError, Segmenter, ViewSegments, segment_views};
use gprop::setup::ModelFiles;
use gprop::words::progress::Progress;
use image::{GrayImage, Luma, Rgb, RgbImage};

use crate::support;

fn segmenter(files: &ModelFiles) -> Segmenter {
    Segmenter::new(files, None, 2).unwrap()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The reference masks, which are not distributed with gprop.
fn references(test: &str) -> Option<PathBuf> {
    support::shared(test, "reference/sam")
}

/// The same count within 2%, overlaps of at least 0.98 on average and 0.90 each, and similar scores.
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
    // Only printed, not checked.
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

/// A photo of a blue disc and a red square side by side on white, each 60 pixels across.
fn two_shapes() -> Photo {
    let is_disc = |x: u32, y: u32| (x as f32 - 50.0).hypot(y as f32 - 60.0) < 30.0;
    let is_square = |x: u32, y: u32| (79..139).contains(&x) && (30..90).contains(&y);
    let rgb = RgbImage::from_fn(200, 120, |x, y| match (is_disc(x, y), is_square(x, y)) {
        (true, _) => Rgb([30, 60, 200]),
        (_, true) => Rgb([200, 40, 30]),
        _ => Rgb([255; 3]),
    });
    let foreground =
        GrayImage::from_fn(200, 120, |x, y| Luma([if is_disc(x, y) || is_square(x, y) { 255 } else { 0 }]));
    Photo { rgb, foreground, foreground_source: ForegroundSource::Alpha, over_white: true }
}

/// A sparser grid than the default, for speed.
fn quick_options() -> Options {
    let mut options = Options::default();
    options.generator.points_per_side = 6;
    options
}

fn label_of_most(map: &LabelMap, x: std::ops::Range<u32>, y: std::ops::Range<u32>) -> (u16, f64) {
    let mut counts = std::collections::BTreeMap::<u16, u32>::new();
    let area = x.len() * y.len();
    for (x, y) in x.flat_map(|x| y.clone().map(move |y| (x, y))) {
        *counts.entry(map.at(x, y)).or_default() += 1;
    }
    let (label, count) = counts.into_iter().max_by_key(|&(_, count)| count).unwrap();
    (label, f64::from(count) / area as f64)
}

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn two_shapes_are_two_segments_whatever_the_number_of_threads() {
    let Some(files) = support::models("two_shapes_are_two_segments_whatever_the_number_of_threads") else { return };
    let (segmenter, photo) = (segmenter(&files), two_shapes());
    let segment = || segmenter.segment_view("shapes", &photo, &quick_options(), &()).unwrap();
    let (one, two) = (in_pool(1, segment), in_pool(2, segment));
    assert_eq!(one, two);
    let (disc, disc_share) = label_of_most(&one.map, 35..65, 45..75);
    let (square, square_share) = label_of_most(&one.map, 85..133, 36..84);
    assert!(disc > 0 && square > 0 && disc != square, "{:?}", one.segments);
    assert!(disc_share > 0.98 && square_share > 0.98, "{disc_share} {square_share}");
    for (i, &label) in one.map.labels.iter().enumerate() {
        assert!(label == 0 || photo.foreground.as_raw()[i] == 255, "pixel {i} of the background has a segment");
    }
    for segment in &one.segments {
        let area = one.map.labels.iter().filter(|&&label| label == segment.id).count();
        assert_eq!(area, segment.area as usize);
    }
}

#[test]
fn a_view_without_foreground_has_no_segments_and_one_that_sam_makes_nothing_of_has_one() {
    let test = "a_view_without_foreground_has_no_segments_and_one_that_sam_makes_nothing_of_has_one";
    let Some(files) = support::models(test) else { return };
    let segmenter = segmenter(&files);
    let mut photo = two_shapes();
    let mut strict = quick_options();
    strict.generator.points_per_side = 2;
    strict.generator.min_predicted_iou = 2.0;
    let whole = segmenter.segment_view("strict", &photo, &strict, &()).unwrap();
    assert!(whole.warning().unwrap().contains("strict"), "{:?}", whole.warning());
    assert!(whole.map.labels.iter().zip(photo.foreground.as_raw()).all(|(&label, &fg)| (label == 1) == (fg == 255)));
    photo.foreground = GrayImage::new(200, 120);
    let none = segmenter.segment_view("empty", &photo, &quick_options(), &()).unwrap();
    assert!(none.segments.is_empty() && none.warning().unwrap().contains("no foreground"));
}

#[test]
fn tiny_and_extremely_long_pictures_are_segmented() {
    let Some(files) = support::models("tiny_and_extremely_long_pictures_are_segmented") else { return };
    let segmenter = segmenter(&files);
    for (width, height) in [(1, 1), (3000, 1)] {
        let photo = Photo {
            rgb: RgbImage::from_pixel(width, height, Rgb([90, 120, 30])),
            foreground: GrayImage::from_pixel(width, height, Luma([255])),
            foreground_source: ForegroundSource::Alpha,
            over_white: false,
        };
        let mut options = quick_options();
        options.generator.points_per_side = 2;
        let segments = segmenter.segment_view("odd", &photo, &options, &()).unwrap();
        assert_eq!((segments.map.width, segments.map.height), (width, height));
        assert!(!segments.segments.is_empty());
    }
}

#[test]
fn views_are_handed_on_one_by_one_and_returned_in_order() {
    let Some(files) = support::models("views_are_handed_on_one_by_one_and_returned_in_order") else { return };
    let segmenter = segmenter(&files);
    let mut options = quick_options();
    options.generator.points_per_side = 2;
    let saved = Mutex::new(Vec::new());
    let save = |view: &ViewSegments| {
        saved.lock().unwrap().push(view.view.clone());
        Ok::<_, SegmentError>(())
    };
    let names = ["c", "a", "b"];
    let segmentation =
        segment_views(&segmenter, &names, &|_| Ok(two_shapes()), &options, Progress::HIDDEN, &save).unwrap();
    assert_eq!(segmentation.views.iter().map(|view| view.view.as_str()).collect::<Vec<_>>(), names);
    saved.lock().unwrap().sort();
    assert_eq!(*saved.lock().unwrap(), ["a", "b", "c"]);

    let failing = |name: &str| if name == "a" { anyhow::bail!("cannot read a") } else { Ok(two_shapes()) };
    let error = segment_views(&segmenter, &names, &failing, &options, Progress::HIDDEN, &|_| Ok(())).unwrap_err();
    assert_eq!(error.to_string(), "cannot read a");
}
