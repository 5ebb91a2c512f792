//! The picture that is sent for a subject (a part or a segment): the whole object, the same with the subject in red, the subject alone.
//!
//! The paper shows its model the object and the segment together (its ablation: 22.17 mIoU with the segment alone,
//! 55.83 with both). The three panels are labelled and of equal size, in a row, or one below the other if the object is
//! so wide that a row would make it small. Everything is drawn with integers and IEEE arithmetic, so that the same
//! photo and subject give the same pixels on every processor; recordings are found by those pixels, before JPEG.

pub(crate) mod panel;
pub mod sides;

use image::codecs::jpeg::JpegEncoder;
use image::{GenericImage, GrayImage, Rgb, RgbImage};
use panel::Area;
use serde::{Deserialize, Serialize};

use crate::lettering::Style;
use crate::query::recorded::sha256::Sha256Hex;
use crate::scene::Photo;
use crate::segment::LabelMap;

/// How much of the object the model is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Context {
    /// Whole object, part in it, part alone, as in the paper.
    #[default]
    GlobalLocal,
    /// The part alone, as in the paper's ablation.
    Local,
}

/// A drawn sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    pub picture: RgbImage,
}

/// Compression of the sheet that is sent and saved; at this quality text and outlines stay clean.
const JPEG_QUALITY: u8 = 90;
/// Size of the labels' type on a sheet of up to 1399 pixels, in pixels; twice as large on the next 700, and so on. It is
/// smaller if the panels are too narrow for the longest label.
const LABEL_PX: u32 = 13;
/// The label that takes the most room.
const LONGEST_LABEL: &str = "2 the part, in red";
/// Space between panels and around them, in pixels.
const GAP: u32 = 8;
/// The first of several panels has at most this many times the photo's resolution: more would cost tokens and show no
/// more.
const ENLARGED_AT_MOST: u32 = 2;
/// An object wider than this times its height gets its panels one below the other.
const WIDE: f64 = 4.0 / 3.0;
const PAPER: Rgb<u8> = Rgb([255, 255, 255]);

impl Sheet {
    /// The photo beside the object alone, cropped and enlarged, on a sheet of at most `longest_side` pixels per side.
    pub fn of_object(photo: &Photo, longest_side: u32) -> Self {
        let (width, height) = photo.rgb.dimensions();
        let whole = Area { x0: 0, y0: 0, x1: width, y1: height };
        let object = panel::bounding_box(&photo.foreground).map_or(whole, |found| found.with_margin(width, height));
        let mut sheet = Canvas::new(longest_side, 2, whole.aspect(), height.saturating_mul(ENLARGED_AT_MOST));
        sheet.place("1 the photo", &panel::object(photo, whole, sheet.panel));
        sheet.place("2 the object", &panel::object(photo, object, sheet.panel));
        Self { picture: sheet.picture }
    }

    /// SHA-256 of width and height (little-endian u32) and the RGB bytes.
    pub fn pixels_sha256(&self) -> Sha256Hex {
        Sha256Hex::of_picture(self.picture.dimensions(), self.picture.as_raw())
    }

    /// The sheet as JPEG.
    pub fn jpeg(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .encode_image(&self.picture)
            .expect("an RGB picture below 65536 pixels a side encodes into memory");
        bytes
    }
}

/// Draws the sheets of one view.
pub struct Drawer<'a> {
    photo: &'a Photo,
    map: &'a LabelMap,
    longest_side: u32,
    /// The sheet with the whole object in its first panel; `None` if only the subject is shown.
    begun: Option<Begun>,
}

struct Begun {
    sheet: Canvas,
    object_box: Area,
    object: RgbImage,
}

impl<'a> Drawer<'a> {
    /// A drawer for a view whose label map and photo have the same size. Sheets have at most `longest_side`
    /// pixels per side.
    pub fn new(photo: &'a Photo, map: &'a LabelMap, context: Context, longest_side: u32) -> Self {
        let begun = match context {
            Context::GlobalLocal => begin(photo, map, longest_side),
            Context::Local => None,
        };
        Self { photo, map, longest_side, begun }
    }

    /// The sheet of the subject with this id; `None` if the label map has no pixel of it.
    pub fn sheet(&self, id: u16) -> Option<Sheet> {
        let mask = mask(self.map, |label| label == id);
        let subject_box = panel::bounding_box(&mask)?.with_margin(self.map.width, self.map.height);
        let alone = |size| panel::subject_alone(self.photo, &mask, subject_box, size);
        let picture = match &self.begun {
            Some(Begun { sheet, object_box, object }) => {
                let mut sheet = sheet.clone();
                sheet.place(LONGEST_LABEL, &panel::subject_in_red(object.clone(), &mask, *object_box));
                sheet.place("3 the part alone", &alone(sheet.panel));
                sheet.picture
            }
            None => {
                let mut sheet = Canvas::new(self.longest_side, 1, subject_box.aspect(), u32::MAX);
                sheet.place("the part alone", &alone(sheet.panel));
                sheet.picture
            }
        };
        Some(Sheet { picture })
    }
}

/// The first panel: the object, that is, everything that is foreground or subject.
fn begin(photo: &Photo, map: &LabelMap, longest_side: u32) -> Option<Begun> {
    let foreground = panel::bounding_box(&photo.foreground);
    let subjects = panel::bounding_box(&mask(map, |label| label != 0));
    let object_box = foreground.into_iter().chain(subjects).reduce(Area::hull)?.with_margin(map.width, map.height);
    let most_height = object_box.height().saturating_mul(ENLARGED_AT_MOST);
    let mut sheet = Canvas::new(longest_side, 3, object_box.aspect(), most_height);
    let object = panel::object(photo, object_box, sheet.panel);
    sheet.place("1 whole object", &object);
    Some(Begun { sheet, object_box, object })
}

fn mask(map: &LabelMap, inside: impl Fn(u16) -> bool) -> GrayImage {
    let samples = map.labels.iter().map(|label| if inside(*label) { 255 } else { 0 }).collect();
    GrayImage::from_raw(map.width, map.height, samples).expect("a label map has a label for every pixel")
}

/// A sheet that is filled panel by panel.
#[derive(Clone)]
struct Canvas {
    picture: RgbImage,
    /// Width and height of each panel.
    panel: (u32, u32),
    label: Style,
    in_a_row: bool,
    placed: u32,
}

impl Canvas {
    /// Room for `panels` panels of one size, each as near to `aspect` (width / height) as labels and sheet allow and at
    /// most `most_height` high.
    fn new(longest_side: u32, panels: u32, aspect: f64, most_height: u32) -> Self {
        let in_a_row = aspect <= WIDE;
        let (columns, rows) = if in_a_row { (panels, 1) } else { (1, panels) };
        let widest = (longest_side - GAP * (columns + 1)) / columns;
        let mut label = Style::semibold(LABEL_PX * (longest_side / 700).max(1));
        while label.width(LONGEST_LABEL) > widest {
            label.px -= 1;
        }
        let highest = (longest_side - (GAP + label.height()) * rows - GAP) / rows;
        let height = highest.min((f64::from(widest) / aspect) as u32).clamp(1, most_height.max(1));
        let width = ((f64::from(height) * aspect) as u32).max(label.width(LONGEST_LABEL)).min(widest);
        let picture =
            RgbImage::from_pixel(columns * (width + GAP) + GAP, rows * (height + label.height() + GAP) + GAP, PAPER);
        Self { picture, panel: (width, height), label, in_a_row, placed: 0 }
    }

    fn place(&mut self, label: &str, panel: &RgbImage) {
        let (width, height) = self.panel;
        let (column, row) = if self.in_a_row { (self.placed, 0) } else { (0, self.placed) };
        let x = GAP + column * (width + GAP);
        let y = GAP + row * (height + self.label.height() + GAP);
        self.label.write(&mut self.picture, label, (x as i32, y as i32));
        self.picture.copy_from(panel, x, y + self.label.height()).expect("the canvas was made for its panels");
        self.placed += 1;
    }
}
