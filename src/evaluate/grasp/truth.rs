//! The true properties of the part that a proposed grasp presses on, from a scene's ground truth: `parts.json` says what
//! the true parts are, `part_maps/` which of them each pixel of a view shows, and `part_maps/labels.json` which material
//! of the library comes nearest to each.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::evaluate::EvaluateError;
use crate::evaluate::label_maps::LabelMaps;
use crate::files;
use crate::files::json;
use crate::grasp::candidates::Candidate;
use crate::materials::MaterialLibrary;
use crate::render::{RenderOptions, render};
use crate::scene::{Scene, robust_bounds};

/// A contact lies on the side of the object that a view sees if it is at most this far behind the view's depth map, as
/// a share of the object's diagonal: more than the depth's error (0.3 %) and the reach of a Gaussian in front of its
/// centre. On thin things the far side passes too, but it is mostly the same part.
const BEHIND: f64 = 0.05;

/// The true properties that decide how a grasp ends: the mass of the whole object, and the others of the part that the
/// fingers press on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    pub part: String,
    pub family: String,
    pub mass_kg: f64,
    pub friction: f64,
    /// The middle of the library's range for the nearest material: the ground truth has no strengths.
    pub strength_pa: f64,
    pub youngs_modulus_pa: f64,
    /// A shell's wall; for a solid, the distance between the contacts as gprop measured it.
    pub thickness_m: f64,
}

/// `ground_truth/parts.json` of a scene.
#[derive(Deserialize)]
struct SceneTruth {
    total_mass_kg: f64,
    parts: Vec<TruePart>,
}

#[derive(Deserialize)]
struct TruePart {
    id: u16,
    name: String,
    family: String,
    /// Thickness of a shell's wall.
    thickness_m: Option<f64>,
    youngs_modulus_pa: f64,
    friction_rubber_pad: f64,
}

/// The truth about `place` on the object of `scene`, whose ground truth is in the folder `truth`.
///
/// # Errors
/// If the ground truth cannot be read, no view with a part map sees a contact, or the part or its material is unknown.
pub fn of(place: &Candidate, scene: &Scene, truth: &Path, library: &MaterialLibrary) -> Result<Truth, EvaluateError> {
    let path = truth.join("parts.json");
    let text = files::read_to_string(&path).map_err(|source| EvaluateError::Read {
        path: path.clone(),
        source,
        remedy: ": grasps are judged by true parts",
    })?;
    let known: SceneTruth =
        json::read(text.as_bytes()).map_err(|source| EvaluateError::Json { path, expected: "true parts", source })?;
    let folder = truth.join("part_maps");
    let maps = LabelMaps::open(&folder)?;
    let id = part_at(place, scene, &maps)?
        .ok_or_else(|| EvaluateError::Unseen { scene: scene.name.clone(), path: folder.clone() })?;
    let unknown =
        |name: &str| EvaluateError::Label { path: folder.clone(), name: name.to_owned(), hint: String::new() };
    let part = known.parts.iter().find(|part| part.id == id).ok_or_else(|| unknown(&id.to_string()))?;
    let name = &maps.names[&id];
    let material = library.get(name).ok_or_else(|| unknown(name))?;
    Ok(Truth {
        part: part.name.clone(),
        family: part.family.clone(),
        mass_kg: known.total_mass_kg,
        friction: part.friction_rubber_pad,
        strength_pa: material.strength_pa.mid(),
        youngs_modulus_pa: part.youngs_modulus_pa,
        thickness_m: part.thickness_m.unwrap_or(place.thickness_m.mid),
    })
}

/// The number of the true part that most views show at the contacts; `None` if none shows them.
fn part_at(place: &Candidate, scene: &Scene, maps: &LabelMaps) -> Result<Option<u16>, EvaluateError> {
    let meters_per_unit = scene.scale.as_ref().map_or(1.0, |scale| scale.meters_per_unit);
    let contacts = place.contacts_m.map(|contact| Point3::from(contact) / meters_per_unit);
    let behind = BEHIND * robust_bounds(&scene.gaussians).diagonal();
    let mut shown: BTreeMap<u16, usize> = BTreeMap::new();
    for view in &scene.views {
        let Camera { intrinsics, .. } = &view.camera;
        let Some(map) = maps.of(&view.name, (intrinsics.width, intrinsics.height))? else { continue };
        let drawn = render(&scene.gaussians, &view.camera, &RenderOptions::default());
        for contact in contacts {
            let in_camera = view.camera.point_in_camera(contact);
            let Some(pixel) = view.camera.pixel(in_camera) else { continue };
            if !(0.0..f64::from(map.width)).contains(&pixel.x) || !(0.0..f64::from(map.height)).contains(&pixel.y) {
                continue;
            }
            let (x, y) = (pixel.x as u32, pixel.y as u32);
            let id = map.at(x, y);
            let depth = f64::from(drawn.median_depth[y as usize * map.width as usize + x as usize]);
            if maps.names.contains_key(&id) && in_camera.z <= depth + behind {
                *shown.entry(id).or_default() += 1;
            }
        }
    }
    // Of equally many, the smallest number.
    Ok(shown.into_iter().rev().max_by_key(|(_, views)| *views).map(|(id, _)| id))
}
