//! The parts as they are written, in metres and kilograms.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::units::Estimate;

/// The object and its parts, in metres and kilograms. Written as `parts.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Parts {
    /// The whole object.
    pub object: Object,
    /// By id.
    pub parts: Vec<Part>,
    /// What the user should check.
    pub warnings: Vec<String>,
    /// What the user may want to know.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// The whole object. It has a volume; without one there is no result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Part {
    /// Its value of `part_label` in `field.ply`.
    pub id: u32,
    pub caption: String,
    /// Name of the library row.
    pub material: String,
    pub family: String,
    /// Number of Gaussians with its label.
    pub gaussians: usize,
    /// `None`, like what follows from it, if the part has no volume.
    pub volume_m3: Option<Estimate>,
    /// Why it has no volume; missing if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "NoVolume"))]
    pub no_volume: Option<NoVolume>,
    /// Thickness below the surface that is grasped: from surface to surface for a solid, the wall for a shell; `None` if no
    /// surface of it was seen.
    pub thickness_m: Option<Estimate>,
    pub density_kg_m3: Estimate,
    pub mass_kg: Option<Estimate>,
    /// World frame, metres.
    pub center_of_mass_m: Option<[f64; 3]>,
    /// About the part's centre of mass, world axes.
    pub inertia_kg_m2: Option<[[f64; 3]; 3]>,
    /// The connected bodies that it is made of.
    pub bodies: Vec<PartBody>,
    /// Distance from the nearest place on its outer surface to the object's centre of mass; `None` if it has no outer surface.
    pub surface_to_center_of_mass_m: Option<f64>,
}

/// A connected body of a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PartBody {
    pub volume_m3: f64,
    pub mass_kg: f64,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
}
