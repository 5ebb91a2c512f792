//! Photos: their size without decoding them, and decoded with the foreground that alpha or a mask tells.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageReader, Luma, RgbImage, RgbaImage};

use super::{SceneError, View};

/// A decoded photo at its camera's size.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The picture composited over white where it has alpha (straight, in the picture's own sRGB values).
    pub rgb: RgbImage,
    /// 255 on the object, 0 elsewhere; all 255 where nothing tells the two apart.
    pub foreground: GrayImage,
    pub foreground_source: ForegroundSource,
}

/// What told the foreground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ForegroundSource {
    /// The photo's alpha, from one half on.
    Alpha,
    /// A mask file, from one half on.
    Mask,
    /// The alpha that the object's Gaussians render.
    Gaussians,
    /// Nothing: all of the photo counts.
    Whole,
}

/// Whether a photo is used as it is stored, or turned as its EXIF orientation says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Upright {
    #[default]
    AsStored,
    Turned,
}

/// What a photo's header says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Header {
    stored: (u32, u32),
    orientation: Orientation,
}

impl Header {
    pub fn is_turned(&self) -> bool {
        self.orientation != Orientation::NoTransforms
    }

    /// Width and height of the photo used so.
    pub fn size(&self, upright: Upright) -> (u32, u32) {
        let (width, height) = self.stored;
        let on_its_side = matches!(
            self.orientation,
            Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
        );
        if upright == Upright::Turned && on_its_side { (height, width) } else { (width, height) }
    }

    /// The orientation is honoured, unless the declared size shows that the cameras belong to the pixels as they are stored:
    /// its shape is theirs and not the upright photo's.
    pub fn upright_for(&self, declared: Option<(u32, u32)>) -> Upright {
        if !self.is_turned() {
            return Upright::AsStored;
        }
        let same_shape = |(width, height): (u32, u32), (w, h): (u32, u32)| {
            let (a, b) = (u64::from(width) * u64::from(h), u64::from(height) * u64::from(w));
            // A resized picture's sides are rounded: one percent.
            a.abs_diff(b) * 100 <= a.max(b)
        };
        let stored = declared.is_some_and(|size| {
            same_shape(size, self.size(Upright::AsStored)) && !same_shape(size, self.size(Upright::Turned))
        });
        if stored { Upright::AsStored } else { Upright::Turned }
    }
}

impl View {
    /// Decodes the view's photo: 8 or 16 bits a channel, grey or colour, with or without alpha.
    ///
    /// # Errors
    /// [`SceneError`] names the file: missing, undecodable, or of another size than when the scene was loaded.
    pub fn photo(&self) -> Result<Photo, SceneError> {
        let picture = decode(&self.image, self.upright)?;
        let expected = (self.camera.intrinsics.width, self.camera.intrinsics.height);
        let found = (picture.width(), picture.height());
        if found != expected {
            return Err(SceneError::ImageChanged { path: self.image.clone(), expected, found });
        }
        Photo::of(picture, self.mask.as_deref(), self.upright)
    }
}

impl Photo {
    /// A photo by itself, upright, with its foreground by `mask` or its own alpha.
    ///
    /// # Errors
    /// [`SceneError`] names the file that is missing or undecodable.
    pub fn open(path: &Path, mask: Option<&Path>) -> Result<Self, SceneError> {
        Self::of(decode(path, Upright::Turned)?, mask, Upright::Turned)
    }

    fn of(picture: DynamicImage, mask: Option<&Path>, upright: Upright) -> Result<Self, SceneError> {
        let (rgb, alpha) = over_white(picture);
        let (width, height) = rgb.dimensions();
        let mask = mask.map(|path| mask_at(path, (width, height), upright)).transpose()?;
        let (foreground, foreground_source) = match (mask, alpha) {
            (Some(mask), _) => (mask, ForegroundSource::Mask),
            (None, Some(alpha)) => (alpha, ForegroundSource::Alpha),
            (None, None) => (GrayImage::from_pixel(width, height, Luma([255])), ForegroundSource::Whole),
        };
        Ok(Self { rgb, foreground, foreground_source })
    }
}

/// The mask's alpha where it has one that says something, else its brightness; resized to the photo where need be.
fn mask_at(path: &Path, (width, height): (u32, u32), upright: Upright) -> Result<GrayImage, SceneError> {
    let picture = decode(path, upright)?;
    let alpha = picture.color().has_alpha().then(|| alpha_of(&picture.to_rgba8())).filter(|alpha| !is_white(alpha));
    let mask = alpha.unwrap_or_else(|| picture.into_luma8());
    let mask = match mask.dimensions() == (width, height) {
        true => mask,
        false => image::imageops::resize(&mask, width, height, image::imageops::FilterType::Triangle),
    };
    Ok(thresholded(mask))
}

fn decode(path: &Path, upright: Upright) -> Result<DynamicImage, SceneError> {
    let undecodable = |reason| SceneError::Image { path: path.to_owned(), reason };
    let mut decoder = open(path)?.into_decoder().map_err(undecodable)?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut picture = DynamicImage::from_decoder(decoder).map_err(undecodable)?;
    if upright == Upright::Turned {
        picture.apply_orientation(orientation);
    }
    Ok(picture)
}

/// Size and orientation of the photo at `path`, from its header.
pub(super) fn header(path: &Path) -> Result<Header, SceneError> {
    let undecodable = |reason| SceneError::Image { path: path.to_owned(), reason };
    let mut decoder = open(path)?.into_decoder().map_err(undecodable)?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    Ok(Header { stored: decoder.dimensions(), orientation })
}

/// Opens a photo; its first bytes tell the format, whatever its name says.
fn open(path: &Path) -> Result<ImageReader<BufReader<File>>, SceneError> {
    let io_error = |reason: std::io::Error| match reason.kind() {
        std::io::ErrorKind::NotFound => SceneError::MissingImage { path: path.to_owned() },
        _ => SceneError::Io { path: path.to_owned(), reason },
    };
    ImageReader::open(path).map_err(io_error)?.with_guessed_format().map_err(io_error)
}

/// The picture over white, and the foreground that its alpha tells; `None` where it has none or is opaque everywhere.
fn over_white(picture: DynamicImage) -> (RgbImage, Option<GrayImage>) {
    if !picture.color().has_alpha() {
        return (picture.into_rgb8(), None);
    }
    let rgba = picture.into_rgba8();
    let mut rgb = RgbImage::new(rgba.width(), rgba.height());
    let mut opaque = true;
    for (from, to) in rgba.pixels().zip(rgb.pixels_mut()) {
        let [r, g, b, alpha] = from.0;
        opaque &= alpha == 255;
        to.0 = [r, g, b].map(|channel| blend_over_white(channel, alpha));
    }
    let alpha = (!opaque).then(|| thresholded(alpha_of(&rgba)));
    (rgb, alpha)
}

fn alpha_of(rgba: &RgbaImage) -> GrayImage {
    GrayImage::from_fn(rgba.width(), rgba.height(), |x, y| Luma([rgba.get_pixel(x, y)[3]]))
}

fn is_white(mask: &GrayImage) -> bool {
    mask.as_raw().iter().all(|value| *value == 255)
}

/// 255 from one half on, else 0.
fn thresholded(mut mask: GrayImage) -> GrayImage {
    for value in mask.iter_mut() {
        *value = if *value >= 128 { 255 } else { 0 };
    }
    mask
}

/// `channel * alpha + white * (1 - alpha)`, rounded.
fn blend_over_white(channel: u8, alpha: u8) -> u8 {
    let (channel, alpha) = (u32::from(channel), u32::from(alpha));
    ((channel * alpha + 255 * (255 - alpha) + 127) / 255) as u8
}
