//! Every variant of SAM in the standard two-file form, recognised by inputs and outputs: the tiny models of
//! `fixtures/sam`, whose arithmetic is defined in `make.py` there.

use std::fs;
use std::path::Path;

use gprop::scene::{ForegroundSource, Photo};
use gprop::segment::preprocess::prepare;
use gprop::segment::sam::mismatch::Mismatch;
use gprop::segment::sam::{LOGITS_SIDE, MODEL_SIDE, Sam, check_decoder};
use gprop::segment::{DecoderRuntime, Options, SegmentError, Segmenter};
use gprop::setup::ModelFiles;
use image::{GrayImage, Luma, Rgb, RgbImage};

use super::root;
use crate::support;

/// Decoders and the number of prompts that each takes at once.
const DECODERS: [(&str, usize); 6] = [
    ("multi_mask", 1),
    ("single_mask", 1),
    ("dynamic_batch", 1),
    ("fixed_batch", 3),
    ("one_point", 1),
    ("conditional", 1),
];

/// Sums of 256 channels in single precision.
const ROUNDING: f32 = 1e-4;

/// The tiny encoder and a tiny decoder, on the ONNX Runtime that any user gets.
pub fn tiny(test: &str, decoder: &str) -> Option<ModelFiles> {
    let folder = root().join("fixtures/sam");
    let files = support::models(test)?;
    Some(ModelFiles {
        encoder: folder.join("encoder.onnx"),
        decoder: folder.join(decoder).with_extension("onnx"),
        ..files
    })
}

fn refused(files: &ModelFiles) -> SegmentError {
    Sam::open(files, None, 1).err().expect("it must not open")
}

/// A prepared picture of one colour, already normalised.
fn plain_input(rgb: [f32; 3]) -> Vec<f32> {
    rgb.into_iter().flat_map(|value| std::iter::repeat_n(value, MODEL_SIDE * MODEL_SIDE)).collect()
}

/// The tiny encoder's embedding of a picture of one colour, averaged over its channels: weights `(i % 5 - 1) / 3`.
fn mean_embedding(rgb: [f32; 3]) -> f32 {
    let weight = |output: usize, channel: usize| ((output * 3 + channel) % 5) as f32 / 3.0 - 1.0 / 3.0;
    let value = |output| rgb.iter().enumerate().map(|(channel, value)| weight(output, channel) * value).sum::<f32>();
    (0..256).map(value).sum::<f32>() / 256.0
}

#[test]
fn every_form_of_the_export_gives_the_three_levels() {
    let points = [[500.0, 300.0], [40.0, 1000.0], [7.0, 3.0], [900.0, 20.0]];
    let rgb = [0.9, -0.4, 2.0];
    for (decoder, batch) in DECODERS {
        let Some(files) = tiny("every_form_of_the_export_gives_the_three_levels", decoder) else { return };
        let sam = Sam::open(&files, None, 2).unwrap();
        assert_eq!(sam.batch(), batch, "{decoder}");
        let prepared = sam.prepare(&sam.encode(&plain_input(rgb)).unwrap(), (1024, 1024)).unwrap();
        let mut decoded = 0;
        for points in points.chunks(batch) {
            sam.decode(&prepared, points, &|_| [true; 3], |index, masks| {
                decoded += 1;
                let shift = (points[index][0] + points[index][1]) / 1000.0;
                for level in 0..3 {
                    // The decoder's mask 0 is the one for unambiguous prompts.
                    let (logit, score) =
                        (mean_embedding(rgb) * (level + 2) as f32 + shift, shift / 4.0 + (level + 1) as f32 / 10.0);
                    assert!((masks.predicted_iou[level] - score).abs() < ROUNDING, "{decoder} {level}: {masks:?}");
                    let logits = masks.logits[level].unwrap();
                    assert_eq!(logits.len(), LOGITS_SIDE * LOGITS_SIDE);
                    let is_right = |value: &f32| (value - logit).abs() < ROUNDING;
                    assert!(logits.iter().all(is_right), "{decoder} {level}: {}", logits[0]);
                }
            })
            .unwrap();
        }
        assert_eq!(decoded, points.len(), "{decoder}");
    }
}

/// gprop's own decoder against the same export run by ONNX Runtime, on a real picture's embedding.
#[test]
fn the_decoder_computes_what_onnx_runtime_computes() {
    let Some(files) = support::models("the_decoder_computes_what_onnx_runtime_computes") else { return };
    let own = Sam::open(&files, Some(DecoderRuntime::Native), 1).unwrap();
    let whole = Sam::open(&files, Some(DecoderRuntime::OnnxRuntime), 1).unwrap();
    assert!(own.decodes_natively() && !whole.decodes_natively());
    assert!(
        Sam::open(&files, None, 1).unwrap().decodes_natively(),
        "what can be native is, unless it is asked not to be"
    );
    let photo = image::open(root().join("fixtures/hammer/images/000.png")).unwrap().into_rgb8();
    let embedding = own.encode(&prepare(&photo).input).unwrap();
    let answers = |sam: &Sam, wanted: [bool; 3]| {
        let prepared = sam.prepare(&embedding, (1024, 1024)).unwrap();
        let mut answers = Vec::new();
        for point in [[512.0, 512.0], [300.0, 700.0], [20.0, 1000.0]] {
            sam.decode(&prepared, &[point], &|_| wanted, |_, decoded| {
                answers.push((decoded.logits.map(|logits| logits.map(<[f32]>::to_vec)), decoded.predicted_iou));
            })
            .unwrap();
        }
        answers
    };
    let all = answers(&own, [true; 3]);
    for ((logits, scores), (expected, expected_scores)) in all.iter().zip(answers(&whole, [true; 3])) {
        for level in 0..3 {
            assert!((scores[level] - expected_scores[level]).abs() < 1e-4, "{scores:?} {expected_scores:?}");
            let (logits, expected) = (logits[level].as_ref().unwrap(), expected[level].as_ref().unwrap());
            let spread = expected.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
            let apart = logits.iter().zip(expected).fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
            assert!(apart < 1e-4 * spread, "level {level}: {apart} of {spread}");
        }
    }
    for (sam, name) in [(&own, "own"), (&whole, "ONNX Runtime's")] {
        for ((logits, _), (expected, _)) in answers(sam, [true, false, true]).iter().zip(answers(sam, [true; 3])) {
            assert_eq!(logits[1], None, "{name}");
            assert_eq!((&logits[0], &logits[2]), (&expected[0], &expected[2]), "{name}");
        }
    }
}

/// An export of SAM's graph with other parameter names: ONNX Runtime runs it, unless gprop is told to compute it
/// itself.
#[test]
fn a_native_decoder_that_cannot_be_is_an_error_only_if_it_is_asked_for() {
    let Some(files) = support::models("a_native_decoder_that_cannot_be_is_an_error_only_if_it_is_asked_for") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut unknown = fs::read(&files.decoder).unwrap();
    let name = b"mask_decoder.";
    let places: Vec<usize> = (0..unknown.len() - name.len()).filter(|&i| unknown[i..].starts_with(name)).collect();
    for place in places {
        unknown[place..][..name.len()].copy_from_slice(b"some_decoder.");
    }
    let decoder = folder.path().join("decoder.onnx");
    fs::write(&decoder, unknown).unwrap();
    let files = ModelFiles { decoder, ..files };
    for choice in [None, Some(DecoderRuntime::OnnxRuntime)] {
        assert!(!Sam::open(&files, choice, 1).unwrap().decodes_natively(), "{choice:?}");
    }
    let error = Sam::open(&files, Some(DecoderRuntime::Native), 1).err().unwrap();
    assert!(matches!(error, SegmentError::NoNativeDecoder { source: Mismatch::NoParameter(_), .. }), "{error:?}");
    let message = error.to_string();
    for part in ["--decoder native", "decoder.onnx", "no parameter", "--decoder onnxruntime"] {
        assert!(message.contains(part), "{message}");
    }
}

/// Without ONNX Runtime: a graph with the right names that is not SAM's mask decoder, and bytes that are not a graph.
#[test]
fn what_differs_from_sams_mask_decoder_is_told_apart() {
    let decoder = fs::read(root().join("fixtures/sam/multi_mask.onnx")).unwrap();
    assert!(matches!(check_decoder(&decoder), Err(Mismatch::NoParameter(_))), "{:?}", check_decoder(&decoder));
    assert!(matches!(check_decoder(&decoder[..decoder.len() / 2]), Err(Mismatch::NotOnnx)));
    let encoder = fs::read(root().join("fixtures/sam/encoder.onnx")).unwrap();
    let missing = check_decoder(&encoder).unwrap_err();
    assert!(matches!(missing, Mismatch::Missing { kind: "input", name: "image_embeddings", .. }), "{missing}");
}

#[test]
fn every_form_of_the_export_finds_the_same_segments() {
    // Bright at the top, dark at the bottom; the object is the whole picture.
    let photo = Photo {
        rgb: RgbImage::from_fn(120, 90, |x, y| if y < 40 { Rgb([255 - x as u8, 250, 240]) } else { Rgb([20, 10, 30]) }),
        foreground: GrayImage::from_pixel(120, 90, Luma([255])),
        foreground_source: ForegroundSource::Whole,
        over_white: false,
    };
    let mut options = Options::default();
    options.generator.points_per_side = 5;
    options.generator.min_predicted_iou = 0.1;
    let mut first = None;
    for (decoder, _) in DECODERS {
        let Some(files) = tiny("every_form_of_the_export_finds_the_same_segments", decoder) else { return };
        let segments = Segmenter::new(&files, None, 2).unwrap().segment_view("view", &photo, &options, &()).unwrap();
        assert!(segments.segments.iter().any(|segment| !segment.is_rest()), "{decoder}: {:?}", segments.segments);
        assert_ne!(segments.map.at(60, 10), segments.map.at(60, 80), "{decoder}");
        assert_eq!(&segments, first.get_or_insert(segments.clone()), "{decoder}");
    }
}

#[test]
fn a_model_that_is_no_sam_says_which_tensor_is_missing() {
    let test = "a_model_that_is_no_sam_says_which_tensor_is_missing";
    let Some(good) = tiny(test, "multi_mask") else { return };
    let decoder = |name: &str| good.decoder.with_file_name(name).with_extension("onnx");
    for (files, missing) in [
        (ModelFiles { decoder: decoder("no_mask_input"), ..good.clone() }, "no input \"mask_input\""),
        (ModelFiles { decoder: decoder("no_scores"), ..good.clone() }, "no output \"iou_predictions\""),
        (ModelFiles { decoder: good.encoder.clone(), ..good.clone() }, "no input \"image_embeddings\""),
        (ModelFiles { decoder: decoder("many_points"), ..good.clone() }, "65536 points at most"),
        (ModelFiles { encoder: good.decoder.clone(), ..good.clone() }, "image_embeddings, point_coords"),
    ] {
        let error = refused(&files);
        assert!(matches!(error, SegmentError::NotSam { .. }) && error.to_string().contains(missing), "{error}");
    }
}

#[test]
fn a_model_cut_short_or_not_there_is_named() {
    let Some(files) = support::models("a_model_cut_short_or_not_there_is_named") else { return };
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.onnx");
    for (whole, is_encoder) in [(&files.encoder, true), (&files.decoder, false)] {
        let bytes = fs::read(whole).unwrap();
        fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
        let error = refused(&if is_encoder {
            ModelFiles { encoder: cut.clone(), ..files.clone() }
        } else {
            ModelFiles { decoder: cut.clone(), ..files.clone() }
        });
        assert!(matches!(error, SegmentError::Model { .. }) && error.to_string().contains("cut.onnx"), "{error}");
    }
    let error = refused(&ModelFiles { encoder: folder.path().join("none.onnx"), ..files.clone() });
    assert!(matches!(error, SegmentError::Read { .. }), "{error}");
}

#[test]
fn embeddings_are_kept_by_picture_and_model() {
    let Some(files) = tiny("embeddings_are_kept_by_picture_and_model", "multi_mask") else { return };
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("embeddings");
    let caching = |files: &ModelFiles| Sam::open(files, None, 1).unwrap().caching_embeddings(&cache, files).unwrap();
    let kept = || fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let (picture, other_picture) = (plain_input([1.0, 0.0, 0.5]), plain_input([0.0, 1.0, 0.5]));

    let sam = caching(&files);
    let made = sam.encode(&picture).unwrap();
    assert_eq!((made.clone(), kept().len()), (sam.encode(&picture).unwrap(), 1));

    // The stored embedding is used unless it is incomplete.
    let path = kept().remove(0);
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, vec![0; bytes.len()]).unwrap();
    assert_ne!(sam.encode(&picture).unwrap(), made);
    fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
    assert_eq!(sam.encode(&picture).unwrap(), made);
    assert_eq!(fs::read(&path).unwrap(), bytes);

    sam.encode(&other_picture).unwrap();
    assert_eq!(kept().len(), 2);
    caching(&ModelFiles { encoder: renamed(&files.encoder, folder.path()), ..files }).encode(&picture).unwrap();
    assert_eq!(kept().len(), 3, "another model's file has its own");
}

/// The model as another producer would have saved it: `producer_name`, field 2 of `ModelProto`, is "x".
fn renamed(model: &Path, folder: &Path) -> std::path::PathBuf {
    let path = folder.join("renamed.onnx");
    fs::write(&path, [fs::read(model).unwrap().as_slice(), &[0x12, 1, b'x']].concat()).unwrap();
    path
}
