//! The splat of a scene folder: where it lies and in which format.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::SplatProblem;
use super::loaded::Loaded;
use super::{SceneError, ply, splat, spz};
use crate::files;

/// The splat that was chosen, and what else could have been.
pub(super) struct Found {
    pub path: PathBuf,
    pub others: Vec<PathBuf>,
}

/// The splat of `folder`: the first of
/// 1. `point_cloud.ply` (this project's scenes), `point_cloud/iteration_N/point_cloud.ply` of the largest N (3DGS),
/// 2. `splat.ply`, `exports/splat/splat.ply` (nerfstudio), `ply/point_cloud_N.ply` of the largest N (gsplat), `export_N.ply`
///    of the largest N (Brush),
/// 3. the first file by name that ends in .spz, .splat or .ply and begins as a splat does.
pub(super) fn find(folder: &Path) -> Result<Found, SceneError> {
    let named = [folder.join("point_cloud.ply"), folder.join("splat.ply"), folder.join("exports/splat/splat.ply")];
    let [point_cloud, splat, export] = named.map(|path| files::is_there(&path).then_some(path));
    let trained = numbered(&folder.join("point_cloud"), "iteration_", "").map(|path| path.join("point_cloud.ply"));
    let gsplat = numbered(&folder.join("ply"), "point_cloud_", ".ply");
    let brush = numbered(folder, "export_", ".ply");
    let (splats, clouds) = loose_splats(folder);
    let known = [point_cloud, trained.filter(|path| files::is_there(path)), splat, export, gsplat, brush];
    let mut candidates: Vec<PathBuf> = Vec::new();
    for path in known.into_iter().flatten().chain(splats) {
        if !candidates.contains(&path) {
            candidates.push(path);
        }
    }
    if candidates.is_empty() {
        return Err(SceneError::NoSplat { folder: folder.to_owned(), others: clouds });
    }
    let others = candidates.split_off(1);
    Ok(Found { path: candidates.remove(0), others })
}

/// Reads a splat in the format that its name and first bytes tell.
pub(super) fn read(path: &Path) -> Result<Loaded, SceneError> {
    let kind = kind_of(path);
    if kind == Some(Kind::Ply) {
        return Ok(ply::read(path)?);
    }
    let in_file = |problem| SceneError::Splat { path: path.to_owned(), problem };
    let bytes = files::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })?;
    match kind {
        Some(Kind::Spz) => spz::parse(&bytes).map_err(|problem| in_file(problem.into())),
        Some(Kind::Splat) => splat::parse(&bytes).map_err(|problem| in_file(problem.into())),
        _ => Err(in_file(SplatProblem::Format)),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Ply,
    Spz,
    Splat,
}

fn kind_of(path: &Path) -> Option<Kind> {
    match path.extension()?.to_str()?.to_lowercase().as_str() {
        "ply" => Some(Kind::Ply),
        "spz" => Some(Kind::Spz),
        "splat" => Some(Kind::Splat),
        _ => None,
    }
}

/// The entry `{prefix}{N}{suffix}` of the largest N.
fn numbered(folder: &Path, prefix: &str, suffix: &str) -> Option<PathBuf> {
    let number = |name: &str| name.strip_prefix(prefix)?.strip_suffix(suffix)?.parse::<u64>().ok();
    let numbered = names_in(folder).into_iter().filter_map(|name| number(&name).map(|n| (n, name)));
    numbered.max().map(|(_, name)| folder.join(name))
}

/// Splats by file name, and the names of files that look like one but are none.
fn loose_splats(folder: &Path) -> (Vec<PathBuf>, Vec<String>) {
    let mut splats = Vec::new();
    let mut others = Vec::new();
    for name in names_in(folder) {
        let path = folder.join(&name);
        match kind_of(&path) {
            Some(Kind::Spz | Kind::Splat) => splats.push(path),
            Some(Kind::Ply) if files::is_special(&path) || ply::is_splat(&path) => splats.push(path),
            Some(Kind::Ply) => others.push(name),
            None if [".ksplat", ".sog"].iter().any(|end| name.to_lowercase().ends_with(end)) => others.push(name),
            None => {}
        }
    }
    (splats, others)
}

/// Names in a folder, sorted; none where it cannot be read.
pub(super) fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
