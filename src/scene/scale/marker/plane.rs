//! A grey picture, and the light at any place in it.

use std::sync::LazyLock;

use image::RgbImage;
use nalgebra::Point2;

use crate::numeric::srgb_light;

/// A grey picture with the photo's own (gamma-encoded) values.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<u8>,
}

/// The light, 0 to 1, for each value of sRGB. Blur, whether of a lens or of a pixel, is symmetric in light
/// and not in encoded values, so edges are located in light.
static LIGHT: LazyLock<[f64; 256]> = LazyLock::new(|| std::array::from_fn(|value| srgb_light(value as u8)));

impl Plane {
    pub fn of(picture: &RgbImage) -> Self {
        // Rec. 601's weights in 256ths.
        let grey = |[r, g, b]: [u8; 3]| ((77 * u32::from(r) + 150 * u32::from(g) + 29 * u32::from(b)) >> 8) as u8;
        Self {
            width: picture.width() as usize,
            height: picture.height() as usize,
            values: picture.pixels().map(|pixel| grey(pixel.0)).collect(),
        }
    }

    /// The picture at half its size; an odd last row or column is left out.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let (upper, lower) = (&self.values[2 * y * self.width..], &self.values[(2 * y + 1) * self.width..]);
            values.extend((0..width).map(|x| {
                let sum: u32 =
                    [upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1]].map(u32::from).iter().sum();
                ((sum + 2) / 4) as u8
            }));
        }
        Self { width, height, values }
    }

    /// The light at a place in pixels from the upper left corner, linear between the centres of pixels; `None` outside.
    pub fn light(&self, at: Point2<f64>) -> Option<f64> {
        let (x, y) = (at.x - 0.5, at.y - 0.5);
        let inside = x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64;
        if !inside {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (u, v) = (x - column as f64, y - row as f64);
        let first = row * self.width + column;
        let value = |at: usize| LIGHT[usize::from(self.values[at])];
        let upper = value(first) * (1.0 - u) + value(first + 1) * u;
        let lower = value(first + self.width) * (1.0 - u) + value(first + self.width + 1) * u;
        Some(upper * (1.0 - v) + lower * v)
    }
}
