//! The parts as they are written, in metres and kilograms.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::units::Estimate;

/// The object and its parts, in metres and kilograms. Written as `parts.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parts {
    pub object: Object,
    /// By id.
    pub parts: Vec<Part>,
    pub warnings: Vec<String>,
}

/// The whole. It has a volume: an object without one is not an object (see [`PartsError::NoVolume`](super::PartsError)).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Object {
    pub volume_m3: Estimate,
    pub mass_kg: Estimate,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About the centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
}

/// Why a part has no volume, and with it no mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoVolume {
    /// None of the object's surface is its own: other parts cover what its Gaussians draw, or they lie off the object.
    OwnsNoPlace,
    /// It owns places, but all of them lie too far behind what was seen to count as material, or its wall has no thickness.
    NoMaterial,
}

impl fmt::Display for NoVolume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OwnsNoPlace => "owns no place on the surface",
            Self::NoMaterial => "holds no material in the places that it owns",
        })
    }
}

/// One part. What follows from a volume is `None` if it has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Its value of `part_label` in `field.ply`.
    pub id: u32,
    pub caption: String,
    pub material: String,
    pub family: String,
    /// How many Gaussians carry its label.
    pub gaussians: usize,
    pub volume_m3: Option<Estimate>,
    /// Why it has no volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_volume: Option<NoVolume>,
    /// Of the surface that bears a grasp: wall to wall for a solid, the wall for a shell; `None` if it has no surface.
    pub thickness_m: Option<Estimate>,
    pub density_kg_m3: Estimate,
    pub mass_kg: Option<Estimate>,
    pub center_of_mass_m: Option<[f64; 3]>,
    pub inertia_kg_m2: Option<[[f64; 3]; 3]>,
    /// The connected pieces that it is made of.
    pub bodies: Vec<PartBody>,
    /// From the nearest place on its outer surface to the object's centre of mass; `None` where it has no outer surface.
    pub surface_to_center_of_mass_m: Option<f64>,
}

/// A connected piece of a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PartBody {
    pub volume_m3: f64,
    pub mass_kg: f64,
    pub center_of_mass_m: [f64; 3],
}
