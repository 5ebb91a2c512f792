//! Pictures of segments, cropped to the object: one photo at SAM's three levels, and the materials of its segments
//! before and after the vote.

use std::collections::BTreeMap;

use image::{Rgb, RgbImage};

use super::figure::{PANEL_NARROWEST, PANEL_PX, ShownObject};
use super::framing::Framing;
use super::panels::{Entry, Key, Panel, compose};
use super::{field_colors, palette, tinted};
use crate::camera::Camera;
use crate::scene::Photo;
use crate::segment::{LabelMap, Level};
use crate::vote::field_ply::material_names;

/// Between two segments.
const BORDER: Rgb<u8> = Rgb([255; 3]);
/// The colour of segments about which there is no answer.
const UNNAMED: [f32; 3] = [0.35; 3];

/// The photo, then its segments at each level.
pub fn levels(camera: &Camera, photo: &Photo, levels: &[(Level, LabelMap)]) -> RgbImage {
    let framing = Framing::new(camera, photo, PANEL_PX, PANEL_NARROWEST);
    let panel = |(level, map): &(Level, LabelMap)| {
        let count = map.labels.iter().max().copied().unwrap_or(0);
        let title = match level {
            Level::Small => format!("Small: {count}"),
            Level::Middle => format!("Middle: {count}"),
            Level::Large => format!("Large: {count}"),
        };
        Panel::new(&title, bordered(&framing, photo, map, |id| palette::part(u32::from(id))))
    };
    let photo = Panel::new("Photo", framing.photo(photo));
    compose(&std::iter::once(photo).chain(levels.iter().map(panel)).collect::<Vec<_>>())
}

/// The photo; the segments of `map` in the colours of the materials that the answers about this view alone give them;
/// and the Gaussians in the colours of those that the vote of all views gave them.
pub fn before_and_after(
    camera: &Camera,
    photo: &Photo,
    map: &LabelMap,
    answered: &BTreeMap<u16, String>,
    ShownObject { gaussians, field, .. }: ShownObject,
) -> RgbImage {
    let framing = Framing::new(camera, photo, PANEL_PX, PANEL_NARROWEST);
    let voted = material_names(&field.parts);
    let mut names: Vec<&str> = voted.clone();
    for name in answered.values() {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let color = |name: &str| palette::material(names.iter().position(|n| *n == name).map_or(0, |n| n as u32));
    let entry = |name: &str| Entry { text: name.to_owned(), key: Key::Square(palette::bytes(color(name))) };
    let is_shown = |name: &&str| map.labels.iter().any(|id| answered.get(id).is_some_and(|answer| answer == name));
    let mut before: Vec<Entry> = names.iter().copied().filter(is_shown).map(entry).collect();
    if map.labels.iter().any(|id| *id > 0 && !answered.contains_key(id)) {
        before.push(Entry { text: "no answer".to_owned(), key: Key::Square(palette::bytes(UNNAMED)) });
    }
    let of_segment = |id: u16| answered.get(&id).map_or(UNNAMED, |name| color(name));
    let after = framing.colored(gaussians, &field_colors::material_colors(field));
    compose(&[
        Panel::new("Photo", framing.photo(photo)),
        Panel::new("Before: answers for this view", bordered(&framing, photo, map, of_segment)).with_legend(before),
        Panel::new("After: vote of all views", after).with_legend(voted.into_iter().map(entry).collect()),
    ])
}

/// The photo with every segment in its colour and a line between segments.
fn bordered(framing: &Framing, photo: &Photo, map: &LabelMap, color: impl Fn(u16) -> [f32; 3]) -> RgbImage {
    let mut rgb = tinted(photo, map, color);
    let (width, height) = (map.width as usize, map.height as usize);
    for y in 0..height {
        for x in 0..width {
            let here = map.labels[y * width + x];
            let differs = |other: usize| here > 0 && map.labels[other] > 0 && map.labels[other] != here;
            let right = x + 1 < width && differs(y * width + x + 1);
            let below = y + 1 < height && differs((y + 1) * width + x);
            if right || below {
                rgb.put_pixel(x as u32, y as u32, BORDER);
            }
        }
    }
    framing.photo(&Photo { rgb, ..photo.clone() })
}
