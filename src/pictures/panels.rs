//! Pictures side by side on a white background, each with its title above and its legend below.

use image::imageops::{self, FilterType};
use image::{GenericImage, Rgb, RgbImage};
use nalgebra::Point2;

use super::{palette, strokes};
use crate::lettering::Style;

const PAPER: Rgb<u8> = Rgb([255; 3]);
/// Longest side of a panel in pixels; a larger picture is shrunk.
const LONGEST_SIDE: u32 = 1024;
/// A panel is as wide as its legend, up to this width, even if its picture is narrower.
const WIDEST_LEGEND: u32 = 640;
/// Space between and around the panels.
const GAP: u32 = 24;
/// Width of the scale of colours, in multiples of its height.
const SCALE_SIDES: u32 = 5;
const TITLE_PX: u32 = 24;
const TEXT_PX: u32 = 20;

/// A picture with its title and legend.
pub struct Panel {
    pub title: String,
    pub picture: RgbImage,
    pub legend: Vec<Entry>,
}

/// A line of a legend.
pub struct Entry {
    pub text: String,
    pub key: Key,
}

/// The symbol before a line of a legend.
pub enum Key {
    /// A colour.
    Square(Rgb<u8>),
    /// A colour and the number in the picture.
    Number(Rgb<u8>, u32),
    /// The scale of colours for numbers, from low to high.
    Scale,
    None,
}

impl Panel {
    pub fn new(title: &str, picture: RgbImage) -> Self {
        Self { title: title.to_owned(), picture, legend: Vec::new() }
    }

    pub fn with_legend(self, legend: Vec<Entry>) -> Self {
        Self { legend, ..self }
    }
}

/// The panels from left to right.
pub fn compose(panels: &[Panel]) -> RgbImage {
    let (title, text) = (Style::semibold(TITLE_PX), Style::regular(TEXT_PX));
    let pictures: Vec<RgbImage> = panels.iter().map(|panel| fitted(&panel.picture)).collect();
    let legend_width = |panel: &Panel| {
        let entries = panel.legend.iter().map(|entry| entry_width(entry, TEXT_PX));
        entries.chain([title.width(&panel.title)]).max().unwrap_or(0).min(WIDEST_LEGEND)
    };
    let widths = panels.iter().zip(&pictures).map(|(panel, picture)| picture.width().max(legend_width(panel)));
    let widths: Vec<u32> = widths.collect();
    let tallest = pictures.iter().map(RgbImage::height).max().unwrap_or(0);
    let lines = panels.iter().map(|panel| panel.legend.len()).max().unwrap_or(0) as u32;
    let legend_top = 2 * GAP + title.height() + tallest;
    let line_height = text.height() + 6;
    let width = widths.iter().map(|width| width + GAP).sum::<u32>() + GAP;
    let height = legend_top + if lines > 0 { lines * line_height + GAP } else { 0 };
    let mut sheet = RgbImage::from_pixel(width, height, PAPER);
    let mut x = GAP;
    for ((panel, picture), width) in panels.iter().zip(&pictures).zip(&widths) {
        let titled = title.fitted(&panel.title, *width);
        title.write(&mut sheet, &titled, (x as i32, (GAP / 2) as i32));
        let left = x + (width - picture.width()) / 2;
        let top = GAP + title.height() + (tallest - picture.height()) / 2;
        sheet.copy_from(picture, left, top).expect("the sheet was made for its panels");
        for (row, entry) in (0..).zip(&panel.legend) {
            write_entry(&mut sheet, entry, (x, legend_top + row * line_height), *width, TEXT_PX);
        }
        x += width + GAP;
    }
    sheet
}

/// Width of a line of a legend with type of `px` pixels.
pub fn entry_width(entry: &Entry, px: u32) -> u32 {
    indent(&entry.key, px) + Style::regular(px).width(&entry.text)
}

/// Width of the symbol and of the space behind it.
fn indent(key: &Key, px: u32) -> u32 {
    match key {
        Key::Square(_) => px + px / 2,
        Key::Number(..) => px + 6 + px / 2,
        Key::Scale => SCALE_SIDES * px + px / 2,
        Key::None => 0,
    }
}

/// A line of a legend with type of `px` pixels in a column of `width` pixels, its upper left corner at `at`.
pub fn write_entry(sheet: &mut RgbImage, entry: &Entry, at: (u32, u32), width: u32, px: u32) {
    let style = Style::regular(px);
    let side = px;
    let top = at.1 + (style.height() - side) / 2;
    match entry.key {
        Key::Square(color) => {
            let half = 0.5 * f64::from(side);
            let (left, middle) = (f64::from(at.0), f64::from(top) + half);
            let ends = [left, left + f64::from(side)].map(|x| Point2::new(x, middle));
            strokes::bar(sheet, ends, half, color);
        }
        Key::Number(color, number) => {
            let radius = 0.5 * f64::from(side) + 2.0;
            let center = Point2::new(f64::from(at.0) + radius, f64::from(top) + 0.5 * f64::from(side));
            strokes::numbered(sheet, center, radius, color, number);
        }
        Key::Scale => {
            let wide = SCALE_SIDES * side;
            for x in 0..wide.min(sheet.width().saturating_sub(at.0)) {
                let color = palette::bytes(palette::scale((f64::from(x) / f64::from(wide - 1)) as f32));
                (top..(top + side).min(sheet.height())).for_each(|y| sheet.put_pixel(at.0 + x, y, color));
            }
        }
        Key::None => {}
    }
    let indent = indent(&entry.key, px);
    let text = style.fitted(&entry.text, width.saturating_sub(indent));
    style.write(sheet, &text, ((at.0 + indent) as i32, at.1 as i32));
}

fn fitted(picture: &RgbImage) -> RgbImage {
    let longest = picture.width().max(picture.height());
    if longest <= LONGEST_SIDE {
        return picture.clone();
    }
    let side = |length: u32| (u64::from(length) * u64::from(LONGEST_SIDE) / u64::from(longest)).max(1) as u32;
    imageops::resize(picture, side(picture.width()), side(picture.height()), FilterType::Triangle)
}
