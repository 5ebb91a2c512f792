//! The objects that were told apart in a capture, compared with the true ones: masks in the photos, boxes, and up.
//!
//! An object is found if the masks of one that was told apart and its true ones have an IoU of at least [`LEAST_IOU`], all photos
//! together. It is cut in two if a second one lies on it, and one that covers two true objects merges them.

use std::collections::BTreeMap;
use std::fmt::Write;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::gaussians::bounds::Bounds;
use crate::words::output::{counted, one_line};

/// Least IoU of the masks of an object that is found; no two can have as much with the same one.
const LEAST_IOU: f64 = 0.5;
/// Least share of a true object's pixels that a second object covers if it is cut in two, or that one object covers of each if
/// it merges them.
const LEAST_SHARE: f64 = 0.1;

/// The true objects of a capture: `ground_truth/objects.json`.
#[derive(Debug, Clone, Deserialize)]
pub struct Truth {
    pub objects: Vec<TrueObject>,
    /// A unit vector in COLMAP's frame, which is the input's.
    pub up_colmap: [f64; 3],
    pub metres_per_colmap_unit: f64,
}

/// A true object.
#[derive(Debug, Clone, Deserialize)]
pub struct TrueObject {
    /// Its value in the maps.
    pub id: u8,
    pub name: String,
    /// The lower and the upper corner in the input's frame and unit.
    pub box_axis_aligned_colmap: [[f64; 3]; 2],
}

/// An object that was told apart: its name, and its box in the input's frame and unit.
#[derive(Debug, Clone)]
pub struct FoundObject {
    pub name: String,
    pub bounds: Bounds,
}

/// Pixels of all photos together, counted by true object and found object.
#[derive(Debug, Clone, Default)]
pub struct Overlaps {
    /// By the id of the true one, then the number of the found one, from 1.
    both: BTreeMap<(u8, u32), usize>,
    true_pixels: BTreeMap<u8, usize>,
    found_pixels: BTreeMap<u32, usize>,
}

/// How well a true object was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectScore {
    pub name: String,
    /// The one that was told apart; `None` if none was.
    pub found: Option<String>,
    /// IoU of the masks, all photos together; 0 if it was not found.
    pub mask_iou: f64,
    pub box_iou: f64,
    /// Distance between the middles of the boxes, in metres.
    pub center_error_m: Option<f64>,
}

/// How well the objects of a capture were told apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectsEvaluation {
    pub scene: String,
    pub objects: Vec<ObjectScore>,
    /// Over all true objects; those that were not found count as 0.
    pub mean_mask_iou: f64,
    /// True objects on which more than one lies.
    pub cut: Vec<String>,
    /// Objects that cover several true ones.
    pub merging: Vec<String>,
    /// Objects that are no true one.
    pub false_objects: Vec<String>,
    /// The angle between the true up and the one that was found, in degrees.
    pub up_error_deg: f64,
    /// Number of photos with a map.
    pub photos: usize,
}

impl Overlaps {
    /// Counts one photo: for each pixel the id of the true object, and the number of the found one, from 1; both may be anything
    /// else where there is none.
    pub fn count(&mut self, truth: &[u8], found: &[Option<u32>], ids: &[u8], count: u32) {
        for (id, number) in truth.iter().zip(found) {
            let id = Some(*id).filter(|id| ids.contains(id));
            let number = number.filter(|number| (1..=count).contains(number));
            if let Some(id) = id {
                *self.true_pixels.entry(id).or_default() += 1;
            }
            if let Some(number) = number {
                *self.found_pixels.entry(number).or_default() += 1;
            }
            if let Some(both) = id.zip(number) {
                *self.both.entry(both).or_default() += 1;
            }
        }
    }

    fn both(&self, id: u8, number: u32) -> usize {
        self.both.get(&(id, number)).copied().unwrap_or(0)
    }

    fn iou(&self, id: u8, number: u32) -> f64 {
        let [of_true, of_found] =
            [self.true_pixels.get(&id), self.found_pixels.get(&number)].map(|n| n.copied().unwrap_or(0));
        let both = self.both(id, number);
        both as f64 / (of_true + of_found - both).max(1) as f64
    }

    /// Whether a found object covers enough of a true one to count.
    fn covers(&self, id: u8, number: u32) -> bool {
        let of_true = self.true_pixels.get(&id).copied().unwrap_or(0);
        self.both(id, number) as f64 > LEAST_SHARE * of_true as f64
    }
}

/// Compares them. `up` is the unit vector that was found, in the input's frame.
pub fn compare(
    scene: &str,
    truth: &Truth,
    found: &[FoundObject],
    overlaps: &Overlaps,
    up: [f64; 3],
    photos: usize,
) -> ObjectsEvaluation {
    let numbered = || (1_u32..).zip(found);
    let score = |object: &TrueObject| {
        let best = numbered().map(|(number, of)| (overlaps.iou(object.id, number), of));
        let best = best.filter(|(iou, _)| *iou >= LEAST_IOU).max_by(|a, b| a.0.total_cmp(&b.0));
        let [min, max] = object.box_axis_aligned_colmap.map(Point3::from);
        let bounds = Bounds { min, max };
        ObjectScore {
            name: object.name.clone(),
            found: best.map(|(_, of)| of.name.clone()),
            mask_iou: best.map_or(0.0, |(iou, _)| iou),
            box_iou: best.map_or(0.0, |(_, of)| box_iou(&bounds, &of.bounds)),
            center_error_m: best
                .map(|(_, of)| (bounds.center() - of.bounds.center()).norm() * truth.metres_per_colmap_unit),
        }
    };
    let objects: Vec<ObjectScore> = truth.objects.iter().map(score).collect();
    let covering = |object: &&TrueObject| numbered().filter(|(number, _)| overlaps.covers(object.id, *number)).count();
    let covered = |number: u32| truth.objects.iter().filter(|object| overlaps.covers(object.id, number)).count();
    let named = |is_so: &dyn Fn(u32, &FoundObject) -> bool| {
        numbered().filter(|(number, of)| is_so(*number, of)).map(|(_, of)| of.name.clone()).collect::<Vec<_>>()
    };
    ObjectsEvaluation {
        scene: scene.to_owned(),
        mean_mask_iou: objects.iter().map(|object| object.mask_iou).sum::<f64>() / objects.len().max(1) as f64,
        cut: truth.objects.iter().filter(|object| covering(object) > 1).map(|object| object.name.clone()).collect(),
        merging: named(&|number, _| covered(number) > 1),
        false_objects: named(&|_, of| objects.iter().all(|object| object.found.as_ref() != Some(&of.name))),
        up_error_deg: Vector3::from(up).angle(&Vector3::from(truth.up_colmap)).to_degrees(),
        objects,
        photos,
    }
}

/// The volume of what two boxes share, divided by that of both together.
fn box_iou(one: &Bounds, other: &Bounds) -> f64 {
    let volume = |bounds: &Bounds| bounds.size().map(|side| side.max(0.0)).product();
    let shared = volume(&Bounds { min: one.min.sup(&other.min), max: one.max.inf(&other.max) });
    let both = volume(one) + volume(other) - shared;
    if both > 0.0 { shared / both } else { 0.0 }
}

impl ObjectsEvaluation {
    /// The comparison as a table.
    pub fn text(&self) -> String {
        let found = self.objects.iter().filter(|object| object.found.is_some()).count();
        let mut text = format!(
            "{}: {found} of {} found in {}; mean mask IoU {:.3}; up is {:.2} degrees off\n{:<20} {:<12} {:>9} {:>8} {:>12}\n",
            one_line(&self.scene),
            counted(self.objects.len(), "object"),
            counted(self.photos, "photo"),
            self.mean_mask_iou,
            self.up_error_deg,
            "object",
            "found",
            "mask IoU",
            "box IoU",
            "middle off"
        );
        for object in &self.objects {
            let off = object.center_error_m.map_or("-".to_owned(), |meters| format!("{:.1} mm", 1e3 * meters));
            let found = object.found.as_deref().unwrap_or("-");
            let name = one_line(&object.name);
            // Writing into a string cannot fail.
            let _ = writeln!(text, "{name:<20} {found:<12} {:>9.3} {:>8.3} {off:>12}", object.mask_iou, object.box_iou);
        }
        for (what, names) in [("cut", &self.cut), ("merging", &self.merging), ("false", &self.false_objects)] {
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            let _ = writeln!(text, "{what}: {}", one_line(&names));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth() -> Truth {
        let object = |id: u8, name: &str, low: f64| TrueObject {
            id,
            name: name.to_owned(),
            box_axis_aligned_colmap: [[low, 0.0, 0.0], [low + 1.0, 1.0, 1.0]],
        };
        let objects = vec![object(0, "mug", 0.0), object(1, "bowl", 4.0), object(7, "box", 8.0)];
        Truth { objects, up_colmap: [0.0, 0.0, 1.0], metres_per_colmap_unit: 0.5 }
    }

    fn found(name: &str, low: f64) -> FoundObject {
        FoundObject {
            name: name.to_owned(),
            bounds: Bounds { min: [low, 0.0, 0.0].into(), max: [low + 1.0, 1.0, 1.0].into() },
        }
    }

    #[test]
    fn an_object_is_found_missed_cut_or_merged() {
        let none = 255;
        // The mug: 8 of 10 pixels and one beside. The bowl: cut in two. The box: missed. A false object elsewhere.
        let maps: [(&[u8], u32, usize); 7] =
            [(&[0], 1, 8), (&[0], 0, 2), (&[none], 1, 1), (&[1], 2, 6), (&[1], 3, 4), (&[7], 0, 5), (&[none], 4, 3)];
        let (mut ids, mut numbers) = (Vec::new(), Vec::new());
        for (id, number, count) in maps {
            ids.extend(std::iter::repeat_n(id[0], count));
            numbers.extend(std::iter::repeat_n(Some(number), count));
        }
        let mut overlaps = Overlaps::default();
        overlaps.count(&ids, &numbers, &[0, 1, 7], 4);
        let all = [found("object_1", 0.5), found("object_2", 4.0), found("object_3", 4.5), found("object_4", 20.0)];
        let report = compare("table", &truth(), &all, &overlaps, [0.0, 1.0, 0.0], 1);
        let [mug, bowl, missed] = &report.objects[..] else { panic!("{report:?}") };
        assert_eq!(mug.found.as_deref(), Some("object_1"));
        assert!((mug.mask_iou - 8.0 / 11.0).abs() < 1e-12 && (mug.box_iou - 1.0 / 3.0).abs() < 1e-12, "{mug:?}");
        assert!((mug.center_error_m.unwrap() - 0.25).abs() < 1e-12, "half a unit of half a metre: {mug:?}");
        assert!((bowl.mask_iou - 0.6).abs() < 1e-12 && bowl.found.as_deref() == Some("object_2"), "{bowl:?}");
        assert_eq!((missed.found.as_ref(), missed.mask_iou, missed.center_error_m), (None, 0.0, None));
        assert_eq!(report.cut, ["bowl"]);
        assert_eq!(report.false_objects, ["object_3", "object_4"]);
        assert!(report.merging.is_empty());
        assert!((report.up_error_deg - 90.0).abs() < 1e-9);
        assert!((report.mean_mask_iou - (8.0 / 11.0 + 0.6) / 3.0).abs() < 1e-12);
        overlaps.count(&[1; 20], &[Some(1); 20], &[0, 1, 7], 4);
        let merged = compare("table", &truth(), &all, &overlaps, [0.0, 0.0, 1.0], 2);
        assert_eq!(merged.merging, ["object_1"]);
    }
}
