//! The formats of splats, in one table: their file name endings, the functions that read them, and how large they
//! become in memory.

pub mod dot_splat;
pub(super) mod find;
pub mod ksplat;
mod loaded;
pub mod ply;
mod quantized;
mod quaternion_order;
pub mod sog;
pub mod spz;

use std::path::Path;

use super::SceneError;
use super::error::SplatProblem;
use crate::files;
pub use loaded::Loaded;
pub use quaternion_order::QuaternionOrder;

/// A format that splats are stored in.
pub struct SplatFormat {
    /// The ending of its file names, in lower case; the case of an actual file name does not matter.
    pub ending: &'static str,
    /// How many times larger a splat is as plain floats, 62 of 4 bytes per Gaussian.
    pub inflation: u64,
    read: fn(&Path) -> Result<Loaded, SceneError>,
    /// Tells whether a file with this ending is a splat: a PLY may hold a point cloud or a mesh.
    is_splat: fn(&Path) -> bool,
}

/// The ending of plain PLY files.
const PLY: &str = ".ply";

/// Every format that gprop reads. If several endings match a name, the first counts.
pub const SPLAT_FORMATS: &[SplatFormat] = &[
    // 16 bytes per Gaussian.
    SplatFormat { ending: ".compressed.ply", inflation: 16, read: read_ply, is_splat: is_splat_ply },
    SplatFormat { ending: PLY, inflation: 1, read: read_ply, is_splat: is_splat_ply },
    // About 20 bytes per Gaussian.
    SplatFormat {
        ending: ".spz",
        inflation: 12,
        read: |path| read_bytes(path, |bytes| Ok(spz::parse(bytes)?)),
        is_splat: |_| true,
    },
    // 32 bytes per Gaussian.
    SplatFormat {
        ending: ".splat",
        inflation: 8,
        read: |path| read_bytes(path, |bytes| Ok(dot_splat::parse(bytes)?)),
        is_splat: |_| true,
    },
    // 24 bytes per Gaussian at least.
    SplatFormat {
        ending: ".ksplat",
        inflation: 11,
        read: |path| read_bytes(path, |bytes| Ok(ksplat::parse(bytes)?)),
        is_splat: |_| true,
    },
    // About 13 bytes per Gaussian.
    SplatFormat { ending: ".sog", inflation: 20, read: read_sog, is_splat: is_sog },
];

impl SplatFormat {
    /// The format of a file with this name.
    pub fn of(path: &Path) -> Option<&'static Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        // SOG's files without their bundle.
        let name = if name == sog::META { "meta.sog".to_owned() } else { name };
        SPLAT_FORMATS.iter().find(|format| name.len() > format.ending.len() && name.ends_with(format.ending))
    }

    /// True if the file, whose name has this format's ending, begins like a splat.
    pub(super) fn is_splat(&self, path: &Path) -> bool {
        (self.is_splat)(path)
    }
}

/// Reads a splat in the format determined by its name and first bytes. Only a PLY's quaternions may have another `order`: every
/// other format defines its own.
pub(super) fn read(path: &Path, order: QuaternionOrder) -> Result<Loaded, SceneError> {
    match SplatFormat::of(path) {
        Some(format) if order == QuaternionOrder::default() => (format.read)(path),
        Some(format) if format.ending == PLY => {
            let mut loaded = (format.read)(path)?;
            order.apply(&mut loaded.gaussians);
            loaded.notes.push(format!("its quaternions are read in the order {order}"));
            Ok(loaded)
        }
        Some(_) => Err(SceneError::Splat { path: path.to_owned(), problem: SplatProblem::QuaternionOrder }),
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

/// A bundle, or the files beside a `meta.json`.
fn read_sog(path: &Path) -> Result<Loaded, SceneError> {
    if is_bundle(path) {
        return read_bytes(path, |bytes| Ok(sog::parse(bytes)?));
    }
    let wrong = |problem: sog::Problem| SceneError::Splat { path: path.to_owned(), problem: problem.into() };
    sog::read_folder(path).map_err(wrong)
}

fn is_sog(path: &Path) -> bool {
    is_bundle(path) || sog::is_meta(path)
}

fn is_bundle(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("sog"))
}

fn read_bytes(path: &Path, parse: fn(&[u8]) -> Result<Loaded, SplatProblem>) -> Result<Loaded, SceneError> {
    let bytes = files::read_large(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })?;
    parse(&bytes).map_err(|problem| SceneError::Splat { path: path.to_owned(), problem })
}
