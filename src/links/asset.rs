//! The container again, with what was found written where it keeps masses, inertias and frictions, and its meshes beside it.
//! Every other byte is as it was.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};

use super::LinksError;
use super::weighed::{Found, Links};
use crate::export::below;
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::files::write::Folder;
use crate::scene;
use crate::scene::mesh::containers::write::{Statement, with_statements};
use crate::scene::mesh::containers::{Body, Container, Geometry};
use crate::scene::mesh::{self, Axes};

/// What was written.
#[derive(Debug, Default)]
pub struct Written {
    /// The container first.
    pub files: Vec<PathBuf>,
    /// What was not, and why.
    pub warnings: Vec<String>,
}

/// Writes the files of a container into `out`, with the masses of `links` in them.
///
/// # Errors
/// [`LinksError`] if `out` is the container's own folder, or a file cannot be read or written.
pub fn write(container: &Container, links: &Links, out: &Path, scope: &ReadScope) -> Result<Written, LinksError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| LinksError::Write { path, source }
    };
    let home = scene::home(&container.sources[0]);
    let folder = Folder::open(out).map_err(failed(out))?;
    if out.canonicalize().ok() == home.canonicalize().ok() {
        return Err(LinksError::OwnFolder { folder: home });
    }
    let mut written = Written::default();
    let statements: Vec<(&Body, Statement)> = container
        .bodies
        .iter()
        .zip(&links.links)
        .filter_map(|(body, link)| Some((body, statement(link.found.as_ref()?))))
        .filter(|(_, statement)| statement.is_finite())
        .collect();
    let mut done = BTreeSet::new();
    for (source, path) in container.sources.iter().enumerate() {
        let Some(relative) = below(path, &home).filter(|relative| done.insert(relative.clone())) else {
            written.warnings.extend(outside(path, &done));
            continue;
        };
        let bytes = files::read(path).map_err(failed(path))?;
        let changed = with_statements(container.format, &bytes, source, &statements);
        let changed = changed.ok_or_else(|| LinksError::Changed { path: path.clone() })?;
        folder.write(&relative, |file| file.write_all(&changed)).map_err(failed(&out.join(&relative)))?;
        written.files.push(out.join(relative));
    }
    for path in files_of_meshes(container, scope) {
        let Some(relative) = below(&path, &home) else {
            written.warnings.extend(outside(&path, &done));
            continue;
        };
        if done.insert(relative.clone()) {
            let bytes = files::read_large(&path).map_err(failed(&path))?;
            folder.write(&relative, |file| file.write_all(&bytes)).map_err(failed(&out.join(&relative)))?;
            written.files.push(out.join(relative));
        }
    }
    Ok(written)
}

/// The warning that a file is not among those written.
fn outside(path: &Path, done: &BTreeSet<PathBuf>) -> Option<String> {
    let is_written = done.iter().any(|relative| path.ends_with(relative));
    (!is_written).then(|| format!("{path:?} lies outside of the model's folder and is not copied"))
}

fn statement(found: &Found) -> Statement {
    Statement {
        mass_kg: Some(found.mass_kg.mid),
        center_m: Some(Vector3::from(found.center_of_mass_m)),
        inertia_kg_m2: Some(Matrix3::from_fn(|row, column| found.inertia_kg_m2[row][column])),
        friction: Some(found.friction_rubber).filter(|friction| friction.is_finite()),
    }
}

/// The meshes that a container names and may read, each with the files that it names itself.
fn files_of_meshes(container: &Container, scope: &ReadScope) -> BTreeSet<PathBuf> {
    let shapes = container.bodies.iter().flat_map(|body| &body.shapes);
    let meshes: BTreeSet<&Path> = shapes
        .filter_map(|shape| match &shape.geometry {
            Geometry::Mesh(used) => used.file.as_deref().ok(),
            _ => None,
        })
        .collect();
    let of_mesh = |path: &Path| match mesh::read(path, Axes::OfFile, scope) {
        Ok(mesh) => mesh.files,
        Err(_) => vec![path.to_owned()],
    };
    meshes.into_iter().flat_map(of_mesh).collect()
}
