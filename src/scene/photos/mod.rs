//! Photos: their size without decoding them, and decoded with the foreground given by alpha or a mask.

pub(super) mod choose;
pub(super) mod find;
pub(super) mod flaws;
mod listing;
mod look_up;
mod mask;
pub(super) mod mask_color;
mod mask_files;
mod mask_lying;
pub(super) mod mask_reading;
mod sharpness;
pub(super) mod view_names;

use std::path::Path;

use image::error::DecodingError;
use image::metadata::Orientation;
use image::{
    DynamicImage, GenericImageView, GrayImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Luma, RgbImage,
    Rgba, RgbaImage,
};

use super::{SceneError, View};
use crate::files::{self, PictureSource, jpeg};
pub use mask::Mask;

/// A decoded photo at its camera's size.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The picture, composited over white if it has alpha (straight, in the picture's own sRGB values).
    pub rgb: RgbImage,
    /// 255 on the object, 0 elsewhere; 255 everywhere if nothing distinguishes the two.
    pub foreground: GrayImage,
    pub foreground_source: ForegroundSource,
    /// Whether some of the white behind it shows.
    pub over_white: bool,
}

/// The source of the foreground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ForegroundSource {
    /// The photo's alpha, thresholded at one half.
    Alpha,
    /// A mask file, thresholded at one half.
    Mask,
    /// The alpha rendered from the object's Gaussians.
    Gaussians,
    /// No source: all of the photo counts as foreground.
    Whole,
}

/// Whether a photo is used as it is stored, or rotated according to its EXIF orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Upright {
    #[default]
    AsStored,
    Turned,
}

/// The contents of a photo's header.
#[derive(Debug, Clone, Copy)]
pub(super) struct Header {
    stored: (u32, u32),
    orientation: Orientation,
    has_alpha: bool,
}

impl Header {
    pub fn is_turned(&self) -> bool {
        self.orientation != Orientation::NoTransforms
    }

    pub fn orientation(&self) -> Orientation {
        self.orientation
    }

    /// Width and height of the photo when used this way.
    pub fn size(&self, upright: Upright) -> (u32, u32) {
        let (width, height) = self.stored;
        if upright == Upright::Turned && swaps_sides(self.orientation) { (height, width) } else { (width, height) }
    }

    /// Applies the orientation, unless the declared size shows that the cameras may belong to the pixels as stored: it
    /// has their aspect ratio, and the turned photo's is no nearer to it. COLMAP's cameras belong to the pixels as stored.
    pub fn upright_for(&self, declared: Option<(u32, u32)>) -> Upright {
        let (stored, turned) = (self.size(Upright::AsStored), self.size(Upright::Turned));
        let ratio = |(width, height): (u32, u32)| (f64::from(width) / f64::from(height)).ln();
        let off = |size, other| (ratio(size) - ratio(other)).abs();
        let fits_stored = |size| same_shape(size, stored) && off(size, stored) <= off(size, turned);
        if !self.is_turned() || declared.is_some_and(fits_stored) { Upright::AsStored } else { Upright::Turned }
    }
}

/// Whether applying the orientation exchanges width and height.
fn swaps_sides(orientation: Orientation) -> bool {
    matches!(
        orientation,
        Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
    )
}

/// Memory limit for decoding a view's photo: every thread may process a photo at once, each in a few copies, and every
/// label map is kept.
const VIEW_LIMIT: Limit = Limit {
    bytes: 256 << 20,
    remedy: ", and its intrinsics with it if the camera file does not give the photo's size",
};
/// Memory limit for decoding a photo on its own: 20,000 x 20,000 pixels of four bytes.
const ALONE_LIMIT: Limit = Limit { bytes: 1_600_000_000, remedy: ", or save it with 8 bits per channel as PNG" };
/// A photo on its own whose longer side has at least three times this many pixels is shrunk by an integer factor. SAM
/// sees 1024 pixels of that side.
const KEPT_SIDE: u32 = 2048;

/// The number of bytes that a decoded picture may take, and what the user can do if it takes more, besides scaling it
/// down.
#[derive(Clone, Copy)]
struct Limit {
    bytes: u64,
    remedy: &'static str,
}

impl View {
    /// Decodes the view's photo: 8 or 16 bits per channel, grey or colour, with or without alpha.
    ///
    /// # Errors
    /// [`SceneError`] names the file if it is missing, undecodable, too large, or has a different size than when the
    /// scene was loaded.
    pub fn photo(&self) -> Result<Photo, SceneError> {
        let picture = decode(&self.image, self.upright, VIEW_LIMIT)?;
        let expected = (self.camera.intrinsics.width, self.camera.intrinsics.height);
        let found = (picture.width(), picture.height());
        if found != expected {
            return Err(SceneError::ImageChanged { path: self.image.clone(), expected, found });
        }
        let mask = self.mask.as_ref().map(|mask| mask.coverage(self.upright, VIEW_LIMIT, expected)).transpose()?;
        Ok(Photo::of(picture, mask))
    }

    /// The share of each pixel that the object covers, 0 to 255: the mask, or the photo's alpha; `None` if the view has
    /// neither.
    ///
    /// # Errors
    /// As for [`Self::photo`].
    pub fn coverage(&self) -> Result<Option<GrayImage>, SceneError> {
        let expected = (self.camera.intrinsics.width, self.camera.intrinsics.height);
        if let Some(mask) = &self.mask {
            return Ok(Some(mask.coverage(self.upright, VIEW_LIMIT, expected)?));
        }
        if !header(&self.image)?.has_alpha {
            return Ok(None);
        }
        let picture = decode(&self.image, self.upright, VIEW_LIMIT)?;
        let found = (picture.width(), picture.height());
        if found != expected {
            return Err(SceneError::ImageChanged { path: self.image.clone(), expected, found });
        }
        let alpha = alpha_of(&picture.into_rgba8());
        Ok((!is_white(&alpha)).then_some(alpha))
    }
}

impl Photo {
    /// Decodes a photo without a camera, turned upright, with its foreground from a mask or its own alpha. If its
    /// longer side has 6144 pixels or more, it is shrunk by an integer factor. Also returns its width and height before
    /// that.
    ///
    /// # Errors
    /// [`SceneError`] names the file that is missing, undecodable, or too large to decode.
    pub fn open(path: &Path, path_of_mask: Option<&Path>) -> Result<(Self, (u32, u32)), SceneError> {
        let picture = decode(path, Upright::Turned, ALONE_LIMIT)?;
        let size = (picture.width(), picture.height());
        let factor = size.0.max(size.1) / KEPT_SIDE;
        let picture = if factor > 2 { shrunk(&picture, factor) } else { picture };
        let shown = (picture.width(), picture.height());
        let read_alone = |mask| mask_reading::alone(path, mask, shown)?.coverage(Upright::Turned, ALONE_LIMIT, shown);
        let mask = path_of_mask.map(read_alone).transpose()?;
        Ok((Self::of(picture, mask), size))
    }

    fn of(picture: DynamicImage, mask: Option<GrayImage>) -> Self {
        let (rgb, alpha) = over_white(picture);
        let (width, height) = rgb.dimensions();
        let over_white = alpha.is_some();
        let (foreground, foreground_source) = match (mask, alpha) {
            (Some(mask), _) => (thresholded(mask), ForegroundSource::Mask),
            (None, Some(alpha)) => (alpha, ForegroundSource::Alpha),
            (None, None) => (GrayImage::from_pixel(width, height, Luma([255])), ForegroundSource::Whole),
        };
        Self { rgb, foreground, foreground_source, over_white }
    }
}

/// Whether two pictures have the same aspect ratio, within one percent or the rounding of one of them to whole pixels.
fn same_shape((width, height): (u32, u32), (w, h): (u32, u32)) -> bool {
    let (a, b) = (u64::from(width) * u64::from(h), u64::from(height) * u64::from(w));
    a.abs_diff(b) * 100 <= a.max(b) || a.abs_diff(b) <= u64::from(w.max(h).max(width).max(height))
}

/// The picture with each square of `factor` x `factor` pixels replaced by their mean; leftover pixels at the right and
/// lower edges are included in the last square. A pixel counts for the colour by its alpha: what is transparent has none.
fn shrunk(picture: &DynamicImage, factor: u32) -> DynamicImage {
    let side = |length: u32| (length / factor).max(1);
    let (width, height) = (side(picture.width()), side(picture.height()));
    let mut sums = vec![[0_u64; 5]; width as usize * height as usize];
    for y in 0..picture.height() {
        let row = (y / factor).min(height - 1) as usize * width as usize;
        for x in 0..picture.width() {
            let Rgba([r, g, b, alpha]) = picture.get_pixel(x, y);
            let sum = &mut sums[row + (x / factor).min(width - 1) as usize];
            let weight = u64::from(alpha);
            for (sum, value) in sum.iter_mut().zip([r, g, b].map(|channel| weight * u64::from(channel))) {
                *sum += value;
            }
            sum[3] += weight;
            sum[4] += 1;
        }
    }
    let rounded = |sum: u64, count: u64| ((sum + count / 2) / count.max(1)) as u8;
    let mean = |[r, g, b, alpha, count]: [u64; 5]| {
        let [r, g, b] = [r, g, b].map(|sum| rounded(sum, alpha));
        [r, g, b, rounded(alpha, count)]
    };
    let pixels: Vec<u8> = sums.into_iter().flat_map(mean).collect();
    DynamicImage::ImageRgba8(RgbaImage::from_raw(width, height, pixels).expect("four bytes per pixel"))
}

fn decode(path: &Path, upright: Upright, limit: Limit) -> Result<DynamicImage, SceneError> {
    let undecodable = |reason| SceneError::Image { path: path.to_owned(), reason };
    let reader = open(path)?;
    let format = reader.format();
    let mut decoder = reader.into_decoder().map_err(undecodable)?;
    let size = decoder.dimensions();
    let pixels = u64::from(size.0) * u64::from(size.1);
    let bytes = match format {
        // A progressive JPEG is also held completely as 16-bit coefficients.
        Some(ImageFormat::Jpeg) => pixels * (3 + 3 * 2),
        _ => decoder.total_bytes(),
    };
    if bytes > limit.bytes {
        let Limit { bytes: most, remedy } = limit;
        return Err(SceneError::TooLarge { path: path.to_owned(), size, bytes, most, remedy });
    }
    if format == Some(ImageFormat::Jpeg) {
        let file = files::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })?;
        if !jpeg::is_whole(&file) {
            let reason = DecodingError::new(ImageFormat::Jpeg.into(), "the file ends before the picture does");
            return Err(undecodable(ImageError::Decoding(reason)));
        }
    }
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
    Ok(Header { stored: decoder.dimensions(), orientation, has_alpha: decoder.color_type().has_alpha() })
}

/// Opens a photo; its format is determined by its first bytes, whatever its name.
fn open(path: &Path) -> Result<ImageReader<PictureSource<'static>>, SceneError> {
    let io_error = |reason: std::io::Error| match reason.kind() {
        std::io::ErrorKind::NotFound => SceneError::MissingImage { path: path.to_owned() },
        _ => SceneError::Io { path: path.to_owned(), reason },
    };
    ImageReader::new(files::picture(path).map_err(io_error)?).with_guessed_format().map_err(io_error)
}

/// The picture over white, and the foreground given by its alpha; `None` if it has no alpha or is opaque everywhere.
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

/// 255 from one half upwards, else 0.
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
