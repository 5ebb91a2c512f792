//! Lettering on pictures: Inter in two weights, anti-aliased.
//!
//! The files are the Latin subset of Inter 4 (version 5.3.0 of the package `@fontsource/inter`) without layout tables
//! and hints, as TrueType; their licence is `OFL.txt`. Outlines are rasterised with IEEE arithmetic alone, so the same
//! text gives the same pixels on every processor.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use image::{Rgb, RgbImage};

static REGULAR: LazyLock<FontRef<'static>> = LazyLock::new(|| built_in(include_bytes!("inter-regular.ttf")));
static SEMIBOLD: LazyLock<FontRef<'static>> = LazyLock::new(|| built_in(include_bytes!("inter-semibold.ttf")));

/// Nearly black.
pub const INK: Rgb<u8> = Rgb([27, 29, 32]);

fn built_in(bytes: &'static [u8]) -> FontRef<'static> {
    FontRef::try_from_slice(bytes).expect("the font in the binary is whole")
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weight {
    Regular,
    SemiBold,
}

/// How a line is written.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    pub weight: Weight,
    /// Size of the type (the em) in pixels.
    pub px: u32,
    pub ink: Rgb<u8>,
}

impl Style {
    pub fn regular(px: u32) -> Self {
        Self { weight: Weight::Regular, px, ink: INK }
    }

    pub fn semibold(px: u32) -> Self {
        Self { weight: Weight::SemiBold, ..Self::regular(px) }
    }

    pub fn inked(self, ink: Rgb<u8>) -> Self {
        Self { ink, ..self }
    }

    /// Height of a line in pixels, with the space between lines.
    pub fn height(self) -> u32 {
        (self.px * 13).div_ceil(10)
    }

    /// Width of a line in pixels.
    pub fn width(self, line: &str) -> u32 {
        let font = self.font().as_scaled(self.scale());
        line.chars().map(|character| font.h_advance(font.glyph_id(character))).sum::<f32>().ceil() as u32
    }

    /// Writes `line` with the upper left corner of its [`height`](Self::height) at `at`; what lies outside the picture
    /// is clipped. A character that the font lacks becomes an empty box.
    pub fn write(self, picture: &mut RgbImage, line: &str, at: (i32, i32)) {
        let font = self.font().as_scaled(self.scale());
        let middle = at.1 as f32 + 0.5 * self.height() as f32;
        let baseline = (middle + 0.5 * (font.ascent() + font.descent())).round();
        let mut x = at.0 as f32;
        for character in line.chars() {
            let glyph = font.glyph_id(character).with_scale_and_position(self.scale(), point(x, baseline));
            x += font.h_advance(glyph.id);
            let Some(outline) = font.outline_glyph(glyph) else { continue };
            let corner = outline.px_bounds().min;
            outline.draw(|dx, dy, coverage| {
                blend(picture, corner.x as i64 + i64::from(dx), corner.y as i64 + i64::from(dy), self.ink, coverage);
            });
        }
    }

    /// `line`, or as much of it as fits into `width` pixels, with an ellipsis.
    pub fn fitted(self, line: &str, width: u32) -> String {
        let font = self.font().as_scaled(self.scale());
        let advance = |character| font.h_advance(font.glyph_id(character));
        let fits = |length: f32| length.ceil() as u32 <= width;
        let ellipsis = advance('…');
        let mut length = 0.0_f32;
        // End of the longest prefix that fits together with an ellipsis and does not end in a space.
        let mut end = fits(ellipsis).then_some(0);
        for (start, character) in line.char_indices() {
            length += advance(character);
            if !fits(length) {
                return end.map_or_else(String::new, |end| format!("{}…", &line[..end]));
            }
            if !character.is_whitespace() && fits(length + ellipsis) {
                end = Some(start + character.len_utf8());
            }
        }
        line.to_owned()
    }

    /// `text` broken at spaces into lines of at most `width` pixels; a longer word has a line of its own.
    pub fn wrapped(self, text: &str, width: u32) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            match lines.last_mut() {
                Some(line) if self.width(&format!("{line} {word}")) <= width => *line = format!("{line} {word}"),
                _ => lines.push(word.to_owned()),
            }
        }
        lines
    }

    fn font(self) -> &'static FontRef<'static> {
        match self.weight {
            Weight::Regular => &REGULAR,
            Weight::SemiBold => &SEMIBOLD,
        }
    }

    /// The library scales by the font's height instead of its em.
    fn scale(self) -> PxScale {
        let font = self.font();
        PxScale::from(self.px as f32 * font.height_unscaled() / font.units_per_em().expect("Inter has an em"))
    }
}

/// Covers a pixel with the share `coverage` (0 to 1) of `color`; pixels outside the picture are ignored.
pub fn blend(picture: &mut RgbImage, x: i64, y: i64, color: Rgb<u8>, coverage: f32) {
    let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
    if let Some(pixel) = picture.get_pixel_mut_checked(x, y) {
        let share = coverage.clamp(0.0, 1.0);
        let mixed = |c: usize| f32::from(pixel[c]) * (1.0 - share) + f32::from(color[c]) * share;
        *pixel = Rgb([mixed(0), mixed(1), mixed(2)].map(|value| value.round() as u8));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inked(line: &str, style: Style) -> (RgbImage, Vec<(u32, u32)>) {
        let mut picture = RgbImage::from_pixel(400, 60, Rgb([255; 3]));
        style.write(&mut picture, line, (10, 10));
        let dark = picture.enumerate_pixels().filter(|(_, _, p)| p[0] < 128).map(|(x, y, _)| (x, y)).collect();
        (picture, dark)
    }

    #[test]
    fn a_line_fills_its_width_and_height_and_has_soft_edges() {
        for style in [Style::regular(30), Style::semibold(30)] {
            let (picture, dark) = inked("Hammer, 10 cm", style);
            let right = dark.iter().map(|(x, _)| *x).max().unwrap();
            let (top, bottom) =
                (dark.iter().map(|(_, y)| *y).min().unwrap(), dark.iter().map(|(_, y)| *y).max().unwrap());
            let width = style.width("Hammer, 10 cm");
            assert!((10 + width - 5..10 + width).contains(&right), "{right} of {width}");
            assert!(top >= 10 && bottom < 10 + style.height(), "{top} to {bottom}");
            // The height of Inter's capitals is 0.727 em; the comma hangs below.
            assert!((20..32).contains(&(bottom - top)), "{top} to {bottom}");
            assert!(picture.pixels().any(|p| (60..200).contains(&p[0])), "no pixel is half covered");
        }
        assert!(inked("Hammer", Style::semibold(30)).1.len() > inked("Hammer", Style::regular(30)).1.len());
    }

    #[test]
    fn every_sign_that_gprop_writes_is_in_the_font() {
        for font in [&*REGULAR, &*SEMIBOLD] {
            for sign in (' '..='~').chain("äöüßéñçøåÄÖÜ°±²³µ·×÷–—‘’“”•…−".chars())
            {
                assert_ne!(font.glyph_id(sign).0, 0, "{sign:?} is missing");
            }
        }
    }

    #[test]
    fn text_outside_the_picture_and_signs_that_the_font_lacks_do_no_harm() {
        let mut picture = RgbImage::new(4, 4);
        for at in [(-50, -50), (100, 100), (-3, 2)] {
            Style::regular(20).write(&mut picture, "槌 hammer", at);
        }
        assert!(Style::regular(20).width("槌") > 0);
    }

    #[test]
    fn lines_are_cut_and_wrapped_to_their_width() {
        let style = Style::regular(20);
        let (text, room) = ("a long caption of a part that does not fit", 150);
        let cut = style.fitted(text, room);
        assert!(cut.ends_with('…') && style.width(&cut) <= room && style.width(&cut) > room / 2, "{cut}");
        assert_eq!(style.fitted("short", room), "short");
        // This takes hours if the line is measured once for each of its characters.
        assert_eq!(style.fitted(&text.repeat(50_000), room), cut);
        for room in 0..style.width("a b ") {
            let fits = |end: usize| style.width(&format!("{}…", "a b "[..end].trim_end())) <= room;
            let longest = (0..4).rev().find(|&end| fits(end)).map(|end| format!("{}…", "a b "[..end].trim_end()));
            assert_eq!(style.fitted("a b ", room), longest.unwrap_or_default(), "{room}");
        }
        let lines = style.wrapped(text, room);
        assert!(lines.len() > 1 && lines.iter().all(|line| style.width(line) <= room), "{lines:?}");
        assert_eq!(lines.join(" "), text);
    }
}
