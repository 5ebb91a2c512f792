//! Photos: their size without decoding them, and decoded with the foreground that their alpha tells.

use std::path::Path;

use image::{DynamicImage, GrayImage, ImageReader, RgbImage};

use super::{SceneError, View};

/// A decoded photo at its camera's size.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The picture composited over white where it has alpha (straight, in the picture's own sRGB values).
    pub rgb: RgbImage,
    /// 255 where alpha is at least one half, 0 elsewhere; all 255 where the picture has no alpha.
    pub foreground: GrayImage,
}

impl View {
    /// Decodes the view's photo: 8 or 16 bits a channel, grey or colour, with or without alpha.
    ///
    /// # Errors
    /// [`SceneError`] names the file: missing, undecodable, or of another size than when the scene was loaded.
    pub fn photo(&self) -> Result<Photo, SceneError> {
        let reader = open(&self.image)?;
        let picture = reader.decode().map_err(|reason| SceneError::Image { path: self.image.clone(), reason })?;
        let (expected, found) =
            ((self.camera.intrinsics.width, self.camera.intrinsics.height), (picture.width(), picture.height()));
        if found != expected {
            return Err(SceneError::ImageChanged { path: self.image.clone(), expected, found });
        }
        Ok(over_white(picture))
    }
}

/// Width and height of the photo at `path`, from its header.
pub(super) fn size(path: &Path) -> Result<(u32, u32), SceneError> {
    open(path)?.into_dimensions().map_err(|reason| SceneError::Image { path: path.to_owned(), reason })
}

/// Opens a photo; its first bytes tell the format, whatever its name says.
fn open(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>, SceneError> {
    let io_error = |reason: std::io::Error| match reason.kind() {
        std::io::ErrorKind::NotFound => SceneError::MissingImage { path: path.to_owned() },
        _ => SceneError::Io { path: path.to_owned(), reason },
    };
    ImageReader::open(path).map_err(io_error)?.with_guessed_format().map_err(io_error)
}

fn over_white(picture: DynamicImage) -> Photo {
    let (width, height) = (picture.width(), picture.height());
    if !picture.color().has_alpha() {
        let foreground = GrayImage::from_pixel(width, height, image::Luma([255]));
        return Photo { rgb: picture.into_rgb8(), foreground };
    }
    let rgba = picture.into_rgba8();
    let mut rgb = RgbImage::new(width, height);
    let mut foreground = GrayImage::new(width, height);
    for ((from, to), mask) in rgba.pixels().zip(rgb.pixels_mut()).zip(foreground.pixels_mut()) {
        let [r, g, b, alpha] = from.0;
        to.0 = [r, g, b].map(|channel| blend_over_white(channel, alpha));
        mask.0 = [if alpha >= 128 { 255 } else { 0 }];
    }
    Photo { rgb, foreground }
}

/// `channel * alpha + white * (1 - alpha)`, rounded.
fn blend_over_white(channel: u8, alpha: u8) -> u8 {
    let (channel, alpha) = (u32::from(channel), u32::from(alpha));
    ((channel * alpha + 255 * (255 - alpha) + 127) / 255) as u8
}
