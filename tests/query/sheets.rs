use std::borrow::Cow;

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::question::sheet::{Drawer, Sheet};
use gprop::query::recorded::Mask;
use gprop::query::{Context, Prompts, Queries, ViewSubjects};
use gprop::scene::ForegroundSource;
use image::{Rgb, RgbImage};

use super::{View, small, two_segments, view};

const GREY: Rgb<u8> = Rgb([128; 3]);

fn sheet(view: &View, segment: u16, context: Context, longest_side: u32) -> Sheet {
    Drawer::new(&view.photo, &view.segments.map, context, longest_side).sheet(segment).expect("the segment is there")
}

fn has(picture: &RgbImage, pixel: Rgb<u8>) -> bool {
    picture.pixels().any(|other| *other == pixel)
}

#[test]
fn sheets_keep_to_their_size_whatever_the_shape() {
    for size in [(400, 30), (30, 400), (200, 200), (3, 3)] {
        let whole = view("v", size, 80, |_, _| 1);
        for longest_side in [256, 1536] {
            for context in [Context::GlobalLocal, Context::Local] {
                let (width, height) = sheet(&whole, 1, context, longest_side).picture.dimensions();
                assert!(width.max(height) <= longest_side, "{size:?} gave {width} x {height}");
                assert!(width > 20 && height > 20, "{size:?} gave {width} x {height}");
            }
        }
    }
}

#[test]
fn a_wide_object_has_its_panels_one_below_the_other() {
    let wide = sheet(&view("v", (400, 100), 80, |_, _| 1), 1, Context::GlobalLocal, 768).picture;
    let high = sheet(&view("v", (100, 400), 80, |_, _| 1), 1, Context::GlobalLocal, 768).picture;
    // One panel of the wide object is four times as wide as high; a row of three would be twelve times.
    assert!(wide.width() < 3 * wide.height());
    assert!(high.height() > high.width() / 2);
}

#[test]
fn no_label_runs_into_the_next_panel() {
    let high = view("v", (100, 400), 80, |_, _| 1);
    for longest_side in [256, 300, 1536] {
        let picture = sheet(&high, 1, Context::GlobalLocal, longest_side).picture;
        // Three panels in a row, with a gap of 8 pixels before and after each.
        let step = (picture.width() - 8) / 3;
        let in_gap = |x: u32| x % step < 8;
        assert!(
            picture.enumerate_pixels().all(|(x, _, pixel)| !in_gap(x) || *pixel == Rgb([255; 3])),
            "{longest_side}"
        );
    }
}

/// Only alpha was composited over white.
#[test]
fn surroundings_keep_their_colour_unless_they_are_white_behind_alpha() {
    let mut view = view("v", (100, 100), 80, |x, y| u16::from((20..80).contains(&x) && (20..80).contains(&y)));
    let corner = |view: &View| {
        let picture = sheet(view, 1, Context::GlobalLocal, 768).picture;
        // The top left corner of the first panel, below its label.
        *picture.get_pixel(9, 26)
    };
    assert_eq!(corner(&view), Rgb([222; 3]));
    view.photo.foreground_source = ForegroundSource::Mask;
    assert_eq!(corner(&view), Rgb([222; 3]), "a mask beside a photo with alpha");
    view.photo.over_white = false;
    assert_eq!(corner(&view), Rgb([255; 3]), "a white wall");
}

#[test]
fn the_segment_is_red_in_the_second_panel_and_alone_in_the_third() {
    let view = two_segments("v", 80, 80);
    let left = sheet(&view, 1, Context::GlobalLocal, 1000).picture;
    let right = sheet(&view, 2, Context::GlobalLocal, 1000).picture;
    assert_eq!(left.dimensions(), right.dimensions());
    assert!(has(&left, Rgb([255, 0, 0])), "no outline");
    assert!(has(&left, GREY), "no grey ground");
    assert!(has(&left, Rgb([222; 3])), "no plain ground");
    // The object is twice as wide as high, so the panels are below each other; the first does not depend on the
    // segment.
    let first_panel = |picture: &RgbImage| picture.as_raw()[..picture.as_raw().len() / 4].to_vec();
    assert_eq!(first_panel(&left), first_panel(&right));
    assert_ne!(left, right);
}

#[test]
fn the_segment_alone_shows_no_other_segment() {
    // Segment 2 is bright green, segment 1 has no green at all.
    let mut view = two_segments("v", 0, 80);
    for (x, y, pixel) in view.photo.rgb.enumerate_pixels_mut() {
        match view.segments.map.labels[(y * 160 + x) as usize] {
            1 => *pixel = Rgb([90, 0, 90]),
            2 => *pixel = Rgb([0, 255, 0]),
            _ => {}
        }
    }
    let alone = sheet(&view, 1, Context::Local, 512).picture;
    assert!(has(&alone, Rgb([90, 0, 90])));
    assert!(!has(&alone, Rgb([0, 255, 0])));
    assert!(!has(&alone, Rgb([255, 0, 0])), "the segment alone is not marked");
}

#[test]
fn a_single_pixel_and_a_whole_picture_are_segments_too() {
    let dot = view("v", (64, 64), 80, |x, y| if (x, y) == (40, 9) { 2 } else { 1 });
    let picture = sheet(&dot, 2, Context::GlobalLocal, 512).picture;
    assert!(has(&picture, GREY) && has(&picture, Rgb([255, 0, 0])));
    let whole = view("v", (64, 64), 80, |_, _| 1);
    let picture = sheet(&whole, 1, Context::GlobalLocal, 512).picture;
    let (x, y) = (picture.width() / 2, picture.height() / 2);
    let [red, green, _] = picture.get_pixel(x, y).0;
    assert!(red > 102 && green < 80, "all of the second panel is tinted: {red}, {green}");
}

/// A wire in a large photo covers a fifth of the pixels of the panel that it touches.
#[test]
fn a_segment_thinner_than_a_pixel_of_the_panel_is_marked_too() {
    let wire = view("v", (800, 600), 80, |x, _| if (400..402).contains(&x) { 2 } else { 1 });
    let picture = sheet(&wire, 2, Context::GlobalLocal, 256).picture;
    let red = picture.enumerate_pixels().filter(|(.., pixel)| **pixel == Rgb([255, 0, 0]));
    let columns: std::collections::BTreeSet<u32> = red.map(|(x, ..)| x).collect();
    assert_eq!(columns.len(), 1, "{columns:?}");
    // In the middle of the second of three panels.
    let middle = picture.width() / 2;
    assert!(columns.iter().all(|x| x.abs_diff(middle) <= 2), "{columns:?} of {}", picture.width());
}

#[test]
fn a_segment_without_pixels_has_no_sheet() {
    let view = two_segments("v", 80, 80);
    assert_eq!(Drawer::new(&view.photo, &view.segments.map, Context::GlobalLocal, 512).sheet(7), None);
}

#[test]
fn the_same_segment_gives_the_same_pixels_and_another_one_others() {
    let view = two_segments("v", 80, 80);
    let hash = |segment| sheet(&view, segment, Context::GlobalLocal, 512).pixels_sha256();
    assert_eq!(hash(1), hash(1));
    assert_ne!(hash(1), hash(2));
}

#[test]
fn the_jpeg_decodes_to_the_sheet_but_for_compression() {
    let sheet = sheet(&two_segments("v", 80, 80), 1, Context::GlobalLocal, 512);
    let decoded = image::load_from_memory(&sheet.jpeg()).unwrap().to_rgb8();
    assert_eq!(decoded.dimensions(), sheet.picture.dimensions());
    let apart = |(a, b): (&u8, &u8)| f64::from(a.abs_diff(*b));
    let mean = decoded.as_raw().iter().zip(sheet.picture.as_raw()).map(apart).sum::<f64>() / decoded.len() as f64;
    assert!(mean < 6.0, "JPEG moves a sample by {mean} on average");
}

/// A part that was found later has a higher number than the pieces of others, which have a map of their own.
#[test]
fn questions_are_in_the_order_of_their_ids_whichever_map_shows_them() {
    let View { name, photo, segments } = view("v", (100, 100), 80, |x, _| if x < 60 { 1 } else { 4 });
    let pieces = view("v", (100, 100), 80, |x, _| if x < 60 { 2 + u16::from(x >= 30) } else { 0 }).segments.map;
    let maps = [Cow::Borrowed(&segments.map), Cow::Borrowed(&pieces)];
    let (prompts, options) = (Prompts::builtin(), small());
    let about_object = |ids: &[u16]| {
        let views = [ViewSubjects { name, photo: &photo, maps: &maps, ids }];
        Queries::prepare(&views, MaterialLibrary::builtin(), &prompts, &options, AskAbout::Object)
            .map(|queries| queries.subjects.into_iter().map(|shown| (shown.id, shown.mask)).collect::<Vec<_>>())
    };
    let shown = about_object(&[4, 3, 1]).unwrap();
    let mask = |map: usize, id: u16| (id, Mask::of_id(&maps[map], id));
    assert_eq!(shown, [mask(0, 1), mask(1, 3), mask(0, 4)]);
    assert!(about_object(&[1, 5]).unwrap_err().to_string().contains('5'), "no map has it");
}
