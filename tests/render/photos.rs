//! Held-out photos and depths of the scenes against the rasteriser's pictures.

use gprop::render::{Render, RenderOptions, render};

use super::reference;
use crate::vote::scenes::{self, HeldOut};

/// PSNR in dB over the object's pixels, both over black.
fn psnr(photo: &image::RgbaImage, rgb: impl Fn(usize) -> [f64; 3]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (pixel, truth) in photo.pixels().enumerate() {
        if truth.0[3] < 128 {
            continue;
        }
        let drawn = rgb(pixel);
        let alpha = f64::from(truth.0[3]) / 255.0;
        for (drawn, shot) in drawn.into_iter().zip(truth.0) {
            sum += (drawn.clamp(0.0, 1.0) - f64::from(shot) / 255.0 * alpha).powi(2);
            count += 1;
        }
    }
    -10.0 * (sum / f64::from(count)).log10()
}

fn draw(scene: &scenes::Measured, view: &HeldOut) -> Render {
    render(&scene.scene.gaussians, &view.camera, &RenderOptions::default())
}

#[test]
fn held_out_photos_look_as_in_the_reference_renderer() {
    for measured in scenes::all() {
        let mut total = [0.0; 2];
        for view in &measured.held_out {
            let ours = draw(measured, view);
            let theirs = reference::render(&measured.scene.gaussians, &view.camera);
            let ours = psnr(&view.photo, |pixel| ours.rgb[pixel].map(f64::from));
            let theirs = psnr(&view.photo, |pixel| theirs.rgb[pixel]);
            assert!((ours - theirs).abs() < 0.05, "{ours} dB, reference {theirs} dB");
            total[0] += ours / measured.held_out.len() as f64;
            total[1] += theirs / measured.held_out.len() as f64;
        }
        println!("{}: {:.3} dB on the object, reference {:.3} dB", measured.scene.name, total[0], total[1]);
        // The trainer's own renderer reaches 27.5 to 29.7 dB on these views; the mean over six views hides a little.
        assert!(total[0] > 26.5);
    }
}

/// Median of the absolute depth error inside the silhouette, as a share of the object's bounding-box diagonal.
fn depth_error(measured: &scenes::Measured, depth: impl Fn(&Render) -> &Vec<f32>) -> f64 {
    let mut errors = Vec::new();
    for view in &measured.held_out {
        let drawn = draw(measured, view);
        let pairs = depth(&drawn).iter().zip(&view.depth);
        errors.extend(pairs.filter(|(_, truth)| **truth > 0.0).map(|(depth, truth)| f64::from((depth - truth).abs())));
    }
    let middle = errors.len() / 2;
    errors.select_nth_unstable_by(middle, f64::total_cmp);
    errors[middle] / measured.scene.object_bounds().diagonal()
}

#[test]
fn depths_are_within_six_thousandths_of_the_diagonal() {
    for measured in scenes::all() {
        let median = depth_error(measured, |r| &r.median_depth);
        let expected = depth_error(measured, |r| &r.expected_depth);
        println!("{}: median depth {:.3}%, expected {:.3}%", measured.scene.name, 100.0 * median, 100.0 * expected);
        // Depths of the Gaussians' centres are off by 0.4 to 1.2%.
        assert!(median < 0.006 && expected < 0.006);
    }
}
