//! The scenes with ground truth: `hammer` is a fixture; the others are used if they are available.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use gprop::camera::Camera;
use gprop::scene::{self, Scene, View};
use gprop::segment::LabelMap;

use crate::support::shared;

/// A scene with its held-out views.
pub struct Measured {
    pub folder: PathBuf,
    pub scene: Scene,
    pub held_out: Vec<HeldOut>,
}

/// A view that was used neither for training nor for the vote.
pub struct HeldOut {
    pub camera: Camera,
    /// RGBA, straight alpha.
    pub photo: image::RgbaImage,
    /// Part id of every pixel, 255 outside.
    pub parts: image::GrayImage,
    /// Planar depth in metres, 0 outside.
    pub depth: Vec<f32>,
}

/// `hammer`, and the other scenes if their folder is beside this crate's.
pub fn all() -> &'static [Measured] {
    static ALL: OnceLock<Vec<Measured>> = OnceLock::new();
    ALL.get_or_init(load_all)
}

fn load_all() -> Vec<Measured> {
    let others = ["mug", "table_lamp", "chair"].map(|name| shared("vote::scenes", &format!("scenes/{name}")));
    std::iter::once(hammer()).chain(others.iter().flatten().map(|folder| load(folder))).collect()
}

/// The fixture.
pub fn hammer() -> Measured {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer"))
}

fn load(folder: &Path) -> Measured {
    let options = scene::Options { scale: scene::ScaleChoice::Metric, ..Default::default() };
    let scene = scene::load(folder, &options).unwrap();
    let truth = folder.join("ground_truth");
    let text = std::fs::read_to_string(truth.join("transforms_eval.json")).unwrap();
    let document: serde_json::Value = serde_json::from_str(&text).unwrap();
    let depth_unit_m = document["depth_unit_m"].as_f64().unwrap() as f32;
    let held_out = document["frames"].as_array().unwrap().iter().map(|frame| {
        let photo = frame["file_path"].as_str().unwrap();
        let name = Path::new(photo).file_name().unwrap();
        let open = |path: PathBuf| image::open(path).unwrap();
        let depth = open(truth.join("eval/depth").join(name)).into_luma16();
        HeldOut {
            camera: camera(&document, frame, &scene),
            photo: open(truth.join(photo)).into_rgba8(),
            parts: open(truth.join("eval/part_maps").join(name)).into_luma8(),
            depth: depth.pixels().map(|p| f32::from(p.0[0]) * depth_unit_m).collect(),
        }
    });
    Measured { folder: folder.to_owned(), held_out: held_out.collect(), scene }
}

fn camera(document: &serde_json::Value, frame: &serde_json::Value, scene: &Scene) -> Camera {
    let number = |key: &str| document[key].as_f64().unwrap();
    let row = |r: usize, c: usize| frame["transform_matrix"][r][c].as_f64().unwrap();
    let pose = nalgebra::Matrix4::from_fn(row);
    let mut intrinsics = scene.views[0].camera.intrinsics;
    (intrinsics.fx, intrinsics.fy) = (number("fl_x"), number("fl_y"));
    (intrinsics.cx, intrinsics.cy) = (number("cx"), number("cy"));
    Camera { intrinsics, camera_from_world: gprop::camera::camera_from_world_of_opengl(&pose).unwrap() }
}

impl Measured {
    /// The ground truth's part maps of the views that a run would choose, as label maps: ids from 1.
    pub fn true_maps(&self) -> Vec<(View, LabelMap)> {
        let views = self.scene.chosen_views(&scene::Options::default()).unwrap();
        let map_of = |view: &View| {
            let file = self.folder.join("ground_truth/part_maps").join(format!("{}.png", view.name));
            let map = image::open(file).unwrap().into_luma8();
            let labels = map.pixels().map(|p| if p.0[0] == 255 { 0 } else { u16::from(p.0[0]) + 1 }).collect();
            LabelMap { width: map.width(), height: map.height(), labels }
        };
        views.into_iter().map(|view| (view.clone(), map_of(&view))).collect()
    }

    /// Names of the parts by their id in the part maps.
    pub fn part_names(&self) -> Vec<String> {
        let text = std::fs::read_to_string(self.folder.join("ground_truth/parts.json")).unwrap();
        let document: serde_json::Value = serde_json::from_str(&text).unwrap();
        let parts = document["parts"].as_array().unwrap();
        parts.iter().map(|part| part["name"].as_str().unwrap().to_owned()).collect()
    }
}
