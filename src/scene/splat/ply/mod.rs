//! 3D Gaussian Splatting PLY files: ascii, little and big endian, float or double, properties in any order, SH degree
//! 0 to 3, with or without normals, with properties that gprop does not know.
//!
//! Reading goes in this order:
//! 1. `header`: ply-rs-bw reads the header, after a check for duplicates, which it would silently merge.
//! 2. `layout`: determines where each property goes, and checks that this is a splat.
//! 3. `binary` or `ascii`: reads the rows directly into the structure of arrays, after the count in the header has been
//!    checked against the bytes in the file. Memory is bounded by the file's actual size, whatever the header claims.
//!    `compressed` reads packed rows.
//! 4. `activated`: refuses values that were not written as logarithms and logits.
//! 5. `kinds`: converts the Gaussians of 2DGS and Mip-Splatting into plain ones.
//! 6. Gaussians with values that no renderer could draw are dropped and counted.

mod activated;
mod ascii;
mod binary;
mod compressed;
mod header;
mod kinds;
mod layout;
mod row;
mod source;
mod write;

use std::path::{Path, PathBuf};

use ply_rs_bw::ply::Encoding;
use thiserror::Error;

use super::loaded::drop_unusable;
use crate::gaussians::Gaussians;
use layout::Layout;
use source::{Bytes, FileBytes};

pub use super::loaded::Loaded;
pub use ascii::RowProblem;
pub use write::{write, write_with_comments};

/// A PLY file that cannot be read as a splat. The message is complete: it includes that of the problem.
#[derive(Debug, Error)]
#[error("`{}`: {problem}", path.display())]
pub struct PlyError {
    pub path: PathBuf,
    pub problem: Problem,
}

/// An error in a PLY, and what to do about it.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("cannot be read: {0}")]
    Io(std::io::Error),
    #[error("is not a PLY file (its first line is not `ply`); point gprop at the .ply that the trainer wrote")]
    NotPly,
    #[error("line {line} of the header is not PLY: `{text}`; export the splat again")]
    HeaderLine { line: usize, text: String },
    #[error("the header is broken: {0}; export the splat again")]
    Header(String),
    #[error("the header has no `end_header` within its first {limit} bytes; the file is cut off or not a PLY")]
    HeaderEnd { limit: u64 },
    #[error("the header declares {kind} `{name}` twice (line {line}); remove one of the two and its values")]
    Duplicate { kind: &'static str, name: String, line: usize },
    #[error("has no element `vertex`, where the Gaussians would be; export the splat again")]
    NoVertex,
    #[error("element `vertex` has zero Gaussians: training or export kept nothing; export the splat again")]
    Empty,
    #[error("vertex property `{name}` is a list, which no splat has; export the splat as plain scalar properties")]
    List { name: String },
    #[error("element `{name}` before `vertex` has list properties; write `vertex` as the first element")]
    ListBeforeVertex { name: String },
    #[error(
        "is a point cloud, not a splat (no opacity, scale or rotation); point gprop at what the trainer wrote, \
         usually point_cloud/iteration_N/point_cloud.ply"
    )]
    PointCloud,
    #[error("is a compressed splat that is not binary_little_endian; export it again")]
    CompressedEncoding,
    #[error("is a compressed splat without its element `chunk`, the bounds of its values; export it again")]
    NoChunks,
    #[error(
        "is a compressed splat of {count} Gaussians with {chunks} chunks, but needs one for every 256; export it again"
    )]
    TooFewChunks { chunks: u64, count: u64 },
    #[error(
        "is a compressed splat whose element `sh` is not f_rest_0, f_rest_1 ... of type uchar for each Gaussian; export it again"
    )]
    CompressedSh,
    #[error("is not a 3DGS splat: vertex properties missing: {}; export the splat again with all of them", missing.join(" "))]
    NotASplat { missing: Vec<String> },
    #[error(
        "has {found} properties f_rest_*, of which {contiguous} are numbered from 0 without a gap; spherical harmonics of \
         degree 0, 1, 2, 3 have 0, 9, 24, 45; export the splat again with one of these"
    )]
    ShCount { found: usize, contiguous: usize },
    #[error(
        "is truncated: the header claims {count} Gaussians, for which the file needs at least {expected} bytes, but it has \
         {found}; copy or export it again"
    )]
    Truncated { count: u64, expected: u128, found: u64 },
    #[error(
        "is truncated: the header claims {count} Gaussians, but the text ends after {found}; copy or export it again"
    )]
    TruncatedText { count: u64, found: u64 },
    #[error("line {line}, Gaussian {index}: {reason}; export the splat again")]
    Row { line: u64, index: u64, reason: RowProblem },
    #[error(
        "its values look activated: {which}, but a splat PLY holds logarithms of scales and logits of opacities; write \
         ln(scale) and ln(opacity / (1 - opacity)) and export the splat again"
    )]
    Activated { which: &'static str },
    #[error("none of the {count} Gaussians has finite values: training diverged; train again")]
    NothingFinite { count: usize },
}

impl From<std::io::Error> for Problem {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

/// Reads the splat at `path`.
///
/// # Errors
/// [`PlyError`], which says which file is affected, what is wrong with it and what to do.
pub fn read(path: &Path) -> Result<Loaded, PlyError> {
    let in_file = |problem| PlyError { path: path.to_owned(), problem };
    let file = FileBytes::open(path).map_err(|e| in_file(e.into()))?;
    read_bytes(&file).map_err(in_file)
}

/// True if the file at `path` has the header of a splat; a damaged splat counts, a point cloud or a mesh does not.
pub(in crate::scene) fn is_splat(path: &Path) -> bool {
    let Ok(file) = FileBytes::open(path) else { return false };
    let Ok(header) = header::read(&file) else { return false };
    compressed::is_compressed(&header) || !matches!(Layout::of(&header), Err(Problem::PointCloud | Problem::NoVertex))
}

/// Reads a splat from memory, as [`read`] does from a file.
///
/// # Errors
/// [`Problem`], which says what is wrong.
pub fn parse(bytes: &[u8]) -> Result<Loaded, Problem> {
    read_bytes(&bytes)
}

fn read_bytes(bytes: &impl Bytes) -> Result<Loaded, Problem> {
    let header = header::read(bytes)?;
    if compressed::is_compressed(&header) {
        let rows = compressed::read(bytes, &header)?;
        return finished(rows, Loaded { notes: vec!["PlayCanvas compressed PLY".to_owned()], ..Loaded::default() });
    }
    let layout = Layout::of(&header)?;
    let mut rows = match header.encoding {
        Encoding::Ascii => ascii::read(bytes, &header, &layout)?,
        Encoding::BinaryLittleEndian => binary::read(bytes, &header, &layout, binary::ByteOrder::Little)?,
        Encoding::BinaryBigEndian => binary::read(bytes, &header, &layout, binary::ByteOrder::Big)?,
    };
    if let Some(which) = activated::activated(&rows.gaussians, layout.flat) {
        return Err(Problem::Activated { which });
    }
    let mut notes = kinds::recognise(&mut rows, layout.flat, &header.comments);
    notes.extend(layout.notes);
    finished(rows, Loaded { notes, warnings: layout.warnings, ..Loaded::default() })
}

fn finished(rows: Rows, mut loaded: Loaded) -> Result<Loaded, Problem> {
    loaded.gaussians = rows.gaussians;
    loaded.warnings.extend(rows.warning);
    if !rows.surely_usable {
        let count = loaded.gaussians.len();
        let dropped = drop_unusable(&mut loaded.gaussians).map_err(|_| Problem::NothingFinite { count })?;
        loaded.warnings.extend(dropped);
    }
    Ok(loaded)
}

/// The Gaussians that the rows of a file hold.
struct Rows {
    gaussians: Gaussians,
    /// False if some Gaussian may not be [usable](Gaussians::is_usable).
    surely_usable: bool,
    warning: Option<String>,
}
