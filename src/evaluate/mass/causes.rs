//! The causes of the error of an object's mass, if its ground truth is detailed enough.
//!
//! Every found part counts towards the true part that it mostly shows in the true part maps; without maps, towards the
//! one in whose box its centre of mass lies (the smallest such box, otherwise the nearest). A filling counts towards the
//! hidden true part in whose box its centre of mass lies, otherwise towards the true part of its shell. Then the true
//! mass of each true part is turned into the found one step by step: first its extent is replaced, then its wall, then
//! its density, and the rest is due to the assumed contents. The steps, in kilograms, add up to the error.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::parts::{Part, Parts};

/// A part whose true mass is known.
#[derive(Debug, Clone)]
pub struct TruePart {
    /// Its value in the true part maps.
    pub id: Option<u8>,
    pub name: String,
    pub volume_m3: f64,
    pub mass_kg: f64,
    pub form: String,
    /// Thickness of a shell's wall; if a shell has none, its volume is that within its outer surface.
    pub thickness_m: Option<f64>,
    /// Lowest and highest corner, world frame.
    pub bounding_box_m: Option<[[f64; 3]; 2]>,
    /// No view shows it.
    pub is_hidden: bool,
}

/// The error of a mass by its causes, kg. The sum is the found mass less the true one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Causes {
    /// The extent of solids, the area of walls, the space within packages.
    pub volume_kg: f64,
    /// The thickness of walls.
    pub wall_kg: f64,
    pub density_kg: f64,
    /// The contents of shells, whether assumed or missed.
    pub filling_kg: f64,
    /// True parts of which nothing was found.
    pub missing_kg: f64,
}

/// The sum of what was found of a true part.
#[derive(Default)]
struct Found {
    volume_m3: f64,
    mass_kg: f64,
    /// Sum of volume times thickness.
    thickness_m4: f64,
    filling_kg: f64,
    /// The space behind its walls that holds the filling.
    hollow_m3: f64,
}

/// A true part, and all that was found of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedPart {
    pub name: String,
    /// Mass of the found parts and of what fills them.
    pub found_kg: f64,
    pub true_kg: f64,
}

/// The causes of the error, and the true parts; `None` if a true part has no box, unless the maps show all found parts.
/// `shown` is, by found part, the `id` of the true part that it mostly shows.
pub fn compare(truth: &[TruePart], shown: &BTreeMap<u32, u8>, measured: &Parts) -> Option<(Causes, Vec<ComparedPart>)> {
    let boxes: Option<Vec<[[f64; 3]; 2]>> = truth.iter().map(|part| part.bounding_box_m).collect();
    let mut found: Vec<Found> = truth.iter().map(|_| Found::default()).collect();
    let mut owner_of_shell = Vec::new();
    for part in &measured.parts {
        let (Some(volume), Some(mass), Some(center)) = (part.volume_m3, part.mass_kg, part.center_of_mass_m) else {
            continue;
        };
        let on_maps = shown.get(&part.id).and_then(|id| with_id(truth, *id));
        let owner = on_maps.or_else(|| nearest(boxes.as_deref()?, center))?;
        owner_of_shell.push((part.id, owner));
        let of = &mut found[owner];
        of.volume_m3 += volume.mid;
        of.mass_kg += mass.mid;
        of.thickness_m4 += volume.mid * thickness(part);
    }
    for filling in &measured.fillings {
        if let Some(hidden) = hidden_at(truth, filling.center_of_mass_m) {
            found[hidden].volume_m3 += filling.volume_m3.mid;
            found[hidden].mass_kg += filling.mass_kg.mid;
            continue;
        }
        let (_, owner) = owner_of_shell.iter().find(|(id, _)| *id == filling.inside_of)?;
        found[*owner].filling_kg += filling.mass_kg.mid;
        found[*owner].hollow_m3 += filling.volume_m3.mid / filling.share_of_hollow.mid;
    }
    let compared = |(part, found): (&TruePart, &Found)| ComparedPart {
        name: part.name.clone(),
        found_kg: found.mass_kg + found.filling_kg,
        true_kg: part.mass_kg,
    };
    let parts = truth.iter().zip(&found).map(compared).collect();
    let each = truth.iter().zip(&found).map(|(part, found)| of_part(part, found));
    let causes = each.fold(Causes::default(), |sum, one| Causes {
        volume_kg: sum.volume_kg + one.volume_kg,
        wall_kg: sum.wall_kg + one.wall_kg,
        density_kg: sum.density_kg + one.density_kg,
        filling_kg: sum.filling_kg + one.filling_kg,
        missing_kg: sum.missing_kg + one.missing_kg,
    });
    Some((causes, parts))
}

fn thickness(part: &Part) -> f64 {
    part.thickness_m.map_or(0.0, |thickness| thickness.mid)
}

fn of_part(truth: &TruePart, found: &Found) -> Causes {
    let whole = found.mass_kg + found.filling_kg;
    if whole <= 0.0 || found.volume_m3 <= 0.0 {
        return Causes { missing_kg: -truth.mass_kg, ..Causes::default() };
    }
    let is_shell = truth.form == "shell";
    if is_shell && truth.thickness_m.is_none() {
        // A package: its volume is the space within, and its density that of wall and contents together.
        let extent = if found.hollow_m3 > 0.0 { (found.volume_m3 + found.hollow_m3) / truth.volume_m3 } else { 1.0 };
        let volume_kg = truth.mass_kg * (extent - 1.0);
        return Causes { volume_kg, filling_kg: whole - truth.mass_kg - volume_kg, ..Causes::default() };
    }
    let found_wall = found.thickness_m4 / found.volume_m3;
    let wall = truth.thickness_m.filter(|_| is_shell && found_wall > 0.0).map_or(1.0, |wall| found_wall / wall);
    let extended_kg = truth.mass_kg * found.volume_m3 / truth.volume_m3 / wall;
    let walled_kg = extended_kg * wall;
    Causes {
        volume_kg: extended_kg - truth.mass_kg,
        wall_kg: walled_kg - extended_kg,
        density_kg: found.mass_kg - walled_kg,
        filling_kg: found.filling_kg,
        missing_kg: 0.0,
    }
}

fn with_id(truth: &[TruePart], id: u8) -> Option<usize> {
    truth.iter().position(|part| part.id == Some(id))
}

/// The hidden part in whose box the point lies.
fn hidden_at(truth: &[TruePart], point: [f64; 3]) -> Option<usize> {
    truth.iter().position(|part| part.is_hidden && part.bounding_box_m.is_some_and(|of| outside(&of, point) == 0.0))
}

/// Distance from a box, 0 within it.
fn outside([low, high]: &[[f64; 3]; 2], point: [f64; 3]) -> f64 {
    (0..3).map(|a| (low[a] - point[a]).max(point[a] - high[a]).max(0.0).powi(2)).sum::<f64>().sqrt()
}

/// The smallest box that holds the point, otherwise the nearest.
fn nearest(boxes: &[[[f64; 3]; 2]], point: [f64; 3]) -> Option<usize> {
    let volume = |[low, high]: &[[f64; 3]; 2]| (0..3).map(|a| high[a] - low[a]).product::<f64>();
    let key = |n: usize| (outside(&boxes[n], point), volume(&boxes[n]));
    (0..boxes.len()).min_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn truth(form: &str, thickness_m: Option<f64>) -> TruePart {
        let (name, form) = ("it".to_owned(), form.to_owned());
        TruePart {
            id: None,
            name,
            volume_m3: 1e-3,
            mass_kg: 1.0,
            form,
            thickness_m,
            bounding_box_m: None,
            is_hidden: false,
        }
    }

    #[test]
    fn the_steps_of_a_solid_are_its_volume_and_its_density() {
        let found = Found { volume_m3: 1.2e-3, mass_kg: 1.8, ..Found::default() };
        let causes = of_part(&truth("solid", None), &found);
        assert!((causes.volume_kg - 0.2).abs() < 1e-12 && (causes.density_kg - 0.6).abs() < 1e-12, "{causes:?}");
    }

    #[test]
    fn a_wall_twice_as_thick_over_the_right_area_is_the_walls_fault() {
        let found = Found { volume_m3: 2e-3, mass_kg: 2.0, thickness_m4: 2e-3 * 4e-3, ..Found::default() };
        let causes = of_part(&truth("shell", Some(2e-3)), &found);
        assert!(causes.volume_kg.abs() < 1e-12 && (causes.wall_kg - 1.0).abs() < 1e-12, "{causes:?}");
    }

    #[test]
    fn what_a_package_lacks_is_inside() {
        let found = Found { volume_m3: 1e-5, mass_kg: 0.1, ..Found::default() };
        let causes = of_part(&truth("shell", None), &found);
        assert!((causes.filling_kg + 0.9).abs() < 1e-12 && causes.volume_kg == 0.0, "{causes:?}");
        let causes = of_part(&truth("solid", None), &Found::default());
        assert_eq!(causes.missing_kg, -1.0);
    }

    #[test]
    fn what_no_view_shows_is_found_by_its_box() {
        let (near, far) = ([[0.0; 3], [1.0; 3]], [[5.0; 3], [6.0; 3]]);
        let part =
            |id, of, is_hidden| TruePart { id: Some(id), bounding_box_m: Some(of), is_hidden, ..truth("solid", None) };
        let truth = [part(3, near, false), part(7, near, true), part(8, far, true)];
        assert_eq!(hidden_at(&truth, [0.5; 3]), Some(1));
        assert_eq!(hidden_at(&truth, [2.0; 3]), None);
        assert_eq!((with_id(&truth, 8), with_id(&truth, 4)), (Some(2), None));
    }

    #[test]
    fn a_box_is_needed_only_for_what_no_map_shows() {
        let one = json!({ "low": 1.0, "mid": 1.0, "high": 1.0 });
        let (center, inertia) = ([0.0; 3], [[0.0; 3]; 3]);
        let part = json!({
            "id": 0, "caption": "it", "material": "brass", "family": "metal", "gaussians": 1, "volume_m3": one,
            "thickness_m": null, "density_kg_m3": one, "mass_kg": one, "center_of_mass_m": center,
            "inertia_kg_m2": null, "bodies": [], "surface_to_center_of_mass_m": null,
        });
        let object = json!({ "volume_m3": one, "mass_kg": one, "center_of_mass_m": center, "inertia_kg_m2": inertia });
        let measured = json!({ "object": object, "parts": [part], "warnings": [] });
        let measured: Parts = serde_json::from_value(measured).unwrap();
        let truth = [TruePart { id: Some(3), ..truth("solid", None) }];
        let (_, parts) = compare(&truth, &BTreeMap::from([(0, 3)]), &measured).expect("the maps show the part");
        assert_eq!(parts, [ComparedPart { name: "it".to_owned(), found_kg: 1.0, true_kg: 1.0 }]);
        assert_eq!(compare(&truth, &BTreeMap::new(), &measured), None);
    }

    #[test]
    fn a_point_belongs_to_the_smallest_box_that_holds_it() {
        let (large, small) = ([[0.0; 3], [4.0; 3]], [[1.0; 3], [2.0; 3]]);
        assert_eq!(nearest(&[large, small], [1.5; 3]), Some(1));
        assert_eq!(nearest(&[large, small], [3.0; 3]), Some(0));
        assert_eq!(nearest(&[small, large], [9.0; 3]), Some(1));
    }
}
