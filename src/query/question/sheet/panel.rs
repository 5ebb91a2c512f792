//! One panel of a sheet: cropped, put on its background, scaled to fit.

use image::imageops::{self, FilterType};
use image::{GenericImage, GrayImage, ImageBuffer, Luma, Pixel, Rgb, RgbImage};

use crate::scene::Photo;
use crate::segment::LabelMap;

/// Background of the object: light enough for dark objects, dark enough that a white one keeps its edge.
const GROUND: Rgb<u8> = Rgb([222, 222, 222]);
/// Background of the subject alone.
const GREY: Rgb<u8> = Rgb([128, 128, 128]);
const RED: [u8; 3] = [255, 0, 0];
/// Share of red over the subject, in tenths: its own appearance still shows through.
const RED_TENTHS: u16 = 4;
/// Width of the red outline inside the subject's edge and of the white one outside it, in pixels of the sheet. The
/// white outline makes the edge visible on a red object.
const OUTLINE: u32 = 2;
/// Blank space around a box: this share of its longer side, but at least the number of pixels below.
const MARGIN_SHARE: u32 = 16;
const MARGIN_MIN: u32 = 2;

/// A box of pixels, `x0 <= x < x1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    pub x0: u32,
    pub y0: u32,
    pub x1: u32,
    pub y1: u32,
}

impl Area {
    pub fn hull(self, other: Self) -> Self {
        Self {
            x0: self.x0.min(other.x0),
            y0: self.y0.min(other.y0),
            x1: self.x1.max(other.x1),
            y1: self.y1.max(other.y1),
        }
    }

    /// The box with its margin, clipped to a picture of `width` x `height`.
    pub fn with_margin(self, width: u32, height: u32) -> Self {
        let margin = ((self.x1 - self.x0).max(self.y1 - self.y0) / MARGIN_SHARE).max(MARGIN_MIN);
        Self {
            x0: self.x0.saturating_sub(margin),
            y0: self.y0.saturating_sub(margin),
            x1: (self.x1 + margin).min(width),
            y1: (self.y1 + margin).min(height),
        }
    }

    /// Width over height.
    pub fn aspect(self) -> f64 {
        f64::from(self.width()) / f64::from(self.height())
    }

    pub fn width(self) -> u32 {
        self.x1 - self.x0
    }

    pub fn height(self) -> u32 {
        self.y1 - self.y0
    }
}

/// The smallest box around all pixels of at least half coverage.
pub fn bounding_box(mask: &GrayImage) -> Option<Area> {
    let mut found: Option<Area> = None;
    for (y, row) in (0..).zip(mask.rows()) {
        let mut covered = (0..).zip(row).filter(|(_, pixel)| pixel[0] >= 128).map(|(x, _)| x);
        if let Some(first) = covered.next() {
            let line = Area { x0: first, y0: y, x1: covered.last().unwrap_or(first) + 1, y1: y + 1 };
            found = Some(found.map_or(line, |all| all.hull(line)));
        }
    }
    found
}

/// The object on its plain background. Where a photo was composited over white, the background shows instead, outside of
/// the object; the surroundings in any other photo stay as they are.
pub fn object(photo: &Photo, object_box: Area, size: (u32, u32)) -> RgbImage {
    let crop = crop(object_box, |x, y| {
        if !photo.over_white {
            return *photo.rgb.get_pixel(x, y);
        }
        let through = u16::from(255 - photo.foreground.get_pixel(x, y)[0]);
        photo.rgb.get_pixel(x, y).map2(&GROUND, |seen, ground| {
            let less = (u16::from(255 - ground) * through + 127) / 255;
            (u16::from(seen).saturating_sub(less)) as u8
        })
    });
    fit(&crop, GROUND, size)
}

/// The object's panel with the subject in translucent red, outlined in red and white.
pub fn subject_in_red(mut object: RgbImage, mask: &GrayImage, object_box: Area) -> RgbImage {
    let mask = scaled_mask(&crop(object_box, |x, y| *mask.get_pixel(x, y)), object.dimensions());
    let edge = near_edge(&mask);
    for ((pixel, coverage), at_edge) in object.pixels_mut().zip(mask.pixels()).zip(edge) {
        match (is_inside(coverage), at_edge) {
            (true, true) => *pixel = Rgb(RED),
            (true, false) => {
                let mix = |under: u8, red: u8| {
                    ((u16::from(under) * (10 - RED_TENTHS) + u16::from(red) * RED_TENTHS) / 10) as u8
                };
                *pixel = pixel.map2(&Rgb(RED), mix);
            }
            (false, true) => *pixel = Rgb([255; 3]),
            (false, false) => {}
        }
    }
    object
}

/// A mask scaled like the picture in a panel of this size. A subject that is too thin to cover half of any pixel there,
/// such as a wire in a large photo, gets every pixel that it touches: it must be marked somewhere.
fn scaled_mask(mask: &GrayImage, size: (u32, u32)) -> GrayImage {
    let scaled = fit(mask, Luma([0]), size);
    if scaled.pixels().any(is_inside) {
        return scaled;
    }
    let (width, height) = fitted(mask.dimensions(), size);
    let in_panel = |pixel: u32, of: u32, to: u32, room: u32| {
        (room - to) / 2 + (u64::from(pixel) * u64::from(to) / u64::from(of)) as u32
    };
    let mut touched = GrayImage::new(size.0, size.1);
    for (x, y, _) in mask.enumerate_pixels().filter(|(.., coverage)| is_inside(coverage)) {
        let (x, y) = (in_panel(x, mask.width(), width, size.0), in_panel(y, mask.height(), height, size.1));
        touched.put_pixel(x, y, Luma([255]));
    }
    touched
}

fn is_inside(coverage: &Luma<u8>) -> bool {
    coverage[0] >= 128
}

/// For each pixel, row by row: true if it lies within [`OUTLINE`] pixels of one on the other side of the mask's edge.
fn near_edge(mask: &GrayImage) -> Vec<bool> {
    let (width, height) = mask.dimensions();
    let mut near = vec![false; (width * height) as usize];
    let mut stamp = |x: u32, y: u32, step_x: u32, step_y: u32| {
        for ny in (y + 1).saturating_sub(OUTLINE)..(y + step_y + OUTLINE).min(height) {
            let row = (ny * width) as usize;
            let start = (x + 1).saturating_sub(OUTLINE) as usize;
            let end = (x + step_x + OUTLINE).min(width) as usize;
            near[row + start..row + end].fill(true);
        }
    };
    for (x, y, pixel) in mask.enumerate_pixels() {
        let here = is_inside(pixel);
        if x + 1 < width && is_inside(mask.get_pixel(x + 1, y)) != here {
            stamp(x, y, 1, 0);
        }
        if y + 1 < height && is_inside(mask.get_pixel(x, y + 1)) != here {
            stamp(x, y, 0, 1);
        }
    }
    near
}

/// The subject's pixels and nothing else, enlarged to fill the panel.
pub fn subject_alone(photo: &Photo, mask: &GrayImage, subject_box: Area, size: (u32, u32)) -> RgbImage {
    let crop = crop(subject_box, |x, y| if mask.get_pixel(x, y)[0] == 0 { GREY } else { *photo.rgb.get_pixel(x, y) });
    fit(&crop, GREY, size)
}

fn crop<P: Pixel>(source: Area, pixel: impl Fn(u32, u32) -> P) -> ImageBuffer<P, Vec<P::Subpixel>> {
    ImageBuffer::from_fn(source.width(), source.height(), |x, y| pixel(source.x0 + x, source.y0 + y))
}

/// Scales a picture to the largest size that fits into `size`, centred on `ground`.
fn fit<P: Pixel<Subpixel = u8> + 'static>(
    picture: &ImageBuffer<P, Vec<u8>>,
    ground: P,
    size: (u32, u32),
) -> ImageBuffer<P, Vec<u8>> {
    let (width, height) = fitted(picture.dimensions(), size);
    let scaled = imageops::resize(picture, width, height, FilterType::CatmullRom);
    let mut panel = ImageBuffer::from_pixel(size.0, size.1, ground);
    panel.copy_from(&scaled, (size.0 - width) / 2, (size.1 - height) / 2).expect("the picture was scaled to fit");
    panel
}

/// The pixel of the photo that a panel of this size shows at `at`, from the panel's upper left corner, from 0 to 1; `None` if it
/// shows the ground there.
pub fn place_in_photo(object_box: Area, size: (u32, u32), at: [f64; 2]) -> Option<[f64; 2]> {
    let (width, height) = fitted((object_box.width(), object_box.height()), size);
    let along = |at: f64, room: u32, shown: u32, first: u32, from: u32| {
        let place = (at * f64::from(room) - f64::from((room - shown) / 2)) / f64::from(shown);
        (0.0..1.0).contains(&place).then(|| f64::from(first) + place * f64::from(from))
    };
    let x = along(at[0], size.0, width, object_box.x0, object_box.width())?;
    Some([x, along(at[1], size.1, height, object_box.y0, object_box.height())?])
}

/// The labels within a box, on a panel of this size, placed as [`fit`] places the picture; 0 around them.
pub fn labels(map: &LabelMap, object_box: Area, size: (u32, u32)) -> LabelMap {
    let (width, height) = fitted((object_box.width(), object_box.height()), size);
    let (left, top) = ((size.0 - width) / 2, (size.1 - height) / 2);
    let nearest = |at: u32, of: u32, from: u32| (u64::from(at) * u64::from(from) / u64::from(of)) as u32;
    let label = |x: u32, y: u32| {
        let (x, y) = (x.checked_sub(left).filter(|x| *x < width)?, y.checked_sub(top).filter(|y| *y < height)?);
        let x = object_box.x0 + nearest(x, width, object_box.width());
        let y = object_box.y0 + nearest(y, height, object_box.height());
        map.labels.get((y * map.width + x) as usize).copied()
    };
    let places = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
    let labels = places.map(|(x, y)| label(x, y).unwrap_or(0)).collect();
    LabelMap { width: size.0, height: size.1, labels }
}

/// The largest size with the proportions of a picture of `width` x `height` that fits into `size`.
fn fitted((width, height): (u32, u32), size: (u32, u32)) -> (u32, u32) {
    let (width, height) = (u64::from(width), u64::from(height));
    let (room_x, room_y) = (u64::from(size.0), u64::from(size.1));
    let (fit_x, fit_y) = if width * room_y >= height * room_x {
        (room_x, (room_x * height / width).max(1))
    } else {
        ((room_y * width / height).max(1), room_y)
    };
    (fit_x as u32, fit_y as u32)
}
