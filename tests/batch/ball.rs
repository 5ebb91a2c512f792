//! A data set of balls of two materials: three photos each, label maps instead of SAM, and a server that always gives
//! the same answer.

use std::fs;
use std::path::{Path, PathBuf};

use gprop::camera::Camera;
use gprop::scene::splat::ply;
use gprop::segment::LabelMap;
use image::{Rgba, RgbaImage};
use nalgebra::{Matrix4, Point3, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::query::{a, completion, good_answer};
use crate::support::server::{MockServer, Request, Response, json_of};
use crate::vote::build::{Blob, camera_at, cloud};

const RADIUS_M: f64 = 0.1;
const EYES: [[f64; 3]; 3] = [[0.4, 0.1, 0.05], [-0.2, 0.35, 0.0], [-0.15, -0.3, 0.2]];

/// Scenes `ball-0`, `ball-1`, ... in a folder, each with its label maps.
pub struct Balls {
    home: TempDir,
    server: MockServer,
}

impl Balls {
    pub fn new(count: usize) -> Self {
        Self::answering(count, &good_answer(a("wood")))
    }

    /// The same with a server that gives this answer.
    pub fn answering(count: usize, answer: &Value) -> Self {
        let answer = answer.clone();
        Self::asked(count, move |_| answer.clone())
    }

    /// The same with a server that answers each request with what the function makes of its body.
    pub fn asked(count: usize, answer: impl Fn(&Value) -> Value + Send + Sync + 'static) -> Self {
        let respond =
            move |request: &Request| Response::new(200).json(completion(&answer(&json_of(request)).to_string()));
        let server = MockServer::new(respond);
        let balls = Self { home: tempfile::tempdir().unwrap(), server };
        (0..count).for_each(|number| balls.write(number));
        balls
    }

    /// The data set.
    pub fn folder(&self) -> PathBuf {
        self.home.path().join("scenes")
    }

    pub fn scene(&self, number: usize) -> PathBuf {
        self.folder().join(format!("ball-{number}"))
    }

    pub fn labels(&self, number: usize) -> PathBuf {
        self.scene(number).join("labels")
    }

    /// True label maps of a scene, in its `ground_truth/maps`: both parts are wood. Also writes true part maps and masses.
    pub fn write_truth(&self, number: usize) {
        let maps = self.scene(number).join("ground_truth/maps");
        let part_maps = maps.with_file_name("part_maps");
        fs::create_dir_all(&maps).unwrap();
        fs::create_dir_all(&part_maps).unwrap();
        for entry in fs::read_dir(self.labels(number)).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), maps.join(entry.file_name())).unwrap();
            let mut parts = image::open(entry.path()).unwrap().into_luma16();
            parts.pixels_mut().for_each(|pixel| pixel.0[0] = pixel.0[0].wrapping_sub(1).min(255));
            let parts = image::GrayImage::from_fn(parts.width(), parts.height(), |x, y| {
                image::Luma([parts.get_pixel(x, y).0[0] as u8])
            });
            parts.save(part_maps.join(entry.file_name())).unwrap();
        }
        fs::write(maps.join("labels.json"), r#"{"1": "wood", "2": "wood"}"#).unwrap();
        fs::write(maps.with_file_name("parts.json"), r#"{"total_mass_kg": 1.0, "parts": []}"#).unwrap();
    }

    /// Removes the label maps of a scene, so that it is segmented by SAM, which needs models.
    pub fn forget_labels(&self, number: usize) {
        let path = self.scene(number).join("gprop.toml");
        let options = fs::read_to_string(&path).unwrap();
        let others: Vec<&str> = options.lines().filter(|line| !line.starts_with("segments")).collect();
        fs::write(&path, others.join("\n")).unwrap();
    }

    /// The flags that name the server and its model.
    pub fn answers(&self) -> [String; 4] {
        ["--lmm-url".into(), format!("{}/v1", self.server.uri()), "--lmm-model".into(), "test-model".into()]
    }

    fn write(&self, number: usize) {
        let (scene, labels) = (self.scene(number), self.labels(number));
        fs::create_dir_all(scene.join("images")).unwrap();
        fs::create_dir_all(&labels).unwrap();
        write_cloud(&scene.join("point_cloud.ply"), 200 + 100 * number);
        let mut frames = Vec::new();
        for (view, eye) in EYES.into_iter().enumerate() {
            let camera = camera_at(eye, [0.0; 3]);
            let map = ball_seen_by(&camera);
            let file = format!("images/{view:03}.png");
            photo(&map, number as u8).save(scene.join(&file)).unwrap();
            fs::write(labels.join(format!("{view:03}.png")), map.to_png().unwrap()).unwrap();
            frames.push(frame(&file, &camera));
        }
        let intrinsics = camera_at(EYES[0], [0.0; 3]).intrinsics;
        let transforms = json!({
            "w": intrinsics.width, "h": intrinsics.height, "fl_x": intrinsics.fx, "fl_y": intrinsics.fy,
            "cx": intrinsics.cx, "cy": intrinsics.cy, "frames": frames,
        });
        fs::write(scene.join("transforms.json"), transforms.to_string()).unwrap();
        // A few hundred Gaussians are too few to find parts in.
        let options = concat!(
            "scale = \"metric\"\nsegments = \"labels\"\nask = \"segments\"\n",
            "volume-cells = 20000\nsheet-size = 256\n"
        );
        fs::write(scene.join("gprop.toml"), options).unwrap();
    }
}

/// Gaussians spread evenly over the ball's surface.
fn write_cloud(path: &Path, count: usize) {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let blobs: Vec<Blob> = (0..count)
        .map(|index| {
            let z = 1.0 - 2.0 * (index as f64 + 0.5) / count as f64;
            let (sin, cos) = (golden * index as f64).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            let at = [ring * cos, ring * sin, z].map(|side| (side * RADIUS_M) as f32);
            Blob::round(at, 0.012, 0.95)
        })
        .collect();
    let mut bytes = Vec::new();
    ply::write(&mut bytes, &cloud(&blobs), &[]).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Segment 1 is the upper half, segment 2 the lower.
fn ball_seen_by(camera: &Camera) -> LabelMap {
    let world_from_camera = camera.camera_from_world.inverse();
    let eye = world_from_camera.translation.vector;
    let intrinsics = camera.intrinsics;
    let label = |x: u32, y: u32| {
        let along = Vector3::new(
            (f64::from(x) + 0.5 - intrinsics.cx) / intrinsics.fx,
            (f64::from(y) + 0.5 - intrinsics.cy) / intrinsics.fy,
            1.0,
        );
        let along = (world_from_camera.rotation * along).normalize();
        let half = eye.dot(&along);
        let root = half * half - eye.norm_squared() + RADIUS_M * RADIUS_M;
        let hit = (root >= 0.0).then(|| Point3::from(eye + along * (-half - root.sqrt())));
        hit.map_or(0, |hit| if hit.z >= 0.0 { 1 } else { 2 })
    };
    let (width, height) = (intrinsics.width, intrinsics.height);
    let labels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| label(x, y)).collect();
    LabelMap { width, height, labels }
}

fn photo(map: &LabelMap, tint: u8) -> RgbaImage {
    RgbaImage::from_fn(map.width, map.height, |x, y| match map.labels[(y * map.width + x) as usize] {
        0 => Rgba([0, 0, 0, 0]),
        1 => Rgba([150, 100, 60 + 5 * tint, 255]),
        _ => Rgba([90, 90 + 5 * tint, 100, 255]),
    })
}

/// A frame of transforms.json, whose cameras have y up and z backward.
fn frame(file: &str, camera: &Camera) -> Value {
    let opengl = Matrix4::from_diagonal(&[1.0, -1.0, -1.0, 1.0].into());
    let pose = camera.camera_from_world.inverse().to_homogeneous() * opengl;
    let rows: Vec<Vec<f64>> = (0..4).map(|row| (0..4).map(|column| pose[(row, column)]).collect()).collect();
    json!({ "file_path": file, "transform_matrix": rows })
}
