//! From volumes in scene units to kilograms, and from the bounds of volume and density to those of mass.
//!
//! Rule: low = low density x low volume, mid = mid x mid, high = high x high; the object's bounds are the sums of its
//! parts', since what is wrong about one part (a splat too fat, a library's density too high) tends to be wrong about all.

use nalgebra::{Matrix3, Point3};

use super::moments::Moments;
use super::{BodiesAs, Object, Part, PartBody, Shape};
use crate::units::Estimate;
use crate::vote::FieldLabel;

/// A connected body of a part.
pub(super) struct Piece {
    pub moments: Moments,
    pub gaussians: usize,
    pub surface_to_center_of_mass: Option<f64>,
}

/// A part's bodies with the density that goes with them.
pub(super) struct Weighable<'a> {
    pub shape: &'a Shape,
    pub label: &'a FieldLabel,
    pub pieces: &'a [Piece],
}

/// The centre of mass of all, world frame, scene units; `None` where nothing has mass.
pub(super) fn center_of_mass(weighables: &[Weighable]) -> Option<Point3<f64>> {
    combined(weighables).map(|whole| whole.center)
}

fn combined(weighables: &[Weighable]) -> Option<Moments> {
    let pieces = weighables.iter().flat_map(|w| w.pieces.iter().map(|p| (w.label.density_kg_m3.mid, p.moments)));
    Moments::combined(&pieces.collect::<Vec<_>>())
}

/// The object and its parts in metres and kilograms, `scale` metres to a scene unit.
pub(super) fn weigh(weighables: &[Weighable], scale: f64, bodies: BodiesAs) -> (Object, Vec<Part>) {
    let whole_parts = weighables.iter().map(|w| w.part(w.pieces, 1.0, scale));
    let zero = Estimate::exactly(0.0);
    let (volume_m3, mass_kg) =
        whole_parts.fold((zero, zero), |(volume, mass), p| (volume.plus(p.volume_m3), mass.plus(p.mass_kg)));
    let whole = combined(weighables);
    let object = Object {
        volume_m3,
        mass_kg,
        center_of_mass_m: whole.map_or([0.0; 3], |w| (w.center * scale).into()),
        inertia_kg_m2: rows(whole.map_or_else(Matrix3::zeros, |w| w.inertia() * scale.powi(5))),
    };
    (object, weighables.iter().flat_map(|w| w.parts(scale, bodies)).collect())
}

impl Weighable<'_> {
    /// One part of many bodies, or as many parts.
    fn parts(&self, scale: f64, bodies: BodiesAs) -> Vec<Part> {
        let count = self.pieces.len();
        if bodies == BodiesAs::OnePart || count < 2 {
            return vec![self.part(self.pieces, 1.0, scale)];
        }
        let part = |(k, piece): (usize, &Piece)| Part {
            caption: format!("{} ({} of {count})", self.label.caption, k + 1),
            gaussians: piece.gaussians,
            surface_to_center_of_mass_m: piece.surface_to_center_of_mass.map(|d| d * scale),
            ..self.part(std::slice::from_ref(piece), piece.moments.volume / self.shape.volume.mid, scale)
        };
        self.pieces.iter().enumerate().map(part).collect()
    }

    /// The part of these bodies, which are this share of its volume.
    fn part(&self, pieces: &[Piece], share: f64, scale: f64) -> Part {
        let density = self.label.density_kg_m3;
        let volume = self.shape.volume.scaled(share * scale.powi(3));
        // The sum over bodies of unit density: the volume stands for the mass.
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
            thickness_m: self.shape.thickness.scaled(scale),
            density_kg_m3: density,
            mass_kg: Estimate::new(volume.low * density.low, volume.mid * density.mid, volume.high * density.high),
            center_of_mass_m: moments.map_or([0.0; 3], |m| (m.center * scale).into()),
            inertia_kg_m2: rows(moments.map_or_else(Matrix3::zeros, |m| m.inertia() * (density.mid * scale.powi(5)))),
            bodies: pieces.iter().map(body).collect(),
            surface_to_center_of_mass_m: self.shape.surface_to_center_of_mass.map(|d| d * scale),
        }
    }
}

fn rows(m: Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
