//! Finds the splat of a scene folder.

use std::cmp::Reverse;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::files;
use crate::files::read_scope::ReadScope;
use crate::scene::SceneError;
use crate::scene::splat::SplatFormat;
use crate::workdir::Artifact;

/// The splat that was chosen, and the other candidates.
pub(in crate::scene) struct Found {
    pub path: PathBuf,
    pub others: Vec<PathBuf>,
    /// Why this one of several that differ only by the number in their path.
    pub reason: Option<String>,
}

/// The splat of `folder`: the first of
/// 1. `point_cloud.ply` (this project's scenes), `point_cloud/iteration_N/point_cloud.ply` (3DGS),
/// 2. `splat.ply`, `exports/splat/splat.ply` (nerfstudio), `ply/point_cloud_N.ply` (gsplat), `export_N.ply` (Brush),
/// 3. the first file by name that has a [`SplatFormat`] and begins like a splat.
///
/// Of several that differ only by the last number in their name, whatever else that is, the one with the largest number is
/// the latest state of the training.
pub(in crate::scene) fn find(folder: &Path) -> Result<Found, SceneError> {
    let (loose, clouds) = loose_splats(folder);
    let (of_brush, loose): (Vec<String>, Vec<String>) = loose.into_iter().partition(|name| is_of_brush(name));
    let in_folder = |names: Vec<String>| -> Vec<PathBuf> { names.iter().map(|name| folder.join(name)).collect() };
    let known = [
        vec![folder.join("point_cloud.ply")],
        trained_in(&folder.join("point_cloud")),
        vec![folder.join("splat.ply")],
        vec![folder.join("exports/splat/splat.ply")],
        only_splats(folder, trained_in(&folder.join("exports"))),
        only_splats(folder, trained_in(&folder.join("ply"))),
        in_folder(of_brush),
        in_folder(loose),
    ];
    let mut candidates: Vec<PathBuf> = Vec::new();
    let mut seen = HashSet::new();
    for path in known.into_iter().flatten().filter(|path| files::is_there(path)) {
        if seen.insert(path.clone()) {
            candidates.push(path);
        }
    }
    if candidates.is_empty() {
        return Err(SceneError::NoSplat { folder: folder.to_owned(), others: clouds });
    }
    let others = candidates.split_off(1);
    let path = candidates.remove(0);
    let reason = is_latest_of(folder, &path, &others).map(|count| format!("the latest of {count}"));
    Ok(Found { path, others, reason })
}

/// The names of the one splat in the folder of an iteration.
const OF_ITERATION: [&str; 2] = ["point_cloud.ply", "splat.ply"];

/// The files of splats that a trainer left in `folder`, beside each other or in a folder for each iteration: those with
/// numbers first, of each series the latest first.
fn trained_in(folder: &Path) -> Vec<PathBuf> {
    let mut names: Vec<String> = names_in(folder).into_iter().filter(|name| !name.starts_with('.')).collect();
    sort_series(&mut names);
    names.sort_by_key(|name| series(name).is_none());
    let splat = |name: &String| {
        let path = folder.join(name);
        let of_iteration = OF_ITERATION.map(|file| path.join(file)).into_iter().find(|path| files::is_there(path));
        of_iteration.or_else(|| SplatFormat::of(&path).filter(|_| files::is_there(&path)).map(|_| path))
    };
    names.iter().filter_map(splat).collect()
}

/// Those of the files that begin like splats. What lies outside of `scene` is kept, to be refused where it is opened.
fn only_splats(scene: &Path, files: Vec<PathBuf>) -> Vec<PathBuf> {
    let scope = ReadScope::new(scene);
    let is_splat = |path: &PathBuf| SplatFormat::of(path).is_some_and(|format| format.is_splat(path));
    files.into_iter().filter(|path| scope.leads_out(path).is_some() || is_splat(path)).collect()
}

/// Whether this is the name of a file that Brush exports.
fn is_of_brush(name: &str) -> bool {
    series(name).is_some_and(|(series, _)| series == "export_#.ply")
}

/// Sorts by name, but of names that differ only by their last number, the largest number comes first.
fn sort_series(names: &mut [String]) {
    names.sort_by_cached_key(|name| match series(name) {
        Some((series, number)) => (series, Reverse(number)),
        None => (name.clone(), Reverse(0)),
    });
}

/// A name with its last number written as `#`, and that number; `None` if it has none, or one beyond any count of steps.
fn series(name: &str) -> Option<(String, u64)> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = name[..end].trim_end_matches(|c: char| c.is_ascii_digit()).len();
    Some((format!("{}#{}", &name[..start], &name[end..]), name[start..end].parse().ok()?))
}

/// The number of splats that differ from `path` only by a smaller number, and `path` itself; `None` if there are no others.
fn is_latest_of(folder: &Path, path: &Path, others: &[PathBuf]) -> Option<usize> {
    let series_of = |path: &Path| series(&path.strip_prefix(folder).ok()?.to_string_lossy()).map(|(series, _)| series);
    let own = series_of(path)?;
    let earlier = others.iter().filter(|other| series_of(other).as_ref() == Some(&own)).count();
    (earlier > 0).then_some(1 + earlier)
}

/// Names of splats, those that are called like gprop's own results last, and the names of files that look like splats but are
/// not. Hidden files are left out: macOS stores the attributes of `a.splat` as `._a.splat` on other file systems.
fn loose_splats(folder: &Path) -> (Vec<String>, Vec<String>) {
    let mut splats = Vec::new();
    let mut others = Vec::new();
    for name in names_in(folder).into_iter().filter(|name| !name.starts_with('.')) {
        let path = folder.join(&name);
        match SplatFormat::of(&path).filter(|_| files::is_there(&path)) {
            Some(format) if format.is_splat(&path) => splats.push(name),
            Some(_) => others.push(name),
            None => {}
        }
    }
    sort_series(&mut splats);
    let results = [Artifact::Field, Artifact::Recolored].map(|artifact| artifact.path());
    splats.sort_by_key(|name| results.iter().any(|result| result == Path::new(name)));
    (splats, others)
}

/// Names in a folder, sorted; none if it cannot be read.
pub(in crate::scene) fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
