//! Splats that were moved by any similarity: the search finds it, or says that it found none.

use std::path::{Path, PathBuf};

use gprop::gaussians::{Gaussians, SH_C0};
use gprop::inspect::{Inspection, to_text};
use gprop::render::{RenderOptions, render};
use gprop::scene::{self, ForegroundSource, Options, Scene, View};
use image::imageops::{FilterType, resize};
use image::{DynamicImage, Rgba, RgbaImage};
use nalgebra::{Isometry3, Point3, Similarity3, Vector3};
use serde_json::Value;
use tempfile::TempDir;

use crate::inspect::{
    as_gsplat, assert_diagnosed, inspected, median_psnr, moved, thinned_by, write_colmap, write_splat,
};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

/// A fixture, smaller.
struct Small<'a> {
    name: &'a str,
    /// One of so many Gaussians is kept.
    step: usize,
    views: usize,
    /// Of the photos, in pixels.
    side: u32,
}

impl Small<'_> {
    fn folder(&self) -> TempDir {
        let from = scene::load(&fixture(self.name), &Options::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        write_splat(folder.path(), &thinned_by(&from.gaussians, self.step));
        let text = std::fs::read_to_string(fixture(self.name).join("transforms.json")).unwrap();
        let mut transforms: Value = serde_json::from_str(&text).unwrap();
        let frames = transforms["frames"].as_array_mut().unwrap();
        let apart = frames.len() / self.views;
        *frames = frames.iter().step_by(apart).take(self.views).cloned().collect();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        for (frame, view) in frames.iter_mut().zip(from.views.iter().step_by(apart)) {
            let photo = format!("images/{}.png", view.name);
            self.photo(view).save(folder.path().join(&photo)).unwrap();
            frame["file_path"] = photo.into();
        }
        std::fs::write(folder.path().join("transforms.json"), transforms.to_string()).unwrap();
        folder
    }

    fn photo(&self, view: &View) -> RgbaImage {
        let photo = view.photo().unwrap();
        let colors = resize(&photo.rgb, self.side, self.side, FilterType::Triangle);
        let foreground = resize(&photo.foreground, self.side, self.side, FilterType::Triangle);
        RgbaImage::from_fn(self.side, self.side, |x, y| {
            let [r, g, b] = colors.get_pixel(x, y).0;
            Rgba([r, g, b, if foreground.get_pixel(x, y)[0] >= 128 { 255 } else { 0 }])
        })
    }
}

fn loaded(folder: &TempDir) -> Scene {
    scene::load(folder.path(), &Options::default()).unwrap()
}

/// Any rotation, a shift of some units, a scale from a quarter to four.
fn any_similarity(random: &mut fastrand::Rng) -> Similarity3<f64> {
    let mut between = |limit: f64| limit * (2.0 * random.f64() - 1.0);
    let shift = Vector3::from_fn(|_, _| between(5.0));
    let turn = Vector3::from_fn(|_, _| between(1.8));
    Similarity3::new(shift, turn, between(4f64.ln()).exp())
}

/// A tenth of a pixel of the search's largest pictures costs as much.
const LOSS_DB: f64 = 0.3;
/// A photo's own noise: what fits better was drawn from the splat itself, and shows displacements that no photo shows.
const NOISE_DB: f64 = 40.0;

/// Moves the splat and follows what is suggested.
#[track_caller]
fn assert_found(name: &str, folder: &TempDir, of_splat: &Similarity3<f64>) {
    let unmoved = inspected(folder.path(), &Options::default());
    assert_eq!(unmoved.aligned, Some(true), "{name}: {}", to_text(&unmoved));
    let cloud = loaded(folder).whole_cloud().into_owned();
    write_splat(folder.path(), &moved(&cloud, of_splat));
    let align = assert_diagnosed(name, folder);
    assert!(align.starts_with("sim="), "{align}");
    let options = Options { align: align.parse().unwrap(), ..Options::default() };
    let (before, after) = (median_psnr(&unmoved), median_psnr(&inspected(folder.path(), &options)));
    assert!(after > before.min(NOISE_DB) - LOSS_DB, "{name}: {after:.2} dB instead of {before:.2} with {align}");
    write_splat(folder.path(), &cloud);
}

/// A rod; a mug is found below.
#[test]
fn a_splat_moved_by_any_similarity_is_found() {
    let folder = Small { name: "hammer", step: 1, views: 8, side: 192 }.folder();
    assert_found("hammer", &folder, &any_similarity(&mut fastrand::Rng::with_seed(46)));
}

/// The hammer on a floor between walls, each of patches of any colour; photos without alpha.
#[test]
fn a_room_moved_by_any_similarity_is_found() {
    let folder = Small { name: "hammer", step: 4, views: 9, side: 192 }.folder();
    let mut random = fastrand::Rng::with_seed(47);
    let mut scene = loaded(&folder);
    scene.gaussians.append(&room_around(&scene, &mut random));
    write_splat(folder.path(), &scene.gaussians);
    for view in &scene.views {
        let picture = render(&scene.gaussians, &view.camera, &RenderOptions::default()).to_image([1.0; 3]);
        DynamicImage::from(picture).into_rgb8().save(&view.image).unwrap();
    }
    assert_eq!(loaded(&folder).views[0].photo().unwrap().foreground_source, ForegroundSource::Whole);
    assert_found("room", &folder, &any_similarity(&mut random));
}

/// Round Gaussians: a floor below the object and four walls around the cameras.
fn room_around(scene: &Scene, random: &mut fastrand::Rng) -> Gaussians {
    const CELLS: i32 = 20;
    /// Cells along each side of a patch.
    const PATCH: i32 = 4;
    let bounds = scene.object_bounds();
    let farthest = scene.views.iter().map(|view| (view.camera.center_in_world() - bounds.center()).norm());
    let half = 1.5 * farthest.fold(0.0, f64::max);
    let cell = half / f64::from(CELLS);
    let floor = Point3::new(bounds.center().x, bounds.center().y, bounds.min.z - cell);
    let mut places = Vec::new();
    let mut colors = Vec::new();
    let surfaces: [fn(f64, f64) -> Vector3<f64>; 5] = [
        |u, v| Vector3::new(u, v, 0.0),
        |u, v| Vector3::new(u, 1.0, v + 1.0),
        |u, v| Vector3::new(u, -1.0, v + 1.0),
        |u, v| Vector3::new(1.0, u, v + 1.0),
        |u, v| Vector3::new(-1.0, u, v + 1.0),
    ];
    let patches = 2 * CELLS / PATCH;
    for surface in surfaces {
        let palette: Vec<[f32; 3]> = (0..patches * patches).map(|_| [(); 3].map(|()| random.f32())).collect();
        for cell_index in 0..4 * CELLS * CELLS {
            let (column, row) = (cell_index % (2 * CELLS), cell_index / (2 * CELLS));
            let along = |index: i32| (f64::from(index) + 0.5) / f64::from(CELLS) - 1.0;
            places.push((floor + surface(along(column), along(row)) * half).coords.map(|side| side as f32).into());
            colors.push(palette[(row / PATCH * patches + column / PATCH) as usize].map(|value| (value - 0.5) / SH_C0));
        }
    }
    let count = places.len();
    Gaussians {
        positions: places,
        log_scales: vec![[(0.6 * cell).ln() as f32; 3]; count],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
        opacity_logits: vec![4.0; count],
        sh_dc: colors,
        sh_degree: scene.gaussians.sh_degree,
        sh_rest: vec![0.0; count * 3 * scene.gaussians.sh_rest_per_channel()],
        ..Gaussians::default()
    }
}

/// gsplat's frame follows from COLMAP's points; if they are not there, it is searched for.
#[test]
fn gsplats_normalised_world_is_found_without_points() {
    let folder = Small { name: "mug", step: 2, views: 4, side: 128 }.folder();
    let scene = loaded(&folder);
    let poses: Vec<Isometry3<f64>> = scene.views.iter().map(|view| view.camera.camera_from_world).collect();
    let points: Vec<Point3<f64>> = (0..scene.gaussians.len()).map(|i| scene.gaussians.center(i)).collect();
    std::fs::remove_file(folder.path().join("transforms.json")).unwrap();
    write_colmap(folder.path(), &scene.views);
    assert_found("gsplat without points", &folder, &as_gsplat(&poses, &points));
}

#[track_caller]
fn assert_not_explained(found: &Inspection) {
    let text = to_text(found);
    assert!(found.aligned == Some(false) && found.suggestion.is_none(), "{text}");
    assert!(text.contains("NOT ALIGNED") && !text.contains("try         --align"), "{text}");
    // A guess is shown as one.
    let doubtful = found.doubtful.as_ref().unwrap();
    let shown = format!("doubtful    --align {}   ({}", doubtful.align, doubtful.reason);
    assert!(doubtful.align.starts_with("sim=") && text.contains(&shown), "{text}");
    assert!(found.require_aligned().unwrap_err().to_string().contains("doubtful"), "{text}");
}

#[test]
fn photos_of_another_object_are_not_explained_away() {
    let folder = Small { name: "mug", step: 8, views: 8, side: 192 }.folder();
    let other = Small { name: "hammer", step: 8, views: 4, side: 64 }.folder();
    write_splat(folder.path(), &loaded(&other).gaussians);
    assert_not_explained(&inspected(folder.path(), &Options::default()));
}

/// Photos whose alpha is a box around the object: the outlines do not fit, but nor would they in any other place.
#[test]
fn a_search_that_leads_back_to_the_cameras_says_nothing() {
    let folder = Small { name: "hammer", step: 1, views: 8, side: 192 }.folder();
    for view in &loaded(&folder).views {
        let mut photo = image::open(&view.image).unwrap().into_rgba8();
        let shown: Vec<(u32, u32)> =
            photo.enumerate_pixels().filter(|(.., pixel)| pixel[3] > 0).map(|(x, y, _)| (x, y)).collect();
        let columns = || shown.iter().map(|(x, _)| *x);
        let rows = || shown.iter().map(|(_, y)| *y);
        for x in columns().min().unwrap()..=columns().max().unwrap() {
            for y in rows().min().unwrap()..=rows().max().unwrap() {
                if photo.get_pixel(x, y)[3] == 0 {
                    photo.put_pixel(x, y, Rgba([255; 4]));
                }
            }
        }
        photo.save(&view.image).unwrap();
    }
    let found = inspected(folder.path(), &Options::default());
    assert_eq!(found.aligned, Some(false), "{}", to_text(&found));
    assert!(found.suggestion.is_none() && found.doubtful.is_none(), "{}", to_text(&found));
}
