//! The `.ksplat` format of GaussianSplats3D (mkkellogg), version 0.1, little endian:
//!
//! ```text
//! 4096 bytes  header: version (bytes 0, 1), maximum number of sections (u32 at 4), Gaussians (u32 at 16),
//!             compression level (u16 at 20), least and greatest SH value of level 2 (f32 at 36, 40; 0: -1.5, 1.5)
//! 1024 bytes  header of each section: Gaussians (u32 at 0), Gaussians that fit (4), Gaussians per bucket (8), buckets
//!             (12), side of a bucket (f32 at 16), bytes of a bucket's centre (u16 at 20), range of a coordinate (u32 at
//!             24; 0: 32767), full buckets (32), others (36), SH degree (u16 at 40)
//! sections    sizes of the buckets that are not full (u32), centres of the buckets (3 f32), Gaussians
//! ```
//!
//! A Gaussian is its centre, standard deviations (not their logarithm), quaternion w x y z, colour and opacity as bytes,
//! and spherical harmonics, band by band and in each band channel by channel. They are floats at level 0. From level 1
//! on they are half floats, and centres are steps from their bucket's centre; at level 2, harmonics are bytes.

use thiserror::Error;

use super::loaded::{Loaded, drop_unusable};
use super::quantized::{half_float, log_scale_of_deviation, opacity_logit_of_byte, sh_dc_of_color};
use crate::gaussians::Gaussians;
use crate::parallel;

const HEADER: usize = 4096;
const SECTION_HEADER: usize = 1024;
/// Steps from a bucket's centre to its border if the file does not give them.
const RANGE: u32 = 32767;
/// Harmonics of a level-2 file that gives no range lie within this.
const HARMONICS: [f32; 2] = [-1.5, 1.5];

/// An error in a `.ksplat`.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("ends after {size} bytes, within its headers; copy or export it again")]
    Truncated { size: usize },
    #[error("is .ksplat version {major}.{minor}; gprop reads 0.1: convert it to a PLY")]
    Version { major: u8, minor: u8 },
    #[error("has compression level {level}, but .ksplat has only 0 to 2; the file is damaged, copy or export it again")]
    Level { level: u16 },
    #[error("has spherical harmonics of degree {degree}; gprop reads 0 to 3: export it with a lower degree")]
    ShDegree { degree: u16 },
    #[error("holds no Gaussians; export the splat again")]
    Empty,
    #[error("section {section} needs {needed} bytes, but only {left} are left; copy or export the file again")]
    Section { section: usize, needed: u64, left: usize },
    #[error("section {section} has {gaussians} Gaussians, but its buckets hold fewer; export the splat again")]
    Buckets { section: usize, gaussians: usize },
    #[error("none of the {count} Gaussians has finite values; export the splat again")]
    NothingFinite { count: usize },
}

/// One section: its header and its bytes.
struct Section<'a> {
    count: usize,
    sh_degree: usize,
    /// Length of a step of a coordinate, scene units.
    step: f32,
    range: f32,
    /// Per Gaussian: the centre of its bucket; empty at level 0.
    centers: Vec<[f32; 3]>,
    rows: &'a [u8],
    row: usize,
}

/// The compression level: the bytes of a number (in centres, scales and quaternions) and of a harmonic, and the range of
/// harmonics that are stored as bytes.
#[derive(Clone, Copy)]
struct Level {
    number: usize,
    harmonic: usize,
    harmonics: [f32; 2],
}

/// Reads a `.ksplat` from memory.
///
/// # Errors
/// [`Problem`], which says what is wrong.
pub fn parse(bytes: &[u8]) -> Result<Loaded, Problem> {
    if bytes.len() < HEADER {
        return Err(Problem::Truncated { size: bytes.len() });
    }
    if (bytes[0], bytes[1]) != (0, 1) {
        return Err(Problem::Version { major: bytes[0], minor: bytes[1] });
    }
    let or = |value: f32, otherwise: f32| if value == 0.0 { otherwise } else { value };
    let harmonics = [or(float(bytes, 36), HARMONICS[0]), or(float(bytes, 40), HARMONICS[1])];
    let level = match half(bytes, 20) {
        0 => Level { number: 4, harmonic: 4, harmonics },
        1 => Level { number: 2, harmonic: 2, harmonics },
        2 => Level { number: 2, harmonic: 1, harmonics },
        level => return Err(Problem::Level { level }),
    };
    let sections = sections(bytes, level)?;
    let count: usize = sections.iter().map(|section| section.count).sum();
    if count == 0 {
        return Err(Problem::Empty);
    }
    let degree =
        sections.iter().filter(|section| section.count > 0).map(|section| section.sh_degree).max().unwrap_or(0);
    let mut gaussians = Gaussians { sh_degree: degree as u8, ..Gaussians::default() };
    for section in &sections {
        section.read_into(&mut gaussians, level);
    }
    let dropped = drop_unusable(&mut gaussians).map_err(|_| Problem::NothingFinite { count })?;
    Ok(Loaded { gaussians, warnings: dropped.into_iter().collect(), ..Loaded::default() })
}

fn sections(bytes: &[u8], level: Level) -> Result<Vec<Section<'_>>, Problem> {
    let many = word(bytes, 4) as usize;
    let headers = many.checked_mul(SECTION_HEADER).and_then(|size| bytes[HEADER..].get(..size));
    let Some(headers) = headers else { return Err(Problem::Truncated { size: bytes.len() }) };
    let mut rest = &bytes[HEADER + headers.len()..];
    let mut sections = Vec::with_capacity(many);
    for (n, header) in headers.chunks_exact(SECTION_HEADER).enumerate() {
        let [count, fitting, per_bucket, buckets, full, partial] =
            [0, 4, 8, 12, 32, 36].map(|at| u64::from(word(header, at)));
        let degree = half(header, 40);
        if degree > 3 {
            return Err(Problem::ShDegree { degree });
        }
        let bands = usize::from(degree) + 1;
        let row = 10 * level.number + 4 + 3 * (bands * bands - 1) * level.harmonic;
        let sizes = 4 * partial;
        let storage = sizes + u64::from(half(header, 20)) * buckets;
        // In u128, nothing that a header claims overflows.
        let needed = u128::from(storage) + u128::from(fitting) * row as u128;
        let too_long = || Problem::Section { section: n, needed: needed as u64, left: rest.len() };
        if needed > rest.len() as u128 || count > fitting || 12 * buckets > storage - sizes && level.number == 2 {
            return Err(too_long());
        }
        let (own, after) = rest.split_at(needed as usize);
        let (heads, rows) = own.split_at(storage as usize);
        let range = if word(header, 24) == 0 { RANGE } else { word(header, 24) } as f32;
        let count = count as usize;
        let centers = if level.number == 4 {
            Vec::new()
        } else {
            let (sizes, centers) = heads.split_at(sizes as usize);
            centers_of(sizes, centers, buckets as usize, full.saturating_mul(per_bucket), per_bucket, count)
                .ok_or(Problem::Buckets { section: n, gaussians: count })?
        };
        let step = float(header, 16) / 2.0 / range;
        sections.push(Section { count, sh_degree: usize::from(degree), step, range, centers, rows, row });
        rest = after;
    }
    Ok(sections)
}

/// The centre of each Gaussian's bucket: full buckets first, then those whose sizes are listed.
fn centers_of(
    sizes: &[u8],
    centers: &[u8],
    buckets: usize,
    in_full: u64,
    per_bucket: u64,
    count: usize,
) -> Option<Vec<[f32; 3]>> {
    let center = |bucket: usize| (bucket < buckets).then(|| [0, 4, 8].map(|at| float(centers, 12 * bucket + at)));
    let mut of_gaussian = Vec::with_capacity(count);
    let full = in_full.min(count as u64);
    for i in 0..full {
        of_gaussian.push(center((i / per_bucket) as usize)?);
    }
    let first = in_full.checked_div(per_bucket).unwrap_or(0) as usize;
    for (n, size) in sizes.as_chunks::<4>().0.iter().enumerate() {
        let size = (u32::from_le_bytes(*size) as usize).min(count - of_gaussian.len());
        let center = center(first.checked_add(n)?)?;
        of_gaussian.extend(std::iter::repeat_n(center, size));
    }
    (of_gaussian.len() == count).then_some(of_gaussian)
}

impl Section<'_> {
    fn read_into(&self, gaussians: &mut Gaussians, level: Level) {
        let number = |row: &[u8], n: usize| match level.number {
            4 => float(row, 4 * n),
            _ => half_float([row[2 * n], row[2 * n + 1]]),
        };
        let colors = 10 * level.number;
        let rows: Vec<&[u8]> = self.rows.chunks_exact(self.row).take(self.count).collect();
        gaussians.positions.extend(parallel::map_range(rows.len(), |i| match level.number {
            4 => [0, 1, 2].map(|n| float(rows[i], 4 * n)),
            _ => [0, 1, 2].map(|n| (f32::from(half(rows[i], 2 * n)) - self.range) * self.step + self.centers[i][n]),
        }));
        let log_scale = |row: &&[u8]| [3, 4, 5].map(|n| log_scale_of_deviation(number(row, n)));
        gaussians.log_scales.extend(parallel::map(&rows, log_scale));
        gaussians.rotations.extend(parallel::map(&rows, |row| [6, 7, 8, 9].map(|n| number(row, n))));
        let color = |row: &&[u8]| [0, 1, 2].map(|c| sh_dc_of_color(f32::from(row[colors + c]) / 255.0));
        gaussians.sh_dc.extend(parallel::map(&rows, color));
        gaussians.opacity_logits.extend(parallel::map(&rows, |row| opacity_logit_of_byte(row[colors + 3])));
        let wanted = gaussians.sh_rest_per_channel();
        let harmonic = |row: &[u8], n: usize| {
            let at = colors + 4 + n * level.harmonic;
            let [low, high] = level.harmonics;
            match level.harmonic {
                4 => float(row, at),
                2 => half_float([row[at], row[at + 1]]),
                _ => low + f32::from(row[at]) / 255.0 * (high - low),
            }
        };
        gaussians.sh_rest.extend(parallel::flat_map(&rows, |row| {
            let mut rest = vec![0.0; 3 * wanted];
            let mut n = 0;
            for degree in 1..=self.sh_degree {
                let (before, size) = (degree * degree - 1, 2 * degree + 1);
                for channel in 0..3 {
                    for k in 0..size {
                        rest[channel * wanted + before + k] = harmonic(row, n);
                        n += 1;
                    }
                }
            }
            rest
        }));
    }
}

fn half(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|n| bytes[at + n]))
}

fn float(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(word(bytes, at))
}
