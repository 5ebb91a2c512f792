//! The parts as they are written, in metres and kilograms.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::mass::unknowns::Source;
use crate::units::{Estimate, MetricScale, Range, ScaleSource};

/// The object and its parts, in metres and kilograms. Written as `parts.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Parts {
    /// The whole object.
    pub object: Object,
    /// By id.
    pub parts: Vec<Part>,
    /// The fillings of shells, which no photo shows. Their mass is part of the object's.
    #[serde(default)]
    pub fillings: Vec<Filling>,
    /// The known mass of the object; missing if it was not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "KnownMass"))]
    pub known_mass: Option<KnownMass>,
    /// Metres in a scene unit, if they have an interval: from a marker, an estimate or the known mass; missing if they are exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "Estimate"))]
    pub meters_per_unit: Option<Estimate>,
    /// The source of the metric scale if a model estimated it: all metres, kilograms and newtons are no better than that;
    /// missing otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "String"))]
    pub estimated_scale: Option<String>,
    /// Messages about results that should be checked.
    pub warnings: Vec<String>,
    /// Other messages.
    #[serde(default)]
    pub notes: Vec<String>,
}

impl Parts {
    /// The metric scale that follows from the known mass. Only for a scene without a scale of its own: an interval of
    /// another source is taken for one from the mass.
    pub fn scale(&self) -> Option<MetricScale> {
        let Estimate { low, mid, high } = self.meters_per_unit?;
        let provenance = format!("from the known mass of the object: {low:.4} to {high:.4} m");
        Some(MetricScale {
            meters_per_unit: mid,
            source: ScaleSource::KnownMass,
            provenance,
            range: Some(Range::new(low, high)),
        })
    }
}

/// The whole object with its fillings. It has a volume; without one there is no result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Object {
    pub volume_m3: Estimate,
    pub mass_kg: Estimate,
    /// Where the width of the mass comes from.
    #[serde(default)]
    pub width: Vec<Width>,
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
            Self::OwnsNoPlace => "has no surface of its own",
            Self::NoMaterial => "fills no cell of the grid",
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
    /// Where the width of the mass comes from.
    #[serde(default)]
    pub width: Vec<Width>,
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

/// The filling of a shell, as an entry of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Filling {
    /// The `id` of the shell.
    pub inside_of: u32,
    pub caption: String,
    /// Name of a row of `fillings.csv`.
    pub filling: String,
    /// True: no view shows it; the answers say that it is there.
    pub unseen: bool,
    /// The share of the hollow that it takes up, 0 to 1.
    pub share_of_hollow: Estimate,
    /// With the gaps between its pieces.
    pub volume_m3: Estimate,
    pub density_kg_m3: Estimate,
    pub mass_kg: Estimate,
    /// Where the width of the mass comes from.
    pub width: Vec<Width>,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About its centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
}

/// The share of one cause in the width of a mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Width {
    pub source: Source,
    /// The interval of the mass if only this were uncertain.
    pub mass_kg: Range,
}

impl Width {
    pub(super) fn new(source: Source, mass_kg: Estimate) -> Self {
        Self { source, mass_kg: Range::new(mass_kg.low, mass_kg.high) }
    }

    /// How many times as heavy its high end is as its low end.
    pub fn factor(&self) -> f64 {
        self.mass_kg.high / self.mass_kg.low
    }
}

/// One reading of a kitchen scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct KnownMass {
    pub reading_kg: f64,
    /// Half-width of its 90 % interval.
    pub error_kg: f64,
    /// The mass as it was expected without the reading.
    pub expected_kg: Estimate,
    /// The least and the greatest mass that the answers and the surface allow.
    pub possible_kg: Range,
    /// Whether it is possible; if not, the masses are those that were expected.
    pub is_possible: bool,
}

/// Density of carbon steel.
const STEEL_KG_M3: f64 = 7850.0;

impl KnownMass {
    /// Why the reading is impossible, and the nearest mass that is possible; `None` if the reading is possible. The
    /// object's surface encloses `enclosed_m3`.
    pub(super) fn problem(&self, enclosed_m3: f64) -> Option<String> {
        if self.is_possible {
            return None;
        }
        let (reading, Range { low, high }) = (self.reading_kg, self.possible_kg);
        let (side, nearest) = if reading > high { ("high", high) } else { ("low", low) };
        let density = reading / enclosed_m3;
        let steel = if density > STEEL_KG_M3 { ", denser than solid steel" } else { "" };
        Some(format!(
            "--known-mass {reading} kg is impossible: the answers allow {low:.3} to {high:.3} kg. The nearest is \
             {nearest:.3} kg, with every wall, density, filling and unseen depth at its {side} end. {reading} kg would \
             mean a density of {density:.0} kg/m3 for the whole volume within the surface{steel}. Check the reading, \
             the metric scale and the answers; the masses are as without --known-mass"
        ))
    }
}
