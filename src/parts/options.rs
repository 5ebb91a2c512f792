//! Options of the parts stage: parts and volumes.

use std::fmt;
use std::str::FromStr;

use clap::Args;
use serde::{Deserialize, Serialize, Serializer};

use super::mass::weights::Weighing;
use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, above, below, from_to, with_unit};
use crate::scene::ObjectNumber;
use crate::units::Estimate;

/// About 130 cells along each side of a box-shaped object: under a millimetre on a hammer.
const VOLUME_CELLS: usize = 2_000_000;
/// On the scenes where volumes were measured, more views carve no further.
const CARVE_VIEWS: usize = 40;
/// Half the density of a Gaussian of full opacity at its centre.
const FILL_DENSITY: f64 = 0.5;
/// A body with less than 1 % of the cloud's opacity is a floater.
const MIN_BODY_SHARE: f64 = 0.01;
/// A part with less than 0.1 % of the object's volume is more often a wrong answer than a real part.
const MIN_PART_SHARE: f64 = 0.001;
/// A sheet of steel, a mug's wall, a moulded case: 1 to 5 mm.
const WALL_M: f64 = 0.003;

/// A kitchen scale shows grams and is off by about 1 %.
const READING_ERROR: f64 = 0.01;

/// With its margin, the largest of these grids has up to 1.8e9 cells, within the range of a `u32`.
const CELLS: Domain<usize> = from_to(1000, 1 << 30);
/// Up to far more than any capture has.
const VIEWS: Domain<usize> = from_to(1, 100_000);
/// Up to a thousand opaque Gaussians in one place.
const DENSITY: Domain<f64> = above(0.0, 1000.0);
/// Up to thicker than any wall of an object or a building.
const LENGTH_M: Domain<f64> = above(0.0, 100.0);
const SHARE: Domain<f64> = below(0.0, 1.0);
/// From a milligram (kitchen scales and most laboratory scales read no less) to a thousand tonnes (more than any scale
/// weighs at once).
const MASS_KG: Domain<f64> = from_to(1e-6, 1e6);

/// The keys that a scene may set: all of them; they affect only this scene's result.
pub const SCENE_KEYS: &[SceneKey] = &[
    SceneKey::any("volume"),
    SceneKey::any("volume-cells"),
    SceneKey::any("carve-views"),
    SceneKey::any("fill-density"),
    SceneKey::any("wall-m"),
    SceneKey::any("min-body-share"),
    SceneKey::any("min-part-share"),
    SceneKey::any("bodies"),
    SceneKey::any("known-mass"),
    SceneKey::any("known-mass-error"),
];

/// How the inside of the object is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum VolumeMethod {
    /// Carve with up to --carve-views views, or take the volume of a mesh; each part is solid or a wall around a hollow, as
    /// its answer says and the geometry allows.
    #[default]
    Hybrid,
    /// Take the skin that the Gaussians form and everything inside it, all solid; needs no cameras.
    Fill,
    /// Carve with up to --carve-views views; every part is solid.
    Carve,
    /// As `hybrid`, but every part is a wall with the answer's thickness, or `--wall-m`.
    Shell,
}

/// How the connected bodies of one part are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum BodiesAs {
    /// One part that lists its bodies.
    #[default]
    OnePart,
    /// One part for each body; the mass is the same.
    Parts,
}

/// Options of the parts stage.
#[derive(Debug, Clone, PartialEq, Args, Serialize)]
#[command(next_help_heading = "Parts and mass")]
pub struct Options {
    /// How the inside of the object is found
    #[arg(long = "volume", value_enum, default_value_t)]
    pub volume: VolumeMethod,
    /// Number of grid cells over the object's box, on which volumes are measured
    #[arg(long, value_name = "N", default_value_t = VOLUME_CELLS, value_parser = CELLS)]
    pub volume_cells: usize,
    /// Maximum number of views used for carving, spread evenly over the scene's views
    #[arg(long, value_name = "N", default_value_t = CARVE_VIEWS, value_parser = VIEWS)]
    pub carve_views: usize,
    /// For `--volume fill`, density above which a cell is skin: opacity times fall-off, summed over the Gaussians
    #[arg(long, value_name = "DENSITY", default_value_t = FILL_DENSITY, value_parser = DENSITY)]
    pub fill_density: f64,
    /// For `--volume shell` and for meshes of sheets, wall thickness in metres of parts whose answer gives none
    #[arg(long, value_name = "M", default_value_t = WALL_M, value_parser = LENGTH_M)]
    pub wall_m: f64,
    /// Ignore connected bodies with less than this fraction of the object's total opacity: they are floaters
    #[arg(long, value_name = "SHARE", default_value_t = MIN_BODY_SHARE, value_parser = SHARE)]
    pub min_body_share: f64,
    /// List parts smaller than this fraction of the object's volume in the notes
    #[arg(long, value_name = "SHARE", default_value_t = MIN_PART_SHARE, value_parser = SHARE)]
    pub min_part_share: f64,
    /// How to write the connected bodies of one part (such as the four legs of a chair)
    #[arg(long, value_enum, value_name = "AS", default_value_t)]
    pub bodies: BodiesAs,
    /// Weight of the whole object, as a kitchen scale shows it: `660g`, `0.66kg`, or a number in kg; narrows the masses of
    /// all parts, and gives the scale if nothing else does. Of several objects, `2=660g` is the weight of object_2
    #[arg(long, value_name = "[OBJECT=]MASS")]
    pub known_mass: Option<MassReading>,
    /// Error of that weight, such as `5g`: with a probability of 90 %, the true weight differs by no more [default: a
    /// hundredth of the weight]
    #[arg(long, value_name = "MASS", requires = "known_mass", value_parser = mass_kg)]
    pub known_mass_error: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

impl VolumeMethod {
    /// Whether it takes the volumes of a mesh from the mesh.
    pub fn takes_mesh(self) -> bool {
        matches!(self, Self::Hybrid | Self::Shell)
    }
}

/// The units in which a mass can be given, and how many of them make a kilogram.
const MASS_UNITS: [(&str, f64); 2] = [("kg", 1.0), ("g", 1e3)];

/// A mass in kilograms, or with its unit: `0.66`, `660g`.
fn mass_kg(text: &str) -> Result<f64, String> {
    let mass = with_unit(text, &MASS_UNITS).filter(|kg| MASS_KG.contains(*kg));
    mass.ok_or_else(|| "give a mass from 0.000001 to 1000000 kg: a number of kg, or with kg or g after it".to_owned())
}

/// `--known-mass`: what a kitchen scale shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassReading {
    /// Which of several objects was weighed; `None` if there is one.
    pub object: Option<ObjectNumber>,
    pub kg: f64,
}

impl From<f64> for MassReading {
    /// A reading in kg of the only object.
    fn from(kg: f64) -> Self {
        Self { object: None, kg }
    }
}

impl FromStr for MassReading {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let Some((object, mass)) = text.split_once('=') else { return Ok(mass_kg(text)?.into()) };
        let object = object.trim().parse().map_err(|number: String| format!("what stands before = is not {number}"))?;
        Ok(Self { object: Some(object), kg: mass_kg(mass)? })
    }
}

impl fmt::Display for MassReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.object {
            Some(object) => write!(f, "{object}={}", self.kg),
            None => write!(f, "{}", self.kg),
        }
    }
}

/// Serialized in the form that users type.
impl Serialize for MassReading {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Options {
    /// The reading of a kitchen scale, kg.
    pub(super) fn reading_kg(&self) -> Option<f64> {
        self.known_mass.map(|reading| reading.kg)
    }

    /// The same with its error.
    pub(super) fn weighing(&self) -> Option<Weighing> {
        let kg = self.reading_kg()?;
        Some(Weighing { kg, error_kg: self.known_mass_error.unwrap_or(READING_ERROR * kg) })
    }

    /// The thickness of a sheet of which no answer says it, m: of [`WALL_M`], from 1 to 5 mm.
    pub(super) fn sheet_m(&self) -> Estimate {
        Estimate::new(self.wall_m / 3.0, self.wall_m, 5.0 / 3.0 * self.wall_m)
    }

    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        CELLS.check("--volume-cells", self.volume_cells)?;
        VIEWS.check("--carve-views", self.carve_views)?;
        DENSITY.check("--fill-density", self.fill_density)?;
        LENGTH_M.check("--wall-m", self.wall_m)?;
        SHARE.check("--min-body-share", self.min_body_share)?;
        SHARE.check("--min-part-share", self.min_part_share)?;
        MASS_KG.check("--known-mass", self.reading_kg())?;
        MASS_KG.check("--known-mass-error", self.known_mass_error)
    }
}
