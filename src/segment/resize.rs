//! Resizes 8-bit pictures exactly as Pillow's `Image.resize(..., BILINEAR)` does, which SAM's preprocessing calls
//! through torchvision: a triangle filter that widens with the reduction (so it antialiases), columns first, rounded to
//! 8 bits between the two passes, in fixed point with 22 fractional bits (Pillow, `Resample.c`).

use image::{RgbImage, imageops};

const FRACTION_BITS: u32 = 22;

/// For one output sample: the first input sample, and the fixed-point weights of that sample and those after it.
struct Taps {
    first: usize,
    weights: Vec<i32>,
}

/// Returns `picture` resized to `width` x `height`.
pub fn resize_bilinear(picture: &RgbImage, width: u32, height: u32) -> RgbImage {
    let wide = if width == picture.width() { picture.clone() } else { resize_columns(picture, width) };
    if height == wide.height() { wide } else { resize_rows(&wide, height) }
}

/// The part of `picture` inside a rectangle.
pub fn cropped(picture: &RgbImage, rect: &super::mask::Rect) -> RgbImage {
    imageops::crop_imm(picture, rect.x0, rect.y0, rect.width(), rect.height()).to_image()
}

fn resize_columns(picture: &RgbImage, width: u32) -> RgbImage {
    let taps = taps(picture.width() as usize, width as usize);
    let mut resized = RgbImage::new(width, picture.height());
    let (source_stride, target_stride) = (picture.width() as usize * 3, width as usize * 3);
    let rows = picture.as_raw().chunks_exact(source_stride).zip(resized.chunks_exact_mut(target_stride));
    for (source, target) in rows {
        for (taps, pixel) in taps.iter().zip(target.chunks_exact_mut(3)) {
            let mut sums = [1 << (FRACTION_BITS - 1); 3];
            for (weight, sample) in taps.weights.iter().zip(source[taps.first * 3..].chunks_exact(3)) {
                for channel in 0..3 {
                    sums[channel] += i32::from(sample[channel]) * weight;
                }
            }
            for channel in 0..3 {
                pixel[channel] = rounded(sums[channel]);
            }
        }
    }
    resized
}

fn resize_rows(picture: &RgbImage, height: u32) -> RgbImage {
    let taps = taps(picture.height() as usize, height as usize);
    let mut resized = RgbImage::new(picture.width(), height);
    let stride = picture.width() as usize * 3;
    let mut sums = vec![0; stride];
    for (taps, target) in taps.iter().zip(resized.chunks_exact_mut(stride)) {
        sums.fill(1 << (FRACTION_BITS - 1));
        for (weight, source) in taps.weights.iter().zip(picture.as_raw()[taps.first * stride..].chunks_exact(stride)) {
            for (sum, sample) in sums.iter_mut().zip(source) {
                *sum += i32::from(*sample) * weight;
            }
        }
        for (sum, sample) in sums.iter().zip(target) {
            *sample = rounded(*sum);
        }
    }
    resized
}

fn rounded(sum: i32) -> u8 {
    (sum >> FRACTION_BITS).clamp(0, 255) as u8
}

/// The weights of every output sample of one axis.
fn taps(from: usize, to: usize) -> Vec<Taps> {
    let scale = from as f64 / to as f64;
    let support = scale.max(1.0);
    let taps_at = |index: usize| {
        let center = (index as f64 + 0.5) * scale;
        // Casts to integers saturate at zero; Pillow clamps there.
        let first = (center - support + 0.5) as usize;
        let end = ((center + support + 0.5) as usize).min(from);
        let weight = |sample: usize| (1.0 - ((sample as f64 - center + 0.5) / support).abs()).max(0.0);
        let total: f64 = (first..end).map(weight).sum();
        let fixed = |sample: usize| (0.5 + weight(sample) / total * f64::from(1 << FRACTION_BITS)) as i32;
        Taps { first, weights: (first..end).map(fixed).collect() }
    };
    (0..to).map(taps_at).collect()
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    fn grey(width: u32, values: &[u8]) -> RgbImage {
        RgbImage::from_fn(width, values.len() as u32 / width, |x, y| Rgb([values[(y * width + x) as usize]; 3]))
    }

    fn first_channel(picture: &RgbImage) -> Vec<u8> {
        picture.pixels().map(|pixel| pixel[0]).collect()
    }

    /// Expected values from Pillow 13.0: `Image.fromarray(a).resize((w, h), Image.BILINEAR)`.
    #[test]
    fn samples_are_pillows() {
        let ramp = grey(5, &[0, 10, 50, 200, 255, 7, 99, 180, 3, 60]);
        assert_eq!(first_channel(&resize_bilinear(&ramp, 8, 2)), PILLOW_8X2);
        assert_eq!(first_channel(&resize_bilinear(&ramp, 3, 2)), PILLOW_3X2);
        assert_eq!(first_channel(&resize_bilinear(&ramp, 2, 1)), PILLOW_2X1);
        assert_eq!(first_channel(&resize_bilinear(&ramp, 3, 5)), PILLOW_3X5);
    }

    const PILLOW_8X2: [u8; 16] = [0, 4, 13, 38, 97, 191, 231, 255, 7, 47, 104, 155, 125, 14, 35, 60];
    const PILLOW_3X2: [u8; 6] = [4, 74, 231, 46, 123, 36];
    const PILLOW_2X1: [u8; 2] = [55, 121];
    const PILLOW_3X5: [u8; 15] = [4, 74, 231, 8, 79, 212, 25, 99, 134, 42, 118, 55, 46, 123, 36];
}
