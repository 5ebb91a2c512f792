//! Imports masks from other programs: a label PNG or an `_s.npy` for each view, in one folder.

use std::path::{Path, PathBuf};

use super::super::paint::segment_list;
use super::super::{LabelMap, LabelMapError, Level, ViewSegments};
use crate::files;

/// The reason why masks cannot be used. Each message is complete.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error(
        "--segments {folder:?} has neither {view}.png nor {view}_s.npy; every chosen view needs one (--view-list names views)"
    )]
    Missing { folder: PathBuf, view: String },
    #[error("cannot read {path:?}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path:?}: {problem}")]
    Map { path: PathBuf, problem: LabelMapError },
    #[error(
        "{path:?} is {} x {} pixels, its photo {} x {}; make both the same size",
        found.0, found.1, expected.0, expected.1
    )]
    Size { path: PathBuf, expected: (u32, u32), found: (u32, u32) },
}

/// The file in `folder` that holds a view's masks; the PNG if there are both.
pub fn file_of_view(folder: &Path, view: &str) -> Result<PathBuf, ImportError> {
    let files = [format!("{view}.png"), format!("{view}_s.npy")].map(|name| folder.join(name));
    let found = files.into_iter().find(|path| files::is_there(path));
    found.ok_or_else(|| ImportError::Missing { folder: folder.to_owned(), view: view.to_owned() })
}

/// Reads a view's segments from `folder`, for a photo of `size`. From an array with LangSplat's levels, `level` is
/// taken. The quality of such masks is unknown, so their scores are 1.
pub fn import_view(folder: &Path, view: &str, size: (u32, u32), level: Level) -> Result<ViewSegments, ImportError> {
    let path = file_of_view(folder, view)?;
    let bytes = files::read(&path).map_err(|source| ImportError::Read { path: path.clone(), source })?;
    let is_png = path.extension().is_some_and(|extension| extension == "png");
    let map = if is_png {
        LabelMap::from_png(&bytes).and_then(|map| map.renumbered())
    } else {
        LabelMap::from_npy(&bytes, level)
    };
    let map = map.map_err(|problem| ImportError::Map { path: path.clone(), problem })?;
    let found = (map.width, map.height);
    if found != size {
        return Err(ImportError::Size { path, expected: size, found });
    }
    let count = map.labels.iter().copied().max().unwrap_or(0);
    let segments = segment_list(&map, &vec![(1.0, 1.0); usize::from(count)], level);
    Ok(ViewSegments { view: view.to_owned(), map, segments })
}
