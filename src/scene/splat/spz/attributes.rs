//! Decodes the bytes of each attribute, following the format's public description.

use super::Header;
use crate::parallel;
use crate::scene::splat::quantized::{half_float, opacity_logit_of_byte, quaternion_of_smallest_three};

/// Colours are stored as 0.5 + this * f_dc, which leaves room for colours beyond 0 and 1.
const COLOR_SCALE: f32 = 0.15;

/// The signs that a half turn about x gives to the real spherical harmonics of degree 1 to 3: -1 if the polynomial is
/// odd in y and z together.
#[rustfmt::skip]
const SH_SIGNS: [f32; 15] = [
    -1.0, -1.0, 1.0,
    -1.0, 1.0, 1.0, -1.0, 1.0,
    -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0,
];

/// Applies a half turn about x.
fn turned([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

/// Positions: 24-bit fixed point, or half floats in version 1.
pub(super) fn positions(header: &Header, bytes: &[u8]) -> Vec<[f32; 3]> {
    if header.version == 1 {
        let (rows, _) = bytes.as_chunks::<6>();
        return parallel::map(rows, |r| turned([0, 2, 4].map(|at| half_float([r[at], r[at + 1]]))));
    }
    let unit = (-f32::from(header.fractional_bits)).exp2();
    let coordinate = |row: &[u8; 9], at: usize| {
        // The sign is in the third byte; shifting down from the top of 32 bits extends it.
        let fixed = i32::from_le_bytes([0, row[at], row[at + 1], row[at + 2]]) >> 8;
        fixed as f32 * unit
    };
    let (rows, _) = bytes.as_chunks::<9>();
    parallel::map(rows, |row| turned([0, 3, 6].map(|at| coordinate(row, at))))
}

/// Log scales in steps of one sixteenth, starting at -10.
pub(super) fn log_scales(bytes: &[u8]) -> Vec<[f32; 3]> {
    let (rows, _) = bytes.as_chunks::<3>();
    parallel::map(rows, |row| row.map(|byte| f32::from(byte) / 16.0 - 10.0))
}

/// Quaternions as w x y z.
pub(super) fn rotations(header: &Header, bytes: &[u8]) -> Vec<[f32; 4]> {
    let quaternions: Vec<[f32; 4]> = if header.version < 3 {
        let (rows, _) = bytes.as_chunks::<3>();
        let signed = |byte: u8| f32::from(byte) / 127.5 - 1.0;
        parallel::map(rows, |row| quaternion_of_smallest_three(0, row.map(signed)))
    } else {
        let (rows, _) = bytes.as_chunks::<4>();
        parallel::map(rows, |row| smallest_three(u32::from_le_bytes(*row)))
    };
    quaternions.into_iter().map(|[w, x, y, z]| [w, x, -y, -z]).collect()
}

/// Two bits say which of x y z w is the largest; the others follow from the highest bits down, each as a sign and nine
/// bits of magnitude, where 511 is sqrt(1/2), the largest value that a smaller component can have.
fn smallest_three(packed: u32) -> [f32; 4] {
    let component = |field: u32| {
        let bits = packed >> (20 - 10 * field);
        let size = (bits & 0x1ff) as f32 / 511.0 * std::f32::consts::FRAC_1_SQRT_2;
        if bits & 0x200 == 0 { size } else { -size }
    };
    let [x, y, z, w] = quaternion_of_smallest_three((packed >> 30) as usize, [0, 1, 2].map(component));
    [w, x, y, z]
}

pub(super) fn opacity_logits(bytes: &[u8]) -> Vec<f32> {
    bytes.iter().map(|byte| opacity_logit_of_byte(*byte)).collect()
}

pub(super) fn sh_dc(bytes: &[u8]) -> Vec<[f32; 3]> {
    let (rows, _) = bytes.as_chunks::<3>();
    parallel::map(rows, |row| row.map(|byte| (f32::from(byte) / 255.0 - 0.5) / COLOR_SCALE))
}

/// The coefficients in the order of a PLY: the file stores the three colours of a coefficient side by side, a PLY all
/// coefficients of a colour.
pub(super) fn sh_rest(header: &Header, bytes: &[u8]) -> Vec<f32> {
    let bands = usize::from(header.sh_degree) + 1;
    let per_channel = bands * bands - 1;
    if per_channel == 0 {
        return Vec::new();
    }
    let mut values = vec![0.0; bytes.len()];
    let width = 3 * per_channel;
    parallel::for_each_chunk_mut(&mut values, width, |row, to| {
        for (index, byte) in bytes[row * width..][..to.len()].iter().enumerate() {
            let (coefficient, channel) = (index / 3, index % 3);
            to[channel * per_channel + coefficient] = SH_SIGNS[coefficient] * (f32::from(*byte) - 128.0) / 128.0;
        }
    });
    values
}
