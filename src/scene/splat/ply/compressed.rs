//! PlayCanvas' compressed PLY: chunks of 256 Gaussians with the bounds of their values, and four packed words per
//! Gaussian.
//!
//! ```text
//! element chunk   min_x ... max_z, min_scale_x ... max_scale_z (log scales), and in newer files min_r ... max_b: float32
//! element vertex  packed_position 11+10+11 bits within the chunk's box, packed_rotation 2+10+10+10 bits (which component
//!                 of w x y z is largest, then the others from -sqrt(1/2) to sqrt(1/2)), packed_scale 11+10+11 bits,
//!                 packed_color 8+8+8 bits within the chunk's colours and 8 bits of opacity
//! element sh      f_rest_i as one byte each, from -4 to 4, channel-major (absent at SH degree 0)
//! ```

use ply_rs_bw::ply::{ElementDef, Encoding};

use super::header::Header;
use super::layout::{Scalar, scalar_properties, sh_degree_of};
use super::source::Bytes;
use super::{Problem, Rows};
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::scene::splat::quantized::{opacity_logit_of_byte, quaternion_of_smallest_three, sh_dc_of_color};

/// Gaussians that share a chunk's bounds.
const PER_CHUNK: u64 = 256;

/// True if the header declares a compressed splat.
pub(super) fn is_compressed(header: &Header) -> bool {
    let packed = |element: &ElementDef| element.name == "vertex" && element.properties.contains_key("packed_position");
    header.elements.iter().any(packed)
}

pub(super) fn read(bytes: &impl Bytes, header: &Header) -> Result<Rows, Problem> {
    if !matches!(header.encoding, Encoding::BinaryLittleEndian) {
        return Err(Problem::CompressedEncoding);
    }
    let tables = tables(bytes, header)?;
    let chunk = tables.iter().find(|table| table.name == "chunk").ok_or(Problem::NoChunks)?;
    let vertex = tables.iter().find(|table| table.name == "vertex").ok_or(Problem::NoVertex)?;
    let sh = tables.iter().find(|table| table.name == "sh");
    if vertex.count == 0 {
        return Err(Problem::Empty);
    }
    if chunk.count < vertex.count.div_ceil(PER_CHUNK) {
        return Err(Problem::TooFewChunks { chunks: chunk.count, count: vertex.count });
    }
    let bounds = Bounds::of(chunk)?;
    let words = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
    let [position, rotation, scale, color] = columns(vertex, words, Scalar::U32)?;
    let count = vertex.count as usize;
    let colors: Vec<[f32; 4]> = parallel::map_range(count, |row| bytes_of(vertex.word(row, color)));
    let mut gaussians = Gaussians {
        positions: parallel::map_range(count, |row| {
            bounds.of_position(row, unpack_11_10_11(vertex.word(row, position)))
        }),
        log_scales: parallel::map_range(count, |row| bounds.of_scale(row, unpack_11_10_11(vertex.word(row, scale)))),
        rotations: parallel::map_range(count, |row| quaternion(vertex.word(row, rotation))),
        opacity_logits: parallel::map(&colors, |color| opacity_logit_of_byte(color[3] as u8)),
        sh_dc: parallel::map_range(count, |row| {
            let [r, g, b, _] = colors[row];
            bounds.of_color(row, [r, g, b])
        }),
        ..Gaussians::default()
    };
    if let Some(sh) = sh.filter(|sh| sh.width > 0) {
        (gaussians.sh_degree, gaussians.sh_rest) = harmonics(sh, vertex.count)?;
    }
    Ok(Rows { gaussians, surely_usable: false, warning: None })
}

/// The rows of an element.
struct Table {
    name: String,
    count: u64,
    /// Name, offset in the row and type of each property.
    properties: Vec<(String, usize, Scalar)>,
    /// Bytes of a row.
    width: usize,
    bytes: Vec<u8>,
}

impl Table {
    fn word(&self, row: usize, at: usize) -> u32 {
        let start = row * self.width + at;
        u32::from_le_bytes(std::array::from_fn(|i| self.bytes[start + i]))
    }

    fn float(&self, row: usize, at: usize) -> f32 {
        f32::from_bits(self.word(row, at))
    }
}

/// Reads all elements, after checking that the file holds as much as the header claims.
fn tables(bytes: &impl Bytes, header: &Header) -> Result<Vec<Table>, Problem> {
    let mut tables = Vec::new();
    let mut end = u128::from(header.data_at);
    for element in &header.elements {
        let mut width = 0;
        let mut properties = Vec::new();
        for (name, scalar) in scalar_properties(element)? {
            properties.push((name.to_owned(), width, scalar));
            width += scalar.bytes();
        }
        end += element.count as u128 * width as u128;
        tables.push(Table {
            name: element.name.clone(),
            count: element.count as u64,
            properties,
            width,
            bytes: Vec::new(),
        });
    }
    if end > u128::from(bytes.size()) {
        let count = tables.iter().find(|table| table.name == "vertex").map_or(0, |table| table.count);
        return Err(Problem::Truncated { count, expected: end, found: bytes.size() });
    }
    let mut at = header.data_at;
    for table in &mut tables {
        let length = table.count as usize * table.width;
        table.bytes = vec![0; length];
        bytes.read_at(at, &mut table.bytes)?;
        at += length as u64;
    }
    Ok(tables)
}

/// Offsets of the named properties, which must be of one type.
fn columns<const N: usize>(table: &Table, names: [&str; N], scalar: Scalar) -> Result<[usize; N], Problem> {
    let find = |name: &str| table.properties.iter().find(|(found, _, of)| found == name && *of == scalar);
    let missing: Vec<String> =
        names.iter().filter(|name| find(name).is_none()).map(|name| (*name).to_owned()).collect();
    if !missing.is_empty() {
        return Err(Problem::NotASplat { missing });
    }
    Ok(names.map(|name| find(name).map_or(0, |(_, offset, _)| *offset)))
}

/// The chunks' bounds: [min, max] of three values each.
struct Bounds {
    positions: Vec<[[f32; 3]; 2]>,
    log_scales: Vec<[[f32; 3]; 2]>,
    /// `None` in older files, whose colours go from 0 to 1.
    colors: Option<Vec<[[f32; 3]; 2]>>,
}

impl Bounds {
    fn of(chunk: &Table) -> Result<Self, Problem> {
        let read = |names: [&str; 6]| -> Result<Vec<[[f32; 3]; 2]>, Problem> {
            let offsets = columns(chunk, names, Scalar::F32)?;
            let row = |row: usize| [0, 3].map(|first| [0, 1, 2].map(|i| chunk.float(row, offsets[first + i])));
            Ok((0..chunk.count as usize).map(row).collect())
        };
        let colors = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
        Ok(Self {
            positions: read(["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"])?,
            log_scales: read([
                "min_scale_x",
                "min_scale_y",
                "min_scale_z",
                "max_scale_x",
                "max_scale_y",
                "max_scale_z",
            ])?,
            colors: read(colors).ok(),
        })
    }

    fn of_position(&self, row: usize, share: [f32; 3]) -> [f32; 3] {
        within(&self.positions[row / PER_CHUNK as usize], share)
    }

    fn of_scale(&self, row: usize, share: [f32; 3]) -> [f32; 3] {
        within(&self.log_scales[row / PER_CHUNK as usize], share)
    }

    fn of_color(&self, row: usize, bytes: [f32; 3]) -> [f32; 3] {
        let share = bytes.map(|byte| byte / 255.0);
        let color = self.colors.as_ref().map_or(share, |colors| within(&colors[row / PER_CHUNK as usize], share));
        color.map(sh_dc_of_color)
    }
}

fn within([low, high]: &[[f32; 3]; 2], share: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| low[i] * (1.0 - share[i]) + high[i] * share[i])
}

fn unpack_11_10_11(word: u32) -> [f32; 3] {
    [(word >> 21) as f32 / 2047.0, (word >> 11 & 0x3ff) as f32 / 1023.0, (word & 0x7ff) as f32 / 2047.0]
}

fn bytes_of(word: u32) -> [f32; 4] {
    word.to_be_bytes().map(f32::from)
}

fn quaternion(word: u32) -> [f32; 4] {
    let component = |shift: u32| ((word >> shift & 0x3ff) as f32 / 1023.0 - 0.5) * std::f32::consts::SQRT_2;
    quaternion_of_smallest_three((word >> 30) as usize, [20, 10, 0].map(component))
}

/// SH degree and coefficients.
fn harmonics(sh: &Table, count: u64) -> Result<(u8, Vec<f32>), Problem> {
    let names: Vec<(&str, Scalar)> = sh.properties.iter().map(|(name, _, scalar)| (name.as_str(), *scalar)).collect();
    let degree = sh_degree_of(names.iter().map(|(name, _)| *name))?;
    let in_order = names.iter().enumerate().all(|(i, (name, scalar))| {
        *scalar == Scalar::U8 && name.strip_prefix("f_rest_").is_some_and(|number| number == format!("{i}"))
    });
    if !in_order || sh.count < count {
        return Err(Problem::CompressedSh);
    }
    // The first and last values are exact; every other stands for the middle of its step.
    let value = |byte: &u8| match byte {
        0 => -4.0,
        255 => 4.0,
        byte => ((f32::from(*byte) + 0.5) / 256.0 - 0.5) * 8.0,
    };
    Ok((degree, parallel::map(&sh.bytes[..count as usize * sh.width], value)))
}
