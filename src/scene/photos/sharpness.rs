//! Sharpness of a photo: the share of its detail that is as fine as its pixels.
//!
//! Blur removes the finest detail and leaves the coarse. The measure is the energy of the Laplacian at full size
//! divided by that at half size. It is taken well inside the foreground, because the outline is as sharp as the alpha,
//! whatever the photo. It hardly depends on what the photo shows, be it the same wood from near or from far, or a handle
//! or a head. Only values from photos of the same capture are compared.

use image::{GrayImage, Luma, imageops};

use crate::scene::Photo;

/// Minimum distance of a pixel from the background, in pixels, for it to count; a visibly blurred photo is blurred over
/// one to three pixels.
const MARGIN: usize = 5;

/// Ratio of fine to coarse energy in the photo's foreground; `None` if there is no detail at all to judge by.
pub(in crate::scene) fn sharpness(photo: &Photo) -> Option<f64> {
    let fine = imageops::grayscale(&photo.rgb);
    let (width, height) = (fine.width() / 2, fine.height() / 2);
    if width < 3 || height < 3 {
        return None;
    }
    let inside = inside(&photo.foreground);
    let coarse = imageops::resize(&fine, width, height, imageops::FilterType::Triangle);
    let coarse_inside = imageops::resize(&inside, width, height, imageops::FilterType::Nearest);
    let coarse_energy = laplacian_energy(&coarse, &coarse_inside)?;
    let fine_energy = laplacian_energy(&fine, &inside)?;
    (coarse_energy > 0.0).then(|| fine_energy / coarse_energy)
}

/// 255 where all pixels within [`MARGIN`] along rows and columns are foreground: an erosion by a square.
fn inside(foreground: &GrayImage) -> GrayImage {
    let (width, height) = (foreground.width() as usize, foreground.height() as usize);
    let rows: Vec<u8> = foreground.as_raw().chunks_exact(width).flat_map(eroded).collect();
    let column = |x: usize| eroded(&(0..height).map(|y| rows[y * width + x]).collect::<Vec<u8>>());
    let columns: Vec<Vec<u8>> = (0..width).map(column).collect();
    GrayImage::from_fn(foreground.width(), foreground.height(), |x, y| Luma([columns[x as usize][y as usize]]))
}

/// 255 where all of the line within [`MARGIN`] is foreground, 0 elsewhere and near its ends.
fn eroded(line: &[u8]) -> Vec<u8> {
    let mut eroded = vec![0; line.len()];
    for (at, window) in line.windows(2 * MARGIN + 1).enumerate() {
        eroded[at + MARGIN] = if window.contains(&0) { 0 } else { 255 };
    }
    eroded
}

/// Mean square of the four-neighbour Laplacian over the pixels of `mask` that are not on the picture's edge.
fn laplacian_energy(picture: &GrayImage, mask: &GrayImage) -> Option<f64> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let (values, mask) = (picture.as_raw(), mask.as_raw());
    let (mut sum, mut count) = (0u64, 0u64);
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let at = y * width + x;
            if mask[at] == 0 {
                continue;
            }
            let around = [at - 1, at + 1, at - width, at + width];
            let neighbours: i64 = around.iter().map(|neighbour| i64::from(values[*neighbour])).sum();
            let laplacian = neighbours - 4 * i64::from(values[at]);
            sum += (laplacian * laplacian) as u64;
            count += 1;
        }
    }
    (count > 0).then(|| sum as f64 / count as f64)
}
