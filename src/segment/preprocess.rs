//! Prepares a picture for the encoder: longest side 1024, normalised, padded with zeros on the right and below (the
//! public `ResizeLongestSide` and `Sam.preprocess`).

use image::RgbImage;

use super::resize::resize_bilinear;
use super::sam::MODEL_SIDE;

/// Channel means and standard deviations of the training data, 8-bit values (SAM's `pixel_mean` and `pixel_std`).
const MEAN: [f32; 3] = [123.675, 116.28, 103.53];
const DEVIATION: [f32; 3] = [58.395, 57.12, 57.375];

/// A picture prepared for the encoder.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// `[3,1024,1024]`.
    pub input: Vec<f32>,
    /// Width and height of the scaled picture inside, the longer of which is 1024.
    pub scaled: (u32, u32),
}

/// Scales, normalises and pads.
pub fn prepare(picture: &RgbImage) -> Prepared {
    let scaled = scaled_size(picture.width(), picture.height());
    let small = resize_bilinear(picture, scaled.0, scaled.1);
    let mut input = vec![0.0; 3 * MODEL_SIDE * MODEL_SIDE];
    for (channel, plane) in input.chunks_exact_mut(MODEL_SIDE * MODEL_SIDE).enumerate() {
        let rows = small.as_raw().chunks_exact(scaled.0 as usize * 3).zip(plane.chunks_exact_mut(MODEL_SIDE));
        for (source, target) in rows {
            for (pixel, value) in source.chunks_exact(3).zip(target) {
                *value = (f32::from(pixel[channel]) - MEAN[channel]) / DEVIATION[channel];
            }
        }
    }
    Prepared { input, scaled }
}

/// Width and height scaled so that the longer side is 1024, rounded half up.
pub fn scaled_size(width: u32, height: u32) -> (u32, u32) {
    let scale = MODEL_SIDE as f64 / f64::from(width.max(height));
    // A picture more than 2048 times longer than wide would vanish.
    let side = |length: u32| ((f64::from(length) * scale + 0.5) as u32).max(1);
    (side(width), side(height))
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn the_longer_side_is_1024() {
        assert_eq!(scaled_size(758, 1024), (758, 1024));
        assert_eq!(scaled_size(800, 535), (1024, 685));
        assert_eq!(scaled_size(1, 1), (1024, 1024));
        assert_eq!(scaled_size(20_000, 3), (1024, 1));
    }

    #[test]
    fn pixels_are_normalised_and_the_padding_is_zero() {
        let prepared = prepare(&RgbImage::from_pixel(4, 2, Rgb([255, 0, 128])));
        let input_at = |channel: usize, x: usize, y: usize| prepared.input[(channel * MODEL_SIDE + y) * MODEL_SIDE + x];
        assert_eq!(prepared.scaled, (1024, 512));
        for (channel, value) in [255.0, 0.0, 128.0].into_iter().enumerate() {
            assert_eq!(input_at(channel, 1023, 511), (value - MEAN[channel]) / DEVIATION[channel]);
            assert_eq!(input_at(channel, 0, 512), 0.0);
        }
    }
}
