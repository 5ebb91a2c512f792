//! Cameras of every program, built in code and compared with the documentation of each format.

use gprop::camera::{Distortion, Polynomial};
use gprop::scene::cameras::align::{Align, Conversion, SignedPermutation};
use gprop::scene::cameras::gaussian_splatting::TrainingArguments;
use gprop::scene::cameras::{Focal, colmap, transforms};
use gprop::scene::splat::ply;
use gprop::scene::{self, ForegroundSource, Options, Scene, SceneError};
use image::{GrayImage, ImageEncoder, Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use serde_json::json;

use super::folder::{MadeUp, assert_message, hammer, options};
use crate::support::shared;

/// COLMAP's models with their numbers, parameters, and the lens that these describe.
fn colmap_models() -> Vec<(i32, &'static str, Vec<f64>, Distortion)> {
    let fisheye = |radial: [f64; 6], tangential, prism, prism_after_radial| {
        Distortion::Fisheye(Polynomial { radial, tangential, prism, prism_after_radial, ..Default::default() })
    };
    let (none, no_prism) = ([0.0; 2], [0.0; 4]);
    let full = Polynomial {
        radial: [0.1, 0.2, 0.5, 0.0, 0.0, 0.0],
        divisor: [0.6, 0.7, 0.8],
        tangential: [0.3, 0.4],
        ..Default::default()
    };
    let parameters = |values: &[f64]| values.to_vec();
    let two = |lens: &[f64]| [&[10.0, 11.0, 4.0, 3.0], lens].concat();
    vec![
        (0, "SIMPLE_PINHOLE", parameters(&[10.0, 4.0, 3.0]), Distortion::None),
        (1, "PINHOLE", two(&[]), Distortion::None),
        (2, "SIMPLE_RADIAL", parameters(&[10.0, 4.0, 3.0, 0.1]), Distortion::opencv(0.1, 0.0, 0.0, 0.0, 0.0)),
        (3, "RADIAL", parameters(&[10.0, 4.0, 3.0, 0.1, 0.2]), Distortion::opencv(0.1, 0.2, 0.0, 0.0, 0.0)),
        (4, "OPENCV", two(&[0.1, 0.2, 0.3, 0.4]), Distortion::opencv(0.1, 0.2, 0.3, 0.4, 0.0)),
        (5, "OPENCV_FISHEYE", two(&[0.1, 0.2, 0.3, 0.4]), Distortion::fisheye([0.1, 0.2, 0.3, 0.4])),
        (6, "FULL_OPENCV", two(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]), Distortion::Perspective(full)),
        (7, "FOV", two(&[0.9]), Distortion::FieldOfView { omega: 0.9 }),
        (8, "SIMPLE_RADIAL_FISHEYE", parameters(&[10.0, 4.0, 3.0, 0.1]), Distortion::fisheye([0.1, 0.0, 0.0, 0.0])),
        (9, "RADIAL_FISHEYE", parameters(&[10.0, 4.0, 3.0, 0.1, 0.2]), Distortion::fisheye([0.1, 0.2, 0.0, 0.0])),
        (
            10,
            "THIN_PRISM_FISHEYE",
            two(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]),
            fisheye([0.1, 0.2, 0.5, 0.6, 0.0, 0.0], [0.3, 0.4], [0.7, 0.0, 0.8, 0.0], false),
        ),
        (
            11,
            "RAD_TAN_THIN_PRISM_FISHEYE",
            two(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2]),
            fisheye([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.8, 0.7], [0.9, 1.0, 1.1, 1.2], true),
        ),
        (12, "SIMPLE_DIVISION", parameters(&[10.0, 4.0, 3.0, -0.1]), Distortion::Division { k: -0.1 }),
        (13, "DIVISION", two(&[-0.1]), Distortion::Division { k: -0.1 }),
        (14, "SIMPLE_FISHEYE", parameters(&[10.0, 4.0, 3.0]), fisheye([0.0; 6], none, no_prism, false)),
        (15, "FISHEYE", two(&[]), fisheye([0.0; 6], none, no_prism, false)),
        (16, "EUCM", two(&[0.5, 1.1]), Distortion::EnhancedUnified { alpha: 0.5, beta: 1.1 }),
    ]
}

fn cameras_binary(cameras: &[(u32, i32, &[f64])]) -> Vec<u8> {
    let mut file = (cameras.len() as u64).to_le_bytes().to_vec();
    for (id, model, parameters) in cameras {
        file.extend(id.to_le_bytes());
        file.extend(model.to_le_bytes());
        file.extend([8u64, 6].into_iter().flat_map(u64::to_le_bytes));
        file.extend(parameters.iter().flat_map(|value| value.to_le_bytes()));
    }
    file
}

/// Id, quaternion (w x y z), translation, camera, name.
type ImageRow<'a> = (u32, [f64; 4], [f64; 3], u32, &'a str);

fn images_binary(images: &[ImageRow]) -> Vec<u8> {
    let mut file = (images.len() as u64).to_le_bytes().to_vec();
    for (id, quaternion, translation, camera, name) in images {
        file.extend(id.to_le_bytes());
        file.extend(quaternion.iter().chain(translation).flat_map(|value| value.to_le_bytes()));
        file.extend(camera.to_le_bytes());
        file.extend(name.bytes().chain([0]));
        // Two observed points.
        file.extend(2u64.to_le_bytes());
        file.extend([7; 48]);
    }
    file
}

#[test]
fn every_colmap_model_is_read_from_both_formats() {
    for (number, name, parameters, distortion) in colmap_models() {
        let binary = colmap::parse_cameras_binary(&cameras_binary(&[(3, number, &parameters)])).unwrap();
        let words: Vec<String> = parameters.iter().map(f64::to_string).collect();
        let text = colmap::parse_cameras_text(&format!("# a remark\n3 {name} 8 6 {}\n", words.join(" "))).unwrap();
        assert_eq!(binary, text, "{name}");
        let camera = binary[&3];
        assert_eq!((camera.size, camera.cx, camera.cy), (Some((8, 6)), Some(4.0), Some(3.0)), "{name}");
        let shared_focal = name.starts_with("SIMPLE") || name.starts_with("RADIAL");
        assert_eq!(
            (camera.fx, camera.fy),
            (Focal::Pixels(10.0), Some(Focal::Pixels(if shared_focal { 10.0 } else { 11.0 })))
        );
        assert_eq!(camera.distortion, distortion, "{name}");
    }
}

#[test]
fn a_bad_colmap_model_is_refused() {
    let binary = |file: &[u8]| colmap::parse_cameras_binary(file).unwrap_err().to_string();
    let text = |text: &str| colmap::parse_cameras_text(text).unwrap_err().to_string();
    let good = cameras_binary(&[(1, 1, &[10.0, 11.0, 4.0, 3.0])]);
    assert!(binary(&good[..30]).contains("within camera 0 of 1"));
    assert!(binary(&good[..4]).contains("truncated"));
    assert!(
        binary(&[&u64::MAX.to_le_bytes()[..], &good[8..]].concat()).contains("within camera 1 of 18446744073709551615")
    );
    assert!(binary(&cameras_binary(&[(1, 17, &[])])).contains("number 17"));
    assert!(binary(&cameras_binary(&[(1, 1, &[10.0, f64::NAN, 4.0, 3.0])])).contains("is not a number"));
    assert!(binary(&cameras_binary(&[(1, 0, &[-10.0, 4.0, 3.0])])).contains("focal length"));
    assert!(binary(&cameras_binary(&[(1, 7, &[10.0, 10.0, 4.0, 3.0, 9.0])])).contains("lens parameters"));
    assert!(text("1 PINHOLE 8 6 1 2 3").contains("3 parameters, but its model PINHOLE takes 4"));
    assert!(text("1 PINHOLE 8 six 1 2 3 4").contains("line 1: HEIGHT is `six`"));
    assert!(text("\n1 PINHOLE").contains("line 2: WIDTH is missing"));
    assert!(text("1 LENSLESS 8 6 1").contains("LENSLESS"));
    let image = |text: &str| colmap::parse_images_text(text).unwrap_err().to_string();
    assert!(image("1 0 0 0 0 1 2 3 1 a.png").contains("quaternion of length zero"));
    assert!(image("1 1 0 0 0 1 2 3 1").contains("NAME is missing"));
    let good = images_binary(&[(1, [1.0, 0.0, 0.0, 0.0], [0.0; 3], 1, "a.png")]);
    let cut = colmap::parse_images_binary(&good[..good.len() - 1]).unwrap_err().to_string();
    assert!(cut.contains("within image 0 of 1"));
}

#[test]
fn images_are_read_alike_from_both_formats() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Unnormalised, as text files of six digits are.
    let quaternion = [2.0 * half, 0.0, 2.0 * half, 0.0];
    let binary = images_binary(&[
        (5, quaternion, [1.0, 2.0, 3.0], 9, "left eye/b 1.png"),
        (6, quaternion, [0.0; 3], 9, "a.png"),
    ]);
    let binary = colmap::parse_images_binary(&binary).unwrap();
    let q = format!("{} 0 {} 0", quaternion[0], quaternion[2]);
    let text = format!("# IMAGE_ID ...\n5 {q} 1 2 3 9 left eye/b 1.png\n1.5 2.5 -1 3 4 7\n6 {q} 0 0 0 9 a.png\n\n");
    assert_eq!(binary, colmap::parse_images_text(&text).unwrap());
    assert_eq!(binary[0].name, "left eye/b 1.png");
    // A quarter about y takes +x to -z.
    let in_camera = binary[0].camera_from_world * Point3::new(1.0, 0.0, 0.0);
    assert!((in_camera - Point3::new(1.0, 2.0, 2.0)).norm() < 1e-12, "{in_camera}");
}

/// The made-up scene with its cameras as another program writes them, and no transforms.json.
pub fn as_colmap(made_up: &MadeUp) -> Scene {
    let original = made_up.load().unwrap();
    let names: Vec<String> = original.views.iter().map(|view| format!("{}.png", view.name)).collect();
    let rows = original.views.iter().zip(&names).zip(0..).map(|((view, name), id)| {
        let pose = view.camera.camera_from_world;
        let q = pose.rotation;
        (id, [q.w, q.i, q.j, q.k], pose.translation.vector.into(), 1, name.as_str())
    });
    let images: Vec<ImageRow> = rows.collect();
    let sparse = made_up.path("sparse/0");
    std::fs::create_dir_all(&sparse).unwrap();
    std::fs::write(sparse.join("cameras.bin"), cameras_binary(&[(1, 1, &[10.0, 10.0, 4.0, 3.0])])).unwrap();
    std::fs::write(sparse.join("images.bin"), images_binary(&images)).unwrap();
    std::fs::remove_file(made_up.path("transforms.json")).unwrap();
    original
}

#[track_caller]
fn assert_same_cameras(a: &Scene, b: &Scene) {
    assert_eq!(a.views.len(), b.views.len());
    for (a, b) in a.views.iter().zip(&b.views) {
        assert_eq!((&a.name, &a.image), (&b.name, &b.image));
        assert_eq!(a.camera.intrinsics, b.camera.intrinsics);
        let apart = a.camera.camera_from_world.inverse() * b.camera.camera_from_world;
        assert!(apart.translation.vector.norm() + apart.rotation.angle() < 1e-7, "{}: {apart}", a.name);
    }
}

#[test]
fn a_folder_with_a_colmap_model() {
    let made_up = MadeUp::new();
    let original = as_colmap(&made_up);
    let scene = made_up.load_as_is(&Options::default()).unwrap();
    assert_same_cameras(&original, &scene);
    assert!(scene.notes.iter().any(|note| note == "cameras: `sparse/0`"), "{:?}", scene.notes);
    assert_eq!(scene.files.len(), 3);
    // A photo that was registered but is missing.
    std::fs::remove_file(made_up.path("images/001.png")).unwrap();
    let scene = made_up.load_as_is(&Options::default()).unwrap();
    assert_eq!(scene.views.len(), 3);
    assert!(scene.warnings[0].starts_with("1 of the 4 photos") && scene.warnings[0].contains("001.png"));
}

/// The made-up scene as the output folder of 3DGS.
pub fn as_3dgs_output(made_up: &MadeUp) -> Scene {
    let original = made_up.load().unwrap();
    let entry = |view: &scene::View| {
        let pose = view.camera.camera_from_world.inverse();
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let rows: Vec<[f64; 3]> = (0..3).map(|row| [0, 1, 2].map(|column| rotation[(row, column)])).collect();
        let position: [f64; 3] = pose.translation.vector.into();
        json!({
            "id": 0, "img_name": view.name, "width": 8, "height": 6, "position": position, "rotation": rows,
            "fx": 10.0, "fy": 10.0,
        })
    };
    let entries: Vec<_> = original.views.iter().map(entry).collect();
    std::fs::write(made_up.path("cameras.json"), json!(entries).to_string()).unwrap();
    std::fs::remove_file(made_up.path("transforms.json")).unwrap();
    let output = made_up.path("point_cloud/iteration_7000");
    std::fs::create_dir_all(&output).unwrap();
    std::fs::rename(made_up.path("point_cloud.ply"), output.join("point_cloud.ply")).unwrap();
    original
}

#[test]
fn a_3dgs_output_folder() {
    let made_up = MadeUp::new();
    let original = as_3dgs_output(&made_up);
    assert_same_cameras(&original, &made_up.load_as_is(&Options::default()).unwrap());
    // The photos stayed with the training data.
    let data = tempfile::tempdir().unwrap();
    std::fs::rename(made_up.path("images"), data.path().join("photos")).unwrap();
    let cfg_args = format!("Namespace(sh_degree=3, source_path={:?}, images='photos')", data.path().to_str().unwrap());
    std::fs::write(made_up.path("cfg_args"), cfg_args).unwrap();
    let photos = data.path().join("photos");
    let words = ["which `", "cfg_args` names", "outside the scene folder", &format!("`--images {}`", photos.display())];
    assert_message(made_up.load_as_is(&Options::default()), &words);
    let named = Options { images: Some(photos.clone()), ..Options::default() };
    let allowed = Options { allow_read: vec![data.path().to_owned()], ..Options::default() };
    for options in [named, allowed] {
        assert_eq!(made_up.load_as_is(&options).unwrap().views[2].image, photos.join("002.png"));
    }
    // The cameras stayed there too.
    std::fs::rename(made_up.path("cameras.json"), data.path().join("cameras.json")).unwrap();
    let cameras = data.path().join("cameras.json");
    let words = ["camera file `", "cfg_args` names", &format!("`--cameras {}`", cameras.display())];
    assert_message(made_up.load_as_is(&Options::default()), &words);
    let named = Options { cameras: Some(cameras), images: Some(photos), ..Options::default() };
    assert_same_cameras(
        &made_up.load_as_is(&named).unwrap(),
        &made_up.load_as_is(&Options { allow_read: vec![data.path().to_owned()], ..Options::default() }).unwrap(),
    );
}

#[test]
fn cfg_args_is_read_as_text() {
    let parse = TrainingArguments::parse;
    let text =
        r"Namespace(data_device='cuda', images='images', source_path='D:\\data\\my \'plush\'', white_background=False)";
    let expected =
        TrainingArguments { source_path: Some(r"D:\data\my 'plush'".to_owned()), images: Some("images".to_owned()) };
    assert_eq!(parse(text), expected);
    assert_eq!(parse("Namespace(source_path=__import__('os').system('x'))").source_path, None);
    assert_eq!(parse("Namespace(resource_path='x', source_path=\"y\")").source_path, Some("y".to_owned()));
    assert_eq!(parse("source_path='unfinished"), TrainingArguments::default());
}

/// The made-up scene as a Blender exporter writes it: an angle instead of a focal length, no size, no file extensions.
pub fn as_blender(made_up: &MadeUp) {
    let mut frames = made_up.transforms["frames"].clone();
    for frame in frames.as_array_mut().unwrap() {
        let path = frame["file_path"].as_str().unwrap();
        frame["file_path"] = json!(format!("./{}", path.trim_end_matches(".png")));
    }
    let blender = json!({"camera_angle_x": std::f64::consts::FRAC_PI_2, "frames": frames});
    std::fs::write(made_up.path("transforms_train.json"), blender.to_string()).unwrap();
    let _ = std::fs::remove_file(made_up.path("transforms.json"));
}

#[test]
fn blender_leaves_extension_and_size_out() {
    let made_up = MadeUp::new();
    as_blender(&made_up);
    let scene = made_up.load_as_is(&Options::default()).unwrap();
    assert_eq!((scene.views.len(), scene.views[0].camera.intrinsics.width), (4, 8));
    assert!((scene.views[0].camera.intrinsics.fx - 4.0).abs() < 1e-12);
}

#[test]
fn the_cameras_that_are_asked_for_are_used() {
    let made_up = MadeUp::new();
    let original = as_colmap(&made_up);
    std::fs::write(made_up.path("transforms.json"), made_up.transforms.to_string()).unwrap();
    let found = made_up.load_as_is(&Options::default()).unwrap();
    let note = "cameras: `transforms.json` (also there: `sparse/0`; --cameras chooses)";
    assert!(found.notes.iter().any(|found| found == note), "{:?}", found.notes);
    for path in ["sparse/0", "sparse", ""] {
        let options = Options { cameras: Some(made_up.path(path)), ..Options::default() };
        let scene = made_up.load_as_is(&options).unwrap();
        assert!(scene.files.iter().any(|file| file.ends_with("images.bin")), "{path}: {:?}", scene.files);
        assert_same_cameras(&original, &scene);
    }
    let other = Options { cameras: Some(made_up.path("point_cloud.ply")), ..Options::default() };
    assert_message(made_up.load_as_is(&other), &["point_cloud.ply", "is not a camera file that gprop knows"]);
}

/// Without training: applies nerfstudio's transform to the splat's one Gaussian and checks that it is seen in the same
/// place.
#[test]
fn an_exported_splat_is_met_in_its_own_frame() {
    let mut made_up = MadeUp::new();
    let before = made_up.load().unwrap();
    let seen = |scene: &Scene, point: Point3<f64>| {
        let camera = &scene.views[0].camera;
        camera.pixel(camera.point_in_camera(point)).unwrap()
    };
    let point = Point3::new(2.3, -0.2, -4.0);
    let applied = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.0, 0.0, 1.2));
    let trained = Isometry3::new(Vector3::new(-0.5, 0.4, 0.2), Vector3::new(0.3, -0.7, 0.2));
    let rows = |pose: Isometry3<f64>| -> Vec<Vec<f64>> {
        let matrix = pose.to_homogeneous();
        (0..3).map(|row| matrix.row(row).iter().copied().collect()).collect()
    };
    for (applied, applied_scale) in [(Isometry3::identity(), 1.0), (applied, 1.0), (applied, 2.0)] {
        made_up.transforms["applied_transform"] = json!(rows(applied));
        made_up.transforms["applied_scale"] = json!(applied_scale);
        // nerfstudio's dataparser: it trains in scale (trained x), and writes its transform including the applied
        // part.
        let scale = 0.25;
        let written = json!({"transform": rows(trained * applied), "scale": scale * applied_scale});
        std::fs::write(made_up.path("dataparser_transforms.json"), written.to_string()).unwrap();
        let scene = made_up.load().unwrap();
        let in_splat: Point3<f64> = ((trained * point).coords * scale).into();
        assert!((seen(&before, point) - seen(&scene, in_splat)).norm() < 1e-9);
        assert!(scene.files.iter().any(|file| file.ends_with("dataparser_transforms.json")));
    }
    std::fs::write(made_up.path("dataparser_transforms.json"), r#"{"transform": [[1,0,0,0]], "scale": 1}"#).unwrap();
    made_up.assert_refused(&["dataparser_transforms.json", "transform and scale"]);
}

#[test]
fn nerfstudio_lenses() {
    let lens = |keys: serde_json::Value| {
        let mut top = json!({"frames": [{"file_path": "a", "transform_matrix":
            [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]}], "fl_x": 10.0});
        top.as_object_mut().unwrap().extend(keys.as_object().unwrap().clone());
        transforms::parse(top.to_string().as_bytes()).map(|capture| capture.frames[0].declared.distortion)
    };
    let all = json!({"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4, "p1": 0.5, "p2": 0.6});
    let radial = [0.1, 0.2, 0.3, 0.4, 0.0, 0.0];
    let expected = Polynomial { radial, tangential: [0.5, 0.6], ..Default::default() };
    assert_eq!(lens(all.clone()).unwrap(), Distortion::Perspective(expected));
    let mut fisheye = all;
    fisheye["camera_model"] = json!("OPENCV_FISHEYE");
    assert_eq!(lens(fisheye).unwrap(), Distortion::fisheye([0.1, 0.2, 0.3, 0.4]));
    assert_eq!(lens(json!({"k1": 0.0})).unwrap(), Distortion::None);
    assert!(lens(json!({"camera_model": "EQUIRECTANGULAR"})).is_err());
}

#[test]
fn masks_that_are_missing_are_named() {
    let made_up = super::folder::MadeUp::new();
    let masks = tempfile::tempdir().unwrap();
    let options = Options { masks: Some(masks.path().to_owned()), ..Options::default() };
    let refused = made_up.load_with(&options).unwrap_err().to_string();
    assert!(refused.contains("--masks") && refused.contains("for any of the 4 views"), "{refused}");
    let white = image::GrayImage::from_pixel(8, 6, image::Luma([255]));
    for name in ["000", "002"] {
        white.save(masks.path().join(format!("{name}.png"))).unwrap();
    }
    let scene = made_up.load_with(&options).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.contains("--masks") && warning.contains("2 of 4 views: 001, 003"), "{warning}");
    for name in ["001", "003"] {
        white.save(masks.path().join(format!("{name}.png"))).unwrap();
    }
    assert_eq!(made_up.load_with(&options).unwrap().warnings, [""; 0]);
}

#[test]
fn masks_that_the_camera_file_names_in_vain_are_counted() {
    let mut made_up = super::folder::MadeUp::new();
    for (n, frame) in made_up.transforms["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
        frame["mask_path"] = json!(format!("mask/{n:03}.png"));
    }
    let scene = made_up.load().unwrap();
    let warned = scene.warnings.iter().any(|warning| warning.contains("4 masks") && warning.contains("mask/000.png"));
    assert!(warned, "{:?}", scene.warnings);
}

#[test]
fn masks_of_a_neighbouring_folder_are_not_the_scenes() {
    let made_up = super::folder::MadeUp::new();
    let around = tempfile::tempdir().unwrap();
    let (scene, masks) = (around.path().join("scene"), around.path().join("masks"));
    std::fs::create_dir(&masks).unwrap();
    image::GrayImage::new(8, 6).save(masks.join("000.png")).unwrap();
    std::fs::write(made_up.path("transforms.json"), made_up.transforms.to_string()).unwrap();
    std::fs::create_dir_all(scene.join("images")).unwrap();
    for file in
        ["point_cloud.ply", "transforms.json", "images/000.png", "images/001.png", "images/002.png", "images/003.png"]
    {
        std::fs::copy(made_up.path(file), scene.join(file)).unwrap();
    }
    let loaded = gprop::scene::load(&scene, &Options::default()).unwrap();
    assert!(loaded.views.iter().all(|view| view.mask.is_none()));
}

#[test]
fn masks_tell_the_foreground() {
    let made_up = MadeUp::new();
    let mask = GrayImage::from_fn(8, 6, |x, _| image::Luma([if x < 4 { 255 } else { 0 }]));
    std::fs::create_dir(made_up.path("masks")).unwrap();
    mask.save(made_up.path("masks/001.png")).unwrap();
    mask.save(made_up.path("masks/002.png.png")).unwrap();
    let scene = made_up.load().unwrap();
    let sources: Vec<_> = scene.views.iter().map(|view| view.photo().unwrap().foreground_source).collect();
    use ForegroundSource::{Mask, Whole};
    assert_eq!(sources, [Whole, Mask, Mask, Whole]);
    let foreground = scene.views[1].photo().unwrap().foreground;
    assert_eq!(foreground.as_raw().iter().filter(|value| **value == 255).count(), 24);
    // Elsewhere, and smaller than the photos.
    let elsewhere = tempfile::tempdir().unwrap();
    image::imageops::resize(&mask, 4, 3, image::imageops::FilterType::Nearest)
        .save(elsewhere.path().join("003.png"))
        .unwrap();
    let options = Options { masks: Some(elsewhere.path().to_owned()), ..Options::default() };
    let photo = made_up.load_as_is(&options).unwrap().views[3].photo().unwrap();
    assert_eq!((photo.foreground_source, photo.foreground.dimensions()), (Mask, (8, 6)));
    // On its side.
    image::imageops::rotate90(&mask).save(elsewhere.path().join("003.png")).unwrap();
    let error = made_up.load_as_is(&options).unwrap_err().to_string();
    assert!(error.contains("003.png") && error.contains("6 x 8 pixels") && error.contains("8 x 6"), "{error}");
}

/// A JPEG of this width and height as stored, bright on the left, whose EXIF orientation says `orientation`.
fn jpeg_oriented(orientation: u8, (width, height): (u32, u32)) -> Vec<u8> {
    let picture = RgbImage::from_fn(width, height, |x, _| if x < width / 2 { Rgb([250; 3]) } else { Rgb([5; 3]) });
    let mut jpeg = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 100);
    // TIFF header, one entry: tag 0x0112 (orientation), type SHORT, count 1.
    let exif = [&b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..], &[orientation], b"\0\0\0\0\0\0"].concat();
    encoder.set_exif_metadata(exif).unwrap();
    encoder.encode_image(&picture).unwrap();
    jpeg
}

#[test]
fn exif_orientation_is_honoured() {
    let mut made_up = MadeUp::new();
    for frame in made_up.transforms["frames"].as_array_mut().unwrap() {
        frame["file_path"] = json!("images/side.jpg");
    }
    made_up.transforms["frames"].as_array_mut().unwrap().truncate(1);
    // 6: the camera was turned by a quarter turn; the picture has to be turned clockwise.
    std::fs::write(made_up.path("images/side.jpg"), jpeg_oriented(6, (8, 6))).unwrap();
    // Calibrated on the upright picture.
    (made_up.transforms["w"], made_up.transforms["h"]) = (json!(6), json!(8));
    let scene = made_up.load().unwrap();
    let photo = scene.views[0].photo().unwrap();
    assert_eq!(photo.rgb.dimensions(), (6, 8));
    assert!(photo.rgb.get_pixel(3, 1)[0] > 200 && photo.rgb.get_pixel(3, 6)[0] < 50);
    assert!(scene.warnings[0].contains("turned upright"), "{:?}", scene.warnings);
    // Calibrated on the picture as it is stored, as COLMAP and 3DGS do.
    (made_up.transforms["w"], made_up.transforms["h"]) = (json!(8), json!(6));
    let scene = made_up.load().unwrap();
    assert_eq!(scene.views[0].photo().unwrap().rgb.dimensions(), (8, 6));
    assert!(scene.warnings[0].contains("as they are stored"), "{:?}", scene.warnings);
    // 3: upside down. Both ways have the size on which the cameras were calibrated, or half of it.
    std::fs::write(made_up.path("images/side.jpg"), jpeg_oriented(3, (8, 6))).unwrap();
    for (width, height) in [(8, 6), (4, 3)] {
        (made_up.transforms["w"], made_up.transforms["h"]) = (json!(width), json!(height));
        let scene = made_up.load().unwrap();
        let photo = scene.views[0].photo().unwrap();
        assert!(photo.rgb.get_pixel(1, 3)[0] > 200 && photo.rgb.get_pixel(6, 3)[0] < 50, "{width} x {height}");
        assert!(scene.warnings.iter().any(|warning| warning.contains("as they are stored")), "{:?}", scene.warnings);
    }
    // Nearly square: both ways have the shape, but one has it exactly, or at twice the size.
    std::fs::write(made_up.path("images/side.jpg"), jpeg_oriented(6, (201, 200))).unwrap();
    for (size, upright) in [((201, 200), (201, 200)), ((200, 201), (200, 201)), ((400, 402), (200, 201))] {
        (made_up.transforms["w"], made_up.transforms["h"]) = (json!(size.0), json!(size.1));
        let photo = made_up.load().unwrap().views[0].photo().unwrap();
        assert_eq!(photo.rgb.dimensions(), upright);
    }
}

#[test]
fn photos_that_are_all_missing_are_said_to_be() {
    let made_up = MadeUp::new();
    std::fs::remove_dir_all(made_up.path("images")).unwrap();
    made_up.assert_refused(&["none of the 4 photos", "images/000.png", "--images DIR", "--render-views"]);
    let elsewhere = tempfile::tempdir().unwrap();
    RgbImage::new(8, 6).save(elsewhere.path().join("002.png")).unwrap();
    let mut flat = MadeUp::new();
    for frame in flat.transforms["frames"].as_array_mut().unwrap() {
        frame["file_path"] = json!(frame["file_path"].as_str().unwrap().trim_start_matches("images/"));
    }
    let options = Options { images: Some(elsewhere.path().to_owned()), ..Options::default() };
    // nerfstudio names a photo with its folder, which --images may be or hold.
    for names in [&flat, &MadeUp::new()] {
        let scene = names.load_with(&options).unwrap();
        assert_eq!((scene.views.len(), scene.views[0].name.as_str()), (1, "002"));
        assert_eq!(scene.views[0].image, elsewhere.path().join("002.png"));
    }
}

/// Paths of another machine: their ends tell photos apart, as far as they do.
#[test]
fn absolute_paths_lead_to_photos_by_their_ends() {
    let mut made_up = super::folder::MadeUp::new();
    for n in 0..4 {
        let folder = made_up.path(&format!("images/cam{n}"));
        std::fs::create_dir(&folder).unwrap();
        std::fs::rename(made_up.path(&format!("images/{n:03}.png")), folder.join("000.png")).unwrap();
    }
    for path in [
        r"C:\data\images\camN\000.png",
        "d:/data/images/camN/000.png",
        r"\\server\data\images\camN\000.png",
        "/elsewhere/data/images/camN/000.png",
    ] {
        for n in 0..4 {
            made_up.transforms["frames"][n]["file_path"] = json!(path.replace('N', &n.to_string()));
        }
        let scene = made_up.load().unwrap();
        let images: std::collections::BTreeSet<_> = scene.views.iter().map(|view| view.image.clone()).collect();
        assert_eq!((scene.views.len(), images.len()), (4, 4), "{path}");
    }
    // One photo for several cameras can be that of any of them.
    std::fs::copy(made_up.path("images/cam0/000.png"), made_up.path("images/000.png")).unwrap();
    for n in 1..4 {
        std::fs::remove_dir_all(made_up.path(&format!("images/cam{n}"))).unwrap();
    }
    let scene = made_up.load().unwrap();
    assert_eq!(scene.views.len(), 1);
    assert!(scene.warnings.iter().any(|warning| warning.contains("3 of the 4 photos")), "{:?}", scene.warnings);
}

#[test]
fn a_name_may_climb_from_the_folder_of_the_cameras() {
    let mut made_up = MadeUp::new();
    for n in 0..4 {
        made_up.transforms["frames"][n]["file_path"] = json!(format!("../images/{n:03}.png"));
    }
    std::fs::create_dir(made_up.path("nerf")).unwrap();
    let cameras = made_up.path("nerf/transforms.json");
    std::fs::write(&cameras, made_up.transforms.to_string()).unwrap();
    let options = Options { cameras: Some(cameras.clone()), ..Options::default() };
    let scene = made_up.load_as_is(&options).unwrap();
    assert_eq!((scene.views.len(), scene.views[3].name.as_str()), (4, "003"));
    assert_eq!(scene.views[3].image, made_up.path("images/003.png"));
    // So may a mask's name.
    made_up.transforms["frames"][0]["mask_path"] = json!("../mattes/000.png");
    std::fs::create_dir(made_up.path("mattes")).unwrap();
    GrayImage::from_pixel(8, 6, image::Luma([255])).save(made_up.path("mattes/000.png")).unwrap();
    std::fs::write(&cameras, made_up.transforms.to_string()).unwrap();
    let scene = made_up.load_as_is(&options).unwrap();
    assert!(!scene.warnings.iter().any(|warning| warning.contains("missing")), "{:?}", scene.warnings);
    assert!(
        scene.views[0].mask.as_ref().is_some_and(|mask| mask.path.ends_with("mattes/000.png")),
        "{:?}",
        scene.views[0]
    );
    // One that is missing is counted.
    std::fs::remove_file(made_up.path("images/003.png")).unwrap();
    let scene = made_up.load_as_is(&options).unwrap();
    assert_eq!(scene.views.len(), 3);
    assert!(scene.warnings[0].contains("../images/003.png"), "{:?}", scene.warnings);
}

#[test]
fn a_byte_order_mark_is_no_part_of_a_camera_file() {
    let marked = |path: &std::path::Path| {
        let text = std::fs::read(path).unwrap();
        std::fs::write(path, ["\u{feff}".as_bytes(), text.as_slice()].concat()).unwrap();
    };
    let made_up = MadeUp::new();
    let original = made_up.load().unwrap();
    let transforms = made_up.path("transforms.json");
    marked(&transforms);
    assert_same_cameras(&original, &made_up.load_as_is(&Options::default()).unwrap());
    let named = Options { cameras: Some(transforms.clone()), ..Options::default() };
    assert_same_cameras(&original, &made_up.load_as_is(&named).unwrap());
    std::fs::remove_file(&transforms).unwrap();
    std::fs::create_dir(made_up.path("sparse")).unwrap();
    let (cameras, images) = (made_up.path("sparse/cameras.txt"), made_up.path("sparse/images.txt"));
    std::fs::write(&cameras, "# Cameras\n1 SIMPLE_PINHOLE 8 6 10 4 3\n").unwrap();
    std::fs::write(&images, "# Images\n1 1 0 0 0 0 0 0 1 000.png\n\n").unwrap();
    marked(&cameras);
    marked(&images);
    assert_eq!(made_up.load_as_is(&Options::default()).unwrap().views.len(), 1);
}

#[test]
fn every_json_file_of_a_scene_says_what_is_not_json() {
    let utf16 = |text: &str| -> Vec<u8> { text.encode_utf16().flat_map(u16::to_le_bytes).collect() };
    let made_up = MadeUp::new();
    made_up.load().unwrap();
    std::fs::copy(made_up.path("transforms.json"), made_up.path("cameras.json")).unwrap();
    let dataparser = made_up.path("dataparser_transforms.json");
    std::fs::write(&dataparser, utf16("{\"scale\": 1.0}")).unwrap();
    assert_message(made_up.load_as_is(&Options::default()), &["dataparser_transforms.json", "UTF-16"]);
    std::fs::write(&dataparser, "{\"scale\": 1.0, \"transform\": [[NaN]]}").unwrap();
    assert_message(made_up.load_as_is(&Options::default()), &["dataparser_transforms.json", "line 1 column 31: NaN"]);
    std::fs::remove_file(&dataparser).unwrap();
    let named = Options { cameras: Some(made_up.path("cameras.json")), ..Options::default() };
    for (text, words) in
        [(utf16("[]"), "UTF-16"), (b"// 3DGS\n[]".to_vec(), "line 1 column 1: a comment begins here (`//`)")]
    {
        std::fs::write(made_up.path("cameras.json"), text).unwrap();
        assert_message(made_up.load_as_is(&named), &["cameras.json", words]);
    }
}

#[test]
fn a_frames_own_angle_replaces_the_files_focal_length() {
    let mut made_up = super::folder::MadeUp::new();
    made_up.transforms["frames"][0]["camera_angle_x"] = json!(0.8);
    let scene = made_up.load().unwrap();
    let focal = |view: usize| scene.views[view].camera.intrinsics.fx;
    assert!((focal(0) - 4.0 / 0.4f64.tan()).abs() < 1e-9 && focal(1) == 10.0, "{} {}", focal(0), focal(1));
}

#[test]
fn conversions_are_written_as_they_are_read() {
    for text in [
        "none",
        "transposed",
        "transposed-opengl+scale=2",
        "inverted+camera-yz",
        "camera-y+world=x,-y,z",
        "world=y,z,x+scale=0.1",
        "camera-yz+sim=2.5,0.5,-0.5,0.5,-0.5,1,-20.25,0.001",
        "gsplat",
        "gsplat-z",
    ] {
        let align: Align = text.parse().unwrap();
        assert_eq!(align.to_string(), text);
    }
    for text in [
        "",
        "camera-y",
        "camera-",
        "camera-w",
        "world=x,x,z",
        "world=x,y",
        "scale=0",
        "scale=-1",
        "flipped",
        "gsplat-w",
        "gsplat+scale=2",
        "sim=1",
        "sim=0,1,0,0,0,0,0,0",
        "sim=1,0,0,0,0,0,0,0",
        "sim=1,1,0,0,0,0,0,inf",
    ] {
        assert!(text.parse::<Align>().is_err(), "{text}");
    }
    // None of the parts is dropped without a word.
    for text in ["transposed+inverted", "camera-xy+camera-yz", "world=x,y,z+world=y,z,x", "scale=2+scale=3"] {
        let told = text.parse::<Conversion>().unwrap_err();
        let last = text.split('+').next_back().unwrap();
        assert!(told.contains(last) && told.contains("give only one"), "{text}: {told}");
    }
    assert_eq!(SignedPermutation::all().len(), 48);
    assert_eq!(SignedPermutation::all()[0], SignedPermutation::IDENTITY);
}

#[test]
fn align_undoes_another_convention() {
    let pose =
        Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), UnitQuaternion::from_euler_angles(0.3, 0.5, -1.0));
    let apply = |text: &str| text.parse::<Conversion>().unwrap().apply(&pose);
    let near = |a: Isometry3<f64>, b: Isometry3<f64>| (a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-12;
    assert!(near(apply("none"), pose));
    assert!(near(apply("inverted"), pose.inverse()));
    let all: Conversion = "inverted+camera-y+world=y,x,z+scale=3+sim=0.5,0.6,0,0.8,0,1,2,3".parse().unwrap();
    assert!(near(all.undo(&all.apply(&pose)), pose));
    assert_eq!(all.scaling(), 1.5);
    let opengl = Isometry3::rotation(Vector3::x() * std::f64::consts::PI) * pose;
    assert!(near(apply("camera-yz"), opengl));
    // The new world's x is the old y and so on: a point moves with it, so the camera sees it in the same place.
    let old = Point3::new(0.4, 0.5, 9.0);
    let new = Point3::new(old.y, old.z, old.x);
    assert!((apply("world=y,z,x") * new - pose * old).norm() < 1e-12);
    let scaled = apply("scale=3").inverse().translation.vector - pose.inverse().translation.vector * 3.0;
    assert!(scaled.norm() < 1e-12);
    let rotation = apply("transposed").rotation.to_rotation_matrix();
    assert!((rotation.matrix() - Rotation3::from(pose.rotation).matrix().transpose()).norm() < 1e-12);
    for text in [
        "none",
        "transposed+world=y,z,x",
        "transposed-opengl+scale=3",
        "inverted+camera-yz+world=x,-z,y+scale=0.1",
        "camera-y+world=x,-y,z",
    ] {
        let conversion: Conversion = text.parse().unwrap();
        assert!(near(conversion.undo(&conversion.apply(&pose)), pose), "{text}");
    }
}

#[test]
fn captures_of_others_are_read() {
    const TEST: &str = "captures_of_others_are_read";
    if let Some(folder) = shared(TEST, "captures/miku_plush") {
        let load = |cameras: &str| {
            let options = Options { cameras: Some(folder.join(cameras)), ..Options::default() };
            scene::load(&folder, &options).unwrap()
        };
        let reference = load("transforms.json");
        assert_eq!((reference.views.len(), reference.gaussians.sh_degree), (49, 2));
        assert!(reference.warnings[0].starts_with("48 of the 97 photos"));
        // cameras.json has no principal point: cx is half a pixel off there.
        assert_same_cameras(&reference, &load("sparse/0"));
        assert_eq!(load("cameras.json").views.len(), 49);
        assert!(load("cameras_original.json").warnings[1].contains("3958 x 2968, found 989 x 742"));
    }
    if let Some(mouse) = shared(TEST, "formats/colmap/mouse/sparse/0") {
        let cameras = colmap::parse_cameras_binary(&std::fs::read(mouse.join("cameras.bin")).unwrap()).unwrap();
        let images = colmap::parse_images_binary(&std::fs::read(mouse.join("images.bin")).unwrap()).unwrap();
        assert_eq!((cameras.len(), images.len()), (56, 56));
    }
    if let Some(fox) = shared(TEST, "formats/nerfstudio/fox_transforms.json") {
        let capture = transforms::parse(&std::fs::read(fox).unwrap()).unwrap();
        let lens = capture.frames[0].declared;
        assert_eq!(
            (capture.frames.len(), lens.fx, lens.fy),
            (67, Focal::Pixels(1375.52), Some(Focal::Pixels(1374.49)))
        );
        assert_eq!(lens.distortion, Distortion::opencv(0.0578421, -0.0805099, -0.000980296, 0.00015575, 0.0));
    }
    if let Some(lego) = shared(TEST, "formats/blender/lego_transforms_train.json") {
        let capture = transforms::parse(&std::fs::read(lego).unwrap()).unwrap();
        assert_eq!(capture.frames[0].declared.fx, Focal::Angle(0.6911112070083618));
        assert_eq!(capture.frames.len(), 100);
    }
}

#[test]
fn scales_are_measured() {
    let made_up = MadeUp::new();
    made_up.load().unwrap();
    let scale = |text: &str| made_up.load_as_is(&options(&["--scale", text]).unwrap());
    let meters = |text: &str| scale(text).unwrap().scale.unwrap().meters_per_unit;
    assert_eq!(meters("known-length:0,0,0:0,3,4=0.5"), 0.1);
    assert_eq!(meters("known-length 0,0,0:0,3,4=0.5"), 0.1);
    // Cameras 0 and 2 are at x = 2 and x = -2.
    assert_eq!(meters("cameras:000,002=0.8"), 0.2);
    assert!(scale("cameras:000,002=0.8").unwrap().scale.unwrap().provenance.contains("cameras of 000 and 002"));
    assert_message(scale("cameras:000,7=1"), &["--scale", "no view is named `7`; the views are: 000, 001, 002, 003"]);
    let rendered = options(&["--render-views", "2", "--scale", "cameras:000,002=0.8"]).unwrap();
    assert_message(made_up.load_as_is(&rendered), &["no view is named `000`; the scene has no photo with a camera"]);
    assert_message(scale("cameras:000,000=1"), &["measured in the scene is zero"]);
    // The only Gaussian shrinks to a point.
    let mut point = made_up.load().unwrap().gaussians;
    point.log_scales = vec![[-1000.0; 3]];
    let mut bytes = Vec::new();
    ply::write(&mut bytes, &point, &[]).unwrap();
    std::fs::write(made_up.path("point_cloud.ply"), bytes).unwrap();
    assert_message(scale("bbox:z=1"), &["--scale bbox:z=1", "zero"]);
    for nonsense in
        ["bbox:w=1", "bbox:x=0", "cameras:a=1", "known-length:0,0:1,1,1=2", "known-length:0,0,0:1,1,1", "ruler:1=2"]
    {
        assert!(options(&[&format!("--scale={nonsense}")]).is_err(), "{nonsense}");
    }
    let refused = options(&["--scale=bbox:w=1"]).unwrap_err().to_string();
    assert!(refused.contains("is x, y or z") && !refused.contains("known-length"), "{refused}");
}

#[test]
fn a_side_of_the_object_reaches_to_the_ends_of_its_bodies() {
    // The hammer is rendered in metres; these are its true sides. Of its thinnest, 32 mm, the centres of the Gaussians span no
    // more than 24 mm.
    for (side, meters) in [("x", 0.3526), ("y", 0.1091), ("z", 0.0316)] {
        let text = format!("bbox:{side}={meters}");
        let scale = scene::load(&hammer(), &options(&["--scale", &text]).unwrap()).unwrap().scale.unwrap();
        let range = scale.range.expect("strays make it uncertain");
        assert!(range.low < 1.0 && 1.0 < range.high, "{side}: {scale:?}");
        assert!(range.low < scale.meters_per_unit && scale.meters_per_unit < range.high, "{side}: {scale:?}");
        // The error of the thinnest side is 3 %.
        assert!((scale.meters_per_unit - 1.0).abs() < 0.035, "{side}: {scale:?}");
        assert!(scale.provenance.contains("within"), "{scale:?}");
    }
}

#[test]
fn the_object_is_in_the_box() {
    let split = |text: &str| scene::load(&hammer(), &options(&[&format!("--object-box={text}")]).unwrap());
    let whole = scene::load(&hammer(), &Options::default()).unwrap();
    let center = whole.object_bounds().center();
    let half = split(&format!("{},-9,-9:9,9,9", center.x)).unwrap();
    assert_eq!(half.gaussians.len() + half.surroundings.len(), whole.gaussians.len());
    assert!(half.gaussians.positions.iter().all(|p| f64::from(p[0]) >= center.x));
    assert!(half.notes.iter().any(|note| note.contains("--object-box")));
    assert_eq!(half.whole_cloud().len(), whole.gaussians.len());
    assert!(matches!(split("7,7,7:8,8,8"), Err(SceneError::EmptyBox { .. })));
    assert!(options(&["--object-box=1,2:3,4"]).is_err());
}

proptest! {
    #![proptest_config(super::proptest_config())]

    #[test]
    fn no_bytes_make_a_camera_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = colmap::parse_cameras_binary(&bytes);
        let _ = colmap::parse_images_binary(&bytes);
        let text = String::from_utf8_lossy(&bytes);
        let _ = colmap::parse_cameras_text(&text);
        let _ = colmap::parse_images_text(&text);
        let _ = transforms::parse(&bytes);
        let _ = TrainingArguments::parse(&text);
        let _ = TrainingArguments::parse(&format!("source_path='{text}"));
    }
}
