//! A picture's materials at a glance: the photo, the same with every part in its material's colour, a legend below.

use std::collections::BTreeMap;

use image::imageops::{self, FilterType};
use image::{GenericImage, Rgb, RgbImage};

use crate::query::sheet::text;
use crate::query::{Answers, Outcome};
use crate::scene::Photo;
use crate::segment::LabelMap;
use crate::vote::palette;

const PAPER: Rgb<u8> = Rgb([255; 3]);
/// Parts that nobody could name.
const UNNAMED: Rgb<u8> = Rgb([90; 3]);
/// Share of a material's colour over the photo: strong enough to read off, weak enough to see the part through.
const COLOR_SHARE: f32 = 0.75;
/// Longest side of a panel in pixels; a larger photo is shrunk.
const LONGEST_SIDE: u32 = 1024;
/// Space between and around the panels and the legend's lines.
const GAP: u32 = 12;
const TEXT_SCALE: u32 = 2;

/// A line of the legend.
struct Entry<'a> {
    name: &'a str,
    pixels: usize,
    color: Rgb<u8>,
}

/// Draws the map. A part of which `answers` know nothing is dark grey.
pub fn draw(photo: &Photo, map: &LabelMap, answers: &Answers) -> RgbImage {
    let legend = legend(map, answers);
    let colors: BTreeMap<u16, Rgb<u8>> = answers
        .parts
        .iter()
        .filter_map(|part| {
            Some((part.part, legend.iter().find(|entry| Some(entry.name) == name_of(&part.outcome))?.color))
        })
        .collect();
    let mut colored = photo.rgb.clone();
    for (pixel, label) in colored.pixels_mut().zip(&map.labels).filter(|(_, label)| **label != 0) {
        *pixel = mix(*pixel, colors.get(label).copied().unwrap_or(UNNAMED));
    }
    compose(&fitted(&photo.rgb), &fitted(&colored), &legend, map)
}

/// The materials by falling area; what could not be named comes last.
fn legend<'a>(map: &LabelMap, answers: &'a Answers) -> Vec<Entry<'a>> {
    let mut pixels_of_part: BTreeMap<u16, usize> = BTreeMap::new();
    map.labels.iter().filter(|label| **label != 0).for_each(|label| *pixels_of_part.entry(*label).or_default() += 1);
    let mut pixels: BTreeMap<&str, usize> = BTreeMap::new();
    let mut unnamed = 0;
    for part in &answers.parts {
        let area = pixels_of_part.get(&part.part).copied().unwrap_or(0);
        match name_of(&part.outcome) {
            Some(name) => *pixels.entry(name).or_default() += area,
            None => unnamed += area,
        }
    }
    let mut sorted: Vec<_> = pixels.into_iter().collect();
    sorted.sort_by_key(|(_, pixels)| std::cmp::Reverse(*pixels));
    let mut legend: Vec<Entry> =
        (0..).zip(sorted).map(|(n, (name, pixels))| Entry { name, pixels, color: color(n) }).collect();
    if unnamed > 0 {
        legend.push(Entry { name: "(no answer)", pixels: unnamed, color: UNNAMED });
    }
    legend
}

fn compose(photo: &RgbImage, colored: &RgbImage, legend: &[Entry], map: &LabelMap) -> RgbImage {
    let all = map.labels.iter().filter(|label| **label != 0).count().max(1) as f64;
    let lines: Vec<String> =
        legend.iter().map(|entry| format!("{}  {:.0} %", entry.name, 100.0 * entry.pixels as f64 / all)).collect();
    let line_height = text::height(TEXT_SCALE);
    let swatch = line_height + GAP;
    let widest = lines.iter().map(|line| text::width(line, TEXT_SCALE)).max().unwrap_or(0) + swatch;
    let (width, height) = photo.dimensions();
    let legend_top = height + 2 * GAP;
    let size =
        ((2 * width + 3 * GAP).max(widest + 2 * GAP), legend_top + legend.len() as u32 * (line_height + GAP / 2) + GAP);
    let mut sheet = RgbImage::from_pixel(size.0, size.1, PAPER);
    sheet.copy_from(photo, GAP, GAP).expect("the sheet was made for its panels");
    sheet.copy_from(colored, 2 * GAP + width, GAP).expect("the sheet was made for its panels");
    for ((row, line), entry) in (0..).zip(&lines).zip(legend) {
        let y = legend_top + row * (line_height + GAP / 2);
        let square = RgbImage::from_pixel(line_height, line_height, entry.color);
        sheet.copy_from(&square, GAP, y).expect("the sheet was made for its legend");
        text::write(&mut sheet, line, (GAP + swatch, y), TEXT_SCALE);
    }
    sheet
}

fn name_of(outcome: &Outcome) -> Option<&str> {
    match outcome {
        Outcome::Answered(answer) => Some(&answer.material),
        Outcome::Failed(_) => None,
    }
}

fn fitted(picture: &RgbImage) -> RgbImage {
    let longest = picture.width().max(picture.height());
    if longest <= LONGEST_SIDE {
        return picture.clone();
    }
    let side = |length: u32| (u64::from(length) * u64::from(LONGEST_SIDE) / u64::from(longest)).max(1) as u32;
    imageops::resize(picture, side(picture.width()), side(picture.height()), FilterType::Triangle)
}

fn color(n: u32) -> Rgb<u8> {
    Rgb(palette::color(n).map(|channel| (255.0 * channel).round() as u8))
}

fn mix(Rgb(under): Rgb<u8>, Rgb(over): Rgb<u8>) -> Rgb<u8> {
    let channel = |c: usize| f32::from(under[c]) * (1.0 - COLOR_SHARE) + f32::from(over[c]) * COLOR_SHARE;
    Rgb([0, 1, 2].map(|c| channel(c).round() as u8))
}
