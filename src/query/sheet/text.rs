//! Labels in the public domain's 8x8 bitmap font: no font file, the same pixels everywhere.

use font8x8::legacy::BASIC_LEGACY;
use image::{Rgb, RgbImage};

const GLYPH: u32 = 8;
/// Blank rows above and below a line, in font pixels.
const LEADING: u32 = 2;
const INK: Rgb<u8> = Rgb([20, 20, 20]);

/// Height of a line in pixels if every font pixel is `scale` pixels.
pub fn height(scale: u32) -> u32 {
    (GLYPH + 2 * LEADING) * scale
}

/// Width of a line in pixels.
pub fn width(line: &str, scale: u32) -> u32 {
    GLYPH * scale * line.chars().count() as u32
}

/// Writes `line`, which is ASCII, with its upper left corner at `at`; what lies outside the picture is clipped.
pub fn write(picture: &mut RgbImage, line: &str, at: (u32, u32), scale: u32) {
    for (index, character) in (0..).zip(line.chars()) {
        let Some(glyph) = BASIC_LEGACY.get(character as usize) else { continue };
        for y in 0..GLYPH * scale {
            for x in 0..GLYPH * scale {
                let inked = glyph[(y / scale) as usize] >> (x / scale) & 1 == 1;
                let (px, py) = (at.0 + index * GLYPH * scale + x, at.1 + LEADING * scale + y);
                if inked && px < picture.width() && py < picture.height() {
                    picture.put_pixel(px, py, INK);
                }
            }
        }
    }
}
