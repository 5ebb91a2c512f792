//! Finds which of the usual conversions would bring the cameras into the splat's frame, by trying all of them.
//!
//! 1. Every way to read a pose, flip the camera's axes and exchange the world's is tried at the file's own scale;
//!    conversions after which some view would not even have the object in its picture are discarded without rendering.
//! 2. If none fits, the most common of them are tried with the camera centres scaled.
//! 3. The best candidates are rendered for more views; the winner's scale is refined.

use nalgebra::Point3;
use serde::Serialize;

use super::verdict::{Small, Verdict, correlation, picture, small_views};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::upper_median;
use crate::render::RenderOptions;
use crate::scene::cameras::align::{Conversion, Reading, SignedPermutation};
use crate::scene::{Scene, SceneError, View};

/// A conversion that makes the photos fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Suggestion {
    /// The value for `--align`.
    pub align: String,
    /// Its meaning in words.
    pub meaning: String,
    /// Median correlation of photos and splat before and after, -1 to 1.
    pub correlation_before: f64,
    pub correlation_after: f64,
}

/// A winner with less than this has won by chance.
const LEAST_CORRELATION: f64 = 0.8;
/// Minimum gain in correlation of the winner.
const LEAST_GAIN: f64 = 0.05;
/// Number of views rendered for each candidate, and number of candidates rendered for all views.
const FIRST_VIEWS: usize = 3;
const FINALISTS: usize = 6;
/// Maximum number of Gaussians rendered in the search: those that cover most of the picture.
const MOST_GAUSSIANS: usize = 40_000;
/// Share of the object that each view must have in its picture for a candidate to be rendered.
const LEAST_IN_PICTURE: f64 = 0.3;

/// The best conversion, if it fits well and better than `applied`, which the cameras of `views` have gone through and
/// which it is to replace.
pub(super) fn suggest(
    scene: &Scene,
    views: &[View],
    applied: &Conversion,
    verdict: &Verdict,
) -> Result<Option<Suggestion>, SceneError> {
    let mut small = small_views(scene, views)?;
    for view in &mut small {
        view.camera.camera_from_world = applied.undo(&view.camera.camera_from_world);
    }
    let search = Search {
        cloud: reduced(&scene.whole_cloud()),
        samples: samples(&scene.gaussians),
        views: small,
        options: RenderOptions::default(),
    };
    let mut best = search.best(&at_own_scale());
    if best.1 < LEAST_CORRELATION {
        let mut scaled = search.best(&at_other_scales());
        search.refine(&mut scaled);
        if scaled.1 > best.1 {
            best = scaled;
        }
    }
    let (conversion, correlation_after) = best;
    let convincing = correlation_after >= LEAST_CORRELATION && correlation_after >= verdict.correlation + LEAST_GAIN;
    Ok(convincing.then(|| Suggestion {
        align: conversion.to_string(),
        meaning: meaning(&conversion),
        correlation_before: verdict.correlation,
        correlation_after,
    }))
}

struct Search<'a> {
    cloud: Gaussians,
    /// Centres of some of the object's Gaussians.
    samples: Vec<Point3<f64>>,
    /// With their cameras before any conversion.
    views: Vec<Small>,
    options: RenderOptions<'a>,
}

impl Search<'_> {
    /// The conversion whose views correlate best, and their correlation.
    fn best(&self, candidates: &[Conversion]) -> (Conversion, f64) {
        let possible = candidates.iter().filter(|conversion| self.shows_object(conversion));
        let first = &self.views[..self.views.len().min(FIRST_VIEWS)];
        let mut ranked: Vec<(Conversion, f64)> = possible.map(|c| (*c, self.correlation(c, first))).collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        ranked.truncate(FINALISTS);
        let finals = ranked.into_iter().map(|(c, _)| (c, self.correlation(&c, &self.views)));
        // Ties go to the first, since simpler conversions come first in the lists.
        finals.fold((Conversion::default(), f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best })
    }

    fn correlation(&self, conversion: &Conversion, views: &[Small]) -> f64 {
        let of_view = |view: &Small| {
            correlation(&view.picture, &picture(&self.cloud, &converted(&view.camera, conversion), &self.options))
        };
        upper_median(views.iter().map(of_view).collect()).unwrap_or_default()
    }

    fn shows_object(&self, conversion: &Conversion) -> bool {
        let shows = |view: &Small| {
            let camera = converted(&view.camera, conversion);
            let (width, height) = (f64::from(camera.intrinsics.width), f64::from(camera.intrinsics.height));
            let inside = |point: &&Point3<f64>| {
                let pixel = camera.pixel(camera.point_in_camera(**point));
                pixel.is_some_and(|p| (0.0..width).contains(&p.x) && (0.0..height).contains(&p.y))
            };
            let count = self.samples.iter().filter(inside).count();
            count as f64 >= LEAST_IN_PICTURE * self.samples.len() as f64
        };
        self.views.iter().all(shows)
    }

    /// Golden-section search for the scale between the neighbours on the grid.
    fn refine(&self, best: &mut (Conversion, f64)) {
        const STEPS: usize = 8;
        let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
        let (mut low, mut high) = ((best.0.scale / SCALE_STEP).ln(), (best.0.scale * SCALE_STEP).ln());
        for _ in 0..STEPS {
            let (left, right) = (high - golden * (high - low), low + golden * (high - low));
            let at = |log: f64| Conversion { scale: rounded(log.exp()), ..best.0 };
            let (a, b) = (at(left), at(right));
            let (of_a, of_b) = (self.correlation(&a, &self.views), self.correlation(&b, &self.views));
            if of_a.max(of_b) > best.1 {
                *best = if of_a > of_b { (a, of_a) } else { (b, of_b) };
            }
            (low, high) = if of_a > of_b { (low, right) } else { (left, high) };
        }
    }
}

fn converted(camera: &Camera, conversion: &Conversion) -> Camera {
    Camera { camera_from_world: conversion.apply(&camera.camera_from_world), ..camera.clone() }
}

const READINGS: [Reading; 4] = [Reading::AsIs, Reading::Inverted, Reading::Transposed, Reading::TransposedOpenGl];

/// Every conversion without a scale, the simple ones first.
fn at_own_scale() -> Vec<Conversion> {
    let flips = |n: u8| [0, 1, 2].map(|axis| n >> axis & 1 == 1);
    let mut all = Vec::new();
    for world in SignedPermutation::all() {
        for reading in READINGS {
            for camera_flip in [0b000, 0b110, 0b101, 0b011, 0b010, 0b001, 0b100, 0b111].map(flips) {
                all.push(Conversion { reading, camera_flip, world, scale: 1.0 });
            }
        }
    }
    all.retain(Conversion::is_proper);
    all
}

/// Ratio of neighbouring scales: a view of an object a fifth too large still correlates with the right one.
const SCALE_STEP: f64 = 1.2;

/// Scales from 1/1000 to 1000, for cameras that are otherwise right or only have OpenGL's axes.
fn at_other_scales() -> Vec<Conversion> {
    const STEPS: i32 = 38;
    let opengl = [false, true, true];
    let scaled = |camera_flip| {
        (-STEPS..=STEPS).map(move |n| Conversion { camera_flip, scale: SCALE_STEP.powi(n), ..Conversion::default() })
    };
    scaled([false; 3]).chain(scaled(opengl)).collect()
}

/// Rounds to four digits, for the user to type.
fn rounded(value: f64) -> f64 {
    let digits = 10f64.powf(3.0 - value.log10().floor());
    (value * digits).round() / digits
}

/// The Gaussians that cover most of the picture, in their original order.
fn reduced(cloud: &Gaussians) -> Gaussians {
    let mut reduced = cloud.clone();
    if cloud.len() <= MOST_GAUSSIANS {
        return reduced;
    }
    let cover = |i: usize| {
        let mut scales: [f64; 3] = cloud.scale(i).into();
        scales.sort_by(f64::total_cmp);
        cloud.opacity(i) * scales[1] * scales[2]
    };
    let covers: Vec<f64> = (0..cloud.len()).map(cover).collect();
    let mut sorted = covers.clone();
    sorted.sort_by(f64::total_cmp);
    let least = sorted[cloud.len() - MOST_GAUSSIANS];
    reduced.retain(&covers.iter().map(|cover| *cover >= least).collect::<Vec<_>>());
    reduced
}

fn samples(gaussians: &Gaussians) -> Vec<Point3<f64>> {
    const SAMPLES: usize = 300;
    let step = (gaussians.len() / SAMPLES).max(1);
    (0..gaussians.len()).step_by(step).map(|i| gaussians.center(i)).collect()
}

/// Describes a conversion in words.
fn meaning(conversion: &Conversion) -> String {
    let mut parts = Vec::new();
    if conversion.is_none() {
        parts.push("the cameras need no conversion".to_owned());
    }
    match conversion.reading {
        Reading::AsIs => {}
        Reading::Transposed | Reading::TransposedOpenGl => parts.push("the rotations are transposed".to_owned()),
        Reading::Inverted => {
            parts.push("the poses are inverted (world-to-camera instead of camera-to-world)".to_owned());
        }
    }
    match conversion.camera_flip {
        [false, false, false] => {}
        [false, true, true] => {
            parts.push("the cameras' y and z axes are flipped (OpenGL instead of OpenCV)".to_owned());
        }
        flipped => {
            let axes: Vec<&str> =
                ["x", "y", "z"].into_iter().zip(flipped).filter(|(_, f)| *f).map(|(a, _)| a).collect();
            parts.push(format!("the cameras are flipped along {}", axes.join(" and ")));
        }
    }
    if conversion.world != SignedPermutation::IDENTITY {
        let done = if conversion.world.mirrors() { "mirrored" } else { "turned" };
        parts.push(format!("the cameras' world is {done} relative to the splat's"));
    }
    if conversion.scale != 1.0 {
        parts.push(format!("the camera centres have to be scaled by {}", conversion.scale));
    }
    parts.join("; ")
}
