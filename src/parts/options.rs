//! What the user may choose about parts and volumes.

use clap::Args;
use serde::{Deserialize, Serialize};

use super::PartsError;

/// About 130 cells along each side of a box-shaped object: under a millimetre on a hammer.
const VOLUME_CELLS: usize = 2_000_000;
/// More views carve no further on the scenes that volumes were measured on.
const CARVE_VIEWS: usize = 40;
/// Half the density of a Gaussian of full opacity at its centre.
const FILL_DENSITY: f64 = 0.5;
/// A body of less than 1 % of the cloud's opacity floats.
const MIN_BODY_SHARE: f64 = 0.01;
/// A part of less than 0.1 % of the object's volume is more often a wrong answer than a real part.
const MIN_PART_SHARE: f64 = 0.001;
/// A sheet of steel, a mug's wall, a moulded case: 1 to 5 mm.
const WALL_M: f64 = 0.003;

/// How the inside of the object is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum VolumeMethod {
    /// Carved from all views; each part solid or a wall around a void, as its answer says and the geometry allows.
    #[default]
    Hybrid,
    /// The skin that the Gaussians draw and what it encloses, all solid. Needs no cameras.
    Fill,
    /// Carved from all views, all solid.
    Carve,
    /// Carved from all views, every part a wall: of the answer's thickness, or `--wall-m`.
    Shell,
}

/// How the connected bodies of one part are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum BodiesAs {
    /// One part that lists its bodies.
    #[default]
    OnePart,
    /// A part for every body; the mass is the same.
    Parts,
}

/// Options of the parts stage.
#[derive(Debug, Clone, PartialEq, Args, Serialize)]
#[command(next_help_heading = "Parts and mass")]
pub struct Options {
    /// How the inside of the object is found
    #[arg(long = "volume", value_enum, default_value_t)]
    pub volume: VolumeMethod,
    /// Cells of the grid that volumes are measured on, over the object's box
    #[arg(long, value_name = "N", default_value_t = VOLUME_CELLS)]
    pub volume_cells: usize,
    /// At most so many of the scene's views carve, spread evenly over their order
    #[arg(long, value_name = "N", default_value_t = CARVE_VIEWS)]
    pub carve_views: usize,
    /// Density above which a cell is skin for `--volume fill`: opacity times fall-off, summed over Gaussians
    #[arg(long, value_name = "DENSITY", default_value_t = FILL_DENSITY)]
    pub fill_density: f64,
    /// Wall of parts whose answer gives none, for `--volume shell`, in metres
    #[arg(long, value_name = "M", default_value_t = WALL_M)]
    pub wall_m: f64,
    /// Connected bodies with a smaller share of the cloud's summed opacity are floaters and count for nothing
    #[arg(long, value_name = "SHARE", default_value_t = MIN_BODY_SHARE)]
    pub min_body_share: f64,
    /// A part with a smaller share of the object's volume is reported as a speck
    #[arg(long, value_name = "SHARE", default_value_t = MIN_PART_SHARE)]
    pub min_part_share: f64,
    /// How the connected bodies of one part (four legs of a chair) are written
    #[arg(long, value_enum, value_name = "AS", default_value_t)]
    pub bodies: BodiesAs,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            volume: VolumeMethod::default(),
            volume_cells: VOLUME_CELLS,
            carve_views: CARVE_VIEWS,
            fill_density: FILL_DENSITY,
            wall_m: WALL_M,
            min_body_share: MIN_BODY_SHARE,
            min_part_share: MIN_PART_SHARE,
            bodies: BodiesAs::default(),
        }
    }
}

/// The grid's index type holds no more.
const CELLS_MAX: usize = 1 << 30;

impl Options {
    pub(super) fn check(&self) -> Result<(), PartsError> {
        let wrong = |flag, value: f64, domain| Err(PartsError::Option { flag, value, domain });
        if !(1000..=CELLS_MAX).contains(&self.volume_cells) {
            return wrong("--volume-cells", self.volume_cells as f64, "1000 to 2^30");
        }
        if self.carve_views == 0 {
            return wrong("--carve-views", 0.0, "1 or more");
        }
        if !(self.fill_density > 0.0 && self.fill_density.is_finite()) {
            return wrong("--fill-density", self.fill_density, "above 0");
        }
        if !(self.wall_m > 0.0 && self.wall_m.is_finite()) {
            return wrong("--wall-m", self.wall_m, "above 0, in metres");
        }
        if !(0.0..1.0).contains(&self.min_body_share) {
            return wrong("--min-body-share", self.min_body_share, "0 or more and below 1");
        }
        if !(0.0..1.0).contains(&self.min_part_share) {
            return wrong("--min-part-share", self.min_part_share, "0 or more and below 1");
        }
        Ok(())
    }
}
