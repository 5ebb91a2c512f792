//! What the user typed.

use std::path::PathBuf;

use super::Kind;
use crate::config::option_values::from_to;

/// Options of `gprop audit`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "The exit code is 0 if nothing is wrong, 1 if something is, and 3 if a file cannot be read.\n\
                  Meshes are read from the folders that are named, or that hold a named file, and from nowhere else.")]
pub struct Args {
    /// URDF, MJCF, USD (.usda) or glTF files with physics, or folders with such files, however deep.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Write the inertia of the shape, with the stated mass and one density, where the stated one is missing, impossible, a
    /// placeholder or far off, and the centre of the shape where the stated one lies outside it. Nothing else in the files changes.
    #[arg(long)]
    pub fix: bool,
    /// Kinds of findings to leave out, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "KIND")]
    pub ignore: Vec<Kind>,
    /// How many times the volume of what is seen the colliders may have, or the other way round.
    #[arg(long, value_name = "FACTOR", default_value_t = 2.0, value_parser = from_to(1.0, 1e6))]
    pub collider_volume: f64,
    /// How far the hulls of colliders and of what is seen may stand out from each other, as a share of the longest side.
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = from_to(0.0, 1e3))]
    pub collider_distance: f64,
}
