//! A scene reads its own files, and others only if the user allows it.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use gprop::scene::{Options, SceneError};
use image::GrayImage;
use serde_json::json;
use tempfile::TempDir;

use super::cameras::as_colmap;
use super::folder::{MadeUp, assert_message};

/// Moves a file or folder of the scene out of it and leaves a link in its place.
fn moved_out(scene: &MadeUp, name: &str) -> (TempDir, PathBuf) {
    let outside = tempfile::tempdir().unwrap();
    let target = outside.path().canonicalize().unwrap().join(Path::new(name).file_name().unwrap());
    fs::rename(scene.path(name), &target).unwrap();
    symlink(&target, scene.path(name)).unwrap();
    (outside, target)
}

/// The scene with its transforms.json written.
fn made_up() -> MadeUp {
    let scene = MadeUp::new();
    scene.load().unwrap();
    scene
}

/// Checks that the scene is refused, with these words and the target of the file, but read with each of `allowing`.
#[track_caller]
fn assert_outside(scene: &MadeUp, target: &Path, words: &[&str], allowing: &[Options]) {
    let refused = scene.load_as_is(&Options::default());
    assert!(matches!(refused, Err(SceneError::Outside { .. })), "{refused:?}");
    assert_message(refused, &[&["outside the scene folder", &*target.to_string_lossy()], words].concat());
    let allow_read = vec![target.parent().unwrap().to_owned()];
    for options in allowing.iter().chain([&Options { allow_read, ..Options::default() }]) {
        assert_eq!(scene.load_as_is(options).unwrap().views.len(), 4, "{options:?}");
    }
}

#[test]
fn photos() {
    // One photo; the folder of all.
    for name in ["images/002.png", "images"] {
        let scene = made_up();
        let (_outside, target) = moved_out(&scene, name);
        let target = if name == "images" { target.join("000.png") } else { target };
        let flag = format!("--images {}", scene.path("").display());
        let named = Options { images: Some(scene.path("")), ..Options::default() };
        assert_outside(&scene, &target, &["photo `", "transforms.json` names", flag.trim_end_matches('/')], &[named]);
    }
    // COLMAP names photos by their folder.
    let scene = made_up();
    as_colmap(&scene);
    let (_outside, target) = moved_out(&scene, "images/002.png");
    let flag = format!("--images {}", scene.path("images").display());
    let named = Options { images: Some(scene.path("images")), ..Options::default() };
    assert_outside(&scene, &target, &["photo `", "sparse/0` names", &flag], &[named]);
}

#[test]
fn a_colmap_model_finds_no_photos_in_the_folder_above_the_scene() {
    // The third folder above `sparse/0` is the one that contains the scene, and scenes of other people.
    let home = tempfile::tempdir().unwrap();
    let scene = made_up();
    as_colmap(&scene);
    let folder = home.path().join("scene");
    copy(&scene.path(""), &folder);
    fs::rename(folder.join("images"), home.path().join("images")).unwrap();
    let load = |options: &Options| gprop::scene::load(&folder, options);
    let images = home.path().join("images");
    assert_message(load(&Options::default()), &["outside the scene folder", &format!("--images {}", images.display())]);
    assert_eq!(load(&Options { images: Some(images), ..Options::default() }).unwrap().views.len(), 4);
}

#[test]
fn masks() {
    let scene = made_up();
    fs::create_dir(scene.path("masks")).unwrap();
    for view in ["000", "001", "002", "003"] {
        GrayImage::from_pixel(8, 6, image::Luma([255])).save(scene.path("masks").join(format!("{view}.png"))).unwrap();
    }
    let (_outside, target) = moved_out(&scene, "masks");
    let flag = format!("--masks {}", scene.path("masks").display());
    let named = Options { masks: Some(scene.path("masks")), ..Options::default() };
    assert_outside(&scene, &target.join("000.png"), &["mask `", &flag], &[named]);

    // A mask that a frame names.
    let mut scene = MadeUp::new();
    let outside = tempfile::tempdir().unwrap();
    let mask = outside.path().canonicalize().unwrap().join("000.png");
    GrayImage::new(8, 6).save(&mask).unwrap();
    let climbing = format!("{}{}", "../".repeat(20), mask.display());
    for name in [mask.display().to_string(), climbing] {
        scene.transforms["frames"][0]["mask_path"] = json!(name);
        let named = Options { masks: Some(outside.path().to_owned()), ..Options::default() };
        assert!(scene.load_with(&named).unwrap().views[0].mask.is_some());
        assert_outside(&scene, &mask, &["mask `", "transforms.json` names", "--masks "], &[]);
    }
}

#[test]
fn splats_and_cameras() {
    let scene = made_up();
    let (_outside, target) = moved_out(&scene, "point_cloud.ply");
    let named = Options { splat: Some(scene.path("point_cloud.ply")), ..Options::default() };
    assert_outside(&scene, &target, &["splat `", "--splat "], &[named]);

    let scene = made_up();
    let (_outside, target) = moved_out(&scene, "transforms.json");
    let named = Options { cameras: Some(scene.path("transforms.json")), ..Options::default() };
    assert_outside(&scene, &target, &["camera file `", "--cameras "], &[named]);

    for name in ["sparse/0/images.bin", "sparse/0", "sparse"] {
        let scene = made_up();
        as_colmap(&scene);
        let (_outside, target) = moved_out(&scene, name);
        let flag = format!("--cameras {}", scene.path("sparse/0").display());
        let named = Options { cameras: Some(scene.path("sparse/0")), ..Options::default() };
        assert_outside(&scene, &target, &["camera file `", &flag], &[named]);
    }
}

#[test]
fn nerfstudios_transform_belongs_to_what_lies_beside_it() {
    let identity = json!({"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1.0}).to_string();
    let scene = made_up();
    fs::write(scene.path("dataparser_transforms.json"), &identity).unwrap();
    let (_outside, target) = moved_out(&scene, "dataparser_transforms.json");
    assert_outside(&scene, &target, &["camera file `", "dataparser_transforms.json"], &[]);
    // If the user names a splat, the files beside it are allowed too.
    let (scene, export) = (made_up(), tempfile::tempdir().unwrap());
    fs::write(export.path().join("dataparser_transforms.json"), &identity).unwrap();
    fs::copy(scene.path("point_cloud.ply"), export.path().join("splat.ply")).unwrap();
    let options = Options { splat: Some(export.path().join("splat.ply")), ..Options::default() };
    let loaded = scene.load_as_is(&options).unwrap();
    assert!(loaded.files.iter().any(|file| file.ends_with("dataparser_transforms.json")), "{:?}", loaded.files);
}

#[test]
fn links_within_the_scene_and_to_it_are_fine() {
    let scene = made_up();
    fs::create_dir(scene.path("raw")).unwrap();
    for name in ["images/001.png", "point_cloud.ply", "transforms.json"] {
        let target = scene.path("raw").join(Path::new(name).file_name().unwrap());
        fs::rename(scene.path(name), &target).unwrap();
        symlink(&target, scene.path(name)).unwrap();
    }
    assert_eq!(scene.load_as_is(&Options::default()).unwrap().views.len(), 4);
    let elsewhere = tempfile::tempdir().unwrap();
    let link = elsewhere.path().join("link");
    symlink(scene.path(""), &link).unwrap();
    assert_eq!(gprop::scene::load(&link, &Options::default()).unwrap().views.len(), 4);
}

#[test]
fn a_name_that_climbs_out_is_looked_for_where_the_user_says() {
    let mut scene = MadeUp::new();
    let outside = tempfile::tempdir().unwrap();
    fs::rename(scene.path("images"), outside.path().join("images")).unwrap();
    for frame in 0..4 {
        scene.transforms["frames"][frame]["file_path"] = json!(format!("../elsewhere/{frame:03}.png"));
    }
    let leads_to = scene.path("").canonicalize().unwrap().parent().unwrap().join("elsewhere/000.png");
    scene.assert_refused(&[
        "frame 0",
        "leads out of the scene folder, to",
        &*leads_to.to_string_lossy(),
        "--images DIR",
    ]);
    let named = Options { images: Some(outside.path().join("images")), ..Options::default() };
    assert_eq!(scene.load_with(&named).unwrap().views.len(), 4);
}

#[test]
fn a_name_that_climbs_is_judged_by_where_links_lead() {
    let mut scene = MadeUp::new();
    for frame in 0..4 {
        scene.transforms["frames"][frame]["file_path"] = json!(format!("../images/{frame:03}.png"));
    }
    fs::create_dir(scene.path("nerf")).unwrap();
    fs::write(scene.path("nerf/transforms.json"), scene.transforms.to_string()).unwrap();
    let named = Options { cameras: Some(scene.path("nerf/transforms.json")), ..Options::default() };
    assert_eq!(scene.load_as_is(&named).unwrap().views.len(), 4);
    let (_outside, photo) = moved_out(&scene, "images/002.png");
    let refused = scene.load_as_is(&named);
    assert_message(refused, &["photo `", "outside the scene folder", &*photo.to_string_lossy()]);
    // The name climbs from where the cameras are, not from the link to them.
    let (outside, _) = moved_out(&scene, "nerf");
    let leads_to = outside.path().canonicalize().unwrap().join("images/000.png");
    assert_message(scene.load_as_is(&named), &["leads out of the scene folder", &*leads_to.to_string_lossy()]);
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copy(&path, &target) } else { fs::copy(&path, &target).map(drop).unwrap() }
    }
}
