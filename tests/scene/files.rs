//! Files as people have them: photos under other names, models and splats among several, masks of every naming.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use gprop::scene::{Options, Scene, SceneError};
use image::{GrayImage, Luma, RgbImage};
use serde_json::{Value, json};

use super::cameras::{as_3dgs_output, as_colmap};
use super::folder::{MadeUp, assert_message, options};

/// The scene with its transforms.json written.
fn made_up() -> MadeUp {
    let made_up = MadeUp::new();
    made_up.load().unwrap();
    made_up
}

fn move_to(made_up: &MadeUp, from: &str, to: &str) {
    let to = made_up.path(to);
    fs::create_dir_all(to.parent().unwrap()).unwrap();
    fs::rename(made_up.path(from), to).unwrap();
}

#[track_caller]
fn loaded(made_up: &MadeUp) -> Scene {
    made_up.load_as_is(&Options::default()).unwrap()
}

#[track_caller]
fn assert_noted(scene: &Scene, words: &[&str]) {
    let has_all = |note: &String| words.iter().all(|word| note.contains(word));
    assert!(scene.notes.iter().any(has_all), "no note has {words:?}: {:#?}", scene.notes);
}

#[test]
fn a_photo_may_have_another_extension_case_or_unicode_form() {
    let mut made_up = MadeUp::new();
    made_up.transforms["frames"][3]["file_path"] = json!("images/caf\u{e9} 3.jpg");
    move_to(&made_up, "images/000.png", "images/000.JPG");
    move_to(&made_up, "images/001.png", "images/001.PNG");
    move_to(&made_up, "images/002.png", "Images/002.tif");
    move_to(&made_up, "images/003.png", "images/Cafe\u{301} 3.webp");
    let scene = made_up.load().unwrap();
    let images: Vec<_> = scene.views.iter().map(|view| view.image.clone()).collect();
    let expected = ["images/000.JPG", "images/001.PNG", "Images/002.tif", "images/Cafe\u{301} 3.webp"];
    assert_eq!(images, expected.map(|name| made_up.path(name)));
    assert_noted(&scene, &["4 photos were found under another name", "first: `images/000.png` is `images/000.JPG`"]);
    // So it is in the folder that the user names.
    let folder = made_up.path("images");
    let named = Options { images: Some(folder), ..Options::default() };
    assert_eq!(made_up.load_as_is(&named).unwrap().views.len(), 3);
}

#[test]
fn of_several_photos_with_nearly_the_name_none_is_taken() {
    let mut made_up = made_up();
    move_to(&made_up, "images/001.png", "images/001.jpg");
    fs::copy(made_up.path("images/001.jpg"), made_up.path("images/001.webp")).unwrap();
    made_up.assert_refused(&["photo `images/001.png`", "images/001.jpg`", "images/001.webp`", "--images DIR"]);
    // Nor if the camera file gives no extension; a mask beside it has another name.
    fs::remove_file(made_up.path("images/001.webp")).unwrap();
    fs::copy(made_up.path("images/001.jpg"), made_up.path("images/001.jpg.png")).unwrap();
    made_up.transforms["frames"][1]["file_path"] = json!("./images/001");
    let scene = made_up.load().unwrap();
    assert_eq!(scene.views.len(), 4);
    assert!(!scene.notes.iter().any(|note| note.contains("another name")), "{:?}", scene.notes);
    fs::copy(made_up.path("images/001.jpg"), made_up.path("images/001.bmp")).unwrap();
    made_up.assert_refused(&["photo `./images/001`", "images/001.bmp`", "images/001.jpg`"]);
}

#[test]
fn a_photo_may_be_in_a_folder_below() {
    // Old readers of 3DGS keep only the name up to the first dot.
    let scene = made_up();
    as_3dgs_output(&scene);
    move_to(&scene, "images/000.png", "images/cam0/000.png");
    move_to(&scene, "images/001.png", "images/cam0/001.png");
    move_to(&scene, "images/002.png", "images/cam1/002.v2.png");
    let found = loaded(&scene);
    assert_eq!(found.views.len(), 4);
    assert!(found.views[2].image.ends_with("images/cam1/002.v2.png"));
    assert_noted(&found, &["photos: 1 in `images`, 2 in `images/cam0`, 1 in `images/cam1`"]);
    assert_noted(&found, &["3 photos were found", "first: `000` is `images/cam0/000.png`"]);
    fs::copy(scene.path("images/cam0/000.png"), scene.path("images/cam1/000.png")).unwrap();
    let refused = scene.load_as_is(&Options::default());
    assert_message(refused, &["photo `000`", "images/cam0/000.png`", "images/cam1/000.png`"]);
    // A folder that is not known for photos, if there are none elsewhere.
    let scene = made_up();
    as_colmap(&scene);
    move_to(&scene, "images", "photos of the cup");
    assert_eq!(loaded(&scene).views[3].image, scene.path("photos of the cup/003.png"));
}

#[test]
fn one_folder_of_a_rig_does_not_stand_in_for_another() {
    let mut made_up = MadeUp::new();
    fs::create_dir(made_up.path("images/right")).unwrap();
    RgbImage::new(8, 6).save(made_up.path("images/right/000.png")).unwrap();
    made_up.transforms["frames"][0]["file_path"] = json!("images/left/000.png");
    fs::remove_file(made_up.path("images/000.png")).unwrap();
    let scene = made_up.load().unwrap();
    assert_eq!(scene.views.len(), 3);
    let words = ["1 of the 4 photos", "images/left/000.png", "has 4 pictures"];
    assert!(words.iter().all(|word| scene.warnings[0].contains(word)), "{:?}", scene.warnings);
}

#[test]
fn smaller_copies_are_used_if_they_are_all_there_is() {
    for smaller in ["images_2", "images_4", "images_8"] {
        for is_colmap in [false, true] {
            let scene = made_up();
            if is_colmap {
                as_colmap(&scene);
            }
            fs::rename(scene.path("images"), scene.path(smaller)).unwrap();
            let found = loaded(&scene);
            assert_eq!((found.views.len(), &found.views[1].image), (4, &scene.path(smaller).join("001.png")));
            assert_noted(&found, &[&format!("photos: 4 in `{smaller}`")]);
        }
    }
}

#[test]
fn colmaps_undistorted_photos_come_with_their_cameras() {
    for dense in ["dense", "dense/0"] {
        let scene = made_up();
        as_colmap(&scene);
        move_to(&scene, "images", &format!("{dense}/images"));
        // Only the cameras of the photos as they were taken.
        let found = loaded(&scene);
        assert_eq!((found.views.len(), &found.views[1].image), (4, &scene.path(dense).join("images/001.png")));
        // Both; the photos as they were taken are elsewhere, or here.
        let model = format!("{dense}/sparse");
        fs::create_dir(scene.path(&model)).unwrap();
        for file in ["cameras.bin", "images.bin"] {
            fs::copy(scene.path("sparse/0").join(file), scene.path(&model).join(file)).unwrap();
        }
        let found = loaded(&scene);
        assert_noted(&found, &[&format!("cameras: `{model}` (also there: `sparse/0`")]);
        assert_eq!(found.views[1].image, scene.path(dense).join("images/001.png"));
        fs::create_dir(scene.path("images")).unwrap();
        fs::copy(scene.path(dense).join("images/001.png"), scene.path("images/001.png")).unwrap();
        assert_noted(&loaded(&scene), &["cameras: `sparse/0` (also there: ", &model]);
        let named = Options { cameras: Some(scene.path("dense")), ..Options::default() };
        let found = scene.load_as_is(&named).unwrap();
        assert_eq!(found.views[1].image, scene.path(dense).join("images/001.png"));
    }
}

#[test]
fn photos_that_are_not_found_are_answered_with_what_is_there() {
    let scene = made_up();
    for n in 0..4 {
        move_to(&scene, &format!("images/{n:03}.png"), &format!("images/frame_{n}.png"));
    }
    fs::write(scene.path("images/notes.txt"), "").unwrap();
    scene.assert_refused(&[
        "none of the 4 photos",
        "images`, which has frame_0.png frame_1.png frame_2.png frame_3.png",
    ]);
    fs::copy(scene.path("images/frame_0.png"), scene.path("images/frame_4.png")).unwrap();
    scene.assert_refused(&["frame_3.png and 1 more"]);
}

#[test]
fn a_search_stays_in_the_scene() {
    let outside = tempfile::tempdir().unwrap();
    RgbImage::new(8, 6).save(outside.path().join("000.jpg")).unwrap();
    // A link to a photo is refused under whatever name it is found.
    let scene = made_up();
    fs::remove_file(scene.path("images/000.png")).unwrap();
    symlink(outside.path().join("000.jpg"), scene.path("images/000.jpg")).unwrap();
    let refused = scene.load_as_is(&Options::default());
    assert!(matches!(refused, Err(SceneError::Outside(_))), "{refused:?}");
    // A folder elsewhere is not searched, and its names are not told.
    fs::remove_dir_all(scene.path("images")).unwrap();
    for link in ["images", "pictures"] {
        symlink(outside.path(), scene.path(link)).unwrap();
        let message = scene.load_as_is(&Options::default()).unwrap_err().to_string();
        assert!(message.contains("none of the 4 photos") && !message.contains("000.jpg"), "{message}");
    }
    let named = Options { images: Some(outside.path().to_owned()), ..Options::default() };
    assert_eq!(scene.load_as_is(&named).unwrap().views.len(), 1);
    // A circle of links ends.
    let scene = made_up();
    symlink(scene.path(""), scene.path("images/around")).unwrap();
    move_to(&scene, "images/000.png", "images/deep/000.png");
    assert_eq!(loaded(&scene).views.len(), 4);
}

/// The COLMAP model of the scene in two parts: one photo in `sparse/0`, three in `sparse/1`.
fn in_two_models(made_up: &MadeUp) {
    let original = as_colmap(made_up);
    for (model, views) in [("sparse/0", &original.views[..1]), ("sparse/1", &original.views[1..])] {
        let folder = made_up.path(model);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("cameras.txt"), "1 SIMPLE_PINHOLE 8 6 10 4 3\n").unwrap();
        let line = |view: &gprop::scene::View| {
            let (q, t) = (view.camera.camera_from_world.rotation, view.camera.camera_from_world.translation);
            format!("1 {} {} {} {} {} {} {} 1 {}.png\n\n", q.w, q.i, q.j, q.k, t.x, t.y, t.z, view.name)
        };
        fs::write(folder.join("images.txt"), views.iter().map(line).collect::<String>()).unwrap();
    }
}

#[test]
fn the_largest_of_several_models_is_used_and_said_to_be() {
    let scene = made_up();
    in_two_models(&scene);
    let words =
        ["cameras: `sparse/1`, the largest of 2 models, with 3 photos (also there: `sparse/0`; --cameras chooses)"];
    for cameras in [None, Some(scene.path("sparse")), Some(scene.path(""))] {
        let found = scene.load_as_is(&Options { cameras, ..Options::default() }).unwrap();
        assert_eq!(found.views.len(), 3);
        assert_noted(&found, &words);
        assert_noted(
            &found,
            &["1 of the 4 photos there has no camera in `sparse/1` and is left out (first: `images/000.png`)"],
        );
    }
    let named = Options { cameras: Some(scene.path("sparse/0")), ..Options::default() };
    assert_eq!(scene.load_as_is(&named).unwrap().views.len(), 1);
    // What is chosen is in the record of the run too.
    let run = Command::new(env!("CARGO_BIN_EXE_gprop")).args(["run", "--to", "scene"]).arg(scene.path("")).output();
    let run = run.unwrap();
    let told = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{told}");
    let record: Value = serde_json::from_slice(&fs::read(scene.path("gprop/run.json")).unwrap()).unwrap();
    let notes = record["stages"][0]["notes"].to_string();
    assert!(notes.contains("the largest of 2 models") && notes.contains("has no camera"), "{notes}");
}

#[test]
fn a_model_that_claims_more_images_than_it_has_is_not_the_largest() {
    let scene = made_up();
    in_two_models(&scene);
    let folder = scene.path("sparse/2");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("cameras.bin"), 1_u64.to_le_bytes()).unwrap();
    fs::write(folder.join("images.bin"), u64::MAX.to_le_bytes()).unwrap();
    assert_noted(&loaded(&scene), &["cameras: `sparse/1`, the largest of 3 models"]);
}

#[test]
fn every_photo_of_a_model_without_lines_of_points_is_read() {
    let scene = made_up();
    as_colmap(&scene);
    for file in ["cameras.bin", "images.bin"] {
        fs::remove_file(scene.path("sparse/0").join(file)).unwrap();
    }
    fs::write(scene.path("sparse/0/cameras.txt"), "1 SIMPLE_PINHOLE 8 6 10 4 3\n").unwrap();
    let model = |text: &str| {
        fs::write(scene.path("sparse/0/images.txt"), text).unwrap();
        loaded(&scene)
    };
    let line = |n: usize| format!("{n} 1 0 0 0 0 0 0 1 {n:03}.png\n");
    let found = model(&(0..4).map(line).collect::<String>());
    assert_eq!(found.views.len(), 4);
    assert_noted(&found, &["images.txt` has no line of points after 3 of its 4 photos; all of them are read"]);
    // Some have points, some an empty line, some none; a name may be a number.
    fs::rename(scene.path("images/003.png"), scene.path("images/3")).unwrap();
    let mixed = format!("{}1.5 2.5 -1 3 4 7 5 6 8 7 8 9\n{}\n{}3 1 0 0 0 0 0 0 1 3\n", line(0), line(1), line(2));
    let found = model(&mixed);
    assert_eq!(found.views.len(), 4);
    assert_noted(&found, &["after 1 of its 4 photos"]);
    fs::rename(scene.path("images/3"), scene.path("images/003.png")).unwrap();
    let usual = model(&(0..4).map(|n| line(n) + "\n").collect::<String>());
    assert!(!usual.notes.iter().any(|note| note.contains("line of points")), "{:?}", usual.notes);
}

#[test]
fn the_latest_splat_of_a_series_is_used_whatever_it_is_called() {
    let series: [&[&str]; 6] = [
        &["cup_7000.ply", "cup_15000.ply", "cup_30000.ply"],
        &["step-000000900.ply", "step-000029999.ply"],
        &["point_cloud/step_900/point_cloud.ply", "point_cloud/step_1000/point_cloud.ply"],
        &["point_cloud/iteration_7000.ply", "point_cloud/iteration_30000.ply"],
        &["exports/run_2/splat.ply", "exports/run_10/splat.ply"],
        &["ply/splat_7000.ply", "ply/splat_15000.ply", "ply/splat_30000.ply"],
    ];
    for places in series {
        let scene = made_up();
        let splat = fs::read(scene.path("point_cloud.ply")).unwrap();
        fs::remove_file(scene.path("point_cloud.ply")).unwrap();
        for place in places {
            fs::create_dir_all(scene.path(place).parent().unwrap()).unwrap();
            fs::write(scene.path(place), &splat).unwrap();
        }
        let latest = places[places.len() - 1];
        let note = format!("splat: `{latest}`, the latest of {} (also there: `", places.len());
        assert_noted(&loaded(&scene), &[&note]);
    }
    // A point cloud that nerfstudio exports is none of them.
    let scene = made_up();
    move_to(&scene, "point_cloud.ply", "exports/splat/splat.ply");
    fs::create_dir(scene.path("exports/pcd")).unwrap();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    fs::write(scene.path("exports/pcd/point_cloud.ply"), cloud).unwrap();
    assert_noted(&loaded(&scene), &["splat: `exports/splat/splat.ply`"]);
    assert!(!loaded(&scene).notes[0].contains("also there"));
}

fn save_mask(path: &Path) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let png = path.with_extension("png");
    GrayImage::from_fn(8, 6, |x, _| Luma([if x < 4 { 255 } else { 0 }])).save(&png).unwrap();
    fs::rename(png, path).unwrap();
}

#[test]
fn masks_have_many_names() {
    for name in [
        "masks/001.png",
        "masks/001.PNG",
        "masks/001.tif",
        "masks/001.png.png",
        "masks/001_mask.png",
        "masks/001.mask.png",
        "masks/mask_001.png",
        "masks/cup/001.png",
        "mask/001.png",
        "Mask/001_mask.PNG",
        "images/mask/001.png",
        "images/001_mask.png",
        "images/001.png.png",
    ] {
        let scene = made_up();
        save_mask(&scene.path(name));
        let found = loaded(&scene);
        assert_eq!(found.views[1].mask.as_ref().map(|mask| mask.path.clone()), Some(scene.path(name)), "{name}");
        assert_eq!(found.views.len(), 4, "{name}");
        assert!(found.views.iter().filter(|view| view.mask.is_some()).count() == 1, "{name}");
        assert_noted(&found, &["masks: 1, first `", name]);
    }
    let scene = made_up();
    save_mask(&scene.path("masks/001_mask.png"));
    save_mask(&scene.path("masks/001-mask.png"));
    scene.assert_refused(&["001_mask.png", "001-mask.png", "--masks DIR"]);
}

#[test]
fn masks_that_belong_to_no_photo_are_an_error() {
    let scene = made_up();
    save_mask(&scene.path("mask/frame_1.png"));
    scene.assert_refused(&["no mask for any of the 4 views", "mask`, which has frame_1.png", "000.png"]);
    let named = options(&["--masks", scene.path("mask").to_str().unwrap()]).unwrap();
    assert_message(scene.load_as_is(&named), &["no mask for any of the 4 views", "which has frame_1.png"]);
    // One that is there is used, and the views without one are named.
    save_mask(&scene.path("mask/001.png"));
    let found = loaded(&scene);
    assert!(found.warnings[0].contains("`mask` has no mask for 3 of 4 views: 000, 002, 003"), "{:?}", found.warnings);
}

#[test]
fn masks_that_hide_everything_are_an_error() {
    let scene = made_up();
    for view in ["000", "001", "002", "003"] {
        save_mask(&scene.path(&format!("masks/{view}.png")));
    }
    assert_eq!(loaded(&scene).views.len(), 4);
    let forced = options(&["--mask-color", "#ff0000"]).unwrap();
    assert_message(scene.load_as_is(&forced), &["4 masks would hide everything", "#ff0000", "000.png", "0,255"]);
    for view in ["000", "001", "002", "003"] {
        GrayImage::new(8, 6).save(scene.path(&format!("masks/{view}.png"))).unwrap();
    }
    scene.assert_refused(&["4 masks would hide everything", "000.png", "--mask-color"]);
}

#[test]
fn colours_of_masks_are_written_as_they_are_read() {
    for text in ["auto", "white", "black", "not-black", "1", "1,2", "#ff0000", "#800000,7"] {
        assert_eq!(options(&["--mask-color", text]).unwrap().mask_color.to_string(), text);
    }
    for text in ["", "red", "#ff00", "256", "-1", "1,,2", "#gg0000"] {
        let refused = options(&[&format!("--mask-color={text}")]).unwrap_err().to_string();
        assert!(refused.contains("white, black"), "{text}: {refused}");
    }
}
