//! A picture's materials at a glance: the photo, the same photo with every segment in its material's colour, and a
//! legend below.

use std::collections::BTreeMap;

use image::{Rgb, RgbImage};

use super::palette;
use super::panels::{self, Entry, Key, Panel};
use crate::query::{Answers, Outcome};
use crate::scene::Photo;
use crate::segment::LabelMap;

/// The colour of segments without a material name.
const UNNAMED: Rgb<u8> = Rgb([90; 3]);
/// Share of a material's colour over the photo: strong enough to recognise the colour, weak enough for the segment to
/// show through.
const COLOR_SHARE: f32 = 0.75;

/// A material of the picture.
struct Seen<'a> {
    name: &'a str,
    pixels: usize,
    color: Rgb<u8>,
}

/// Draws the map. A segment without an answer in `answers` is dark grey.
pub fn draw(photo: &Photo, map: &LabelMap, answers: &Answers) -> RgbImage {
    let legend = legend(map, answers);
    let colors: BTreeMap<u16, Rgb<u8>> = answers
        .all
        .iter()
        .filter_map(|answer| {
            let seen = legend.iter().find(|entry| Some(entry.name) == name_of(&answer.outcome))?;
            Some((answer.subject.number(), seen.color))
        })
        .collect();
    let mut colored = photo.rgb.clone();
    for (pixel, label) in colored.pixels_mut().zip(&map.labels).filter(|(_, label)| **label != 0) {
        *pixel = mix(*pixel, colors.get(label).copied().unwrap_or(UNNAMED));
    }
    let all = map.labels.iter().filter(|label| **label != 0).count().max(1) as f64;
    let line = |seen: &Seen| Entry {
        text: format!("{}  {:.0} %", seen.name, 100.0 * seen.pixels as f64 / all),
        key: Key::Square(seen.color),
    };
    let legend = legend.iter().map(line).collect();
    panels::compose(&[Panel::new("Photo", photo.rgb.clone()), Panel::new("Materials", colored).with_legend(legend)])
}

/// The materials by decreasing area; unnamed segments come last.
fn legend<'a>(map: &LabelMap, answers: &'a Answers) -> Vec<Seen<'a>> {
    let mut pixels_of_segment: BTreeMap<u16, usize> = BTreeMap::new();
    map.labels.iter().filter(|label| **label != 0).for_each(|label| *pixels_of_segment.entry(*label).or_default() += 1);
    let mut pixels: BTreeMap<&str, usize> = BTreeMap::new();
    let mut unnamed = 0;
    for answer in &answers.all {
        let area = pixels_of_segment.get(&answer.subject.number()).copied().unwrap_or(0);
        match name_of(&answer.outcome) {
            Some(name) => *pixels.entry(name).or_default() += area,
            None => unnamed += area,
        }
    }
    let mut sorted: Vec<_> = pixels.into_iter().collect();
    sorted.sort_by_key(|(_, pixels)| std::cmp::Reverse(*pixels));
    let mut legend: Vec<Seen> = (0..)
        .zip(sorted)
        .map(|(n, (name, pixels))| Seen { name, pixels, color: palette::bytes(palette::material(n)) })
        .collect();
    if unnamed > 0 {
        legend.push(Seen { name: "(no answer)", pixels: unnamed, color: UNNAMED });
    }
    legend
}

fn name_of(outcome: &Outcome) -> Option<&str> {
    match outcome {
        Outcome::Answered(answer) => Some(&answer.material),
        Outcome::Failed(_) => None,
    }
}

fn mix(Rgb(under): Rgb<u8>, Rgb(over): Rgb<u8>) -> Rgb<u8> {
    let channel = |c: usize| f32::from(under[c]) * (1.0 - COLOR_SHARE) + f32::from(over[c]) * COLOR_SHARE;
    Rgb([0, 1, 2].map(|c| channel(c).round() as u8))
}
