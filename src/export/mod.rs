//! The result in the formats of other programs, with one module per format:
//!
//! - [`mjcf`], [`urdf`]: a rigid body for simulators, with its shape as convex [`pieces`];
//! - [`usda`]: the same with its Gaussians as points, for USD;
//! - [`npz`]: every number as NumPy arrays;
//! - [`physgaussian`]: a model folder and configuration for the MPM simulator PhysGaussian and its forks.
//!
//! Everything rigid is in metres, in the world frame of the splat, z up. Gaussians that were set aside are left out.

mod mjcf;
mod npz;
mod physgaussian;
mod pieces;
mod urdf;
mod usda;

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::parts::{Interior, Parts, PartsError};
use crate::scene::gaussians::Gaussians;
use crate::units::MetricScale;
use crate::vote::{FieldLabel, MaterialField};
use crate::workdir::write_atomic;
use pieces::Piece;

/// A format to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// MuJoCo: a free body with mass, inertia, convex geoms, friction
    Mjcf,
    /// Robot description: a link on a floating joint, convex meshes
    Urdf,
    /// NumPy: per-Gaussian and per-part arrays
    Npz,
    /// PhysGaussian: configuration and a PLY with per-particle properties
    Physgaussian,
    /// USD as text: rigid body, mass, colliders, physics materials, points
    Usda,
}

/// The data to export.
#[derive(Debug, Clone, Copy)]
pub struct Model<'a> {
    pub name: &'a str,
    pub gaussians: &'a Gaussians,
    pub field: &'a MaterialField,
    pub interior: &'a Interior,
    /// Both `None` if the metric scale is unknown.
    pub scale: Option<&'a MetricScale>,
    pub parts: Option<&'a Parts>,
}

/// An error of the export.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error(transparent)]
    Scale(#[from] PartsError),
    #[error(
        "the object has no mass, so it is not a rigid body: no part fills any volume; see the warnings of the parts stage"
    )]
    NoMass,
    #[error("cannot write {path:?}: {source}; make room or choose another folder with --out")]
    Write { path: PathBuf, source: io::Error },
}

/// Writes the model into `folder` and returns the files, the main one first. Each file is written completely or not at
/// all.
///
/// # Errors
/// If the scale is unknown and the format needs kilograms, or if a file cannot be written.
pub fn export(model: &Model, format: Format, folder: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let own = without_set_aside(model);
    let model = &match &own {
        Some((gaussians, field)) => Model { gaussians, field, ..*model },
        None => *model,
    };
    let mut files = Files { folder, written: Vec::new() };
    match format {
        Format::Mjcf => mjcf::write(&Rigid::of(model)?, &mut files)?,
        Format::Urdf => urdf::write(&Rigid::of(model)?, &mut files)?,
        Format::Usda => usda::write(model, &Rigid::of(model)?, &mut files)?,
        Format::Npz => npz::write(model, &mut files)?,
        Format::Physgaussian => physgaussian::write(model, &mut files)?,
    }
    Ok(files.written)
}

/// The Gaussians and their field without those set aside; `None` if none is.
fn without_set_aside(model: &Model) -> Option<(Gaussians, MaterialField)> {
    if model.gaussians.set_aside.is_empty() {
        return None;
    }
    let kept: Vec<bool> = model.gaussians.set_aside.iter().map(|set_aside| !set_aside).collect();
    let (mut gaussians, mut field) = (model.gaussians.clone(), model.field.clone());
    gaussians.retain(&kept);
    field.retain(&kept);
    Some((gaussians, field))
}

/// The object as a rigid body.
struct Rigid<'a> {
    /// Name of letters, digits and underscores.
    name: String,
    parts: &'a Parts,
    labels: &'a [FieldLabel],
    pieces: Vec<Piece>,
}

impl<'a> Rigid<'a> {
    fn of(model: &Model<'a>) -> Result<Self, ExportError> {
        let (Some(parts), Some(scale)) = (model.parts, model.scale) else {
            return Err(PartsError::ScaleUnknown.into());
        };
        if parts.object.mass_kg.mid <= 0.0 {
            return Err(ExportError::NoMass);
        }
        Ok(Self {
            name: identifier(model.name),
            parts,
            labels: &model.field.labels,
            pieces: pieces::pieces(model.interior, scale.meters_per_unit),
        })
    }

    /// Mass in kg, centre of mass in m, inertia about it in kg m^2 with world axes: the middle estimates.
    fn inertial(&self) -> (f64, [f64; 3], [[f64; 3]; 3]) {
        let object = &self.parts.object;
        (object.mass_kg.mid, object.center_of_mass_m, object.inertia_kg_m2)
    }

    fn label(&self, piece: &Piece) -> &FieldLabel {
        &self.labels[piece.part as usize]
    }
}

/// A name that every format accepts.
fn identifier(name: &str) -> String {
    let letters: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if letters.starts_with(|c: char| c.is_ascii_alphabetic()) { letters } else { format!("object_{letters}") }
}

/// Numbers separated by spaces, with all significant digits.
fn spaced(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

/// The folder that is written into.
struct Files<'a> {
    folder: &'a Path,
    written: Vec<PathBuf>,
}

impl Files<'_> {
    fn write(
        &mut self,
        name: impl AsRef<Path>,
        fill: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), ExportError> {
        let path = self.folder.join(name);
        write_atomic(&path, fill).map_err(|source| ExportError::Write { path: path.clone(), source })?;
        self.written.push(path);
        Ok(())
    }
}
