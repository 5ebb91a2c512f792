//! The material field as one camera sees it: materials, parts, confidence or a property of the Gaussians, and the
//! paper's figure of photo, parts and materials.

use clap::ValueEnum;
use image::RgbImage;
use nalgebra::Point2;

use super::framing::{Framing, middles};
use super::panels::{Panel, compose};
use super::property::Property;
use super::{field_colors, legends, palette, strokes};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::scene::Photo;
use crate::vote::MaterialField;

/// Longest side of a panel, px.
pub const PANEL_PX: u32 = 720;
/// A panel is at least this many times as wide as high: a narrower one leaves no room for its legend.
pub const PANEL_NARROWEST: f64 = 0.6;

/// The aspect of the field to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Shown {
    /// Photo, parts and materials side by side, with legends and a scale bar
    #[default]
    Figure,
    /// Each Gaussian in its material's colour, with a legend
    Materials,
    /// Each Gaussian in its part's colour, with a legend
    Parts,
    /// Each Gaussian's confidence: from dark purple, no votes, to yellow, all votes agree
    Confidence,
    /// Shore hardness: from dark purple, Shore A 0, to yellow, Shore D 100; grey without a hardness
    Hardness,
    /// Young's modulus, on a logarithmic scale from dark purple, soft, to yellow, stiff
    YoungsModulus,
    /// Density, on a logarithmic scale from dark purple, light, to yellow, heavy
    Density,
    /// Friction on rubber, from dark purple, none, to yellow, high
    Friction,
}

/// A field with all that is needed to draw it.
#[derive(Clone, Copy)]
pub struct ShownObject<'a> {
    pub gaussians: &'a Gaussians,
    pub field: &'a MaterialField,
    /// `None` if unknown: there is no scale bar then.
    pub meters_per_unit: Option<f64>,
}

/// Draws the field as `camera` sees it, cropped to the object in its `photo`.
pub fn draw(shown: Shown, camera: &Camera, photo: &Photo, object: ShownObject) -> RgbImage {
    let framing = Framing::new(camera, photo, PANEL_PX, PANEL_NARROWEST);
    let with_bar = |mut picture: RgbImage| {
        if let Some(meters_per_unit) = object.meters_per_unit {
            strokes::scale_bar(&mut picture, framing.pixels_per_meter(object.gaussians, meters_per_unit));
        }
        picture
    };
    let shot = || Panel::new("Photo", with_bar(framing.photo(photo)));
    let alone = |panel: Panel| Panel { picture: with_bar(panel.picture), ..panel };
    match shown {
        Shown::Figure => compose(&[shot(), parts(&framing, object), materials(&framing, object)]),
        Shown::Materials => compose(&[alone(materials(&framing, object))]),
        Shown::Parts => compose(&[alone(parts(&framing, object))]),
        Shown::Confidence => compose(&[alone(confidence(&framing, object))]),
        Shown::Hardness => compose(&[alone(property(Property::Hardness, &framing, object))]),
        Shown::YoungsModulus => compose(&[alone(property(Property::YoungsModulus, &framing, object))]),
        Shown::Density => compose(&[alone(property(Property::Density, &framing, object))]),
        Shown::Friction => compose(&[alone(property(Property::Friction, &framing, object))]),
    }
}

fn materials(framing: &Framing, ShownObject { gaussians, field, .. }: ShownObject) -> Panel {
    let picture = framing.colored(gaussians, &field_colors::material_colors(field));
    Panel::new("Materials", picture).with_legend(legends::materials(field))
}

/// The parts, each with its number where the picture shows it.
fn parts(framing: &Framing, ShownObject { gaussians, field, .. }: ShownObject) -> Panel {
    let mut picture = framing.colored(gaussians, &field_colors::part_colors(field));
    let labels = framing.labels(gaussians, &field.part_index);
    let radius = (f64::from(picture.width().min(picture.height())) / 36.0).clamp(9.0, 15.0);
    for (label, place) in field.parts.iter().zip(middles(&labels, picture.width() as usize, field.parts.len())) {
        let Some((x, y)) = place else { continue };
        let center = Point2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        strokes::numbered(&mut picture, center, radius, palette::bytes(palette::part(label.id)), label.id);
    }
    Panel::new("Parts", picture).with_legend(legends::parts(field))
}

fn confidence(framing: &Framing, ShownObject { gaussians, field, .. }: ShownObject) -> Panel {
    let picture = framing.colored(gaussians, &field_colors::confidence_colors(field));
    Panel::new("Confidence", picture).with_legend(legends::confidence())
}

fn property(property: Property, framing: &Framing, ShownObject { gaussians, field, .. }: ShownObject) -> Panel {
    let picture = framing.colored(gaussians, &property.colors(field));
    Panel::new(property.title(), picture).with_legend(property.legend(field))
}
