//! The `.splat` format of antimatter15's viewer: no header, 32 bytes per Gaussian, no spherical harmonics.
//!
//! ```text
//! bytes  0..12  centre x y z, float32 little endian, scene units
//!       12..24  standard deviations, float32 (not their logarithm)
//!       24..28  colour r g b and opacity, one byte each
//!       28..32  quaternion w x y z, each (byte - 128) / 128
//! ```

use thiserror::Error;

use super::loaded::{Loaded, drop_unusable};
use super::quantized::{log_scale_of_deviation, opacity_logit_of_byte, sh_dc_of_color};
use crate::gaussians::Gaussians;
use crate::parallel;

/// Bytes per Gaussian.
const ROW: usize = 32;

/// An error in a `.splat`.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("holds no Gaussians; export the splat again")]
    Empty,
    #[error(
        "is {size} bytes long, which is not a multiple of the 32 that a Gaussian takes: it is cut off or not a .splat; \
         copy or export it again"
    )]
    Size { size: usize },
    #[error("none of the {count} Gaussians has finite values; export the splat again")]
    NothingFinite { count: usize },
}

/// Reads a `.splat` from memory.
///
/// # Errors
/// [`Problem`], which says what is wrong.
pub fn parse(bytes: &[u8]) -> Result<Loaded, Problem> {
    let (rows, rest) = bytes.as_chunks::<ROW>();
    if !rest.is_empty() {
        return Err(Problem::Size { size: bytes.len() });
    }
    if rows.is_empty() {
        return Err(Problem::Empty);
    }
    let mut gaussians = Gaussians {
        positions: parallel::map(rows, |row| floats(row, 0)),
        log_scales: parallel::map(rows, |row| floats(row, 12).map(log_scale_of_deviation)),
        rotations: parallel::map(rows, quaternion),
        opacity_logits: parallel::map(rows, |row| opacity_logit_of_byte(row[27])),
        sh_dc: parallel::map(rows, color),
        ..Gaussians::default()
    };
    let dropped = drop_unusable(&mut gaussians).map_err(|_| Problem::NothingFinite { count: rows.len() })?;
    Ok(Loaded { gaussians, warnings: dropped.into_iter().collect(), ..Loaded::default() })
}

fn floats(row: &[u8; ROW], at: usize) -> [f32; 3] {
    std::array::from_fn(|i| f32::from_le_bytes(std::array::from_fn(|byte| row[at + 4 * i + byte])))
}

fn color(row: &[u8; ROW]) -> [f32; 3] {
    std::array::from_fn(|channel| sh_dc_of_color(f32::from(row[24 + channel]) / 255.0))
}

fn quaternion(row: &[u8; ROW]) -> [f32; 4] {
    std::array::from_fn(|i| (f32::from(row[28 + i]) - 128.0) / 128.0)
}
