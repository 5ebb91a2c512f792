//! The material library: fifteen families, ranges of every property in SI, look-up by name.

use serde::{Deserialize, Serialize};

use crate::units::{Range, ShoreHardness};

/// One material of the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Unique after folding case and punctuation.
    pub name: String,
    pub family: String,
    pub aliases: Vec<String>,
    pub density_kg_m3: Range,
    pub youngs_modulus_pa: Range,
    pub poisson_ratio: Range,
    /// The stress at which it fails or flows, of the kind `strength_kind` says.
    pub strength_pa: Range,
    pub strength_kind: String,
    pub friction_rubber: Range,
    pub friction_steel: Range,
    /// `None` where a Shore durometer says nothing about it.
    pub hardness: Option<ShoreHardness>,
    pub law: Law,
}

/// The constitutive law that simulates a material, with what it needs beyond E, nu and density.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "snake_case")]
pub enum Law {
    /// Fixed corotated elasticity; never yields.
    Elastic,
    /// Hencky elasticity with von Mises yield.
    VonMises { yield_stress_pa: f64 },
    /// Drucker-Prager sand.
    DruckerPrager { friction_angle_rad: f64 },
}
