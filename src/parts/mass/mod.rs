//! Converts volumes in scene units to kilograms: of parts, of the fillings of shells, and of the object.
//!
//! A mass is a volume times a density, and as uncertain as both; [`unknowns`] says how the causes add up, and what is
//! learned from a reading of a kitchen scale. The surface is one unknown for the whole object, since an error in how a
//! splat shows it recurs in all parts; each part has unknowns of its own for its wall and its unseen depth, each
//! material one for its density.
//!
//! [`bodies`] finds the connected bodies of a part, [`moments`] their volume, centre of mass and inertia, [`weights`] the
//! masses.

pub mod bodies;
pub mod moments;
pub mod unknowns;
pub mod weights;

use nalgebra::Matrix3;

use super::compose::Hollow;
use super::compose::volume::Volume;
use super::result::{Filling, Width};
use super::{BodiesAs, Object, Part, PartBody, Shape};
use crate::units::Estimate;
use crate::vote::{Contents, FieldPart, Filled};
use moments::Moments;
use weights::{Weight, Weights};

/// A connected body of a part.
pub(super) struct Body {
    pub moments: Moments,
    pub gaussians: usize,
    pub surface_to_center_of_mass: Option<f64>,
}

/// A part's volume and bodies with their density, and the hollow behind its wall.
pub(super) struct Weighable<'a> {
    pub shape: &'a Shape,
    pub label: &'a FieldPart,
    pub volume: &'a Volume,
    pub bodies: &'a [Body],
    /// Whether its volume is that of a wall, whatever the answer's form: `--volume` may say otherwise.
    pub is_wall: bool,
    /// The id of the one shell that it fills, whose wall then takes from its volume.
    pub sleeve: Option<u32>,
    pub hollow: Option<&'a Hollow>,
}

impl Weighable<'_> {
    /// Its hollow and the filling in it.
    pub fn filling(&self) -> Option<(&Hollow, &Filled)> {
        match (&self.label.inside, self.hollow) {
            (Some(Contents::Filled(filled)), Some(hollow)) => Some((hollow, filled)),
            _ => None,
        }
    }

    /// One part with all bodies, or one part per body.
    pub fn parts(&self, weights: &Weights, weight: &Weight, bodies_as: BodiesAs) -> Vec<Part> {
        let count = self.bodies.len();
        let Some(whole) = self.shape.volume.filter(|_| bodies_as == BodiesAs::Parts && count >= 2) else {
            return vec![self.part(self.bodies, 1.0, weights, weight)];
        };
        let part = |(k, body): (usize, &Body)| Part {
            caption: format!("{} ({} of {count})", self.label.caption, k + 1),
            gaussians: body.gaussians,
            surface_to_center_of_mass_m: body.surface_to_center_of_mass.map(|d| d * weights.length()),
            ..self.part(std::slice::from_ref(body), body.moments.volume / whole.mid, weights, weight)
        };
        self.bodies.iter().enumerate().map(part).collect()
    }

    /// The part that consists of these bodies, which have this share of the whole part's volume.
    fn part(&self, bodies: &[Body], share: f64, weights: &Weights, weight: &Weight) -> Part {
        let (scale, length) = (weights.scale, weights.length());
        let is_there = self.shape.volume.is_some();
        let (volume, density) = (weights.of(&weight.volume), weights.of(&weight.density));
        // The weighing may have changed the volume; the shape is the same.
        let grown = if weight.volume.mid > 0.0 { volume.mid / weight.volume.mid } else { 1.0 };
        // The sum over bodies of unit density, so mass is volume.
        let moments = Moments::combined(&bodies.iter().map(|body| (1.0, body.moments)).collect::<Vec<_>>());
        let as_written = |body: &Body| PartBody {
            volume_m3: body.moments.volume * scale.powi(3) * grown,
            mass_kg: body.moments.volume * scale.powi(3) * grown * density.mid,
            center_of_mass_m: (body.moments.center * length).into(),
        };
        let width = |(source, mass): (_, Estimate)| Width::new(source, mass.scaled(share));
        Part {
            id: self.label.id,
            caption: self.label.caption.clone(),
            material: self.label.material.clone(),
            family: self.label.family.clone(),
            corrected: self.label.corrected.clone(),
            gaussians: self.shape.gaussians,
            volume_m3: is_there.then(|| volume.scaled(share)),
            no_volume: self.shape.no_volume,
            thickness_m: match &weight.wall {
                Some(wall) => self.shape.thickness.and(Some(weights.of(wall))),
                None => self.shape.thickness.map(|thickness| thickness.scaled(length)),
            },
            is_wall: self.is_wall,
            density_kg_m3: density,
            mass_kg: is_there.then(|| weights.of(&weight.mass).scaled(share)),
            width: if is_there { weights.by_source(&weight.mass).into_iter().map(width).collect() } else { Vec::new() },
            center_of_mass_m: moments.map(|m| (m.center * length).into()),
            inertia_kg_m2: moments.map(|m| rows(m.inertia() * (grown * density.mid * scale.powi(3) * length.powi(2)))),
            bodies: bodies.iter().map(as_written).collect(),
            surface_to_center_of_mass_m: self.shape.surface_to_center_of_mass.map(|d| d * length),
        }
    }

    /// The filling as an entry of its own.
    pub fn filling_part(&self, weights: &Weights, weight: &Weight) -> Option<Filling> {
        let (hollow, filled) = self.filling()?;
        let (volume, density) = (weights.of(&weight.volume), weights.of(&weight.density));
        let length = weights.length();
        let moments = hollow.moments.with_volume(volume.mid / length.powi(3));
        let inertia = moments.inertia() * (density.mid * length.powi(5));
        Some(Filling {
            inside_of: self.label.id,
            caption: format!("{} in {}", filled.filling, self.label.caption),
            filling: filled.filling.clone(),
            unseen: true,
            share_of_hollow: weight.share.as_ref().map_or(filled.share, |share| at_most_all(weights.of(share))),
            volume_m3: volume,
            density_kg_m3: density,
            mass_kg: weights.of(&weight.mass),
            width: weights.by_source(&weight.mass).into_iter().map(|(source, mass)| Width::new(source, mass)).collect(),
            center_of_mass_m: (moments.center * length).into(),
            inertia_kg_m2: rows(inertia),
        })
    }
}

/// The whole object; `whole` are its moments, by mass.
pub(super) fn object(weights: &Weights, whole: &Moments) -> Object {
    let volumes: Vec<_> = weights.all.iter().map(|weight| weight.volume.clone()).collect();
    let masses = weights.masses();
    Object {
        volume_m3: weights.belief.of_sum(&volumes),
        mass_kg: weights.belief.of_sum(&masses),
        width: weights.sum_by_source(&masses).into_iter().map(|(source, mass)| Width::new(source, mass)).collect(),
        center_of_mass_m: (whole.center * weights.length()).into(),
        // What no part shows is spread like the rest.
        inertia_kg_m2: rows(whole.inertia() * (weights.length().powi(2) * weights.unseen_factor())),
    }
}

fn at_most_all(Estimate { low, mid, high }: Estimate) -> Estimate {
    Estimate::new(low.min(1.0), mid.min(1.0), high.min(1.0))
}

fn rows(m: Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}
