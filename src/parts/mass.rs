//! From volumes in scene units to kilograms, and from the bounds of volume and density to those of mass.
//!
//! Rule: low = low density x low volume, mid = mid x mid, high = high x high; the object's bounds are the sums of its
//! parts', since what is wrong about one part (a splat too fat, a library's density too high) tends to be wrong about all.

use nalgebra::{Matrix3, Point3};

use super::moments::Moments;
use super::{Object, Part, Shape};
use crate::units::Estimate;
use crate::vote::FieldLabel;

/// A part's moments with the density that goes with them.
pub(super) struct Body<'a> {
    pub shape: &'a Shape,
    pub label: &'a FieldLabel,
    pub moments: Option<Moments>,
}

/// The centre of mass of all, world frame, scene units; `None` where nothing has mass.
pub(super) fn center_of_mass(bodies: &[Body]) -> Option<Point3<f64>> {
    combined(bodies).map(|whole| whole.center)
}

fn combined(bodies: &[Body]) -> Option<Moments> {
    let weighed: Vec<(f64, Moments)> =
        bodies.iter().filter_map(|b| Some((b.label.density_kg_m3.mid, b.moments?))).collect();
    Moments::combined(&weighed)
}

/// The object and its parts in metres and kilograms, `scale` metres to a scene unit.
pub(super) fn weigh(bodies: &[Body], scale: f64) -> (Object, Vec<Part>) {
    let parts: Vec<Part> = bodies.iter().map(|b| b.part(scale)).collect();
    let zero = Estimate::exactly(0.0);
    let whole = combined(bodies);
    let object = Object {
        volume_m3: parts.iter().fold(zero, |sum, p| sum.plus(p.volume_m3)),
        mass_kg: parts.iter().fold(zero, |sum, p| sum.plus(p.mass_kg)),
        center_of_mass_m: whole.map_or([0.0; 3], |w| (w.center * scale).into()),
        inertia_kg_m2: rows(whole.map_or_else(Matrix3::zeros, |w| w.inertia() * scale.powi(5))),
    };
    (object, parts)
}

impl Body<'_> {
    fn part(&self, scale: f64) -> Part {
        let density = self.label.density_kg_m3;
        let volume = self.shape.volume.scaled(scale.powi(3));
        Part {
            id: self.label.id,
            caption: self.label.caption.clone(),
            material: self.label.material.clone(),
            family: self.label.family.clone(),
            gaussians: self.shape.gaussians,
            volume_m3: volume,
            thickness_m: self.shape.thickness.scaled(scale),
            density_kg_m3: density,
            mass_kg: Estimate::new(volume.low * density.low, volume.mid * density.mid, volume.high * density.high),
            center_of_mass_m: self.moments.map_or([0.0; 3], |m| (m.center * scale).into()),
            inertia_kg_m2: rows(
                self.moments.map_or_else(Matrix3::zeros, |m| m.inertia() * (density.mid * scale.powi(5))),
            ),
            surface_to_center_of_mass_m: self.shape.surface_to_center_of_mass.map(|d| d * scale),
        }
    }
}

fn rows(m: Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
