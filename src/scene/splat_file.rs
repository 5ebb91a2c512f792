//! Where the splat lies in a scene folder.

use std::fs;
use std::path::{Path, PathBuf};

use super::SceneError;

/// `point_cloud.ply`, else the one of the largest N among `point_cloud/iteration_N/point_cloud.ply`.
pub(super) fn find(folder: &Path) -> Result<PathBuf, SceneError> {
    const NAME: &str = "point_cloud.ply";
    let direct = folder.join(NAME);
    if direct.is_file() {
        return Ok(direct);
    }
    let iterations = folder.join("point_cloud");
    let trained = names_in(&iterations)
        .into_iter()
        .filter_map(|name| name.strip_prefix("iteration_")?.parse::<u64>().ok().map(|n| (n, name)))
        .map(|(iteration, name)| (iteration, iterations.join(name).join(NAME)))
        .filter(|(_, path)| path.is_file())
        .max();
    match trained {
        Some((_, path)) => Ok(path),
        None => {
            let others = names_in(folder).into_iter().filter(|name| name.to_lowercase().ends_with(".ply")).collect();
            Err(SceneError::NoSplat { folder: folder.to_owned(), others })
        }
    }
}

/// Names in a folder, sorted; none where it cannot be read.
fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
