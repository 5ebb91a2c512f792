//! Several things on one table: which are objects, what belongs to each, and commands that take one or all.

use std::path::Path;

use gprop::camera::Camera;
use gprop::gaussians::{ELLIPSOID_DEVIATIONS, Gaussians};
use gprop::pipeline::{Pipeline, Plan, Stage};
use gprop::render::{RenderOptions, render, render_labels};
use gprop::scene::splat::ply;
use gprop::scene::{self, ObjectNumber, ObjectSource, Options, SceneError, StandingObjects};
use gprop::segment::LabelMap;
use image::{DynamicImage, GrayImage};
use nalgebra::{Matrix4, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::folder::{assert_message, options};
use crate::run::{for_python, gprop};
use crate::support::browser::{Page, Point};
use crate::support::shared;
use crate::vote::build::{Blob, camera_at, cloud};

/// The photos' focal length in pixels, and their size.
const FOCAL: f64 = 150.0;
const SIZE: (u32, u32) = (192, 144);
/// Distance between the Gaussians of a thing, and their standard deviation.
const STEP: f32 = 0.02;
const DEVIATION: f32 = 0.01;
/// Of the Gaussians, by the thing that they show.
const NOTHING: u32 = 0;
const BRICK: u32 = 1;
const CUP: u32 = 2;

fn grid(low: f32, high: f32, step: f32) -> impl Iterator<Item = f32> + Clone {
    let count = ((high - low) / step).round() as usize;
    (0..=count).map(move |n| low + step * n as f32)
}

/// The surface of a block, without its bottom.
fn block(low: [f32; 3], high: [f32; 3], color: [f32; 3]) -> Vec<Blob> {
    let [xs, ys, zs] = [0, 1, 2].map(|axis| grid(low[axis], high[axis], STEP));
    let is_end = |value: f32, axis: usize| (value - low[axis]).abs() < 1e-3 || (value - high[axis]).abs() < 1e-3;
    let mut blobs = Vec::new();
    for x in xs {
        for y in ys.clone() {
            for z in zs.clone() {
                if is_end(x, 0) || is_end(y, 1) || (z - high[2]).abs() < 1e-3 {
                    let shade = 0.15 * ((20.0 * x).sin() + (17.0 * y).cos() + (23.0 * z).sin()) / 3.0;
                    blobs.push(Blob { color: color.map(|c| c + shade), ..Blob::round([x, y, z], DEVIATION, 0.95) });
                }
            }
        }
    }
    blobs
}

/// The colour of the table's cloth at a place.
fn cloth(x: f32, y: f32) -> [f32; 3] {
    [0.5 + 0.2 * (7.0 * x).sin() * (9.0 * y).cos(), 0.6, 0.4]
}

/// A table that reaches from -1 to `end` along both axes.
fn table_top(end: f32) -> Vec<Blob> {
    let blob_at = |x: f32, y: f32| Blob {
        color: cloth(x, y),
        scale: [0.025, 0.025, 0.002],
        ..Blob::round([x, y, 0.0], 0.025, 0.95)
    };
    grid(-1.0, end, 0.04).flat_map(|x| grid(-1.0, end, 0.04).map(move |y| blob_at(x, y))).collect()
}

/// A brick and a cup with a saucer that hovers over it on a table; a wall that stands on the table's edge; a sack beside the table,
/// on the floor; crumbs on the table; a wrinkle of its cloth. For each Gaussian, the thing that it shows.
fn things() -> (Vec<Blob>, Vec<u32>) {
    let wrinkle = block([0.1, 0.2, 0.0], [0.4, 0.3, 0.02], [0.0; 3]).into_iter().map(|blob| {
        let [x, y, _] = blob.position;
        Blob { color: cloth(x, y), ..blob }
    });
    let cup = block([-0.5, -0.1, 0.01], [-0.34, 0.06, 0.15], [0.2, 0.3, 0.8]);
    let lid = block([-0.48, -0.08, 0.25], [-0.36, 0.04, 0.27], [0.2, 0.3, 0.8]);
    let all = [
        (NOTHING, table_top(1.0)),
        (BRICK, block([0.1, -0.3, 0.01], [0.5, -0.1, 0.21], [0.8, 0.3, 0.2])),
        (CUP, cup),
        (CUP, lid),
        (NOTHING, block([-0.9, 1.0, 0.01], [0.9, 1.04, 0.8], [0.9, 0.9, 0.8])),
        (NOTHING, block([1.2, 0.0, -0.4], [1.5, 0.3, 0.1], [0.4, 0.4, 0.1])),
        (NOTHING, block([0.3, 0.4, 0.01], [0.32, 0.42, 0.03], [0.9, 0.9, 0.2])),
        (NOTHING, wrinkle.collect()),
    ];
    together(all)
}

fn together<const N: usize>(all: [(u32, Vec<Blob>); N]) -> (Vec<Blob>, Vec<u32>) {
    let (mut blobs, mut thing_of) = (Vec::new(), Vec::new());
    for (thing, of_thing) in all {
        thing_of.extend(std::iter::repeat_n(thing, of_thing.len()));
        blobs.extend(of_thing);
    }
    (blobs, thing_of)
}

fn turned(mut gaussians: Gaussians, turn: &UnitQuaternion<f64>) -> Gaussians {
    for i in 0..gaussians.len() {
        let own = turn * gaussians.rotation(i);
        gaussians.positions[i] = (turn * gaussians.center(i)).map(|side| side as f32).into();
        gaussians.rotations[i] = [own.w, own.i, own.j, own.k].map(|part| part as f32);
    }
    gaussians
}

/// The things in a scene's folder, in another frame, with photos from all around and the true maps.
pub struct Table {
    folder: TempDir,
    turn: UnitQuaternion<f64>,
    /// For each Gaussian.
    thing_of: Vec<u32>,
}

impl Table {
    pub fn new() -> Self {
        Self::with(things())
    }

    fn with((blobs, thing_of): (Vec<Blob>, Vec<u32>)) -> Self {
        let folder = TempDir::new().unwrap();
        let turn = UnitQuaternion::from_euler_angles(0.6, -0.8, 2.3);
        let splat = turned(cloud(&blobs), &turn);
        let mut bytes = Vec::new();
        ply::write(&mut bytes, &splat, &[]).unwrap();
        std::fs::write(folder.path().join("point_cloud.ply"), bytes).unwrap();
        let table = Self { folder, turn, thing_of };
        table.take_photos(&splat);
        table
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    fn take_photos(&self, splat: &Gaussians) {
        let maps = self.path().join("ground_truth/object_maps");
        std::fs::create_dir_all(&maps).unwrap();
        std::fs::create_dir(self.path().join("images")).unwrap();
        let mut frames = Vec::new();
        let mut intrinsics = camera_at([1.0; 3], [0.0; 3]).intrinsics.resized(SIZE.0, SIZE.1);
        (intrinsics.fx, intrinsics.fy) = (FOCAL, FOCAL);
        for n in 0..12 {
            let (sin, cos) = (f64::from(n) * std::f64::consts::FRAC_PI_6).sin_cos();
            let upright = camera_at([1.4 * cos, 1.4 * sin - 0.1, 0.9], [0.0, -0.1, 0.1]);
            let camera_from_world = upright.camera_from_world * self.turn.inverse();
            let camera = Camera { camera_from_world, intrinsics };
            let drawn = render(splat, &camera, &RenderOptions::default()).to_image([1.0; 3]);
            let file = format!("images/{n:03}.png");
            DynamicImage::ImageRgba8(drawn).into_rgb8().save(self.path().join(&file)).unwrap();
            let labels = render_labels(splat, &camera, &self.thing_of, &RenderOptions::default());
            let id = |label: Option<u32>| label.filter(|thing| *thing != NOTHING).map_or(255, |thing| thing as u8);
            let map = GrayImage::from_raw(SIZE.0, SIZE.1, labels.into_iter().map(id).collect()).unwrap();
            map.save(maps.join(format!("{n:03}.png"))).unwrap();
            let pose = camera.camera_from_world.inverse().to_homogeneous()
                * Matrix4::from_diagonal(&[1.0, -1.0, -1.0, 1.0].into());
            let rows: Vec<Vec<f64>> = (0..4).map(|row| (0..4).map(|column| pose[(row, column)]).collect()).collect();
            frames.push(json!({ "file_path": file, "transform_matrix": rows }));
        }
        let i = intrinsics;
        let transforms = json!({
            "w": i.width, "h": i.height, "fl_x": i.fx, "fl_y": i.fy, "cx": i.cx, "cy": i.cy, "frames": frames,
        });
        std::fs::write(self.path().join("transforms.json"), transforms.to_string()).unwrap();
    }

    /// Writes the truth; boxes are those of the Gaussians' ellipsoids.
    fn write_truth(&self) {
        let splat = ply::read(&self.path().join("point_cloud.ply")).unwrap().gaussians;
        let object = |thing: u32, name: &str| {
            let centers = || (0..splat.len()).filter(|i| self.thing_of[*i] == thing).map(|i| splat.center(i));
            let (low, high) = centers()
                .fold((centers().next().unwrap(), centers().next().unwrap()), |(low, high), at| {
                    (low.inf(&at), high.sup(&at))
                });
            let reach = Vector3::repeat(ELLIPSOID_DEVIATIONS * f64::from(DEVIATION));
            let [low, high]: [[f64; 3]; 2] = [(low - reach).coords.into(), (high + reach).coords.into()];
            json!({ "id": thing, "name": name, "box_axis_aligned_colmap": [low, high] })
        };
        let up: [f64; 3] = (self.turn * Vector3::z()).into();
        let truth = json!({
            "objects": [object(BRICK, "brick"), object(CUP, "cup")], "up_colmap": up, "metres_per_colmap_unit": 0.5,
        });
        std::fs::write(self.path().join("ground_truth/objects.json"), truth.to_string()).unwrap();
    }

    /// Label maps of all things, as another program would make them of the photos. Returns their folder.
    pub fn write_labels(&self) -> String {
        let folder = self.path().join("labels");
        std::fs::create_dir(&folder).unwrap();
        for n in 0..12 {
            let labels = self.true_map(n).into_raw().into_iter().map(|id| if id == 255 { 0 } else { u16::from(id) });
            let map = LabelMap { width: SIZE.0, height: SIZE.1, labels: labels.collect() };
            std::fs::write(folder.join(format!("{n:03}.png")), map.to_png().unwrap()).unwrap();
        }
        folder.to_str().unwrap().to_owned()
    }

    /// The thing on each pixel of a photo, 255 for none.
    fn true_map(&self, n: usize) -> GrayImage {
        image::open(self.path().join(format!("ground_truth/object_maps/{n:03}.png"))).unwrap().into_luma8()
    }

    pub fn run(&self, words: &[&str]) -> (Option<i32>, String, String) {
        let mut command = gprop();
        let output = command.args(&words[..1]).arg(self.path()).args(&words[1..]).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    }

    /// Number of Gaussians of all things together.
    pub fn gaussians(&self) -> usize {
        self.thing_of.len()
    }

    /// Stores an answer about the object, as a run does.
    fn answer(&self, object: &str, taken_for: &str) {
        let answer = json!({
            "view": "000", "status": "answered", "object": taken_for, "printed": null, "pieces": [], "unnumbered": [],
            "hypotheses": [{ "what": taken_for, "probability": 1.0, "mass_kg": [0.1, 0.2] }],
        });
        let work = self.path().join("gprop/objects").join(object);
        std::fs::create_dir_all(&work).unwrap();
        std::fs::write(work.join("object.json"), answer.to_string()).unwrap();
    }

    fn views_of(&self, object: &str) -> Value {
        let path = self.path().join("gprop/objects").join(object).join("views.json");
        serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
    }
}

#[test]
fn what_stands_on_the_table_is_found_whole_and_the_room_is_not() {
    let table = Table::new();
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!(found.count, 2);
    // Every Gaussian of the two, the lowest on the table and the lid included, and no other. The brick has more.
    assert_eq!(found.object_of_gaussian, table.thing_of);
    let normal = table.turn * Vector3::z();
    assert!(Vector3::from(found.support.normal).angle(&normal) < 0.003, "{:?}", found.support);
    assert!(found.support.offset.abs() < 0.003, "{:?}", found.support);
    let cup = ObjectNumber::first(2).last().unwrap();
    let size = found.gaussians_of(cup).len();
    assert_eq!(size, table.thing_of.iter().filter(|thing| **thing == CUP).count());
}

/// Rows of small blocks on a table, not quite equally high; under them, no photo shows the table. For each Gaussian, the number of its block.
fn rows_of_blocks([columns, rows]: [u32; 2], spacing: f32, height: f32) -> (Vec<Blob>, Vec<u32>) {
    const HALF: f32 = 0.02;
    let (mut blobs, mut block_of) = (Vec::new(), Vec::new());
    let mut corners = Vec::new();
    for n in 0..columns * rows {
        let [x, y] =
            [(n % columns, columns), (n / columns, rows)].map(|(at, count)| at as f32 - 0.5 * (count - 1) as f32);
        let [x, y] = [spacing * x, spacing * y];
        let color = [0.2, 0.4, 0.9].map(|channel| channel * (0.5 + 0.5 * ((n * 7) % 11) as f32 / 10.0));
        let floor = 0.01 + 0.001 * (n % 5) as f32;
        let of_block = block([x - HALF, y - HALF, floor], [x + HALF, y + HALF, floor + height], color);
        block_of.extend(std::iter::repeat_n(n + 1, of_block.len()));
        blobs.extend(of_block);
        corners.push([x, y]);
    }
    let is_under =
        |[x, y, _]: [f32; 3]| corners.iter().any(|at| (x - at[0]).abs() <= HALF && (y - at[1]).abs() <= HALF);
    let table: Vec<Blob> = table_top(1.0).into_iter().filter(|blob| !is_under(blob.position)).collect();
    block_of.extend(std::iter::repeat_n(NOTHING, table.len()));
    blobs.extend(table);
    (blobs, block_of)
}

/// There are several times as many Gaussians on the blocks as on the table.
#[test]
fn two_hundred_things_are_found_each_by_itself() {
    let table = Table::with(rows_of_blocks([14, 15], 0.1, 0.06));
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!((found.count, &found.warnings), (210, &Vec::new()));
    assert_eq!(found.object_of_gaussian, table.thing_of);
    let normal = table.turn * Vector3::z();
    assert!(Vector3::from(found.support.normal).angle(&normal) < 0.003, "{:?}", found.support);
    let (code, text, error) = table.run(&["objects"]);
    assert!(code == Some(0) && text.contains(": 210 objects\n") && text.contains("object_210 "), "{text}{error}");
    let list: Value = serde_json::from_slice(&std::fs::read(table.path().join("gprop/objects.json")).unwrap()).unwrap();
    assert!(list["objects"].as_array().unwrap().iter().all(|object| object["photos"].as_u64() > Some(0)), "{list}");
    let page = std::fs::metadata(table.path().join("gprop/index.html")).unwrap().len();
    assert!(page < 10 << 20, "{page} bytes");
}

#[test]
fn things_that_touch_in_one_place_are_told_apart() {
    let with_second = |low: [f32; 3], high: [f32; 3]| {
        let brick = block([0.1, -0.3, 0.01], [0.5, -0.1, 0.21], [0.8, 0.3, 0.2]);
        Table::with(together([(NOTHING, table_top(1.0)), (BRICK, brick), (CUP, block(low, high, [0.2, 0.3, 0.8]))]))
    };
    let find = |table: &Table| StandingObjects::find(table.path(), &Options::default()).unwrap();
    let corner_to_corner = with_second([0.5, -0.1, 0.01], [0.7, 0.1, 0.15]);
    let found = find(&corner_to_corner);
    assert_eq!(found.count, 2);
    let truth = found.object_of_gaussian.iter().zip(&corner_to_corner.thing_of);
    let wrong = truth.filter(|(found, true_thing)| found != true_thing).count();
    // Along the edge that they share, each has eight, in the same places.
    assert!(wrong <= 8, "{wrong} Gaussians");
    let side_by_side = with_second([0.5, -0.3, 0.01], [0.9, -0.1, 0.15]);
    assert_eq!(find(&side_by_side).count, 1);
}

#[test]
fn things_in_rows_of_any_height_and_distance_are_found() {
    for (spacing, height) in [(0.19, 0.06), (0.13, 0.06), (0.13, 0.04), (0.09, 0.1), (0.19, 0.14)] {
        let table = Table::with(rows_of_blocks([9, 9], spacing, height));
        let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
        assert_eq!(found.object_of_gaussian, table.thing_of, "{spacing} apart, {height} high: {} found", found.count);
    }
}

#[test]
fn what_stands_too_far_from_what_the_cameras_look_at_is_counted() {
    let (mut blobs, mut thing_of) = rows_of_blocks([2, 1], 0.2, 0.06);
    let far: Vec<Blob> =
        table_top(1.6).into_iter().filter(|blob| blob.position[0] > 1.0 || blob.position[1] > 1.0).collect();
    let aside = block([1.35, -0.2, 0.01], [1.41, -0.14, 0.07], [0.9, 0.2, 0.2]);
    thing_of.extend(std::iter::repeat_n(NOTHING, far.len() + aside.len()));
    blobs.extend(far.into_iter().chain(aside));
    let table = Table::with((blobs, thing_of));
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!(found.count, 2);
    let warning =
        found.warnings.iter().find(|warning| warning.starts_with("1 more thing on the surface")).expect("a warning");
    assert!(warning.contains("left out") && warning.contains("--object-box"), "{warning}");
}

/// Two bricks of which nothing shows on what they stand.
#[test]
fn without_a_surface_no_objects_are_told_apart_and_the_message_says_what_to_do() {
    let brick = |x: f32| block([x, -0.3, -0.2], [x + 0.24, 0.1, 0.3], [0.8, 0.3, 0.2]);
    let table = Table::with(together([(BRICK, brick(-0.5)), (CUP, brick(0.2))]));
    for words in [&["objects"][..], &["run", "--object", "all"]] {
        let (code, _, error) = table.run(words);
        assert_eq!(code, Some(3), "{words:?}: {error}");
        for word in ["no objects to tell apart", "surface", "photos without masks go all around", "--object-box"] {
            assert!(error.contains(word), "{words:?}: {error}");
        }
        assert!(!table.path().join("gprop/objects.json").exists());
    }
}

#[test]
fn a_splat_of_a_room_without_photos_or_cameras_ends_with_what_to_do() {
    let table = Table::new();
    std::fs::remove_file(table.path().join("transforms.json")).unwrap();
    for words in [&["objects"][..], &["run"], &["run", "--object", "all"], &["run", "--object", "1"]] {
        let (code, _, error) = table.run(words);
        assert_eq!(code, Some(3), "{words:?}: {error}");
        let folder = table.path().display().to_string();
        for word in ["no cameras in", &folder, "transforms.json", "--cameras PATH", "--render-views N"] {
            assert!(error.contains(word), "{words:?}: {error}");
        }
    }
    let (code, _, error) = table.run(&["objects", "--render-views", "4"]);
    assert!(code == Some(3) && error.contains("there are no photos") && error.contains("--object-box"), "{error}");
    let (code, text, error) = table.run(&["inspect"]);
    assert!(code == Some(0) && text.contains("Gaussians"), "{text}{error}");
    // With cameras, but without photos.
    let table = Table::new();
    std::fs::remove_dir_all(table.path().join("images")).unwrap();
    let (code, _, error) = table.run(&["objects"]);
    assert!(code == Some(3) && error.contains("transforms.json") && error.contains("--render-views N"), "{error}");
}

/// Along two of its sides the table ends.
#[test]
fn what_the_cameras_look_at_may_stand_in_a_corner() {
    let brick = block([-0.2, -0.2, 0.01], [0.08, 0.08, 0.21], [0.8, 0.3, 0.2]);
    let table = Table::with(together([(NOTHING, table_top(0.12)), (BRICK, brick)]));
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!(found.object_of_gaussian, table.thing_of);
}

/// A doll on a bed whose cover wrinkles as high as its foot is: by height the foot is bed.
#[test]
fn what_sinks_into_a_bed_belongs_to_the_object() {
    let wrinkled = |blob: Blob| {
        let [x, y, _] = blob.position;
        Blob { position: [x, y, 0.03 * (13.0 * x).sin() * (11.0 * y).cos()], scale: [0.025; 3], ..blob }
    };
    let body = block([-0.1, -0.2, 0.0], [0.1, 0.0, 0.3], [0.8, 0.3, 0.2]);
    let foot = block([-0.1, 0.0, -0.025], [0.1, 0.2, 0.015], [0.2, 0.2, 0.9]);
    let feet = body.len()..body.len() + foot.len();
    let bed: Vec<Blob> = table_top(1.0).into_iter().map(wrinkled).collect();
    let table = Table::with(together([(BRICK, body), (BRICK, foot), (NOTHING, bed)]));
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!(found.count, 1);
    let missing = feet.clone().filter(|i| found.object_of_gaussian[*i] == NOTHING).count();
    let of_bed = found.object_of_gaussian[feet.end..].iter().filter(|object| **object != NOTHING).count();
    assert!(missing * 20 < feet.len(), "{missing} of {}", feet.len());
    assert!(of_bed * 50 < found.object_of_gaussian.len() - feet.end, "{of_bed}");
    // The only thing that stands there is what other commands take.
    let scene = scene::load(table.path(), &options(&[]).unwrap()).unwrap();
    assert_eq!(scene.object_source, ObjectSource::Standing);
}

#[test]
fn one_object_is_a_scene_of_its_own() {
    let table = Table::new();
    let load = |arguments: &[&str]| scene::load(table.path(), &options(arguments).unwrap());
    let cup = load(&["--object", "2"]).unwrap();
    assert_eq!(cup.object_source, ObjectSource::Standing);
    assert_eq!(cup.gaussians.len() + cup.surroundings.len(), table.thing_of.len());
    assert_eq!(cup.gaussians.len(), table.thing_of.iter().filter(|thing| **thing == CUP).count());
    let height = cup.object_bounds().size().z;
    assert!((height - 0.26).abs() < 0.01, "{height}: from the table to the lid");
    assert_message(load(&["--object", "object_3"]), &["--object object_3", "only 2 objects stand", "gprop objects"]);
    assert_message(load(&["--object", "all"]), &["--object all is for `gprop run`"]);
    assert!(matches!(load(&["--object", "1", "--render-views", "3"]), Err(SceneError::NoSupport(_))));
    // Without a choice, the densest cluster is the object, and the user is told that there are others. Commands want a choice.
    let densest = load(&[]).unwrap();
    assert_eq!(densest.object_source, ObjectSource::Cluster);
    assert!(densest.warnings.iter().any(|warning| warning.starts_with("2 objects stand")), "{:?}", densest.warnings);
    assert_eq!(densest.unchosen, Some(2));
    let (code, _, error) = table.run(&["query", "--dry-run"]);
    assert!(code == Some(2) && error.contains("2 objects stand") && error.contains("`gprop run SCENE`"), "{error}");
    let of_box = load(&["--object", "2", "--object-box=-9,-9,-9:9,9,9"]).unwrap();
    assert_eq!(of_box.object_source, ObjectSource::Box, "the last one counts");
}

#[test]
fn a_pixel_of_a_photo_chooses_the_object_that_it_shows() {
    let table = Table::new();
    let map = table.true_map(9);
    let place_of = |thing: u32| {
        let mine: Vec<_> = map.enumerate_pixels().filter(|(_, _, id)| u32::from(id.0[0]) == thing).collect();
        let (x, y, _) = mine[mine.len() / 2];
        format!("009:{x},{y}")
    };
    let cup = scene::load(table.path(), &options(&["--object-at", &place_of(CUP)]).unwrap()).unwrap();
    assert!(cup.name.ends_with("_object_2"), "{}", cup.name);
    let at_table = scene::load(table.path(), &options(&["--object-at", "009:0,0"]).unwrap());
    assert_message(at_table, &["--object-at 009:0,0", "192 x 144", "it shows object_1 (such as at ", "object_2"]);
    let outside = scene::load(table.path(), &options(&["--object-at", "009:192,0"]).unwrap());
    assert_message(outside, &["--object-at 009:192,0", "shows no object"]);
    let elsewhere = scene::load(table.path(), &options(&["--object-at", "99:1,1"]).unwrap());
    assert_message(elsewhere, &["no view is named `99`", "000"]);
    // The results go where those of the same object by its number go, and a later command finds them.
    let (code, _, error) = table.run(&["run", "--to", "scene", "--object-at", &place_of(BRICK)]);
    assert!(code == Some(0) && table.views_of("object_1")["gaussians"].is_number(), "{error}");
    let (code, text, error) = table.run(&["run", "--to", "scene", "--dry-run", "--object", "1"]);
    assert_eq!((code, text.trim()), (Some(0), "scene     done"), "{error}");
    let mut of_library = gprop::pipeline::Options::default();
    of_library.scene = options(&["--object-at", &place_of(CUP)]).unwrap();
    let plan = Plan::to(Stage::Scene);
    Pipeline::builder(table.path()).options(of_library).plan(plan).open().unwrap().run().unwrap();
    assert!(table.views_of("object_2")["gaussians"].is_number());
    let (code, _, error) = table.run(&["run", "--object-at", "009"]);
    assert!(code == Some(2) && error.contains("--object-at 009: not VIEW:X,Y"), "{error}");
}

#[test]
fn an_object_is_chosen_by_what_the_model_took_it_for() {
    let table = Table::new();
    let chosen = |option: &str| table.run(&["run", "--to", "scene", "--dry-run", option]);
    let (code, _, error) = chosen("--object=mug");
    assert!(code == Some(2) && error.contains("none was asked about yet") && error.contains("object_2"), "{error}");
    table.answer("object_1", "Red brick");
    table.answer("object_2", "blue mug with a lid");
    let (code, text, error) = chosen("--object=MUG");
    assert!(code == Some(0) && text.trim() == "scene     to do", "{text}{error}");
    assert!(!table.path().join("gprop/objects/object_2/views.json").exists());
    let (code, _, error) = table.run(&["run", "--to", "scene", "--object", "blue mug"]);
    assert!(code == Some(0) && table.views_of("object_2")["gaussians"].is_number(), "{error}");
    let (code, _, error) = chosen("--object=bowl");
    let all = "there are object_1 (Red brick), object_2 (blue mug with a lid)";
    assert!(code == Some(2) && error.contains("--object bowl") && error.contains(all), "{error}");
    // By the same name for a weight, also in the work folder of another.
    let (code, _, error) = table.run(&["run", "--to", "scene", "--object", "1", "--known-mass", "mug=118g"]);
    assert_eq!(code, Some(0), "{error}");
    let record = std::fs::read_to_string(table.path().join("gprop/objects/object_1/run.json")).unwrap();
    assert!(!record.contains("mug") && record.contains("object_1"), "{record}");
    let (code, _, error) = chosen("--known-mass=pan=118g");
    assert!(code == Some(2) && error.contains("--known-mass pan") && error.contains(all), "{error}");
    let (code, text, error) = table.run(&["run", "--to", "scene"]);
    assert!(code == Some(0) && error.contains("object_1 (Red brick)"), "{error}");
    assert!(text.contains("; blue mug with a lid"), "{text}");
}

#[test]
fn blurred_and_over_exposed_photos_are_named_and_not_worked_with() {
    let table = Table::new();
    let path_of = |n: usize| table.path().join(format!("images/{n:03}.png"));
    let photo = |n: usize| image::open(path_of(n)).unwrap().into_rgb8();
    image::imageops::blur(&photo(7), 3.0).save(path_of(7)).unwrap();
    let mut bright = photo(9);
    bright.pixels_mut().for_each(|pixel| pixel.0 = pixel.0.map(|channel| channel.saturating_mul(4)));
    bright.save(path_of(9)).unwrap();
    let (_, text, error) = table.run(&["inspect", "--object", "2", "--json"]);
    let inspection: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{error}"));
    let flaw = |n: usize| inspection["views"][n]["flaw"].as_str();
    assert_eq!((flaw(7), flaw(9), flaw(6)), (Some("blurred"), Some("over_exposed"), None), "{text}");
    let (_, text, _) = table.run(&["inspect", "--object", "2"]);
    assert!(text.contains("over-exposed: 1 photo, not worked with: 009"), "{text}");
    // Of those that a run would use, none is called blurred for being less sharp than the sharpest.
    let (_, text, _) = table.run(&["inspect", "--object", "2", "--views", "5"]);
    assert!(!text.contains("not worked with"), "{text}");
    // Neither if there are more photos than are used, nor if all would be.
    for count in ["5", "12"] {
        let (code, _, error) = table.run(&["run", "--to", "scene", "--object", "2", "--views", count]);
        assert_eq!(code, Some(0), "{error}");
        let views = table.views_of("object_2");
        let names: Vec<&str> =
            views["views"].as_array().unwrap().iter().filter_map(|view| view["name"].as_str()).collect();
        assert!(names.len() >= 5 && !names.contains(&"007") && !names.contains(&"009"), "{names:?}");
    }
    // The user's own choice counts.
    let (code, _, error) = table.run(&["run", "--to", "scene", "--object", "2", "--view-list", "006,007"]);
    assert!(code == Some(0) && table.views_of("object_2")["views"][1]["name"] == "007", "{error}");
}

/// On a second, lower table beside the first there stands another thing.
#[test]
fn of_two_tables_that_counts_which_the_cameras_look_at() {
    let (mut blobs, mut thing_of) = things();
    let lower = table_top(-0.4).into_iter().map(|blob| {
        let [x, y, z] = blob.position;
        Blob { position: [x + 2.6, y + 0.6, z - 0.35], ..blob }
    });
    let other = lower.chain(block([1.8, -0.2, -0.34], [2.0, 0.0, -0.1], [0.2, 0.9, 0.3]));
    blobs.extend(other);
    thing_of.resize(blobs.len(), NOTHING);
    let table = Table::with((blobs, thing_of));
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!(found.object_of_gaussian, table.thing_of);
}

/// What moved while the photos were taken is a haze in the splat at all of its places.
#[test]
fn what_moved_is_no_object_and_spoils_none() {
    let (mut blobs, mut thing_of) = things();
    for x in [-0.2_f32, -0.1, 0.0] {
        let haze = block([x, 0.5, 0.01], [x + 0.14, 0.64, 0.15], [0.3, 0.3, 0.3]);
        blobs.extend(haze.into_iter().map(|blob| Blob { opacity: 0.12, ..blob }));
    }
    thing_of.resize(blobs.len(), NOTHING);
    let table = Table::with((blobs, thing_of));
    let found = StandingObjects::find(table.path(), &Options::default()).unwrap();
    assert_eq!(found.count, 2);
    let wrong = found.object_of_gaussian.iter().zip(&table.thing_of).filter(|(found, true_one)| found != true_one);
    assert_eq!(wrong.count(), 0);
}

/// At the table's edge, which most photos cut off.
#[test]
fn what_most_photos_cut_off_is_found_all_the_same() {
    let near_edge = block([0.7, -0.1, 0.01], [0.86, 0.1, 0.21], [0.2, 0.3, 0.8]);
    let middle = block([-0.2, -0.3, 0.01], [0.2, -0.1, 0.21], [0.8, 0.3, 0.2]);
    let table = Table::with(together([(BRICK, middle), (CUP, near_edge), (NOTHING, table_top(1.0))]));
    let (code, text, error) = table.run(&["objects", "--json"]);
    assert_eq!(code, Some(0), "{error}");
    let found: Value = serde_json::from_str(&text).unwrap();
    let objects = found["objects"].as_array().unwrap();
    assert_eq!(objects.len(), 2, "{text}");
    assert!(objects[1]["photos"].as_u64().unwrap() >= 3, "{text}");
}

#[test]
fn masks_leave_nothing_to_tell_apart() {
    let table = Table::new();
    let masks = table.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    for n in 0..12 {
        let map = table.true_map(n);
        let white = |value: &u8| if *value == CUP as u8 { 255 } else { 0 };
        let mask = GrayImage::from_raw(SIZE.0, SIZE.1, map.as_raw().iter().map(white).collect()).unwrap();
        mask.save(masks.join(format!("{n:03}.png"))).unwrap();
    }
    let found = StandingObjects::find(table.path(), &Options::default()).map(|found| found.count);
    assert_message(found, &["no objects to tell apart", "masks"]);
}

#[test]
fn the_list_says_where_each_object_is_and_how_well_it_is_seen() {
    let table = Table::new();
    let (code, text, error) = table.run(&["objects", "--json"]);
    assert_eq!(code, Some(0), "{error}");
    let printed: Value = serde_json::from_str(&text).unwrap();
    let work = table.path().join("gprop");
    let stored: Value = serde_json::from_slice(&std::fs::read(work.join("objects.json")).unwrap()).unwrap();
    assert_eq!(printed, stored);
    let objects = printed["objects"].as_array().unwrap();
    assert_eq!(objects.len(), 2);
    for (number, object) in (1..).zip(objects) {
        assert_eq!(object["name"], format!("object_{number}"));
        assert_eq!(object["work"], format!("objects/object_{number}"));
        assert_eq!(object["gaussians"], table.thing_of.iter().filter(|thing| **thing == number).count());
        assert_eq!(object["caption"], Value::Null);
        // One camera is behind the wall.
        assert_eq!(object["photos"], 11, "{object}");
        let hidden = object["hidden"].as_f64().unwrap();
        assert!((0.0..0.5).contains(&hidden), "{object}");
    }
    assert!(objects[1]["hidden"].as_f64().unwrap() > 0.01, "the brick stands before the cup in some photos: {text}");
    assert_eq!(printed["up"]["source"], "support");
    assert!(printed["support"]["normal"].is_array() && printed["support"]["offset"].is_number());
    let photo = image::open(work.join("objects.jpg")).unwrap();
    assert_eq!((photo.width(), photo.height()), SIZE);
    let page = std::fs::read_to_string(work.join("index.html")).unwrap();
    assert!(page.contains("object_2") && page.contains("data:image/jpeg;base64,"));
}

#[test]
fn the_page_shows_the_table_in_3d_and_an_object_leads_to_its_report() {
    let test = "the_page_shows_the_table_in_3d_and_an_object_leads_to_its_report";
    let table = Table::new();
    table.answer("object_2", "blue <b>mug</b>");
    let report = table.path().join("gprop/objects/object_2/report.html");
    std::fs::write(&report, "<title>the mug's report</title>").unwrap();
    let (code, _, error) = table.run(&["objects"]);
    assert_eq!(code, Some(0), "{error}");
    let file = table.path().join("gprop/index.html");
    let size = std::fs::metadata(&file).unwrap().len();
    assert!(size < 10 << 20, "{size} bytes");
    let Some(page) = Page::open(test, &format!("file://{}", file.display()), ".frame.ready") else { return };
    for width in [360, 800, 1400] {
        page.show_at([width, 900], "light");
        let beside = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert_eq!(beside, 0, "at {width} px the page is wider than the window");
    }
    let label = |number: usize| format!(".label[data-object=\"{number}\"]");
    assert_eq!(page.text(&label(1)), "object_1");
    assert_eq!(page.text(&label(2)), "blue <b>mug</b>");
    assert_eq!(page.evaluate("document.querySelector('.label').tagName"), "SPAN", "the brick has no report");
    // Below its label stands the mug.
    let (corner, [width, height]) = page.content_box(&label(2));
    let below = |down: f64| Point { x: corner.x + 0.5 * width, y: corner.y + height + down };
    let on_mug = (2..60).map(|n| below(2.0 * f64::from(n))).find(|point| {
        page.move_mouse_to(*point);
        page.settle();
        page.text("#reading").starts_with("blue <b>mug</b> (object_2)")
    });
    page.click_at(on_mug.expect("the pointer finds the mug"));
    let since = std::time::Instant::now();
    while page.text("title") != "the mug's report" {
        assert!(since.elapsed().as_secs() < 20, "{}", page.text("title"));
    }
}

#[test]
fn found_objects_are_compared_with_the_true_ones() {
    let table = Table::new();
    table.write_truth();
    let mut command = gprop();
    let output = command.args(["evaluate", "objects", "--json"]).arg(table.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let report = &found[0];
    for (object, name) in report["objects"].as_array().unwrap().iter().zip(["brick", "cup"]) {
        assert_eq!(object["name"], name);
        // Rendered with the same Gaussians as the truth, in which the thing with most of a pixel's light has it, though it be less than
        // half; a box leaves out a few strays.
        assert!(object["mask_iou"].as_f64().unwrap() > 0.995, "{report}");
        assert!(object["box_iou"].as_f64().unwrap() > 0.8, "{report}");
        assert!(object["center_error_m"].as_f64().unwrap() < 0.01, "{report}");
    }
    assert!(report["up_error_deg"].as_f64().unwrap() < 0.2, "{report}");
    for list in ["cut", "merging", "false_objects"] {
        assert_eq!(report[list], json!([]), "{report}");
    }
    assert_eq!(report["photos"], 12);
}

#[test]
fn a_run_takes_all_objects_and_one_that_fails_does_not_stop_the_others() {
    let table = Table::new();
    let (code, text, error) = table.run(&["run", "--to", "scene", "--views", "5"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains("2 objects on the surface; each is run by itself"), "{error}");
    assert!(text.contains("object_1") && text.contains("index.html"), "{text}");
    for (number, object) in [(BRICK, "object_1"), (CUP, "object_2")] {
        let count = table.thing_of.iter().filter(|thing| **thing == number).count();
        assert_eq!(table.views_of(object)["gaussians"], count);
        assert!(error.contains(&format!("{object}: stage 1 of 1  scene")), "{error}");
    }
    // One object by itself goes on in the same folder, all go on together.
    for (object, states) in [("2", "scene     done"), ("auto", "object_1\nscene     done\n\nobject_2\nscene     done")]
    {
        let (code, text, error) = table.run(&["run", "--to", "scene", "--object", object, "--dry-run"]);
        assert_eq!((code, text.trim()), (Some(0), states), "{error}");
        assert!(error.contains("options of the last run: --views=5\n"), "{error}");
    }
    // All have the same options: those of the first that was run. What another one had is said.
    let said = |arguments: &[&str]| table.run(arguments).2;
    said(&["run", "--to", "scene", "--object", "2", "--views", "4"]);
    let error = said(&["run", "--to", "scene", "--dry-run"]);
    let left_out = "object_2: not used, because all objects have the same options: --views=4";
    assert!(error.contains("options of the last run: --views=5") && error.contains(left_out), "{error}");
    let error = said(&["run", "--to", "scene", "--views", "4", "--dry-run"]);
    assert!(!error.contains("not used"), "{error}");
    std::fs::remove_dir_all(table.path().join("gprop/objects/object_1")).unwrap();
    let error = said(&["run", "--to", "scene", "--dry-run"]);
    assert!(error.contains("options of the last run: --views=4\n") && !error.contains("not used"), "{error}");
    assert_eq!(table.run(&["run", "--to", "scene", "-q"]).1, "");
    // A link in the place of the first object's folder is not followed.
    let folder = table.path().join("gprop/objects/object_1");
    std::fs::remove_dir_all(&folder).unwrap();
    std::fs::remove_dir_all(table.path().join("gprop/objects/object_2")).unwrap();
    std::os::unix::fs::symlink(table.path(), &folder).unwrap();
    let (code, _, error) = table.run(&["run", "--to", "scene", "--object", "all"]);
    assert_eq!(code, Some(6), "{error}");
    assert!(error.contains("1 of 2 objects failed: object_1"), "{error}");
    assert!(table.views_of("object_2")["gaussians"].is_number());
    let list: Value = serde_json::from_slice(&std::fs::read(table.path().join("gprop/objects.json")).unwrap()).unwrap();
    assert!(list["objects"][0]["error"].as_str().unwrap().contains("is a link"), "{list}");
    assert_eq!(list["objects"][1]["error"], Value::Null);
    let (code, _, error) = table.run(&["run", "--known-mass", "1kg"]);
    assert!(code == Some(2) && error.contains("--known-mass 2=1"), "{error}");
}

#[test]
fn python_runs_one_object_or_each() {
    let table = Table::new();
    let (output, works) = for_python(table.path(), &["--to", "scene", "--for-python", "one"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && error.contains("shows 2 objects; name one with object=N"), "{error}");
    assert!(works.is_empty() && !table.path().join("gprop").exists(), "{works:?}");
    let folder_of = |object: &str| table.path().join("gprop/objects").join(object);
    let (_, works) = for_python(table.path(), &["--to", "scene", "--for-python", "one", "--object", "2"]);
    assert!(works.len() == 1 && works[0].1 == folder_of("object_2"), "{works:?}");
    let (_, works) = for_python(table.path(), &["--to", "scene", "--for-python", "all"]);
    let all = ["object_1", "object_2"].map(|object| (object.to_owned(), folder_of(object)));
    assert_eq!(works, all);
    assert!(works.iter().all(|(_, work)| work.join("views.json").exists()));
}

/// In some photos the brick hides some of the cup. There, the cup is neither seen nor absent: no mask of it lies on the brick, and
/// it is not split where the brick's outline crosses it.
#[test]
fn what_another_object_hides_is_no_evidence() {
    let table = Table::new();
    let labels = table.write_labels();
    let (code, _, error) =
        table.run(&["run", "--to", "consensus", "--object", "2", "--views", "12", "--segments", &labels]);
    assert_eq!(code, Some(0), "{error}");
    let work = table.path().join("gprop/objects/object_2");
    let parts: Value = serde_json::from_slice(&std::fs::read(work.join("consensus/consensus.json")).unwrap()).unwrap();
    assert_eq!(parts["parts"].as_array().unwrap().len(), 1, "{parts}");
    let (mut on_cup, mut elsewhere) = (0, 0);
    for n in 0..12 {
        let map = LabelMap::from_png(&std::fs::read(work.join(format!("consensus/{n:03}.png"))).unwrap()).unwrap();
        for (part, thing) in map.labels.iter().zip(table.true_map(n).as_raw()).filter(|(part, _)| **part > 0) {
            assert_eq!(*part, 1);
            if u32::from(*thing) == CUP { on_cup += 1 } else { elsewhere += 1 }
        }
    }
    assert!(on_cup > 1000 && elsewhere * 50 < on_cup, "{elsewhere} of {on_cup} pixels are not the cup's");
}

/// A rendered capture of a breakfast table with five objects; each is found once.
#[test]
fn the_objects_of_a_real_table_are_found() {
    let Some(folder) = shared("the_objects_of_a_real_table_are_found", "tables/fit_breakfast") else { return };
    let mut command = gprop();
    let output = command.args(["evaluate", "objects", "--json"]).arg(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let report = &found[0];
    for list in ["cut", "merging", "false_objects"] {
        assert_eq!(report[list], json!([]), "{report}");
    }
    assert!(report["objects"].as_array().unwrap().iter().all(|object| object["found"].is_string()), "{report}");
    assert!(report["up_error_deg"].as_f64().unwrap() < 1.0, "{report}");
}
