//! Converts volumes in scene units to kilograms, and the bounds of volume and density to those of mass.
//!
//! Rule: low = low density x low volume, mid = mid x mid, high = high x high; the object's bounds are the sums of its
//! parts', since an error in one part (a splat that is too thick, a library density that is too high) tends to affect
//! all.
//!
//! [`bodies`] finds the connected pieces of a part, [`moments`] their volume, centre of mass and inertia.

pub mod bodies;
pub mod moments;

use nalgebra::Matrix3;

use super::{BodiesAs, Object, Part, PartBody, Shape};
use crate::units::Estimate;
use crate::vote::FieldLabel;
use moments::Moments;

/// A connected body of a part.
pub(super) struct Piece {
    pub moments: Moments,
    pub gaussians: usize,
    pub surface_to_center_of_mass: Option<f64>,
}

/// A part's bodies with their density.
pub(super) struct Weighable<'a> {
    pub shape: &'a Shape,
    pub label: &'a FieldLabel,
    pub pieces: &'a [Piece],
}

/// The moments of all parts together, weighted by mass; `None` if nothing has mass. World frame, scene units.
pub(super) fn combined(weighables: &[Weighable]) -> Option<Moments> {
    let pieces = weighables.iter().flat_map(|w| w.pieces.iter().map(|p| (w.label.density_kg_m3.mid, p.moments)));
    Moments::combined(&pieces.collect::<Vec<_>>())
}

/// The object and its parts in metres and kilograms; a scene unit is `scale` metres. `whole` is the result of
/// [`combined`].
pub(super) fn weigh(whole: &Moments, weighables: &[Weighable], scale: f64, bodies: BodiesAs) -> (Object, Vec<Part>) {
    let whole_parts = weighables.iter().map(|w| w.part(w.pieces, 1.0, scale));
    let zero = Estimate::exactly(0.0);
    let measured = whole_parts.filter_map(|part| part.volume_m3.zip(part.mass_kg));
    let (volume_m3, mass_kg) =
        measured.fold((zero, zero), |(volumes, masses), (volume, mass)| (volumes.plus(volume), masses.plus(mass)));
    let object = Object {
        volume_m3,
        mass_kg,
        center_of_mass_m: (whole.center * scale).into(),
        inertia_kg_m2: rows(whole.inertia() * scale.powi(5)),
    };
    (object, weighables.iter().flat_map(|w| w.parts(scale, bodies)).collect())
}

impl Weighable<'_> {
    /// One part with all bodies, or one part per body.
    fn parts(&self, scale: f64, bodies: BodiesAs) -> Vec<Part> {
        let count = self.pieces.len();
        let Some(whole) = self.shape.volume.filter(|_| bodies == BodiesAs::Parts && count >= 2) else {
            return vec![self.part(self.pieces, 1.0, scale)];
        };
        let part = |(k, piece): (usize, &Piece)| Part {
            caption: format!("{} ({} of {count})", self.label.caption, k + 1),
            gaussians: piece.gaussians,
            surface_to_center_of_mass_m: piece.surface_to_center_of_mass.map(|d| d * scale),
            ..self.part(std::slice::from_ref(piece), piece.moments.volume / whole.mid, scale)
        };
        self.pieces.iter().enumerate().map(part).collect()
    }

    /// The part that consists of these bodies, which have this share of the whole part's volume.
    fn part(&self, pieces: &[Piece], share: f64, scale: f64) -> Part {
        let density = self.label.density_kg_m3;
        let volume = self.shape.volume.map(|volume| volume.scaled(share * scale.powi(3)));
        // The sum over bodies of unit density, so mass is volume.
        let moments = Moments::combined(&pieces.iter().map(|p| (1.0, p.moments)).collect::<Vec<_>>());
        let body = |piece: &Piece| PartBody {
            volume_m3: piece.moments.volume * scale.powi(3),
            mass_kg: piece.moments.volume * scale.powi(3) * density.mid,
            center_of_mass_m: (piece.moments.center * scale).into(),
        };
        Part {
            id: self.label.id,
            caption: self.label.caption.clone(),
            material: self.label.material.clone(),
            family: self.label.family.clone(),
            gaussians: self.shape.gaussians,
            volume_m3: volume,
            no_volume: self.shape.no_volume,
            thickness_m: self.shape.thickness.map(|thickness| thickness.scaled(scale)),
            density_kg_m3: density,
            mass_kg: volume.map(|v| Estimate::new(v.low * density.low, v.mid * density.mid, v.high * density.high)),
            center_of_mass_m: moments.map(|m| (m.center * scale).into()),
            inertia_kg_m2: moments.map(|m| rows(m.inertia() * (density.mid * scale.powi(5)))),
            bodies: pieces.iter().map(body).collect(),
            surface_to_center_of_mass_m: self.shape.surface_to_center_of_mass.map(|d| d * scale),
        }
    }
}

fn rows(m: Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
