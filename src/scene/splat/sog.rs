//! PlayCanvas' SOG, version 2: pictures with one pixel for each Gaussian, and `meta.json`, which says how to read them;
//! as a bundle (`.sog`, a ZIP archive) or as files in one folder, for which the user names `meta.json`.
//!
//! - `means`: sign(x) ln(1 + |x|) of the centres as 16 bits between `mins` and `maxs`, the low bytes in one picture and
//!   the high ones in another.
//! - `quats`: red, green and blue are three components of a quaternion w x y z from -1 to 1 over sqrt(2); alpha - 252 is
//!   the number of the largest, which is positive.
//! - `scales`: log scales, `sh0`: the constant harmonics, both as indices into a `codebook`; alpha of `sh0`: the
//!   opacity.
//! - `shN`: the number of an entry of the palette (16 bits), and the palette: 64 entries per row, each with as many pixels
//!   as there are coefficients, whose bytes are indices into a codebook.

use std::io::{Cursor, Read};
use std::path::Path;

use image::{ImageReader, RgbaImage};
use serde::Deserialize;
use thiserror::Error;
use zip::ZipArchive;

use super::loaded::{Loaded, drop_unusable};
use super::quantized::{opacity_logit_of_byte, quaternion_of_smallest_three};
use crate::files;
use crate::files::json;
use crate::gaussians::Gaussians;
use crate::parallel;

/// The file that describes the others.
pub const META: &str = "meta.json";
/// No writer packs more Gaussians than this into a byte of the file.
const DENSEST: usize = 32;
/// A picture may have this many times the pixels that its Gaussians need, plus this many, since pictures are
/// rectangles.
const SPARE: (usize, usize) = (4, 1 << 16);
/// Entries of a palette in a row of its picture.
const PER_ROW: usize = 64;
/// Alpha of a quaternion whose first component is the largest.
const FIRST_LARGEST: u8 = 252;

/// An error in a SOG.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("is not a .sog: {0}; export the splat again")]
    NotZip(String),
    #[error("has no {name}; copy or export it again")]
    Missing { name: String },
    #[error("{name} cannot be read ({reason}); copy or export it again")]
    File { name: String, reason: String },
    #[error("its {META} is not SOG's ({0}); export the splat again")]
    Meta(String),
    #[error("is SOG version {version}; gprop reads version 2: convert it with a recent splat-transform")]
    Version { version: u64 },
    #[error("holds no Gaussians; export the splat again")]
    Empty,
    #[error(
        "claims {count} Gaussians, far more than its {size} bytes can hold; the file is damaged, copy or export it again"
    )]
    Count { count: usize, size: usize },
    #[error("{name} is {width} x {height} pixels, which does not fit {count} entries; copy or export it again")]
    Size { name: String, width: u32, height: u32, count: usize },
    #[error("a Gaussian has entry {entry} of {key}, which has {length}; the file is damaged, copy or export it again")]
    Entry { key: &'static str, entry: usize, length: usize },
    #[error("none of the {count} Gaussians has finite values; export the splat again")]
    NothingFinite { count: usize },
}

#[derive(Deserialize)]
struct Meta {
    count: usize,
    #[serde(default)]
    antialias: bool,
    means: Means,
    scales: Coded,
    quats: Pictures,
    sh0: Coded,
    #[serde(rename = "shN")]
    harmonics: Option<Harmonics>,
}

#[derive(Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: [String; 2],
}

#[derive(Deserialize)]
struct Coded {
    codebook: Vec<f32>,
    files: [String; 1],
}

#[derive(Deserialize)]
struct Pictures {
    files: [String; 1],
}

#[derive(Deserialize)]
struct Harmonics {
    bands: u8,
    count: usize,
    codebook: Vec<f32>,
    /// Palette, entries.
    files: [String; 2],
}

impl Meta {
    /// Harmonics beyond the constant one, if there are any.
    fn harmonics(&self) -> Option<&Harmonics> {
        self.harmonics.as_ref().filter(|harmonics| harmonics.bands > 0)
    }

    /// The names of the pictures that are read.
    fn pictures(&self) -> impl Iterator<Item = &String> {
        let own = [&self.scales.files, &self.quats.files, &self.sh0.files].into_iter().flatten();
        let harmonics = self.harmonics().into_iter().flat_map(|harmonics| &harmonics.files);
        own.chain(&self.means.files).chain(harmonics)
    }
}

/// Where the files are.
enum Source<'a> {
    Bundle(ZipArchive<Cursor<&'a [u8]>>, usize),
    Folder(&'a Path),
}

/// Reads a bundle from memory.
///
/// # Errors
/// [`Problem`], which says what is wrong.
pub fn parse(bytes: &[u8]) -> Result<Loaded, Problem> {
    let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| Problem::NotZip(error.to_string()))?;
    read(Source::Bundle(archive, bytes.len()))
}

/// Reads the files beside a `meta.json`.
///
/// # Errors
/// [`Problem`], which says what is wrong.
pub fn read_folder(meta: &Path) -> Result<Loaded, Problem> {
    read(Source::Folder(meta.parent().unwrap_or(Path::new(""))))
}

/// True if a file called `meta.json` is SOG's.
pub fn is_meta(path: &Path) -> bool {
    #[derive(Deserialize)]
    struct Head {
        #[serde(rename = "means")]
        _means: serde_json::Value,
        #[serde(rename = "quats")]
        _quats: serde_json::Value,
    }
    files::read(path).is_ok_and(|bytes| json::read::<Head>(&bytes).is_ok())
}

fn read(mut source: Source) -> Result<Loaded, Problem> {
    let bytes = source.file(META)?;
    let value: serde_json::Value = files::json::parse(&bytes).map_err(|problem| Problem::Meta(problem.to_string()))?;
    match value.get("version").map(|version| version.as_u64().unwrap_or(0)) {
        Some(2) => {}
        version => return Err(Problem::Version { version: version.unwrap_or(1) }),
    }
    let meta: Meta = serde_json::from_value(value).map_err(|error| Problem::Meta(error.to_string()))?;
    let count = meta.count;
    if count == 0 {
        return Err(Problem::Empty);
    }
    if let Source::Bundle(_, size) = source
        && count / DENSEST > size
    {
        return Err(Problem::Count { count, size });
    }
    let [low, high] = [&meta.means.files[0], &meta.means.files[1]].map(|name| source.picture(name, count));
    let (low, high) = (low?, high?);
    let (quats, scales) = (source.picture(&meta.quats.files[0], count)?, source.picture(&meta.scales.files[0], count)?);
    let colors = source.picture(&meta.sh0.files[0], count)?;
    let (low, high) = (pixels(&low, count), pixels(&high, count));
    let position = |i: usize| -> [f32; 3] {
        std::array::from_fn(|axis| {
            let (least, most) = (meta.means.mins[axis], meta.means.maxs[axis]);
            let share = f64::from(u16::from_le_bytes([low[i][axis], high[i][axis]])) / 65535.0;
            let value: f64 = least + (most - least) * share;
            (value.abs().exp_m1() * value.signum()) as f32
        })
    };
    let mut gaussians = Gaussians {
        positions: parallel::map_range(count, position),
        log_scales: coded(pixels(&scales, count), &meta.scales.codebook, "the codebook of scales")?,
        rotations: parallel::map(pixels(&quats, count), quaternion),
        sh_dc: coded(pixels(&colors, count), &meta.sh0.codebook, "the codebook of colours")?,
        opacity_logits: parallel::map(pixels(&colors, count), |pixel| opacity_logit_of_byte(pixel[3])),
        antialiased: meta.antialias,
        ..Gaussians::default()
    };
    if let Some(harmonics) = meta.harmonics() {
        gaussians.sh_degree = harmonics.bands;
        gaussians.sh_rest = rest(&mut source, harmonics, count)?;
    }
    let dropped = drop_unusable(&mut gaussians).map_err(|_| Problem::NothingFinite { count })?;
    let notes = vec!["SOG version 2".to_owned()];
    let files = match source {
        Source::Folder(folder) => meta.pictures().map(|name| folder.join(name)).collect(),
        Source::Bundle(..) => Vec::new(),
    };
    Ok(Loaded { gaussians, notes, warnings: dropped.into_iter().collect(), files })
}

/// The spherical harmonics beyond the constant one, channel-major.
fn rest(source: &mut Source, harmonics: &Harmonics, count: usize) -> Result<Vec<f32>, Problem> {
    let bands = usize::from(harmonics.bands) + 1;
    if bands > 4 {
        return Err(Problem::Meta(format!("spherical harmonics of degree {}; gprop reads 0 to 3", bands - 1)));
    }
    let coefficients = bands * bands - 1;
    let [palette, entries] = &harmonics.files;
    // A palette has at most 2^16 entries.
    let most = harmonics.count.min(1 << 16);
    let entries = source.picture(entries, count)?;
    let palette_picture = source.picture(palette, most * coefficients)?;
    let width = PER_ROW * coefficients;
    if palette_picture.width() as usize != width || (palette_picture.height() as usize) < most.div_ceil(PER_ROW) {
        let (width, height) = palette_picture.dimensions();
        return Err(Problem::Size { name: palette.clone(), width, height, count: most });
    }
    let all = palette_picture.as_raw().as_chunks::<4>().0;
    let fill = |row: &mut [f32], pixel: &[u8; 4]| -> Result<(), Problem> {
        let entry = usize::from(u16::from_le_bytes([pixel[0], pixel[1]]));
        if entry >= most {
            return Err(Problem::Entry { key: "the palette of harmonics", entry, length: most });
        }
        let first = entry / PER_ROW * width + entry % PER_ROW * coefficients;
        let own = &all[first..first + coefficients];
        let bytes = (0..3).flat_map(|channel| own.iter().map(move |pixel| pixel[channel]));
        for (value, byte) in row.iter_mut().zip(bytes) {
            *value = code(byte, &harmonics.codebook, "the codebook of harmonics")?;
        }
        Ok(())
    };
    let mut rest = vec![0.0; count * 3 * coefficients];
    let entries = pixels(&entries, count);
    let filled = parallel::map_chunks_mut(&mut rest, 3 * coefficients, |n, row| fill(row, &entries[n]));
    filled.into_iter().collect::<Result<(), Problem>>()?;
    Ok(rest)
}

fn pixels(picture: &RgbaImage, count: usize) -> &[[u8; 4]] {
    &picture.as_raw().as_chunks::<4>().0[..count]
}

fn code(byte: u8, codebook: &[f32], key: &'static str) -> Result<f32, Problem> {
    let entry = usize::from(byte);
    codebook.get(entry).copied().ok_or(Problem::Entry { key, entry, length: codebook.len() })
}

/// Red, green and blue as indices into a codebook.
fn coded(pixels: &[[u8; 4]], codebook: &[f32], key: &'static str) -> Result<Vec<[f32; 3]>, Problem> {
    let values = |pixel: &[u8; 4]| {
        Ok([code(pixel[0], codebook, key)?, code(pixel[1], codebook, key)?, code(pixel[2], codebook, key)?])
    };
    parallel::try_map(pixels, values)
}

/// A quaternion w x y z; the identity if no component is marked as the largest.
fn quaternion(pixel: &[u8; 4]) -> [f32; 4] {
    let Some(largest) = pixel[3].checked_sub(FIRST_LARGEST) else { return [1.0, 0.0, 0.0, 0.0] };
    let others = [pixel[0], pixel[1], pixel[2]];
    let signed = |byte: u8| (f32::from(byte) / 255.0 * 2.0 - 1.0) * std::f32::consts::FRAC_1_SQRT_2;
    quaternion_of_smallest_three(usize::from(largest), others.map(signed))
}

impl Source<'_> {
    /// The bytes of one of its files.
    fn file(&mut self, name: &str) -> Result<Vec<u8>, Problem> {
        // A plain name: nothing outside the folder.
        if name.is_empty() || name.contains(['/', '\\']) || name == ".." {
            return Err(Problem::Meta(format!("{name:?} is not the name of a file beside it")));
        }
        let failed = |reason: String| Problem::File { name: name.to_owned(), reason };
        match self {
            Self::Folder(folder) => {
                let path = folder.join(name);
                if std::fs::symlink_metadata(&path).is_ok_and(|found| found.is_symlink()) {
                    return Err(failed("it is a link".to_owned()));
                }
                files::read(&path).map_err(|error| failed(error.to_string()))
            }
            Self::Bundle(archive, size) => {
                let file = archive.by_name(name).map_err(|_| Problem::Missing { name: name.to_owned() })?;
                // Pictures are compressed already; a meta.json has a few codebooks.
                let most = 16 * *size as u64 + (1 << 20);
                let mut bytes = Vec::new();
                file.take(most + 1).read_to_end(&mut bytes).map_err(|error| failed(error.to_string()))?;
                if bytes.len() as u64 > most {
                    return Err(failed("it is far larger than the bundle".to_owned()));
                }
                Ok(bytes)
            }
        }
    }

    /// A picture with at least `count` pixels.
    fn picture(&mut self, name: &str, count: usize) -> Result<RgbaImage, Problem> {
        let bytes = self.file(name)?;
        let failed = |reason: String| Problem::File { name: name.to_owned(), reason };
        let reader = || ImageReader::new(files::picture_of(&bytes)).with_guessed_format();
        let (width, height) = reader()
            .map_err(|error| failed(error.to_string()))?
            .into_dimensions()
            .map_err(|error| failed(error.to_string()))?;
        let area = width as usize * height as usize;
        if area < count || area > SPARE.0.saturating_mul(count).saturating_add(SPARE.1) {
            return Err(Problem::Size { name: name.to_owned(), width, height, count });
        }
        if count / DENSEST > bytes.len() {
            return Err(Problem::Count { count, size: bytes.len() });
        }
        let decoded = reader().map_err(|error| failed(error.to_string()))?.decode();
        Ok(decoded.map_err(|error| failed(error.to_string()))?.into_rgba8())
    }
}
