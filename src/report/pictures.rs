//! The report's pictures: each view's photo, the splat, its segments and the materials of the Gaussians seen from there,
//! and the sheets of its questions.

use std::collections::BTreeMap;

use image::{ImageError, ImageFormat, ImageReader, ImageResult, RgbImage};

use crate::files;

use crate::gaussians::Gaussians;
use crate::pictures::{field_colors, jpeg, labels_of_segments, palette, tinted};
use crate::render::{Colors, RenderOptions, render, render_labels};
use crate::scene::{SceneError, View};
use crate::segment::LabelMap;
use crate::vote::MaterialField;

/// Longest side of a report's picture in pixels: the page shows four side by side, and each is sharp even on a screen
/// with two pixels per CSS pixel.
const LONGEST_SIDE: u32 = 640;
/// Longest side of a sheet on the page: its three panels are still recognisable.
const SHEET_LONGEST_SIDE: u32 = 480;

/// Why a view's pictures could not be drawn.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    #[error("{0}")]
    Photo(#[from] SceneError),
    #[error("{0}")]
    Encode(#[from] ImageError),
}

/// Every picture of a report.
#[derive(Debug, Clone)]
pub struct Pictures {
    pub views: Vec<ViewPictures>,
    pub sheets: Vec<SheetPicture>,
    /// The picture of the question what the object is, as JPEG, if that was asked.
    pub object: Option<Vec<u8>>,
    /// Animated GIF of the simulation.
    pub animation: Vec<u8>,
    /// PNG of the best places to grasp at.
    pub grasp: Option<Vec<u8>>,
}

/// The pictures of a view, all of the same size, as JPEG.
#[derive(Debug, Clone)]
pub struct ViewPictures {
    pub name: String,
    pub photo: Vec<u8>,
    /// The splat as the photo's camera sees it.
    pub splat: Vec<u8>,
    pub segments: Vec<u8>,
    /// The Gaussians in the colours of their parts.
    pub materials: Vec<u8>,
    /// The id of the part that each segment shows.
    pub part_of_segment: BTreeMap<u16, u32>,
}

/// The sheet of a subject in a view, as JPEG.
#[derive(Debug, Clone)]
pub struct SheetPicture {
    pub view: String,
    /// Its id in the view's label map.
    pub subject: u16,
    pub jpeg: Vec<u8>,
}

impl Pictures {
    /// The id of the part that the Gaussians under a `segment` of a `view` belong to; `None` if no Gaussian is there.
    pub fn part_of(&self, view: &str, segment: u16) -> Option<u32> {
        let view = self.views.iter().find(|drawn| drawn.name == view)?;
        view.part_of_segment.get(&segment).copied()
    }
}

/// Longest side of the picture with the whole object from several sides: its numbers are still legible.
const OBJECT_LONGEST_SIDE: u32 = 1200;

/// Shrinks the sheet with the whole object that was sent.
///
/// # Errors
/// If it is not a picture.
pub fn shrink_object(sheet: &[u8]) -> ImageResult<Vec<u8>> {
    shrunk(sheet, OBJECT_LONGEST_SIDE)
}

/// A sheet that was sent, as JPEG with this longest side.
fn shrunk(sheet: &[u8], longest_side: u32) -> ImageResult<Vec<u8>> {
    let picture = ImageReader::with_format(files::picture_of(sheet), ImageFormat::Jpeg).decode()?.into_rgb8();
    jpeg(&picture, longest_side)
}

impl SheetPicture {
    /// Shrinks the `sheet` that was sent.
    ///
    /// # Errors
    /// If it is not a picture.
    pub fn shrink(view: &str, subject: u16, sheet: &[u8]) -> ImageResult<Self> {
        Ok(Self { view: view.to_owned(), subject, jpeg: shrunk(sheet, SHEET_LONGEST_SIDE)? })
    }
}

impl ViewPictures {
    /// Draws the pictures of `view`.
    ///
    /// # Errors
    /// If the photo cannot be read, or a picture cannot be encoded.
    pub fn draw(
        view: &View,
        map: &LabelMap,
        gaussians: &Gaussians,
        field: &MaterialField,
    ) -> Result<Self, PictureError> {
        let photo = view.photo()?;
        let labels = render_labels(gaussians, &view.camera, &field.part_index, &RenderOptions::default());
        let id_of = |label: u32| field.parts[label as usize].id;
        let part_of_segment: BTreeMap<u16, u32> =
            labels_of_segments(map, &labels).into_iter().map(|(segment, label)| (segment, id_of(label))).collect();
        let color = |segment| part_of_segment.get(&segment).map_or(palette::NOTHING, |part| palette::part(*part));
        let of_parts = field_colors::part_colors(field);
        let seen = |colors| jpeg(&seen(view, gaussians, colors), LONGEST_SIDE);
        Ok(Self {
            name: view.name.clone(),
            splat: seen(Colors::Sh)?,
            segments: jpeg(&tinted(&photo, map, color), LONGEST_SIDE)?,
            materials: seen(Colors::Fixed(&of_parts))?,
            photo: jpeg(&photo.rgb, LONGEST_SIDE)?,
            part_of_segment,
        })
    }
}

/// The splat as seen by the view's camera.
fn seen(view: &View, gaussians: &Gaussians, colors: Colors) -> RgbImage {
    let options = RenderOptions { colors, ..RenderOptions::default() };
    image::DynamicImage::ImageRgba8(render(gaussians, &view.camera, &options).to_image([1.0; 3])).into_rgb8()
}
