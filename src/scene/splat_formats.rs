//! The formats of splats, in one table: which files are splats, which function reads them, how large they grow in memory.

use std::path::Path;

use super::error::SplatProblem;
use super::loaded::Loaded;
use super::{SceneError, ply, splat, spz};
use crate::files;

/// A format that splats are stored in.
pub struct SplatFormat {
    /// What the names of its files end in, in lower case; those of a file may be in upper case.
    pub ending: &'static str,
    /// How many times larger a splat is as plain floats, 62 of 4 bytes a Gaussian.
    pub inflation: u64,
    read: fn(&Path) -> Result<Loaded, SceneError>,
    /// Whether a file with this ending is a splat: a PLY may hold a point cloud or a mesh.
    is_splat: fn(&Path) -> bool,
}

/// Every format that gprop reads. Of the endings that fit a name, the first counts.
pub const SPLAT_FORMATS: &[SplatFormat] = &[
    // 16 bytes a Gaussian.
    SplatFormat { ending: ".compressed.ply", inflation: 16, read: read_ply, is_splat: is_splat_ply },
    SplatFormat { ending: ".ply", inflation: 1, read: read_ply, is_splat: is_splat_ply },
    // About 20 bytes a Gaussian.
    SplatFormat {
        ending: ".spz",
        inflation: 12,
        read: |path| read_bytes(path, |bytes| Ok(spz::parse(bytes)?)),
        is_splat: |_| true,
    },
    // 32 bytes a Gaussian.
    SplatFormat {
        ending: ".splat",
        inflation: 8,
        read: |path| read_bytes(path, |bytes| Ok(splat::parse(bytes)?)),
        is_splat: |_| true,
    },
];

impl SplatFormat {
    /// The format of a file with this name.
    pub fn of(path: &Path) -> Option<&'static Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        SPLAT_FORMATS.iter().find(|format| name.len() > format.ending.len() && name.ends_with(format.ending))
    }

    /// Whether the file, whose name says that it is of this format, begins as a splat does.
    pub(super) fn is_splat(&self, path: &Path) -> bool {
        (self.is_splat)(path)
    }
}

/// Reads a splat in the format that its name and first bytes tell.
pub(super) fn read(path: &Path) -> Result<Loaded, SceneError> {
    match SplatFormat::of(path) {
        Some(format) => (format.read)(path),
        None => {
            let endings: Vec<_> = SPLAT_FORMATS.iter().map(|format| format.ending).collect();
            let problem = SplatProblem::Format { endings: endings.join(", ") };
            Err(SceneError::Splat { path: path.to_owned(), problem })
        }
    }
}

fn read_ply(path: &Path) -> Result<Loaded, SceneError> {
    Ok(ply::read(path)?)
}

fn is_splat_ply(path: &Path) -> bool {
    files::is_special(path) || ply::is_splat(path)
}

fn read_bytes(path: &Path, parse: fn(&[u8]) -> Result<Loaded, SplatProblem>) -> Result<Loaded, SceneError> {
    let bytes = files::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })?;
    parse(&bytes).map_err(|problem| SceneError::Splat { path: path.to_owned(), problem })
}
