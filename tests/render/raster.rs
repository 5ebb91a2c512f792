//! Projection, blending, depth, labels.

use gprop::camera::{Camera, Distortion};
use gprop::render::{
    Colors, FOREGROUND_ALPHA, RenderOptions, Splat, close_holes, project, render, render_foregrounds, render_labels,
};
use nalgebra::Vector3;

use super::reference;
use crate::vote::build::{Blob, camera, cloud, jumble};

fn splats(blobs: &[Blob], camera: &Camera) -> Vec<Splat> {
    project(&cloud(blobs), camera, &RenderOptions::default())
}

/// Largest difference a pixel may have from the double-precision reference: f32 sums of up to a hundred terms (1e-5)
/// and the light from behind at which the rasteriser stops (transmittance 1e-4 times a colour of up to 2).
const PIXEL_TOLERANCE: f64 = 3e-4;

/// A thin sheet across the optical axis that fills the picture.
fn sheet(depth: f32, opacity: f32) -> Blob {
    Blob { scale: [40.0, 40.0, 1e-4], ..Blob::round([0.0, 0.0, depth], 1.0, opacity) }
}

#[test]
fn a_round_gaussian_on_the_axis_projects_as_by_hand() {
    // f s / z = 50 * 0.2 / 2 = 5 px, so the variance is 25 + 0.3 px^2 along both axes.
    let splat = splats(&[Blob::round([0.0, 0.0, 2.0], 0.2, 0.8)], &camera())[0];
    assert_eq!(splat.center, [32.0, 24.0]);
    assert_eq!(splat.depth, 2.0);
    let variance = 25.3;
    for (got, expected) in splat.conic.into_iter().zip([1.0 / variance, 0.0, 1.0 / variance]) {
        assert!((got - expected).abs() < 1e-7, "{:?}", splat.conic);
    }
    // Alpha falls to 1/255 at sqrt(2 ln(0.8 * 255)) deviations.
    let reach = (2.0 * (0.8f32 * 255.0).ln() * variance).sqrt();
    assert!((splat.reach[0] - reach).abs() < 1e-3 && (splat.reach[1] - reach).abs() < 1e-3, "{:?}", splat.reach);
    // On the axis depth and pixel are independent: no slope, and the whole deviation lies along the ray.
    assert!(splat.depth_slope.iter().all(|s| s.abs() < 1e-6), "{:?}", splat.depth_slope);
    assert!((splat.depth_deviation - 0.2).abs() < 1e-6, "{}", splat.depth_deviation);
    // The solid ball with this covariance has the radius sqrt(5) * 0.2.
    assert!((splat.surface_depth - (2.0 - 5.0f32.sqrt() * 0.2)).abs() < 1e-6, "{}", splat.surface_depth);
}

#[test]
fn the_depth_of_a_tilted_disc_follows_its_plane() {
    // A disc of radius 0.3 through (0, 0, 2), thin along its normal, turned 45 degrees about y: its plane is
    // z = 2 - x, since the turn takes x to (cos, 0, -sin).
    let half_turn = 22.5f32.to_radians();
    let mut disc = Blob::round([0.0, 0.0, 2.0], 0.3, 0.9);
    disc.scale[2] = 1e-4;
    disc.rotation = [half_turn.cos(), 0.0, half_turn.sin(), 0.0];
    let splat = splats(&[disc], &camera())[0];
    // One pixel is 2 / 50 scene units at depth 2, where a step along x moves the plane equally far along z; the
    // low-pass takes 0.3 px^2 of about 28 px^2 off, in all 1%.
    assert!((splat.depth_slope[0] + 0.04).abs() < 0.01 * 0.04 + 2e-4, "{:?}", splat.depth_slope);
    assert!(splat.depth_slope[1].abs() < 1e-6);
    // The only extent left along the ray comes from half a pixel of low-pass across a slope of 0.04.
    assert!(splat.depth_deviation < 0.03, "{}", splat.depth_deviation);
}

#[test]
fn what_is_behind_or_too_near_or_outside_or_broken_is_not_drawn() {
    let seen = |blob: Blob| splats(&[blob], &camera()).len() == 1;
    assert!(seen(Blob::round([0.0, 0.0, 1.0], 0.01, 0.9)));
    assert!(!seen(Blob::round([0.0, 0.0, -1.0], 0.01, 0.9)), "behind");
    assert!(!seen(Blob::round([0.0, 0.0, 0.009], 0.001, 0.9)), "nearer than the near plane");
    // The right border lies at x = 0.64; alpha 0.9 reaches 3.3 deviations of 0.01.
    assert!(seen(Blob::round([0.66, 0.0, 1.0], 0.01, 0.9)), "its centre is outside, its rim inside");
    assert!(!seen(Blob::round([0.72, 0.0, 1.0], 0.01, 0.9)), "right of the picture");
    assert!(!seen(Blob::round([0.0, -2.0, 1.0], 0.01, 0.9)), "above the picture");
    assert!(!seen(Blob::round([0.0, 0.0, 1.0], 0.01, 0.003)), "alpha under 1/255");
    assert!(!seen(Blob::round([0.0, 0.0, f32::NAN], 0.01, 0.9)), "not a place");
    assert!(!seen(Blob::round([0.0, 0.0, 1.0], f32::INFINITY, 0.9)), "endless");
    let mut zero_quaternion = Blob::round([0.0, 0.0, 1.0], 0.01, 0.9);
    zero_quaternion.rotation = [0.0; 4];
    assert!(seen(zero_quaternion), "a zero quaternion means no rotation");
}

#[test]
fn an_enormous_gaussian_covers_the_picture_and_nothing_breaks() {
    let picture = render(&cloud(&[Blob::round([0.0, 0.0, 5.0], 1e6, 0.9)]), &camera(), &RenderOptions::default());
    assert!(picture.alpha.iter().all(|a| (a - 0.9).abs() < 1e-4));
}

#[test]
fn two_layers_blend_and_give_the_depths_computed_by_hand() {
    // Thin sheets, so large that alpha is constant around the centre: 0.6 in front, 0.9 behind.
    let red = Blob { color: [1.0, 0.0, 0.0], ..sheet(2.0, 0.6) };
    let blue = Blob { color: [0.0, 0.0, 1.0], ..sheet(4.0, 0.9) };
    let at_center = 24 * 64 + 32;
    let draw = |blobs: &[Blob]| render(&cloud(blobs), &camera(), &RenderOptions::default());
    let picture = draw(&[blue, red]);
    // Weights 0.6 and 0.4 * 0.9 = 0.36.
    let [r, g, b] = picture.rgb[at_center];
    assert!((r - 0.6).abs() < 1e-3 && g.abs() < 1e-6 && (b - 0.36).abs() < 1e-3, "{r} {g} {b}");
    assert!((picture.alpha[at_center] - 0.96).abs() < 1e-3);
    // (0.6 * 2 + 0.36 * 4) / 0.96 = 2.75; half of the light comes from the red layer alone.
    assert!((picture.expected_depth[at_center] - 2.75).abs() < 1e-2, "{}", picture.expected_depth[at_center]);
    assert!((picture.median_depth[at_center] - 2.0).abs() < 1e-2, "{}", picture.median_depth[at_center]);
    // With alpha 0.3 in front, half of the light is reached in the blue layer.
    let picture = draw(&[Blob { opacity: 0.3, ..red }, blue]);
    assert!((picture.median_depth[at_center] - 4.0).abs() < 1e-2, "{}", picture.median_depth[at_center]);
    // A single layer of 0.3 never reaches it.
    let picture = draw(&[Blob { opacity: 0.3, ..red }]);
    assert_eq!(picture.median_depth[at_center], f32::INFINITY);
    // Over white, 0.2 red and 0.8 white: 204 of 255.
    let picture = draw(&[Blob { opacity: 0.2, ..red }]);
    assert_eq!(picture.to_image([1.0; 3]).get_pixel(32, 24).0, [255, 204, 204, 255]);
}

#[test]
fn every_pixel_equals_the_reference() {
    let gaussians = jumble(400, 7);
    let mut distorted = camera();
    distorted.intrinsics.distortion = Distortion::opencv(-0.12, 0.05, 0.003, -0.002, 0.0);
    let mut turned = camera();
    turned.camera_from_world.rotation = nalgebra::UnitQuaternion::new(Vector3::new(0.1, -0.3, 0.2));
    turned.camera_from_world.translation.vector = Vector3::new(0.2, -0.1, 1.5);
    turned.intrinsics.cx = 28.5;
    turned.intrinsics.fy = 44.0;
    for (name, camera) in [("plain", camera()), ("distorted", distorted), ("turned", turned)] {
        let ours = render(&gaussians, &camera, &RenderOptions::default());
        let theirs = reference::render(&gaussians, &camera);
        assert!(theirs.alpha.iter().sum::<f64>() > 1000.0, "{name}: the reference shows almost nothing");
        for pixel in 0..theirs.alpha.len() {
            let error = (0..3)
                .map(|c| (f64::from(ours.rgb[pixel][c]) - theirs.rgb[pixel][c]).abs())
                .fold((f64::from(ours.alpha[pixel]) - theirs.alpha[pixel]).abs(), f64::max);
            assert!(error < PIXEL_TOLERANCE, "{name}: pixel {pixel} is {error} off");
        }
    }
}

#[test]
fn fixed_colors_replace_the_harmonics() {
    let gaussians = jumble(50, 3);
    let white = vec![[1.0; 3]; gaussians.len()];
    let options = RenderOptions { colors: Colors::Fixed(&white), ..Default::default() };
    let picture = render(&gaussians, &camera(), &options);
    for (rgb, alpha) in picture.rgb.iter().zip(&picture.alpha) {
        assert!(rgb.iter().all(|c| (c - alpha).abs() < 1e-6));
    }
}

#[test]
fn the_antialiased_variant_keeps_the_light_of_what_is_thinner_than_a_pixel() {
    // 0.1 px wide: the low-pass spreads it to sqrt(0.31) px, so its alpha falls by 0.01 / 0.31.
    let mut gaussians = cloud(&[Blob::round([0.0, 0.0, 2.0], 0.004, 0.9)]);
    gaussians.antialiased = true;
    let splat = project(&gaussians, &camera(), &RenderOptions::default())[0];
    assert!((splat.opacity - 0.9 * 0.01 / 0.31).abs() < 1e-5, "{}", splat.opacity);
}

#[test]
fn a_pixel_belongs_to_the_label_that_gives_most_of_its_light() {
    let (front, middle, back) = (sheet(2.0, 0.4), sheet(3.0, 0.4), sheet(4.0, 0.95));
    let gaussians = cloud(&[front, middle, back]);
    let at_center = |labels: [u32; 3]| render_labels(&gaussians, &camera(), &labels, &Default::default())[24 * 64 + 32];
    // Weights 0.4, 0.6 * 0.4 = 0.24, 0.36 * 0.95 = 0.342.
    assert_eq!(at_center([7, 8, 9]), Some(7));
    assert_eq!(at_center([7, 8, 8]), Some(8));
    assert_eq!(at_center([9, 7, 9]), Some(9));
    // An alpha of 0.4 is not foreground.
    let thin = cloud(&[front]);
    assert_eq!(render_labels(&thin, &camera(), &[7], &Default::default())[24 * 64 + 32], None);
}

/// Whole pictures of each label by itself, white before black.
#[test]
fn foregrounds_of_all_labels_are_those_of_each() {
    for seed in 0..8 {
        let gaussians = jumble(3000, seed);
        let labels: Vec<u32> = (0..gaussians.len() as u32).map(|i| i * i % 5).collect();
        let camera = camera();
        let width = camera.intrinsics.width as usize;
        let of = |label: u32| {
            let colors: Vec<[f32; 3]> = labels.iter().map(|of| [f32::from(u8::from(*of == label)); 3]).collect();
            let options = RenderOptions { colors: Colors::Fixed(&colors), ..Default::default() };
            let own: Vec<f32> = render(&gaussians, &camera, &options).rgb.iter().map(|[share, ..]| *share).collect();
            let mut closed = own.clone();
            close_holes(&mut closed, width);
            (label, own, closed)
        };
        let each: Vec<_> = [1, 4].map(of).into();
        assert!(labels.contains(&0) && !labels.contains(&2), "squares modulo five");
        let at = |pixel: usize| {
            let own = each.iter().find(|(_, own, _)| own[pixel] >= FOREGROUND_ALPHA);
            own.or(each.iter().find(|(.., closed)| closed[pixel] >= FOREGROUND_ALPHA)).map(|(label, ..)| *label)
        };
        let shown = render_foregrounds(&gaussians, &camera, &labels);
        let expected: Vec<Option<u32>> = (0..shown.len()).map(at).collect();
        assert!(expected.contains(&None) && expected.contains(&Some(1)) && expected.contains(&Some(4)));
        assert_eq!(shown, expected, "seed {seed}");
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let gaussians = jumble(3000, 11);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&gaussians, &camera(), &RenderOptions::default()))
    };
    let (one, two, five) = (on(1), on(2), on(5));
    assert!(one == two && one == five);
}
