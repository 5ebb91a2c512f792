//! `gprop segment PICTURE` as a user types it, with pictures of every kind and the files written for them. The tiny
//! models of `fixtures/sam` are used if SAM's result does not matter.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use gprop::segment::LabelMap;
use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};

use super::models::tiny;
use super::root;
use crate::run::gprop;
use crate::support::{models, python, python_has, stderr};

/// `gprop segment PICTURE` with the tiny models; `None` if there is no ONNX Runtime to run them.
fn segment(test: &str, picture: &Path, arguments: &[&str]) -> Option<Output> {
    let files = tiny(test, "multi_mask")?;
    let mut command = gprop();
    command.arg("segment").arg(picture).arg("--sam-encoder").arg(files.encoder).arg("--sam-decoder").arg(files.decoder);
    Some(command.args(["--points-per-side", "4"]).args(arguments).output().unwrap())
}

/// The file in the picture's work folder.
fn written(picture: &Path, name: &str) -> PathBuf {
    picture.with_extension("gprop").join("segments").join(name)
}

fn map_of(picture: &Path) -> LabelMap {
    let name = format!("{}.png", picture.file_stem().unwrap().to_string_lossy());
    LabelMap::from_png(&fs::read(written(picture, &name)).unwrap()).unwrap()
}

/// A red square on a green ground, with a transparent border.
fn coloured(width: u32, height: u32) -> RgbaImage {
    RgbaImage::from_fn(width, height, |x, y| match (x * 10 / width, y * 10 / height) {
        (3..5, 3..6) => Rgba([230, 40, 20, 255]),
        (1..9, 1..8) => Rgba([30, 140, 60, 255]),
        _ => Rgba([0; 4]),
    })
}

#[test]
fn pictures_of_every_kind_are_segmented() {
    let test = "pictures_of_every_kind_are_segmented";
    let folder = tempfile::tempdir().unwrap();
    let colours = DynamicImage::from(coloured(60, 40));
    let pictures: [(&str, DynamicImage); 7] = [
        ("dot.png", RgbImage::from_pixel(1, 1, Rgb([9, 90, 200])).into()),
        ("line.png", RgbImage::from_pixel(1, 3000, Rgb([9, 90, 200])).into()),
        ("grey.png", colours.to_luma8().into()),
        ("grey.tif.png", colours.to_luma16().into()),
        ("deep.png", colours.to_rgba16().into()),
        ("photo.jpg", colours.to_rgb8().into()),
        ("dull.jpg", GrayImage::from_fn(50, 30, |x, y| Luma([(x * 4 + y) as u8])).into()),
    ];
    let mut files: Vec<PathBuf> = Vec::new();
    for (name, picture) in pictures {
        files.push(folder.path().join(name));
        picture.save(files.last().unwrap()).unwrap();
    }
    files.push(folder.path().join("cmyk.jpg"));
    fs::copy(root().join("fixtures/pictures/cmyk.jpg"), files.last().unwrap()).unwrap();
    for path in files {
        let Some(output) = segment(test, &path, &[]) else { return };
        assert_eq!(output.status.code(), Some(0), "{path:?}: {}", stderr(&output));
        let (map, picture) = (map_of(&path), image::open(&path).unwrap());
        assert_eq!((map.width, map.height), (picture.width(), picture.height()), "{path:?}");
        assert!(map.labels.iter().any(|&label| label > 0), "{path:?} has no segment");
    }
}

#[test]
fn a_picture_that_is_not_whole_is_named() {
    let test = "a_picture_that_is_not_whole_is_named";
    let folder = tempfile::tempdir().unwrap();
    let picture = RgbImage::from_fn(80, 60, |x, y| Rgb([(x * y) as u8, (x + y) as u8, (x ^ y) as u8]));
    for name in ["cut.png", "cut.jpg"] {
        let path = folder.path().join(name);
        picture.save(&path).unwrap();
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let Some(output) = segment(test, &path, &[]) else { return };
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        assert!(stderr(&output).contains(name) && stderr(&output).contains("cannot be decoded"), "{}", stderr(&output));
        assert!(!path.with_extension("gprop").exists());
    }
    let missing = folder.path().join("none.png");
    let Some(output) = segment(test, &missing, &[]) else { return };
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
}

#[test]
fn the_largest_picture_fits_into_memory() {
    let test = "the_largest_picture_fits_into_memory";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.png");
    const SIDE: u32 = 20_000;
    GrayImage::from_fn(SIDE, SIDE, |x, y| Luma([if x < SIDE / 2 && y < SIDE / 2 { 250 } else { 20 }]))
        .save(&path)
        .unwrap();
    let Some(output) = segment(test, &path, &["--json"]) else { return };
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let map = map_of(&path);
    assert_eq!((map.width, map.height), (SIDE, SIDE));
    let shown: Value = serde_json::from_slice(&output.stdout).unwrap();
    for segment in shown["segments"].as_array().unwrap() {
        let area = map.labels.iter().filter(|&&label| u64::from(label) == segment["id"].as_u64().unwrap()).count();
        assert_eq!(segment["area"], json!(area));
    }
}

#[test]
fn where_sam_finds_nothing_the_whole_foreground_is_one_segment() {
    let test = "where_sam_finds_nothing_the_whole_foreground_is_one_segment";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("thing.png");
    coloured(60, 40).save(&path).unwrap();
    let Some(output) = segment(test, &path, &["--min-predicted-iou", "1", "--min-stability", "1"]) else { return };
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("SAM found no segments in view thing"), "{}", stderr(&output));
    let map = map_of(&path);
    for (pixel, label) in coloured(60, 40).pixels().zip(map.labels) {
        assert_eq!(label, u16::from(pixel[3] == 255));
    }
}

#[test]
fn a_model_cut_short_ends_with_its_own_code() {
    let Some(files) = models("a_model_cut_short_ends_with_its_own_code") else { return };
    let folder = tempfile::tempdir().unwrap();
    let (picture, cut) = (folder.path().join("thing.png"), folder.path().join("cut.onnx"));
    coloured(60, 40).save(&picture).unwrap();
    let whole = fs::read(&files.decoder).unwrap();
    fs::write(&cut, &whole[..whole.len() - 1000]).unwrap();
    let output = gprop().arg("segment").arg(&picture).arg("--sam-decoder").arg(&cut).output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    assert!(stderr(&output).contains("cut.onnx"), "{}", stderr(&output));
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    if models("bytes_do_not_depend_on_the_number_of_threads").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let picture = root().join("fixtures/hammer/images/003.png");
    let bytes = |threads: &str| {
        let out = folder.path().join(threads);
        let mut command: Command = gprop();
        command.arg("segment").arg(&picture).arg("--out").arg(&out).args(["--threads", threads]);
        let output = command.args(["--points-per-side", "12", "--also", "npy,coco"]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        ["003.png", "003_s.npy", "coco.json", "segments.json"]
            .map(|name| fs::read(out.join("segments").join(name)).unwrap())
    };
    assert!(bytes("1") == bytes("2"));
}

#[test]
fn other_forms_are_read_by_the_programs_that_they_are_for() {
    let test = "other_forms_are_read_by_the_programs_that_they_are_for";
    if !python_has(test, "numpy", "numpy") || !python_has(test, "pillow", "PIL") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("thing.png");
    coloured(60, 40).save(&path).unwrap();
    let Some(output) = segment(test, &path, &["--min-predicted-iou", "0.1", "--also", "langsplat,coco"]) else {
        return;
    };
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let script = root().join("tests/segment/read_segments.py");
    let files = ["thing.png", "thing_s.npy"].map(|name| written(&path, name));
    let found = python(&script, &[&files[0], &files[1]]);
    let segments = map_of(&path).labels.into_iter().max().unwrap();
    assert_eq!(
        found,
        json!({ "png": "I;16", "dtype": "int32", "shape": [4, 40, 60], "least": -1, "most": segments - 1, "same": true })
    );
    if python_has(test, "pycocotools", "pycocotools.mask") {
        let coco = written(&path, "coco.json");
        assert_eq!(
            python(&script, &[&files[0], &coco]),
            json!({ "annotations": segments, "same": true, "areas": true })
        );
    }
}

/// The other formats are of the label maps beside them and name the photos; later stages do not depend on them.
#[test]
fn other_formats_follow_the_label_maps() {
    let (scene, masks) = (crate::run::hammer(), tempfile::tempdir().unwrap());
    let paint = |object: u16| {
        let png: ImageBuffer<Luma<u16>, Vec<u16>> =
            ImageBuffer::from_fn(512, 512, |x, _| Luma([if x < 200 { 0 } else { object }]));
        png.save(masks.path().join("003.png")).unwrap();
    };
    let run = |arguments: &[&str]| {
        let mut command = gprop();
        command.arg("segment").arg(scene.path()).args(["--view-list", "003", "--segments"]).arg(masks.path());
        let output = command.args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stderr(&output)
    };
    let folder = scene.path().join("gprop/segments");
    let digest = || {
        let record: Value = serde_json::from_slice(&fs::read(scene.path().join("gprop/run.json")).unwrap()).unwrap();
        let stage = record["stages"].as_array().unwrap().iter().find(|stage| stage["name"] == "segment").unwrap();
        stage["digest"].as_str().unwrap().to_owned()
    };
    paint(1);
    run(&[]);
    let alone = digest();
    run(&["--also", "npy,coco"]);
    assert_eq!(digest(), alone, "later stages stay valid");
    let coco: Value = serde_json::from_slice(&fs::read(folder.join("coco.json")).unwrap()).unwrap();
    assert_eq!(coco["images"][0]["file_name"], "images/003.png");
    assert!(folder.join("003_s.npy").exists());

    paint(0);
    let warned = run(&[]);
    assert!(warned.contains("the label map of view 003") && warned.contains("only background"), "{warned}");
    assert!(!folder.join("coco.json").exists() && !folder.join("003_s.npy").exists());
    assert_ne!(digest(), alone);

    // Arrays in the folder that the user names are the user's, even if it is gprop's own.
    let map = LabelMap { width: 512, height: 512, labels: vec![1; 512 * 512] };
    map.write_npy(None, &mut fs::File::create(folder.join("003_s.npy")).unwrap()).unwrap();
    fs::remove_file(folder.join("003.png")).unwrap();
    let mut command = gprop();
    command.arg("segment").arg(scene.path()).args(["--view-list", "003", "--segments"]).arg(&folder);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(folder.join("003.png").exists() && folder.join("003_s.npy").exists());
}

/// A label map, as the 16-bit PNG or as the array of other programs, is read back unchanged.
#[test]
fn masks_made_elsewhere_replace_the_stage() {
    let (scene, masks) = (crate::run::hammer(), tempfile::tempdir().unwrap());
    let label = |x: u32, y: u32| match (x, y) {
        (0..200, _) => 0,
        (_, 0..256) => 40,
        _ => 7,
    };
    let png: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_fn(512, 512, |x, y| Luma([label(x, y)]));
    png.save(masks.path().join("003.png")).unwrap();
    let map = LabelMap { width: 512, height: 512, labels: png.into_raw() };
    map.write_npy(None, &mut fs::File::create(masks.path().join("022_s.npy")).unwrap()).unwrap();
    let no_model = masks.path().join("none.onnx");
    fs::write(&no_model, "").unwrap();
    let run = |views: &str| {
        let mut command = gprop();
        command.arg("segment").arg(scene.path()).args(["--view-list", views, "--segments"]).arg(masks.path());
        command.arg("--sam-encoder").arg(&no_model).output().unwrap()
    };
    let output = run("003,022");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for name in ["003.png", "022.png"] {
        let bytes = fs::read(scene.path().join("gprop/segments").join(name)).unwrap();
        let found = LabelMap::from_png(&bytes).unwrap();
        // Ids are renumbered: 7 is the first, 40 the second.
        assert_eq!([found.at(0, 0), found.at(300, 400), found.at(300, 100)], [0, 1, 2], "{name}");
    }

    let output = run("003,010");
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("010.png nor 010_s.npy"), "{}", stderr(&output));
    GrayImage::new(512, 500).save(masks.path().join("010.png")).unwrap();
    let output = run("003,010");
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("512 x 500"), "{}", stderr(&output));
}
