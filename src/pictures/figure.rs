//! The material field as one camera sees it: materials, parts or confidence of the Gaussians, and the paper's figure of
//! photo, parts and materials.

use clap::ValueEnum;
use image::{DynamicImage, RgbImage};

use super::panels::{Entry, color, compose};
use super::{field_colors, tinted};
use crate::camera::Camera;
use crate::render::{Colors, RenderOptions, render};
use crate::scene::Photo;
use crate::scene::gaussians::Gaussians;
use crate::segment::LabelMap;
use crate::vote::{MaterialField, field_ply};

/// The aspect of the field to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Shown {
    /// Photo, parts and materials side by side, with a legend
    #[default]
    Figure,
    /// Each Gaussian in its material's colour, with a legend
    Materials,
    /// Each Gaussian in its part's colour, with a legend
    Parts,
    /// Each Gaussian's confidence: from dark blue, not seen, to yellow, all votes agree
    Confidence,
}

/// Draws the field as `camera` sees it. `map` are the parts or segments in the photo; if there are none, the figure shows
/// the field's parts.
pub fn draw(
    shown: Shown,
    camera: &Camera,
    photo: &Photo,
    map: Option<&LabelMap>,
    gaussians: &Gaussians,
    field: &MaterialField,
) -> RgbImage {
    let seen = |colors: &[[f32; 3]]| {
        let options = RenderOptions { colors: Colors::Fixed(colors), ..RenderOptions::default() };
        DynamicImage::ImageRgba8(render(gaussians, camera, &options).to_image([1.0; 3])).into_rgb8()
    };
    let materials = || seen(&field_colors::material_colors(field));
    let parts = || seen(&field_colors::label_colors(field));
    match shown {
        Shown::Figure => {
            let middle = map.map_or_else(parts, |map| tinted(photo, map));
            compose(&[photo.rgb.clone(), middle, materials()], &material_legend(field))
        }
        Shown::Materials => compose(&[materials()], &material_legend(field)),
        Shown::Parts => compose(&[parts()], &part_legend(field)),
        Shown::Confidence => seen(&field_colors::confidence_colors(field)),
    }
}

fn material_legend(field: &MaterialField) -> Vec<Entry> {
    let names = field_ply::material_names(&field.labels);
    (0..).zip(names).map(|(n, name)| Entry { text: name.to_owned(), color: color(n) }).collect()
}

fn part_legend(field: &MaterialField) -> Vec<Entry> {
    let entry = |label: &crate::vote::FieldLabel| Entry {
        text: format!("{}: {}", label.material, label.caption),
        color: color(label.id),
    };
    field.labels.iter().map(entry).collect()
}
