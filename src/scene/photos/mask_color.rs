//! The colours that a mask has on the object. White is usual, but masks of trackers, annotation tools and other programs are
//! black there, have a number or a colour for each object, or are red.

use std::fmt;
use std::str::FromStr;

use image::{Pixel, Rgb};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::config::as_typed::as_typed;

/// Differences of a channel that lossy compression makes.
const NOISE: u8 = 24;
/// The largest difference of a channel from a given colour in a lossy mask.
const NEAR: u8 = 48;

/// A colour as stored, in 8 bits; the number of an object is a grey.
pub type Color = [u8; 3];

/// Which of a mask's values are the object's.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum MaskColor {
    /// Light ones, from one half; in between, the value is the share of the pixel that the object covers.
    #[default]
    White,
    /// Dark ones, likewise.
    Black,
    /// All but black.
    NotBlack,
    /// These, in this order.
    Colors(Vec<Color>),
}

impl MaskColor {
    /// The share of a pixel of this colour that the object covers, 0 to 255.
    pub(super) fn share(&self, color: Color, is_lossy: bool) -> u8 {
        match self {
            Self::White => luma(color),
            Self::Black => 255 - luma(color),
            Self::NotBlack | Self::Colors(_) => 255 * u8::from(self.is_object(color, is_lossy)),
        }
    }

    /// Whether a pixel of this colour belongs to the object.
    pub(super) fn is_object(&self, color: Color, is_lossy: bool) -> bool {
        let most_off = if is_lossy { NEAR } else { 0 };
        let is_near = |other: &Color| color.iter().zip(other).all(|(a, b)| a.abs_diff(*b) <= most_off);
        match self {
            Self::White => luma(color) >= 128,
            Self::Black => luma(color) < 128,
            Self::NotBlack => color.iter().any(|channel| *channel > if is_lossy { NOISE } else { 0 }),
            Self::Colors(colors) => colors.iter().any(is_near),
        }
    }
}

/// The brightness of a colour, as the `image` crate computes it for sRGB.
fn luma(color: Color) -> u8 {
    Rgb(color).to_luma()[0]
}

/// True for greys, apart from the noise of lossy compression.
pub(super) fn is_grey(color: Color, is_lossy: bool) -> bool {
    let (low, high) = (color.iter().min(), color.iter().max());
    let spread = high.zip(low).map_or(0, |(high, low)| high - low);
    spread <= if is_lossy { NOISE } else { 0 }
}

/// As it is written in notes.
pub(super) fn in_words(color: &MaskColor) -> String {
    match color {
        MaskColor::White => "white on the object".to_owned(),
        MaskColor::Black => "black on the object".to_owned(),
        MaskColor::NotBlack => "black beside the object and not on it".to_owned(),
        MaskColor::Colors(_) => format!("with the object's colour {color}"),
    }
}

/// Colours as [`MaskColor`]'s option takes them: a grey is a number, any other colour `#rrggbb`.
fn written(color: &Color) -> String {
    match color {
        [r, g, b] if r == g && g == b => r.to_string(),
        [r, g, b] => format!("#{r:02x}{g:02x}{b:02x}"),
    }
}

impl fmt::Display for MaskColor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::White => f.write_str("white"),
            Self::Black => f.write_str("black"),
            Self::NotBlack => f.write_str("not-black"),
            Self::Colors(colors) => f.write_str(&colors.iter().map(written).collect::<Vec<_>>().join(",")),
        }
    }
}

impl Serialize for MaskColor {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// `--mask-color`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum MaskChoice {
    /// The splat and the photos decide.
    #[default]
    Auto,
    Given(MaskColor),
}

impl FromStr for MaskChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(Self::Given(match text.trim() {
            "auto" => return Ok(Self::Auto),
            "white" => MaskColor::White,
            "black" => MaskColor::Black,
            "not-black" => MaskColor::NotBlack,
            colors => {
                let colors: Option<Vec<Color>> = colors.split(',').map(|color| parsed(color.trim())).collect();
                MaskColor::Colors(colors.ok_or(
                    "give auto, white, black, not-black, or colours separated by commas: each a number from 0 to 255, or \
                     such as #ff0000",
                )?)
            }
        }))
    }
}

/// A colour as [`written`] writes it.
fn parsed(text: &str) -> Option<Color> {
    let Some(digits) = text.strip_prefix('#') else { return text.parse().ok().map(|id: u8| [id; 3]) };
    let is_hexadecimal = digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let [_, r, g, b] = u32::from_str_radix(digits, 16).ok().filter(|_| is_hexadecimal)?.to_be_bytes();
    Some([r, g, b])
}

impl fmt::Display for MaskChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Given(color) => color.fmt(f),
        }
    }
}

/// Serialized in the form that users type.
impl Serialize for MaskChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for MaskChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        as_typed(deserializer)
    }
}
