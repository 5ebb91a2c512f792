//! Scenes with ground truth, and the material field that flawless segmentation and answers would give: labels from the
//! true part maps, materials, forms and walls from the true parts. Only the error of the volume remains.

use std::path::{Path, PathBuf};

use gprop::materials::MaterialLibrary;
use gprop::numeric::nearest::Nearest;
use gprop::query::Form;
use gprop::render::{Colors, RenderOptions, render};
use gprop::scene::{self, Scene};
use gprop::units::{Estimate, Range};
use gprop::vote::{FieldPart, MaterialField};
use rayon::prelude::*;
use serde::Deserialize;

use crate::support::{Shared, changed, shared_if_there};

/// A part in `ground_truth/parts.json`.
#[derive(Debug, Clone, Deserialize)]
pub struct TruePart {
    pub id: u8,
    pub name: String,
    pub material: String,
    pub family: String,
    pub visible: bool,
    pub form: String,
    pub thickness_m: Option<f64>,
    pub volume_m3: f64,
    pub density_kg_m3: f64,
    pub mass_kg: f64,
    pub youngs_modulus_pa: f64,
    pub poisson_ratio: f64,
    pub friction_rubber_pad: f64,
}

/// `ground_truth/parts.json`.
#[derive(Debug, Clone, Deserialize)]
pub struct Truth {
    pub total_mass_kg: f64,
    pub parts: Vec<TruePart>,
}

/// A scene with its truth and the field made from it.
pub struct Known {
    pub scene: Scene,
    pub truth: Truth,
    pub field: MaterialField,
}

/// The scene in a folder.
pub fn known(folder: &Path) -> &'static Known {
    static KNOWN: Shared<Known> = Shared::new();
    KNOWN.of(folder, || {
        let (scene, truth) = load(folder);
        Known { field: field(&scene, &truth, folder), scene, truth }
    })
}

pub fn hammer() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer")
}

/// The folder of a scene beside the crate if it exists, or else its fixture, whose splat is compressed.
pub fn beside(name: &str) -> PathBuf {
    let fixture = || Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name);
    shared_if_there(&format!("scenes/{name}")).unwrap_or_else(fixture)
}

pub fn load(folder: &Path) -> (Scene, Truth) {
    let options = scene::Options { scale: scene::ScaleChoice::Metric, ..Default::default() };
    let scene = scene::load(folder, &options).unwrap();
    let text = std::fs::read_to_string(folder.join("ground_truth/parts.json")).unwrap();
    (scene, serde_json::from_str(&text).unwrap())
}

/// Label `i` is the i-th visible true part.
fn field(scene: &Scene, truth: &Truth, folder: &Path) -> MaterialField {
    let visible: Vec<&TruePart> = truth.parts.iter().filter(|p| p.visible).collect();
    let votes = votes(scene, folder, &visible);
    let winner = |votes: &Vec<u32>| {
        let best = (0..votes.len()).rev().max_by_key(|&l| votes[l]).unwrap();
        (votes[best] > 0).then_some(best as u32)
    };
    let seen: Vec<Option<u32>> = votes.iter().map(winner).collect();
    let count = scene.gaussians.len();
    let seen_ones: Vec<usize> = (0..count).filter(|&i| seen[i].is_some()).collect();
    let nearest = Nearest::new(seen_ones.iter().map(|&i| scene.gaussians.positions[i]));
    let of_nearest = |i: usize| {
        let (_, found) = nearest.find(scene.gaussians.positions[i], 1)[0];
        seen[seen_ones[found as usize]].unwrap()
    };
    let labels = visible.iter().enumerate().map(|(l, p)| label(l as u32, p)).collect();
    let part_index = (0..count).into_par_iter().map(|i| seen[i].unwrap_or_else(|| of_nearest(i))).collect();
    let mut field = MaterialField::known(labels, part_index);
    field.views = seen.iter().map(|s| u16::from(s.is_some())).collect();
    field
}

/// Per Gaussian and label: the number of views in which the true part at the Gaussian's centre has this label.
fn votes(scene: &Scene, folder: &Path, visible: &[&TruePart]) -> Vec<Vec<u32>> {
    /// A Gaussian up to this far behind the surface counts as on it, in metres: splats are soft.
    const BEHIND_M: f64 = 0.01;
    let gaussians = &scene.gaussians;
    // Only depths are needed.
    let black = vec![[0.0; 3]; gaussians.len()];
    let options = RenderOptions { colors: Colors::Fixed(&black), ..RenderOptions::default() };
    let mut votes = vec![vec![0; visible.len()]; gaussians.len()];
    for view in &scene.views {
        let map = image::open(folder.join(format!("ground_truth/part_maps/{}.png", view.name))).unwrap().into_luma8();
        let drawn = render(gaussians, &view.camera, &options);
        for (i, votes) in votes.iter_mut().enumerate() {
            let in_camera = view.camera.point_in_camera(gaussians.center(i));
            let Some(pixel) = view.camera.pixel(in_camera) else { continue };
            let (x, y) = (pixel.x.floor(), pixel.y.floor());
            if !(x >= 0.0 && y >= 0.0 && x < f64::from(map.width()) && y < f64::from(map.height())) {
                continue;
            }
            let surface = f64::from(drawn.median_depth[(y as u32 * map.width() + x as u32) as usize]);
            let part = map.get_pixel(x as u32, y as u32).0[0];
            if let Some(l) = visible.iter().position(|p| p.id == part).filter(|_| in_camera.z < surface + BEHIND_M) {
                votes[l] += 1;
            }
        }
    }
    votes
}

fn label(id: u32, part: &TruePart) -> FieldPart {
    let form = match part.thickness_m.filter(|_| part.form == "shell") {
        Some(wall) => Form::Shell { wall_thickness_m: Range::exactly(wall) },
        None => Form::Solid,
    };
    changed(FieldPart::of(id, &MaterialLibrary::builtin().materials()[0]), |label| {
        (label.caption, label.material, label.family) = (part.name.clone(), part.material.clone(), part.family.clone());
        label.density_kg_m3 = Estimate::exactly(part.density_kg_m3);
        label.youngs_modulus_pa = Estimate::exactly(part.youngs_modulus_pa);
        label.poisson_ratio = Estimate::exactly(part.poisson_ratio);
        label.friction_rubber = Estimate::exactly(part.friction_rubber_pad);
        // The truth has neither; no volume depends on them.
        (label.yield_strength_pa, label.hardness) = (Estimate::exactly(1e7), None);
        label.form = form;
    })
}
