//! Pictures side by side on a white background with a legend below.

use image::imageops::{self, FilterType};
use image::{GenericImage, Rgb, RgbImage};

use super::palette;
use crate::query::sheet::text;

const PAPER: Rgb<u8> = Rgb([255; 3]);
/// Longest side of a panel in pixels; a larger picture is shrunk.
const LONGEST_SIDE: u32 = 1024;
/// Space between and around the panels and the legend's lines.
const GAP: u32 = 12;
const TEXT_SCALE: u32 = 2;

/// A line of the legend.
pub struct Entry {
    pub text: String,
    pub color: Rgb<u8>,
}

/// Colour `n` of the palette.
pub fn color(n: u32) -> Rgb<u8> {
    Rgb(palette::color(n).map(|channel| (255.0 * channel).round() as u8))
}

/// The panels, all of the same size, from left to right, and the legend.
pub fn compose(panels: &[RgbImage], legend: &[Entry]) -> RgbImage {
    let panels: Vec<RgbImage> = panels.iter().map(fitted).collect();
    let (width, height) = panels.first().map_or((0, 0), RgbImage::dimensions);
    let line_height = text::height(TEXT_SCALE);
    let swatch = line_height + GAP;
    let widest = legend.iter().map(|entry| text::width(&entry.text, TEXT_SCALE)).max().unwrap_or(0) + swatch;
    let count = panels.len() as u32;
    let legend_top = height + 2 * GAP;
    let size = (
        (count * width + (count + 1) * GAP).max(widest + 2 * GAP),
        legend_top + legend.len() as u32 * (line_height + GAP / 2) + GAP,
    );
    let mut sheet = RgbImage::from_pixel(size.0, size.1, PAPER);
    for (n, panel) in (0..).zip(&panels) {
        sheet.copy_from(panel, GAP + n * (width + GAP), GAP).expect("the sheet was made for its panels");
    }
    for (row, entry) in (0..).zip(legend) {
        let y = legend_top + row * (line_height + GAP / 2);
        let square = RgbImage::from_pixel(line_height, line_height, entry.color);
        sheet.copy_from(&square, GAP, y).expect("the sheet was made for its legend");
        text::write(&mut sheet, &entry.text, (GAP + swatch, y), TEXT_SCALE);
    }
    sheet
}

fn fitted(picture: &RgbImage) -> RgbImage {
    let longest = picture.width().max(picture.height());
    if longest <= LONGEST_SIDE {
        return picture.clone();
    }
    let side = |length: u32| (u64::from(length) * u64::from(LONGEST_SIDE) / u64::from(longest)).max(1) as u32;
    imageops::resize(picture, side(picture.width()), side(picture.height()), FilterType::Triangle)
}
