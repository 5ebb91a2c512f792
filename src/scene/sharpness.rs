//! How sharp a photo is: how much of its detail is as fine as its pixels.
//!
//! Blur takes the finest detail and leaves the coarse. The measure is the energy of the Laplacian at full size over that at
//! half size, within the foreground, so that it hardly depends on what the photo shows: the same wood from near and
//! from far, a handle or a head. Compared between the photos of one capture only.

use image::{GrayImage, imageops};

use super::Photo;

/// Fine over coarse energy of the photo's foreground; `None` where there is no detail at all to judge by.
pub(super) fn sharpness(photo: &Photo) -> Option<f64> {
    let fine = imageops::grayscale(&photo.rgb);
    let (width, height) = (fine.width() / 2, fine.height() / 2);
    if width < 3 || height < 3 {
        return None;
    }
    let coarse = imageops::resize(&fine, width, height, imageops::FilterType::Triangle);
    let coarse_foreground = imageops::resize(&photo.foreground, width, height, imageops::FilterType::Nearest);
    let coarse_energy = laplacian_energy(&coarse, &coarse_foreground)?;
    let fine_energy = laplacian_energy(&fine, &photo.foreground)?;
    (coarse_energy > 0.0).then(|| fine_energy / coarse_energy)
}

/// Mean square of the four-neighbour Laplacian over the foreground and its outline, which shows blur best.
fn laplacian_energy(picture: &GrayImage, foreground: &GrayImage) -> Option<f64> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let (values, mask) = (picture.as_raw(), foreground.as_raw());
    let (mut sum, mut count) = (0u64, 0u64);
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let at = y * width + x;
            let around = [at - 1, at + 1, at - width, at + width];
            if mask[at] == 0 && around.iter().all(|neighbour| mask[*neighbour] == 0) {
                continue;
            }
            let neighbours: i64 = around.iter().map(|neighbour| i64::from(values[*neighbour])).sum();
            let laplacian = neighbours - 4 * i64::from(values[at]);
            sum += (laplacian * laplacian) as u64;
            count += 1;
        }
    }
    (count > 0).then(|| sum as f64 / count as f64)
}
