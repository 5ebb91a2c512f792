//! Films: pictures of one size, shown at a constant rate, as MP4 through ffmpeg or as GIF.
//!
//! MP4 is small and exact, but needs ffmpeg. Without it a film is a GIF: gprop can write it alone, every browser and
//! every page shows it, and with one palette for the whole film and a dither that stands still it looks nearly as good.
//! (For WebP, the pure Rust encoders write only lossless pictures, several times as large.) [`orbit`] has cameras that
//! see all of a moving object, [`gif`] and [`mp4`] the two formats.

pub mod gif;
pub mod mp4;
pub mod orbit;

use std::fmt;
use std::io;
use std::path::Path;
use std::str::FromStr;

use image::RgbImage;

use serde::{Serialize, Serializer};

use crate::config::option_values::{Domain, OptionError, check_typed, from_to};
use gif::Gif;
use mp4::Mp4;

/// Sides of a film in pixels: from what is still recognisable to 4K. Even, as video encoders require.
const SHORTEST_SIDE: u32 = 64;
const LONGEST_SIDE: u32 = 4096;

const FPS: Domain<u32> = from_to(1, 60);

/// Pictures from which the palette of a GIF is learned.
pub const GIF_SAMPLES: usize = 4;

/// Size and rate of a film.
#[derive(Debug, Clone, Copy, PartialEq, clap::Args, Serialize)]
pub struct Options {
    /// Size of the film in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value_t = Self::default().size)]
    pub size: Size,

    /// Pictures per second of the film
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = FPS)]
    pub fps: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { size: Size { width: 1280, height: 720 }, fps: 24 }
    }
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        check_typed("--size", &self.size)?;
        FPS.check("--fps", self.fps)
    }
}

/// Why there is no film.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    #[error("an MP4 needs ffmpeg, which is not installed: install it, or write a .gif")]
    NoFfmpeg,
    #[error("ffmpeg failed, most likely because it was built without H.264: {0}")]
    Ffmpeg(io::Error),
    #[error("the GIF could not be encoded: {0}")]
    Gif(#[from] ::gif::EncodingError),
}

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    Gif,
    Mp4,
}

impl Format {
    /// The format that a file's ending names; `None` if it is not that of a film.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "gif" => Some(Self::Gif),
            "mp4" => Some(Self::Mp4),
            _ => None,
        }
    }

    /// A film of `count` pictures, at least one.
    ///
    /// # Errors
    /// [`FilmError`].
    pub fn encode(
        self,
        fps: u32,
        count: usize,
        mut picture: impl FnMut(usize) -> RgbImage,
    ) -> Result<Vec<u8>, FilmError> {
        match self {
            Self::Gif => {
                let samples: Vec<RgbImage> = (0..GIF_SAMPLES).map(|n| picture(n * (count - 1) / GIF_SAMPLES)).collect();
                let mut film = Gif::new(fps, &samples)?.in_a_circle();
                for index in 0..count {
                    film.add(&picture(index))?;
                }
                Ok(film.finish()?)
            }
            Self::Mp4 => {
                let first = picture(0);
                let started = Mp4::start(first.dimensions(), fps).map_err(FilmError::Ffmpeg)?;
                let mut film = started.ok_or(FilmError::NoFfmpeg)?;
                film.add(&first).map_err(FilmError::Ffmpeg)?;
                for index in 1..count {
                    film.add(&picture(index)).map_err(FilmError::Ffmpeg)?;
                }
                film.finish().map_err(FilmError::Ffmpeg)
            }
        }
    }
}

/// Width and height of a film in pixels, both even.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    pub width: u32,
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    /// `WIDTHxHEIGHT`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let sides = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
        let fits = |side: u32| (SHORTEST_SIDE..=LONGEST_SIDE).contains(&side) && side.is_multiple_of(2);
        match sides {
            Some([width, height]) if fits(width) && fits(height) => Ok(Self { width, height }),
            _ => Err(format!(
                "a size is WIDTHxHEIGHT in pixels, such as 1280x720: two even numbers from {SHORTEST_SIDE} to {LONGEST_SIDE}"
            )),
        }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl Serialize for Size {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_two_even_numbers_of_pixels() {
        assert_eq!("1280x720".parse(), Ok(Size { width: 1280, height: 720 }));
        assert_eq!(Options::default().size.to_string().parse(), Ok(Options::default().size));
        for bad in ["", "1280", "x", "1280x721", "0x0", "62x64", "5000x720", "-2x64", "1280X720", "1280x720x2"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
    }
}
