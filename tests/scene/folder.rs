//! Whole scene folders: the fixture, and made-up ones with one error each.

use std::path::{Path, PathBuf};

use clap::Parser;
use gprop::scene::splat::ply;
use gprop::scene::{self, Options, Scene, SceneError, UpChoice};
use gprop::units::ScaleSource;
use image::RgbImage;
use serde_json::{Value, json};
use tempfile::TempDir;

pub fn hammer() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer")
}

/// A scene of one Gaussian and four views from the sides of a square, each photo 8 x 6.
pub struct MadeUp {
    folder: TempDir,
    pub transforms: Value,
}

impl MadeUp {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("point_cloud.ply"), super::ply::one_gaussian()).unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        let directions = [[2.0, 0.0], [0.0, 2.0], [-2.0, 0.0], [0.0, -2.0]];
        let frames: Vec<Value> = directions.iter().enumerate().map(|(n, at)| frame(folder.path(), n, *at)).collect();
        Self { folder, transforms: json!({"fl_x": 10.0, "w": 8, "h": 6, "frames": frames}) }
    }

    /// Writes transforms.json and loads.
    pub fn load_with(&self, options: &Options) -> Result<Scene, SceneError> {
        std::fs::write(self.path("transforms.json"), self.transforms.to_string()).unwrap();
        self.load_as_is(options)
    }

    /// Loads the folder as it is, in its own frame, whatever is up in it, unless the options say something else.
    pub fn load_as_is(&self, options: &Options) -> Result<Scene, SceneError> {
        let up = if options.up == UpChoice::Auto { UpChoice::Along([0.0, 0.0, 1.0]) } else { options.up };
        scene::load(self.folder.path(), &Options { up, ..options.clone() })
    }

    pub fn load(&self) -> Result<Scene, SceneError> {
        self.load_with(&Options::default())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Checks that loading fails with a message that contains all `needles`.
    #[track_caller]
    pub fn assert_refused(&self, needles: &[&str]) {
        assert_message(self.load(), needles);
    }
}

#[track_caller]
pub fn assert_message<T: std::fmt::Debug>(outcome: Result<T, SceneError>, needles: &[&str]) {
    let message = outcome.expect_err("the scene was accepted").to_string();
    for needle in needles {
        assert!(message.contains(needle), "`{needle}` is not in: {message}");
    }
}

/// Writes photo `n` and returns its frame: a camera at (x, y, 0) with the world's axes.
fn frame(folder: &Path, n: usize, [x, y]: [f64; 2]) -> Value {
    let file = format!("images/{n:03}.png");
    RgbImage::new(8, 6).save(folder.join(&file)).unwrap();
    json!({
        "file_path": file,
        "transform_matrix": [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
    })
}

fn names(scene: &Scene, options: &Options) -> Vec<String> {
    scene.chosen_views(options).unwrap().into_iter().map(|view| view.name).collect()
}

pub fn options(arguments: &[&str]) -> Result<Options, clap::Error> {
    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        options: Options,
    }
    let arguments = std::iter::once("test").chain(arguments.iter().copied());
    CommandLine::try_parse_from(arguments).map(|line| line.options)
}

#[test]
fn the_fixture_loads() {
    let options = options(&["--scale", "metric"]).unwrap();
    let scene = scene::load(&hammer(), &options).unwrap();
    assert_eq!(scene.name, "hammer");
    assert_eq!((scene.gaussians.len(), scene.gaussians.sh_degree, scene.views.len()), (28_736, 3, 30));
    assert_eq!(scene.views[7].name, "007");
    assert_eq!(scene.warnings, Vec::<String>::new());
    let photo = scene.views[7].photo().unwrap();
    assert_eq!(photo.rgb.dimensions(), (512, 512));
    let foreground = photo.foreground.as_raw().iter().filter(|value| **value == 255).count();
    assert!((5_000..100_000).contains(&foreground), "{foreground}");
    // Ground truth: 0.353 x 0.109 x 0.032 m; the box leaves out half a percent at each end.
    let size = scene.object_bounds().size();
    assert!((size - nalgebra::Vector3::new(0.353, 0.109, 0.032)).amax() < 0.015, "{size}");
}

#[test]
fn writing_what_was_read_gives_the_same_bytes() {
    let original = std::fs::read(hammer().join("point_cloud.ply")).unwrap();
    let loaded = ply::parse(&original).unwrap();
    let mut written = Vec::new();
    ply::write(&mut written, &loaded.gaussians, &[]).unwrap();
    assert!(written == original, "the bytes differ");
}

#[test]
fn chosen_views_are_spread_and_always_the_same() {
    let scene = scene::load(&hammer(), &Options::default()).unwrap();
    let chosen = names(&scene, &Options::default());
    assert_eq!(chosen.len(), 10);
    assert!(chosen.is_sorted(), "{chosen:?} is not in camera-file order");
    assert_eq!(chosen, names(&scene, &Options::default()));
    // Nearest neighbours are farther apart among the chosen views than among the first ten.
    let center = scene.object_bounds().center();
    let least_angle = |names: &[String]| {
        let views = names.iter().map(|name| scene.views.iter().find(|view| view.name == *name).unwrap());
        let directions: Vec<_> = views.map(|view| (view.camera.center_in_world() - center).normalize()).collect();
        let pairs = directions.iter().enumerate().flat_map(|(i, a)| directions[..i].iter().map(move |b| a.angle(b)));
        pairs.fold(f64::INFINITY, f64::min)
    };
    let first: Vec<String> = scene.views[..10].iter().map(|view| view.name.clone()).collect();
    println!("{chosen:?}: {:.3} rad apart at least, the first ten {:.3}", least_angle(&chosen), least_angle(&first));
    assert!(least_angle(&chosen) > 1.5 * least_angle(&first));
}

#[test]
fn a_folder_inside_a_scene_points_to_the_scene() {
    let made_up = MadeUp::new();
    made_up.load().unwrap();
    let trained = made_up.path("point_cloud/iteration_1400");
    std::fs::create_dir_all(&trained).unwrap();
    std::fs::rename(made_up.path("point_cloud.ply"), trained.join("point_cloud.ply")).unwrap();
    for inside in ["images", "point_cloud"] {
        let loaded = scene::load(&made_up.path(inside), &Options::default());
        let parent = format!("its parent `{}` has a splat", made_up.folder.path().display());
        assert_message(loaded, &["is not a scene", &parent, "did you mean that?"]);
    }
}

#[test]
fn an_unknown_view_is_answered_with_a_few_names() {
    let known = (0..49).map(|n| format!("{n:03}")).collect();
    let message = SceneError::UnknownView { name: "x".to_owned(), known }.to_string();
    assert!(message.ends_with("the views are: 000, 001, 002, 003, 004, 005, 006, 007 and 41 more"), "{message}");
}

#[test]
fn views_by_number_and_by_name() {
    let mut made_up = MadeUp::new();
    let scene = made_up.load().unwrap();
    assert_eq!(names(&scene, &options(&["--views", "9"]).unwrap()), ["000", "001", "002", "003"]);
    assert_eq!(names(&scene, &options(&["--views", "1"]).unwrap()).len(), 1);
    // The first view is arbitrary among equals; the second lies opposite.
    let opposite = names(&scene, &options(&["--views", "2"]).unwrap());
    assert!(opposite == ["000", "002"] || opposite == ["001", "003"], "{opposite:?}");
    assert_eq!(names(&scene, &options(&["--view-list", "003,001"]).unwrap()), ["001", "003"]);
    let unknown = scene.chosen_views(&options(&["--view-list", "7"]).unwrap()).unwrap_err().to_string();
    assert_eq!(unknown, "no view is named `7`; the views are: 000, 001, 002, 003");
    assert!(options(&["--views", "0"]).is_err());
    // By a file name that is not safe everywhere.
    std::fs::rename(made_up.path("images/000.png"), made_up.path("images/my photo (1).png")).unwrap();
    made_up.transforms["frames"][0]["file_path"] = json!("images/my photo (1).png");
    let scene = made_up.load().unwrap();
    for name in ["my photo (1)", "my_photo__1_"] {
        assert_eq!(names(&scene, &options(&["--view-list", name]).unwrap()), ["my_photo__1_"]);
        // Cameras 0 and 2 are at x = 2 and x = -2.
        let measured = made_up.load_as_is(&options(&["--scale", &format!("cameras:{name},002=0.4")]).unwrap());
        assert_eq!(measured.unwrap().scale.unwrap().meters_per_unit, 0.1, "{name}");
    }
}

#[test]
fn options_on_the_command_line_default_to_the_default() {
    assert_eq!(options(&[]).unwrap(), Options::default());
}

#[test]
fn the_scale_is_what_was_said() {
    let made_up = MadeUp::new();
    let scale = |text| made_up.load_with(&options(&["--scale", text]).unwrap()).unwrap().scale;
    assert_eq!(scale("auto"), None);
    assert_eq!(scale("metric").map(|s| (s.meters_per_unit, s.source)), Some((1.0, ScaleSource::Metric)));
    assert_eq!(scale("0.25").map(|s| (s.meters_per_unit, s.source)), Some((0.25, ScaleSource::Factor)));
    for nonsense in ["0", "-1", "inf", "NaN", "metres"] {
        assert!(options(&[&format!("--scale={nonsense}")]).is_err(), "{nonsense}");
    }
    let json = serde_json::to_value(options(&["--scale", "0.25"]).unwrap()).unwrap();
    assert_eq!(json["scale"], "0.25");
}

#[test]
fn the_largest_iteration_is_found() {
    let made_up = MadeUp::new();
    for iteration in ["iteration_7000", "iteration_30000", "iteration_last"] {
        let folder = made_up.path("point_cloud").join(iteration);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("point_cloud.ply"), iteration).unwrap();
    }
    // A training that was stopped before it wrote the splat.
    std::fs::create_dir(made_up.path("point_cloud/iteration_40000")).unwrap();
    let splat = made_up.path("point_cloud.ply");
    std::fs::rename(&splat, made_up.path("point_cloud/iteration_30000/point_cloud.ply")).unwrap();
    assert_eq!(made_up.load().unwrap().gaussians.len(), 1);
}

#[test]
fn what_is_not_there_is_named() {
    let made_up = MadeUp::new();
    assert_message(scene::load(Path::new("no/such"), &Options::default()), &["no such scene folder", "no/such"]);
    let splat = made_up.path("point_cloud.ply");
    assert_message(scene::load(&splat, &Options::default()), &["is a file", "the folder that holds the photos"]);
    assert_message(scene::load(made_up.folder.path(), &Options::default()), &["no cameras", "transforms.json"]);
    std::fs::create_dir(made_up.path("sparse")).unwrap();
    let without = scene::load(made_up.folder.path(), &Options::default());
    assert_message(without, &["no cameras", "COLMAP", "--render-views", "gprop inspect"]);
    std::fs::remove_file(&splat).unwrap();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    std::fs::write(made_up.path("points3d.ply"), cloud).unwrap();
    made_up.assert_refused(&[
        "no splat",
        "there is points3d.ply",
        "3DGS",
        "nerfstudio",
        "ns-export",
        "gsplat",
        "Brush",
    ]);
    std::fs::write(made_up.path("plush.sog"), "").unwrap();
    made_up.assert_refused(&["plush.sog", "is not a .sog"]);
}

#[test]
fn the_splats_of_each_trainer_are_found() {
    let made_up = MadeUp::new();
    let splat = std::fs::read(made_up.path("point_cloud.ply")).unwrap();
    std::fs::remove_file(made_up.path("point_cloud.ply")).unwrap();
    // From the last choice to the first: each is preferred to those before it.
    let places = [
        "z.ply",
        "a.ply",
        "export_100.ply",
        "export_30000.ply",
        "ply/point_cloud_29999.ply",
        "exports/splat/splat.ply",
        "splat.ply",
        "point_cloud/iteration_7000/point_cloud.ply",
        "point_cloud.ply",
    ];
    for (index, place) in places.iter().enumerate() {
        let path = made_up.path(place);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &splat).unwrap();
        let scene = made_up.load().unwrap();
        assert_eq!(scene.files[0], path);
        assert_eq!(scene.notes[0].contains("also there"), index > 0, "{}", scene.notes[0]);
    }
    let options = Options { splat: Some(made_up.path("z.ply")), ..Options::default() };
    assert_eq!(made_up.load_with(&options).unwrap().files[0], made_up.path("z.ply"));
}

#[test]
fn hidden_files_and_folders_are_no_splats() {
    let made_up = MadeUp::new();
    let row = super::formats::splat_row([0.0; 3], [0.1; 3], [255; 4], [255, 128, 128, 128]);
    std::fs::write(made_up.path("toy.splat"), row).unwrap();
    std::fs::remove_file(made_up.path("point_cloud.ply")).unwrap();
    // What macOS leaves beside a file on a USB stick, a multiple of 32 bytes long; and a folder of results.
    std::fs::write(made_up.path("._toy.splat"), [0_u8; 4096]).unwrap();
    std::fs::create_dir(made_up.path("results.splat")).unwrap();
    let scene = made_up.load().unwrap();
    assert_eq!((scene.gaussians.len(), &scene.files[0]), (1, &made_up.path("toy.splat")));
    assert_eq!(scene.notes[0], "splat: `toy.splat`");
}

#[test]
fn a_frame_without_photo_is_counted() {
    let mut made_up = MadeUp::new();
    for file in ["images/nine.png", "/somebody/else/images/nine.png"] {
        made_up.transforms["frames"][2]["file_path"] = json!(file);
        let scene = made_up.load().unwrap();
        assert_eq!(scene.views.len(), 3);
        assert!(scene.warnings[0].starts_with("1 of the 4 photos") && scene.warnings[0].contains(file));
    }
}

#[test]
fn blurred_views_and_those_that_cut_the_object_off_are_left_out() {
    let original = scene::load(&hammer(), &Options::default()).unwrap();
    let options = options(&["--views", "6"]).unwrap();
    let chosen = names(&original, &options);
    let folder = tempfile::tempdir().unwrap();
    let mut scene = original.clone();
    // Blurs the views that would be chosen first by one and a half pixels; their alpha does not change.
    for name in &chosen[..2] {
        let view = scene.views.iter_mut().find(|view| view.name == *name).unwrap();
        let picture = image::open(&view.image).unwrap().into_rgba8();
        let mut blurred = image::imageops::blur(&picture, 1.5);
        for (blurred, pixel) in blurred.pixels_mut().zip(picture.pixels()) {
            blurred[3] = pixel[3];
        }
        view.image = folder.path().join(format!("{name}.png"));
        blurred.save(&view.image).unwrap();
    }
    // Another looks past the object.
    let past = scene.views.iter_mut().find(|view| view.name == chosen[2]).unwrap();
    past.camera.intrinsics.cx += 300.0;
    let again = names(&scene, &options);
    println!("{chosen:?} {again:?}");
    assert_eq!(again.len(), 6);
    assert!(chosen[..3].iter().all(|name| !again.contains(name)), "{again:?}");
}

#[test]
fn a_splat_problem_names_the_file() {
    let made_up = MadeUp::new();
    std::fs::write(made_up.path("point_cloud.ply"), "plywood\n").unwrap();
    made_up.assert_refused(&["point_cloud.ply`: is not a PLY file"]);
    let mut truncated = super::ply::one_gaussian();
    truncated.pop();
    std::fs::write(made_up.path("point_cloud.ply"), truncated).unwrap();
    made_up.assert_refused(&["point_cloud.ply`: is truncated"]);
}

#[test]
fn broken_json_has_line_and_column() {
    let made_up = MadeUp::new();
    let load = |text: &str| {
        std::fs::write(made_up.path("transforms.json"), text).unwrap();
        scene::load(made_up.folder.path(), &Options::default())
    };
    assert_message(load("{\n \"frames\": [,]\n}"), &["transforms.json", "line 2 column 13"]);
    assert_message(
        load("{\"fl_x\": NaN, \"frames\": []}"),
        &["transforms.json", "line 1 column 10", "NaN is not JSON"],
    );
    assert_message(load("{\n// by hand\n\"frames\": []}"), &["line 2 column 1: a comment begins here"]);
    assert_message(load("{\"frames\": ["), &["EOF", "line 1 column 12"]);
    assert_message(load("{}"), &["missing field `frames`"]);
    assert_message(load("{\"frames\": []}"), &["has no frames"]);
    assert_message(load("{\"fl_x\": \"long\", \"frames\": []}"), &["expected f64", "line 1"]);
    assert_message(load("{\"frames\": [{\"file_path\": \"a.png\"}]}"), &["missing field `transform_matrix`", "line 1"]);
}

#[test]
fn a_bad_frame_is_numbered() {
    let mut made_up = MadeUp::new();
    let good = made_up.transforms.clone();
    let mut check = |pointer: &str, value: Value, needles: &[&str]| {
        made_up.transforms = good.clone();
        match good.pointer(pointer) {
            Some(_) => *made_up.transforms.pointer_mut(pointer).unwrap() = value,
            None => {
                let (parent, key) = pointer.rsplit_once('/').unwrap();
                made_up.transforms.pointer_mut(parent).unwrap()[key] = value;
            }
        }
        made_up.assert_refused(needles);
    };
    let frame_2 = ["transforms.json`, frame 2 (`images/002.png`)"];
    let at_frame_2 = |more: &'static str| [frame_2[0], more];
    check("/frames/2/transform_matrix", json!([[1.0]]), &at_frame_2("not 4 x 4"));
    check("/frames/2/transform_matrix/0/0", json!(-1.0), &at_frame_2("not a rotation"));
    check("/frames/2/fl_x", json!(-3.0), &at_frame_2("fl_x = -3"));
    check("/frames/2/w", json!(0.2), &at_frame_2("w = 0"));
    check("/camera_model", json!("EQUIRECTANGULAR"), &["frame 0", "does not know the camera_model EQUIRECTANGULAR"]);
    check("/fl_x", Value::Null, &["frame 0", "no focal length"]);
    check("/frames/2/file_path", json!("../secret.png"), &["frame 2", "leads out of the scene folder"]);
    check("/frames/2/file_path", json!("images/../../secret.png"), &["frame 2", "leads out of the scene folder"]);
    check("/frames/2/file_path", json!("point_cloud.ply"), &["point_cloud.ply", "cannot be decoded"]);
}

#[test]
fn intrinsics_come_from_frame_top_angle_and_photo() {
    let mut made_up = MadeUp::new();
    made_up.transforms["k1"] = json!(0.1);
    let tenth = gprop::camera::Distortion::opencv(0.1, 0.0, 0.0, 0.0, 0.0);
    made_up.transforms["frames"][1]["fl_x"] = json!(20.0);
    made_up.transforms["frames"][1]["fl_y"] = json!(21.0);
    made_up.transforms["frames"][1]["cx"] = json!(3.5);
    let scene = made_up.load().unwrap();
    let [a, b] = [0, 1].map(|view| scene.views[view].camera.intrinsics);
    assert_eq!((a.width, a.height, a.fx, a.fy, a.cx, a.cy, a.distortion), (8, 6, 10.0, 10.0, 4.0, 3.0, tenth));
    assert_eq!((b.fx, b.fy, b.cx, b.cy, b.distortion), (20.0, 21.0, 3.5, 3.0, tenth));
    // A right angle over 8 pixels: f = 4. Neither focal length nor size is declared.
    made_up.transforms = json!({
        "camera_angle_x": std::f64::consts::FRAC_PI_2, "frames": made_up.transforms["frames"].as_array().unwrap()[2..],
    });
    let i = made_up.load().unwrap().views[0].camera.intrinsics;
    assert!((i.fx - 4.0).abs() < 1e-12 && i.fx == i.fy, "{i:?}");
    assert_eq!((i.width, i.height, i.cx, i.cy), (8, 6, 4.0, 3.0));
}

#[test]
fn photos_of_another_size_rescale_the_intrinsics() {
    let mut made_up = MadeUp::new();
    made_up.transforms["w"] = json!(16);
    made_up.transforms["h"] = json!(12);
    let scene = made_up.load().unwrap();
    let i = scene.views[0].camera.intrinsics;
    assert_eq!((i.width, i.height, i.fx, i.fy, i.cx, i.cy), (8, 6, 5.0, 5.0, 4.0, 3.0));
    assert_eq!(scene.warnings.len(), 1);
    assert!(
        scene.warnings[0].contains("4 photos") && scene.warnings[0].contains("16 x 12, found 8 x 6"),
        "{:?}",
        scene.warnings
    );
}

#[test]
fn view_names_are_unique_and_safe() {
    let mut made_up = MadeUp::new();
    for folder in ["left", "right eye"] {
        std::fs::create_dir(made_up.path("images").join(folder)).unwrap();
        RgbImage::new(8, 6).save(made_up.path("images").join(folder).join("A 1.png")).unwrap();
    }
    made_up.transforms["frames"][0]["file_path"] = json!("./images/left/A 1.png");
    made_up.transforms["frames"][1]["file_path"] = json!("images\\right eye\\A 1.png");
    let absolute = made_up.folder.path().canonicalize().unwrap().join("images/003.png");
    made_up.transforms["frames"][3]["file_path"] = json!(absolute);
    let scene = made_up.load().unwrap();
    let names: Vec<&str> = scene.views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["images_left_A_1", "images_right_eye_A_1", "images_002", "images_003"]);
    assert!(scene.views[0].image.ends_with("images/left/A 1.png"));
}
