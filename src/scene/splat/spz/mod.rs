//! Niantic's `.spz`, versions 1 to 4: quantised Gaussians, attribute by attribute, compressed.
//!
//! 1. [`container`]: versions 1 to 3 are one gzip stream that begins with a 16-byte header; version 4 has an
//!    uncompressed header of 32 bytes and one zstd stream per attribute.
//! 2. [`attributes`]: converts the bytes of an attribute to the values that a 3DGS PLY holds.
//!
//! The format's axes are right, up, back; a 3DGS PLY's are right, down, front. The cloud is rotated by a half turn
//! about x, as the format's own converters do.

mod attributes;
mod container;

use thiserror::Error;

use super::loaded::{Loaded, drop_unusable};
use crate::gaussians::Gaussians;

/// An error in an `.spz`.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("is not an .spz file: no letters NGSP at its start, plain or within gzip; export the splat again")]
    NotSpz,
    #[error("is .spz version {version}; gprop reads versions 1 to 4: convert it to a PLY or to one of these")]
    Version { version: u32 },
    #[error("holds no Gaussians; export the splat again")]
    Empty,
    #[error("has spherical harmonics of degree {degree}; gprop reads 0 to 3: export it with a lower degree")]
    ShDegree { degree: u8 },
    #[error(
        "has {bits} fractional bits, but a coordinate has at most 24; the file is damaged, copy or export it again"
    )]
    FractionalBits { bits: u8 },
    #[error(
        "claims {count} Gaussians, far more than its {size} bytes can hold; the file is damaged, copy or export it again"
    )]
    Count { count: u32, size: usize },
    #[error("ends within its header or its list of streams, after {size} bytes; copy or export it again")]
    Truncated { size: usize },
    #[error("has {found} bytes of {attribute}, but its {count} Gaussians take {expected}; copy or export it again")]
    Length { attribute: &'static str, count: u32, found: u64, expected: u64 },
    #[error("has more bytes of {attribute} than its {count} Gaussians take; copy or export it again")]
    Longer { attribute: &'static str, count: u32 },
    #[error("has {bytes} bytes after its end; copy or export it again")]
    Trailing { bytes: usize },
    #[error("its {attribute} cannot be decompressed ({reason}); copy or export it again")]
    Compression { attribute: &'static str, reason: String },
    #[error("none of the {count} Gaussians has finite values; export the splat again")]
    NothingFinite { count: u32 },
}

/// Version, count and flags, which both kinds of header contain.
#[derive(Debug, Clone, Copy)]
struct Header {
    version: u32,
    count: u32,
    sh_degree: u8,
    /// Number of fractional bits of a coordinate.
    fractional_bits: u8,
    antialiased: bool,
    /// Whether records of other programs follow.
    extended: bool,
}

impl Header {
    /// Bytes of each attribute in file order: positions, opacities, colours, scales, rotations, spherical harmonics.
    fn lengths(&self) -> [(&'static str, u64); 6] {
        let bands = u64::from(self.sh_degree) + 1;
        // Version 1 stored half floats; the smallest three components of a quaternion came with version 3.
        let (position, rotation) = (if self.version == 1 { 6 } else { 9 }, if self.version < 3 { 3 } else { 4 });
        let length_of = |bytes: u64| bytes * u64::from(self.count);
        [
            ("positions", length_of(position)),
            ("opacities", length_of(1)),
            ("colours", length_of(3)),
            ("scales", length_of(3)),
            ("rotations", length_of(rotation)),
            ("spherical harmonics", length_of(3 * (bands * bands - 1))),
        ]
    }
}

/// Reads an `.spz` from memory.
///
/// # Errors
/// [`Problem`], which says what is wrong.
pub fn parse(bytes: &[u8]) -> Result<Loaded, Problem> {
    let (header, [positions, opacities, colors, scales, rotations, sh]) = container::unpack(bytes)?;
    let mut gaussians = Gaussians {
        positions: attributes::positions(&header, &positions),
        log_scales: attributes::log_scales(&scales),
        rotations: attributes::rotations(&header, &rotations),
        opacity_logits: attributes::opacity_logits(&opacities),
        sh_dc: attributes::sh_dc(&colors),
        sh_degree: header.sh_degree,
        sh_rest: attributes::sh_rest(&header, &sh),
        antialiased: header.antialiased,
        ..Gaussians::default()
    };
    let dropped = drop_unusable(&mut gaussians).map_err(|_| Problem::NothingFinite { count: header.count })?;
    let notes = vec![format!("SPZ version {}", header.version)];
    Ok(Loaded { gaussians, notes, warnings: dropped.into_iter().collect(), ..Loaded::default() })
}
