//! Fillings of the hollows of shells: liquids, grains, stuffing, machinery, with the density of the whole filling.
//!
//! A filling is not a material: its density counts the gaps between its pieces, and nothing of it is seen. Its table is
//! `materials/fillings.csv`.

use serde::{Deserialize, Serialize};

use super::Law;
use crate::units::Range;

/// A row of `fillings.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Filling {
    /// Unique after folding case and punctuation.
    pub name: String,
    pub kind: FillingKind,
    /// Mass divided by the volume that the filling takes up, including the gaps between its pieces.
    pub density_kg_m3: Range,
    /// Citations as for a material, or `judgement`.
    pub density_sources: Vec<String>,
    /// The rule by which the density was estimated, or what its ends stand for.
    pub basis: String,
    /// Stiffness of the filling as a whole. A liquid's follows from its bulk modulus and `poisson_ratio`.
    pub youngs_modulus_pa: Range,
    pub poisson_ratio: Range,
    pub law: Law,
}

/// How a filling fills.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FillingKind {
    /// Flows and levels.
    Liquid,
    /// Flows under a load: creams, wet food.
    Paste,
    /// Powders and grains.
    Grains,
    /// Pieces that a person would count or name.
    Pieces,
    /// Material that gives a cushion, a toy or a panel its body.
    Stuffing,
    /// Batteries, motors, electronics, as one solid.
    Machinery,
}

impl FillingKind {
    /// Every kind, in the order of the table.
    pub const ALL: [Self; 6] = [Self::Liquid, Self::Paste, Self::Grains, Self::Pieces, Self::Stuffing, Self::Machinery];

    /// The kind as the table writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liquid => "liquid",
            Self::Paste => "paste",
            Self::Grains => "grains",
            Self::Pieces => "pieces",
            Self::Stuffing => "stuffing",
            Self::Machinery => "machinery",
        }
    }
}
