//! `gprop audit`: checks what robots, scenes and assets claim of masses, inertias, centres of mass, frictions and colliders,
//! without any model and without the network.
//!
//! 1. [`find`] lists the containers in what the user named; `scene::mesh::containers` reads them;
//! 2. [`meshes`] measures each mesh once, and [`measure`] puts the shapes of each body together ([`moments`], [`hull`]);
//! 3. [`judge`] compares what is stated with what the shapes allow, one file for each kind of claim;
//! 4. [`fix`] writes what follows from shape and stated mass alone, and leaves every other byte;
//! 5. [`report`] tells.
//!
//! `docs/audit.md` describes the findings.

pub mod find;
mod finding;
mod fix;
mod hull;
mod judge;
mod measure;
mod meshes;
mod moments;
mod options;
mod report;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::read_scope::ReadScope;
use crate::parallel;
use crate::scene::mesh::containers::{self, Container, ContainerError};

use find::{Found, Named};
use meshes::Meshes;

pub use finding::{Finding, Kind};
pub use options::Args;
pub use report::{FileReport, LinkReport, Report};

/// Why an audit does not end well.
#[derive(Debug, Error)]
pub enum AuditError {
    #[error("there is nothing at {path:?}; name files or folders with URDF, MJCF, USD or glTF")]
    NotThere { path: PathBuf },
    #[error("no URDF, MJCF, USD or glTF with physics in {paths}; name files or folders that have some")]
    NoContainers { paths: String },
    #[error("cannot list {path:?}: {source}")]
    Unlisted { path: PathBuf, source: std::io::Error },
    #[error("{path:?} has more than {most} files and folders; name the ones to audit")]
    TooMany { path: PathBuf, most: usize },
    #[error("cannot write {path:?}: {source}")]
    Unwritable { path: PathBuf, source: std::io::Error },
    #[error("{problems} in {files}")]
    Wrong { problems: String, files: String },
    #[error("{files} cannot be read; the lines above say why")]
    Unreadable { files: String },
}

/// Audits the containers in the files and folders that the user named; with `--fix`, mends them first.
///
/// # Errors
/// [`AuditError`] if nothing can be audited or a mended file cannot be written. What is wrong with a file is in the report.
pub fn audit(args: &Args) -> Result<Report, AuditError> {
    let named: Vec<Named> = args.paths.iter().map(|path| Named::of(path)).collect::<Result<_, _>>()?;
    let scope = named.iter().map(|named| named.folder.as_path()).collect::<Vec<_>>();
    let scope = ReadScope::new(scope.first().copied().unwrap_or(Path::new("."))).and(scope);
    let found = find::find(&named, &scope)?;
    let mut read = read(found, &scope);
    if read.is_empty() {
        return Err(find::nothing(&named));
    }
    let mut meshes = meshes::measure(read.iter().filter_map(Audited::container), &scope);
    let mut fixed = vec![Vec::new(); read.len()];
    if args.fix {
        for (audited, fixed) in read.iter().zip(&mut fixed) {
            if let Ok(container) = &audited.container {
                *fixed = fix::fix(container, &audited.found, &judge::judge(container, &meshes, args))?;
            }
        }
        read = self::read(read.into_iter().map(|audited| audited.found).collect(), &scope);
        meshes = meshes::measure(read.iter().filter_map(Audited::container), &scope);
    }
    let files = parallel::map_range(read.len(), |n| of_file(&read[n], fixed[n].clone(), &meshes, args));
    Ok(Report { files })
}

/// A container that was found and, if it could be, read.
struct Audited {
    found: Found,
    container: Result<Container, ContainerError>,
}

impl Audited {
    fn container(&self) -> Option<&Container> {
        self.container.as_ref().ok()
    }
}

/// Reads all of them. Of what was met in a folder, parts that other files include count with those.
fn read(found: Vec<Found>, scope: &ReadScope) -> Vec<Audited> {
    let containers = parallel::map(&found, |found| containers::read(&found.path, scope));
    let audited = containers.into_iter().zip(found).map(|(container, found)| Audited { found, container });
    let mut all: Vec<Audited> = audited.collect();
    all.retain(|audited| {
        let is_another_xml = matches!(audited.container, Err(ContainerError::NotAContainer { .. }));
        audited.found.is_named || !is_another_xml
    });
    let included = |container: &Container| container.sources[1..].to_vec();
    let included: Vec<PathBuf> = all.iter().filter_map(Audited::container).flat_map(included).collect();
    all.retain(|audited| audited.found.is_named || !included.contains(&audited.found.path));
    all
}

fn of_file(audited: &Audited, fixed: Vec<String>, meshes: &Meshes, args: &Args) -> FileReport {
    let path = audited.found.path.clone();
    match &audited.container {
        Ok(container) => {
            let judged = judge::judge(container, meshes, args);
            FileReport::of(path, container, judged, fixed)
        }
        Err(error) => FileReport::unreadable(path, error),
    }
}
