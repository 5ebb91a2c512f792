//! The mesh that the user has, once more, with its physics:
//!
//! - a GLB or glTF is the same file with mass, centre, inertia, friction and colliders in it ([`gltf`]), and the material of
//!   each vertex; every other byte is as it was;
//! - an OBJ, STL or PLY, which has no place for physics, is copied, and a URDF, an MJCF and a JSON lie beside it.
//!
//! [`facts`] are the numbers that go into the JSON and into the `extras` of a glTF; [`labels`] carries the labels of the Gaussians
//! to faces and vertices, which [`tables`] lists.

mod facts;
mod gltf;
mod labels;
mod tables;

use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{ExportError, Files, OwnMesh, Rigid, Shared, mjcf, urdf};
use crate::files;
use crate::files::json;
use crate::scene::mesh::MeshFormat;
use crate::scene::{self, SceneMesh};
use facts::{Facts, FileFrame};
use labels::SurfaceLabels;
pub(super) use tables::write as write_tables;

/// The mesh of a scene, as it is to be written again.
#[derive(Debug, Clone, Copy)]
pub struct Asset<'a> {
    pub mesh: &'a SceneMesh,
    pub colliders: Colliders,
}

/// The colliders of an asset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Colliders {
    /// The file's own, if it has any, and no others
    Keep,
    /// The file's own; convex ones of each part if it has none
    #[default]
    Add,
    /// Convex ones of each part, in place of the file's own
    Make,
}

impl Asset<'_> {
    fn format(&self) -> &'static MeshFormat {
        MeshFormat::of(&self.mesh.painted.mesh.files[0]).expect("a mesh was read from a file of a known format")
    }

    /// Whether its physics is in files beside it.
    pub(super) fn has_files_beside(&self) -> bool {
        !self.format().is_y_up
    }
}

/// Writes the asset.
pub(super) fn write(asset: &Asset, shared: &Shared, files: &mut Files) -> Result<(), ExportError> {
    let mesh = &asset.mesh.painted.mesh;
    let path = &mesh.files[0];
    let format = asset.format();
    let parts = shared.parts()?;
    let frame = FileFrame::of(shared.model, format);
    let facts = Facts::of(shared.model, parts, mesh, &frame);
    if format.is_y_up {
        let labels = SurfaceLabels::of(shared.model, asset.mesh);
        gltf::write(&gltf::Filled { asset, shared, parts, frame, facts, labels }, files)?;
        return copy(&mesh.files[1..], path, files);
    }
    let rigid = shared.rigid()?;
    copy(&mesh.files, path, files)?;
    let name = rigid.name.clone();
    let scale = [frame.meters_per_unit; 3];
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let colliders = if asset.colliders == Colliders::Keep { &[] } else { rigid.colliders };
    // Readers of URDF take OBJ and STL.
    let own_mesh = (format.ending != ".ply").then_some(OwnMesh { file, scale });
    let rigid = Rigid { colliders, own_mesh, has_splats: false, ..rigid };
    urdf::write(&rigid, files)?;
    mjcf::write(&rigid, files)?;
    let text = json::pretty(&facts).expect("facts are plain data");
    files.write(format!("{name}.json"), |out| out.write_all(text.as_bytes()))
}

/// Copies files that lie beside the mesh at `path`, or below its folder.
fn copy(paths: &[PathBuf], path: &Path, files: &mut Files) -> Result<(), ExportError> {
    let home = scene::home(path);
    for path in paths {
        let relative = below(path, &home).ok_or_else(|| ExportError::NotBeside { path: path.clone() })?;
        let bytes = files::read_large(path).map_err(|_| ExportError::Changed { path: path.clone() })?;
        files.write(relative, |out| out.write_all(&bytes))?;
    }
    Ok(())
}

/// The path as seen from the folder, if it lies in it.
pub fn below(path: &Path, folder: &Path) -> Option<PathBuf> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let relative = path.canonicalize().ok()?.strip_prefix(here.canonicalize().ok()?).ok()?.to_owned();
    relative.components().all(|component| matches!(component, Component::Normal(_))).then_some(relative)
}
