//! From part maps to a material for every Gaussian: splat rasteriser, depth test, tally.

pub mod raster;

use serde::{Deserialize, Serialize};

use crate::materials::Law;
use crate::query::Form;
use crate::units::{Estimate, ShoreHardness};

/// What the vote decided for every Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialField {
    /// The labels that a Gaussian may have; `labels[i].id == i`.
    pub labels: Vec<FieldLabel>,
    /// Per Gaussian: index into `labels`.
    pub part_label: Vec<u32>,
    /// Per Gaussian: share of its votes that its label won, 0 to 1; 0 where it was never seen.
    pub confidence: Vec<f32>,
    /// Per Gaussian: votes for the winning label.
    pub votes: Vec<f32>,
    /// Per Gaussian: views that see it. 0 means the label came from the nearest seen ones.
    pub views: Vec<u16>,
    /// What the user should know: counted, never fatal.
    pub warnings: Vec<String>,
}

/// One part of the object in 3D, as the views agree on it: a material with its properties. Of every property, `low` and
/// `high` bound what the answers for this material say, and `mid` is the median of their middles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldLabel {
    pub id: u32,
    pub caption: String,
    /// Name of the library row.
    pub material: String,
    pub family: String,
    pub density_kg_m3: Estimate,
    pub youngs_modulus_pa: Estimate,
    pub poisson_ratio: Estimate,
    /// Strength that limits a grasp.
    pub yield_strength_pa: Estimate,
    pub hardness: Option<ShoreHardness>,
    pub friction_rubber: Estimate,
    pub form: Form,
    pub law: Law,
}
