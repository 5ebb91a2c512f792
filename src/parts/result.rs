//! The parts as they are written, in metres and kilograms.

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

/// The whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Object {
    pub volume_m3: Estimate,
    pub mass_kg: Estimate,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About the centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
}

/// One part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Its value of `part_label` in `field.ply`.
    pub id: u32,
    pub caption: String,
    pub material: String,
    pub family: String,
    /// How many Gaussians carry its label.
    pub gaussians: usize,
    pub volume_m3: Estimate,
    /// Of the surface that bears a grasp: wall to wall for a solid, the wall for a shell.
    pub thickness_m: Estimate,
    pub density_kg_m3: Estimate,
    pub mass_kg: Estimate,
    pub center_of_mass_m: [f64; 3],
    pub inertia_kg_m2: [[f64; 3]; 3],
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
