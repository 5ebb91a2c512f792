//! Finds the splat of a scene folder.

use std::fs;
use std::path::{Path, PathBuf};

use crate::files;
use crate::scene::SceneError;
use crate::scene::splat::SplatFormat;
use crate::workdir::Artifact;

/// The splat that was chosen, and the other candidates.
pub(in crate::scene) struct Found {
    pub path: PathBuf,
    pub others: Vec<PathBuf>,
}

/// The splat of `folder`: the first of
/// 1. `point_cloud.ply` (this project's scenes), `point_cloud/iteration_N/point_cloud.ply` with the largest N (3DGS),
/// 2. `splat.ply`, `exports/splat/splat.ply` (nerfstudio), `ply/point_cloud_N.ply` with the largest N (gsplat),
///    `export_N.ply` with the largest N (Brush),
/// 3. the first file by name that has a [`SplatFormat`] and begins like a splat.
pub(in crate::scene) fn find(folder: &Path) -> Result<Found, SceneError> {
    let trained = numbered(&folder.join("point_cloud"), "iteration_", "");
    let known = [
        vec![folder.join("point_cloud.ply")],
        trained.into_iter().map(|path| path.join("point_cloud.ply")).collect(),
        vec![folder.join("splat.ply")],
        vec![folder.join("exports/splat/splat.ply")],
        numbered(&folder.join("ply"), "point_cloud_", ".ply"),
        numbered(folder, "export_", ".ply"),
    ];
    let known = known.into_iter().filter_map(|paths| paths.into_iter().find(|path| files::is_there(path)));
    let (splats, clouds) = loose_splats(folder);
    let mut candidates: Vec<PathBuf> = Vec::new();
    for path in known.chain(splats) {
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

/// The entries `{prefix}{N}{suffix}`, from the largest N to the smallest.
fn numbered(folder: &Path, prefix: &str, suffix: &str) -> Vec<PathBuf> {
    let number = |name: &str| name.strip_prefix(prefix)?.strip_suffix(suffix)?.parse::<u64>().ok();
    let mut numbered: Vec<(u64, String)> =
        names_in(folder).into_iter().filter_map(|name| number(&name).map(|n| (n, name))).collect();
    numbered.sort();
    numbered.into_iter().rev().map(|(_, name)| folder.join(name)).collect()
}

/// Splats sorted by file name, those named like gprop's own results last, and the names of files that look like splats
/// but are not. Hidden files are left out: macOS stores the attributes of `a.splat` as `._a.splat` on other file systems.
fn loose_splats(folder: &Path) -> (Vec<PathBuf>, Vec<String>) {
    let mut splats = Vec::new();
    let mut others = Vec::new();
    let results = [Artifact::Field, Artifact::Recolored].map(|artifact| folder.join(artifact.path()));
    for name in names_in(folder).into_iter().filter(|name| !name.starts_with('.')) {
        let path = folder.join(&name);
        match SplatFormat::of(&path).filter(|_| files::is_there(&path)) {
            Some(format) if format.is_splat(&path) => splats.push(path),
            Some(_) => others.push(name),
            None => {}
        }
    }
    splats.sort_by_key(|path| results.contains(path));
    (splats, others)
}

/// Names in a folder, sorted; none if it cannot be read.
pub(in crate::scene) fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
