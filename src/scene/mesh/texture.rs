//! Textures: encoded pictures, decoded on demand, and how their coordinates repeat.

use std::io::Cursor;
use std::path::PathBuf;
use std::sync::Arc;

use image::{ImageDecoder, ImageError, ImageFormat, ImageReader, RgbaImage};

use super::Problem;
use crate::files::{self, PictureSource};
use crate::numeric;

/// The most pixels of all textures of a mesh together: four of 8192 x 8192, a GiB once decoded.
pub const MOST_TEXTURE_PIXELS: u64 = 1 << 28;

/// An encoded picture of a mesh: PNG, JPEG, WebP, BMP, GIF or TIFF.
#[derive(Debug, Clone)]
pub struct Picture {
    pub(super) source: Source,
    /// Where the file has it, for messages.
    pub(super) place: String,
}

/// Where the bytes of a picture are.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Source {
    Bytes(Arc<[u8]>),
    File(PathBuf),
}

/// An encoded picture.
#[derive(Debug, Clone)]
pub struct Encoded {
    pub bytes: Vec<u8>,
    /// Its MIME type.
    pub kind: &'static str,
}

/// How a texture goes on beyond the picture's border.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrapping {
    #[default]
    Repeat,
    MirroredRepeat,
    ClampToEdge,
}

impl Wrapping {
    /// The index of the texel `index`, which may lie outside, in a picture with `count` texels on this side.
    pub fn texel(self, index: i64, count: u32) -> u32 {
        let count = i64::from(count);
        let inside = match self {
            Self::Repeat => index.rem_euclid(count),
            Self::ClampToEdge => index.clamp(0, count - 1),
            Self::MirroredRepeat => {
                let twice = index.rem_euclid(2 * count);
                twice.min(2 * count - 1 - twice)
            }
        };
        inside as u32
    }
}

impl Picture {
    /// Decodes the picture to 8 bits per channel, with straight alpha, in its own sRGB values.
    ///
    /// # Errors
    /// [`Problem`] if the bytes are not a whole picture.
    pub fn decode(&self) -> Result<RgbaImage, Problem> {
        let picture = self.reader().and_then(ImageReader::decode);
        Ok(picture.map_err(|reason| self.undecodable(reason))?.into_rgba8())
    }

    /// The picture in a format that every reader of glTF knows: as it is if it is a PNG or a JPEG, else as a PNG.
    ///
    /// # Errors
    /// [`Problem`] if the bytes are not a picture.
    pub fn encoded_for_gltf(&self) -> Result<Encoded, Problem> {
        let undecodable = |error| self.undecodable(ImageError::IoError(error));
        let kind = match self.reader().map_err(|reason| self.undecodable(reason))?.format() {
            Some(ImageFormat::Png) => Some("image/png"),
            Some(ImageFormat::Jpeg) => Some("image/jpeg"),
            _ => None,
        };
        if let Some(kind) = kind {
            let bytes = match &self.source {
                Source::Bytes(bytes) => bytes.to_vec(),
                Source::File(path) => files::read(path).map_err(undecodable)?,
            };
            return Ok(Encoded { bytes, kind });
        }
        let mut bytes = Vec::new();
        let written = self.decode()?.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png);
        written.map_err(|reason| self.undecodable(reason))?;
        Ok(Encoded { bytes, kind: "image/png" })
    }

    /// Width and height, from the header.
    fn size(&self) -> Result<(u32, u32), Problem> {
        let decoder = self.reader().and_then(ImageReader::into_decoder);
        Ok(decoder.map_err(|reason| self.undecodable(reason))?.dimensions())
    }

    /// A reader of the format that the first bytes tell, whatever the file's name.
    fn reader(&self) -> Result<ImageReader<PictureSource<'_>>, ImageError> {
        let source = match &self.source {
            Source::Bytes(bytes) => files::picture_of(bytes),
            Source::File(path) => files::picture(path).map_err(ImageError::IoError)?,
        };
        ImageReader::new(source).with_guessed_format().map_err(ImageError::IoError)
    }

    fn undecodable(&self, reason: ImageError) -> Problem {
        Problem::Undecodable { place: self.place.clone(), reason }
    }
}

/// Refuses pictures that are not pictures, or larger together than [`MOST_TEXTURE_PIXELS`], without decoding them.
pub(super) fn check_pictures(pictures: &[Picture]) -> Result<(), Problem> {
    let mut pixels = 0;
    for picture in pictures {
        let size = picture.size()?;
        pixels += u64::from(size.0) * u64::from(size.1);
        if size.0 == 0 || size.1 == 0 || pixels > MOST_TEXTURE_PIXELS {
            return Err(Problem::TextureTooLarge { place: picture.place.clone(), size, most: MOST_TEXTURE_PIXELS });
        }
    }
    Ok(())
}

/// Linear light of an sRGB value from 0 to 1 (IEC 61966-2-1).
pub(super) fn linear(srgb: f64) -> f32 {
    numeric::linear(srgb.clamp(0.0, 1.0)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_go_on_beyond_their_border() {
        let row = |wrapping: Wrapping| (-4..8).map(|i| wrapping.texel(i, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrapping::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]);
        assert_eq!(row(Wrapping::ClampToEdge), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
        assert_eq!(row(Wrapping::MirroredRepeat), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
    }
}
