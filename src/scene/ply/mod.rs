//! 3D Gaussian Splatting PLY files: ascii, little and big endian, float or double, properties in any order, SH degree
//! 0 to 3, with or without normals, with properties that gprop does not know.
//!
//! Reading goes in this order:
//! 1. `header`: ply-rs reads the header; what it would swallow or choke on is checked before.
//! 2. `layout`: which property goes where, and whether this is a splat at all.
//! 3. `binary` or `ascii`: the body, straight into the structure of arrays, after the count that the header claims
//!    has been checked against the bytes that are there. Memory is bounded by the file's own size, whatever it claims.
//! 4. Gaussians with values that no renderer could draw are dropped and counted.

mod ascii;
mod binary;
mod header;
mod layout;
mod source;
mod write;

use std::path::{Path, PathBuf};

use ply_rs::ply::Encoding;
use thiserror::Error;

use super::gaussians::Gaussians;
use layout::Layout;
use source::{Bytes, FileBytes};

pub use write::write;

/// A cloud as it came out of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    pub gaussians: Gaussians,
    /// What was dropped, rounded or left out, counted.
    pub warnings: Vec<String>,
}

/// A PLY file that cannot be read as a splat. The message is whole: it holds the problem's.
#[derive(Debug, Error)]
#[error("`{}`: {problem}", path.display())]
pub struct PlyError {
    pub path: PathBuf,
    pub problem: Problem,
}

/// What is wrong with a PLY, and what to do.
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
    #[error("the header has no `end_header` within its first {limit} bytes; the file is cut off or no PLY")]
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
    #[error(
        "is a compressed splat (packed properties), which gprop cannot read yet; convert it with \
         `npx @playcanvas/splat-transform in.compressed.ply point_cloud.ply`"
    )]
    Compressed,
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
    #[error("is truncated: the header claims {count} Gaussians, the text ends after {found}; copy or export it again")]
    TruncatedText { count: u64, found: u64 },
    #[error("line {line}, Gaussian {index}: {reason}; export the splat again")]
    Row { line: u64, index: u64, reason: String },
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
/// [`PlyError`] says which file, what is wrong with it and what to do.
pub fn read(path: &Path) -> Result<Loaded, PlyError> {
    let in_file = |problem| PlyError { path: path.to_owned(), problem };
    let file = FileBytes::open(path).map_err(|e| in_file(e.into()))?;
    read_bytes(&file).map_err(in_file)
}

/// Reads a splat from memory, as [`read`] does from a file.
///
/// # Errors
/// [`Problem`] says what is wrong.
pub fn parse(bytes: &[u8]) -> Result<Loaded, Problem> {
    read_bytes(&bytes)
}

fn read_bytes(bytes: &impl Bytes) -> Result<Loaded, Problem> {
    let header = header::read(bytes)?;
    let layout = Layout::of(&header)?;
    let body = match header.encoding {
        Encoding::Ascii => ascii::read(bytes, &header, &layout)?,
        Encoding::BinaryLittleEndian => binary::read(bytes, &header, &layout, binary::ByteOrder::Little)?,
        Encoding::BinaryBigEndian => binary::read(bytes, &header, &layout, binary::ByteOrder::Big)?,
    };
    let mut warnings = layout.warnings;
    warnings.extend(body.warning);
    let mut gaussians = body.gaussians;
    if !body.surely_usable {
        warnings.extend(drop_unusable(&mut gaussians)?);
    }
    Ok(Loaded { gaussians, warnings })
}

/// What a body reader hands back.
struct Body {
    gaussians: Gaussians,
    /// False where some Gaussian may not be [`Gaussians::is_usable`].
    surely_usable: bool,
    warning: Option<String>,
}

/// Drops every Gaussian that no renderer could draw and says how many there were.
fn drop_unusable(gaussians: &mut Gaussians) -> Result<Option<String>, Problem> {
    let count = gaussians.len();
    let usable: Vec<bool> = (0..count).map(|i| gaussians.is_usable(i)).collect();
    let dropped = usable.iter().filter(|usable| !**usable).count();
    if dropped == count {
        return Err(Problem::NothingFinite { count });
    }
    if dropped == 0 {
        return Ok(None);
    }
    gaussians.retain(&usable);
    Ok(Some(format!(
        "{dropped} of {count} Gaussians have values that are NaN, infinite or beyond float32; they were dropped"
    )))
}
