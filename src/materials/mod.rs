//! The material library: fifteen families, ranges of every property in SI units with their sources, look-up by name,
//! and the checks that keep it plausible.
//!
//! The data is in the crate's `materials/` folder, one CSV per family, and is compiled in; its README describes the
//! columns. The fillings of hollow things have a table of their own, [`fillings`]. [`MaterialLibrary`] reads both,
//! [`check`](check::check) tests them, [`cli`] prints them.

pub mod bibliography;
pub mod check;
pub mod cli;
pub mod fillings;

mod library;
mod names;
mod options;
mod read;
pub mod stats;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::units::{Range, ShoreHardness, ShoreScale};

pub use library::MaterialLibrary;
pub(crate) use names::SPELLINGS;
pub use names::fold;
pub use options::{Options, SCENE_KEYS};
pub use read::LibraryError;

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
    /// The stress at which it fails or flows, of the kind in `strength_kind`.
    pub strength_pa: Range,
    pub strength_kind: StrengthKind,
    /// Coulomb friction, static and dry, against a rubber gripper pad.
    pub friction_rubber: Range,
    /// Coulomb friction, static and dry, against smooth steel.
    pub friction_steel: Range,
    /// That of its family.
    pub restitution: Option<Range>,
    /// `None` if Shore hardness does not apply.
    pub hardness: Option<ShoreHardness>,
    pub law: Law,
    pub labels: Labels,
    pub sources: Sources,
}

/// The kind of stress that a strength is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StrengthKind {
    /// 0.2 % proof stress or yield point, in tension.
    Yield,
    /// Ultimate tensile strength.
    Uts,
    /// Modulus of rupture in bending.
    Flexural,
    /// Crushing strength.
    Compressive,
    /// Plateau of a foam in compression.
    Plateau,
    /// Stress at fracture under any loading.
    Fracture,
    /// Cohesion of a granular or plastic mass; 0 for dry sand.
    Cohesion,
}

/// Writes the name used in the CSV and in JSON.
impl fmt::Display for StrengthKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The constitutive law that simulates a material, with what it needs beyond E, nu and density.
///
/// The laws and their parameters are those of the MPM literature that PhysGaussian (Xie et al., 2024) draws on; its
/// names for them are jelly, metal, sand, foam, snow and plasticine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
// Names in the CSV, in JSON and in messages all come from serde.
#[serde(tag = "law", rename_all = "snake_case")]
pub enum Law {
    /// Fixed corotated elasticity; never yields.
    Elastic,
    /// Hencky elasticity with von Mises yield.
    VonMises { yield_stress_pa: f64 },
    /// Drucker-Prager sand (Klár et al., 2016); `cohesion_pa` is 0 for dry grains.
    DruckerPrager { friction_angle_rad: f64, cohesion_pa: f64 },
    /// Viscoplastic foam (Yue et al., 2015): flows above the yield stress, resisted by the plastic viscosity.
    Foam { yield_stress_pa: f64, viscosity_pa_s: f64 },
    /// Snow (Stomakhin et al., 2013): critical compression `theta_c`, critical stretch `theta_s`, hardening `xi`.
    Snow { theta_c: f64, theta_s: f64, hardening: f64 },
    /// Von Mises yield that softens with plastic flow, for clay, dough, wax.
    Plasticine { yield_stress_pa: f64, softening: f64 },
    /// Pressure only, with Lame's first constant as the bulk modulus; no shear.
    Fluid,
}

/// Labels of the material in the two data sets of the paper's evaluation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Labels {
    pub abo: Label,
    pub mvimgnet: Label,
}

/// A material label of an evaluation data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Label {
    pub name: String,
    /// True if the label means exactly this material; otherwise it is the nearest of the set.
    pub exact: bool,
}

/// Where each number of a row comes from: ids of the bibliography, usually with that source's entry after a colon.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sources {
    pub density: Vec<String>,
    pub youngs_modulus: Vec<String>,
    pub poisson_ratio: Vec<String>,
    pub strength: Vec<String>,
    pub friction_rubber: Vec<String>,
    pub friction_steel: Vec<String>,
    pub hardness: Vec<String>,
    pub law: Vec<String>,
}

impl Sources {
    /// Every property with its sources, in column order.
    pub fn by_property(&self) -> [(&'static str, &[String]); 8] {
        [
            ("density", &self.density),
            ("youngs_modulus", &self.youngs_modulus),
            ("poisson_ratio", &self.poisson_ratio),
            ("strength", &self.strength),
            ("friction_rubber", &self.friction_rubber),
            ("friction_steel", &self.friction_steel),
            ("hardness", &self.hardness),
            ("law", &self.law),
        ]
    }
}

/// Values that hold for every material of a family: bounds wide enough for all of them, and defaults.
///
/// This is the row for an answer that names only the family ("metal", "wood").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Family {
    pub name: String,
    pub density_kg_m3: Range,
    pub youngs_modulus_pa: Range,
    pub poisson_ratio: Range,
    pub strength_pa: Range,
    /// The usual meaning of strength in the family, in words.
    pub strength_meaning: String,
    pub friction_rubber: Range,
    pub friction_steel: Range,
    /// Coefficient of restitution: the speed after an impact on a hard surface at 1 to 3 m/s by that before it, both along
    /// the normal. `None` if a user's table does not say.
    pub restitution: Option<Range>,
    /// Of the restitution.
    pub restitution_sources: Vec<String>,
    /// The softest and the hardest reading.
    pub hardness: [ShoreReading; 2],
    /// The law of a member about which nothing more is known.
    pub law: Law,
    pub labels: Labels,
}

/// One reading of a Shore durometer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShoreReading {
    pub scale: ShoreScale,
    pub value: f64,
}

impl ShoreReading {
    /// Compares readings on both scales: any A is below any D. For bounds only; in reality the scales overlap.
    pub fn is_at_most(self, other: Self) -> bool {
        match (self.scale, other.scale) {
            (ShoreScale::A, ShoreScale::D) => true,
            (ShoreScale::D, ShoreScale::A) => false,
            _ => self.value <= other.value,
        }
    }
}
