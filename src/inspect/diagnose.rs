//! Finds what would bring the cameras into the splat's frame, by trying it.
//!
//! 1. The similarity that gsplat's trainer computes from a COLMAP model, which follows from the files.
//! 2. The usual conversions. Every way to read a pose, flip the camera's axes and exchange the world's is tried at the file's
//!    own scale; conversions after which some view would not even have the object in its picture are discarded without
//!    rendering. If none fits, the most common of them are tried with the camera centres scaled. The best candidates are
//!    rendered for more views; the winner's scale is refined.
//! 3. Any other [similarity](super::similarity), which is searched for only if none of these fits.
//!
//! The first of these after which the photos fit the splat, by the same rules as for the cameras as they are, is suggested.
//! A similarity that was searched for must also be clearly better than any other on photos that the search has not seen; if
//! not, it is shown as doubtful. One that leaves the object where it is says nothing, and is not shown.

use nalgebra::{Isometry3, Point3, Similarity3};
use serde::Serialize;

use super::similarity::{self, Found};
use super::verdict::{self, MOST_VIEWS, Small, Verdict, correlation, picture, small_views};
use super::{ViewFit, compare, samples};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::upper_median;
use crate::render::RenderOptions;
use crate::scene::cameras::align::{Align, Conversion, Reading, SignedPermutation, rounded as rounded_similarity};
use crate::scene::{Scene, SceneError, View};
use crate::words::progress::Progress;

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
    /// Median PSNR of the same views in dB, before and after.
    pub psnr_before_db: f64,
    pub psnr_after_db: f64,
}

/// The best placement that the search for a similarity found, if it does not convince.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Doubtful {
    /// The value for `--align`.
    pub align: String,
    /// Median PSNR, in dB, of photos that the search has not seen.
    pub psnr_db: f64,
    /// The same with the next best placement.
    pub next_psnr_db: Option<f64>,
    /// Why it is not suggested.
    pub reason: String,
}

/// What makes the photos fit, or might.
#[derive(Debug, Default)]
pub(super) struct Diagnosis {
    pub suggestion: Option<Suggestion>,
    pub doubtful: Option<Doubtful>,
}

impl From<Option<Suggestion>> for Diagnosis {
    fn from(suggestion: Option<Suggestion>) -> Self {
        Self { suggestion, doubtful: None }
    }
}

/// A winner with less than this has won by chance.
const LEAST_CORRELATION: f64 = 0.8;
/// Minimum gain of a conversion in PSNR.
const LEAST_GAIN_DB: f64 = 1.0;
/// Number of views rendered for each candidate, and number of candidates rendered for all views.
const FIRST_VIEWS: usize = 3;
const FINALISTS: usize = 6;
/// About how many Gaussians are rendered for each candidate.
const FIRST_GAUSSIANS: usize = 5_000;
/// Maximum number of Gaussians rendered in the search: those that cover most of the picture.
const MOST_GAUSSIANS: usize = 40_000;
/// Share of the object that each view must have in its picture for a candidate to be rendered.
const LEAST_IN_PICTURE: f64 = 0.3;

/// What makes the photos fit best, better than the conversion that the cameras of `views` have gone through and which it is
/// to replace. `fits` and `verdict`: how the views fit now.
pub(super) fn suggest(
    scene: &Scene,
    views: &[View],
    fits: &[ViewFit],
    verdict: &Verdict,
    progress: Progress,
) -> Result<Diagnosis, SceneError> {
    let as_in_file = |view: &View| seen_from(view, scene.conversion.undo(&view.camera.camera_from_world));
    let step = views.len().div_ceil(MOST_VIEWS).max(1);
    let trial = Trial {
        scene,
        views: views.iter().step_by(step).map(as_in_file).collect(),
        correlation_before: verdict.correlation,
        psnr_before_db: median_psnr(fits.iter().step_by(step)),
        progress,
    };
    if let Some(found) = trial.of_gsplat()? {
        return Ok(Some(found).into());
    }
    if let Some(found) = trial.usual()? {
        return Ok(Some(found).into());
    }
    let all: Vec<View> = views.iter().map(as_in_file).collect();
    match similarity::search(scene, &all, progress)? {
        Some(found) if found.moves_object() => trial.of_search(&found),
        _ => Ok(Diagnosis::default()),
    }
}

/// The views that conversions are tried on.
struct Trial<'a> {
    scene: &'a Scene,
    /// With their cameras before any conversion.
    views: Vec<View>,
    correlation_before: f64,
    psnr_before_db: f64,
    progress: Progress<'a>,
}

impl Trial<'_> {
    /// The suggestion of this conversion if it makes the photos fit, and better than before.
    fn of(&self, align: &Align, conversion: &Conversion) -> Result<Option<Suggestion>, SceneError> {
        let (suggestion, fits) = self.tried(align, conversion)?;
        Ok(Some(suggestion).filter(|_| fits))
    }

    /// The suggestion of this conversion, and whether it makes the photos fit, and better than before.
    fn tried(&self, align: &Align, conversion: &Conversion) -> Result<(Suggestion, bool), SceneError> {
        let after = |view: &View| seen_from(view, conversion.apply(&view.camera.camera_from_world));
        let views: Vec<View> = self.views.iter().map(after).collect();
        let fits = compare::compare(self.scene, &views, self.progress)?;
        let verdict = verdict::of(self.scene, &views, &fits, self.progress)?;
        let psnr_after_db = median_psnr(fits.iter());
        let aligned = verdict.as_ref().is_some_and(|verdict| verdict.aligned);
        let suggestion = Suggestion {
            align: align.to_string(),
            meaning: meaning(align, conversion),
            correlation_before: self.correlation_before,
            correlation_after: verdict.map_or(0.0, |verdict| verdict.correlation),
            psnr_before_db: self.psnr_before_db,
            psnr_after_db,
        };
        Ok((suggestion, aligned && psnr_after_db >= self.psnr_before_db + LEAST_GAIN_DB))
    }

    /// What was searched for and found: a suggestion if the photos fit with it and it is clearly the best.
    fn of_search(&self, found: &Found) -> Result<Diagnosis, SceneError> {
        let conversion = Conversion { similarity: rounded_similarity(&found.similarity), ..Conversion::default() };
        let (mut suggestion, fits) = self.tried(&Align::By(conversion), &conversion)?;
        let reason = match (fits, found.is_clear()) {
            (true, true) => {
                suggestion.meaning.push_str(&format!("; {}", found.judgement()));
                return Ok(Some(suggestion).into());
            }
            (false, _) => format!("the photos do not fit the splat with it; {}", found.judgement()),
            (true, false) => format!("other placements fit about as well; {}", found.judgement()),
        };
        let Found { psnr_db, next_psnr_db, .. } = *found;
        Ok(Diagnosis {
            suggestion: None,
            doubtful: Some(Doubtful { align: suggestion.align, psnr_db, next_psnr_db, reason }),
        })
    }

    /// The best of the similarities that gsplat may have used.
    fn of_gsplat(&self) -> Result<Option<Suggestion>, SceneError> {
        let mut best: Option<Suggestion> = None;
        for (turn, conversion) in self.scene.registered.of_gsplat()? {
            let found = self.of(&Align::Gsplat(turn), &conversion)?;
            let psnr = |one: &Option<Suggestion>| one.as_ref().map(|one| one.psnr_after_db);
            if psnr(&found) > psnr(&best) {
                best = found;
            }
        }
        Ok(best)
    }

    /// The best of the usual conversions.
    fn usual(&self) -> Result<Option<Suggestion>, SceneError> {
        let search = Search {
            coarse: thinned(&self.scene.whole_cloud(), FIRST_GAUSSIANS),
            cloud: reduced(&self.scene.whole_cloud()),
            samples: samples(&self.scene.gaussians),
            views: small_views(self.scene, &self.views)?,
            options: RenderOptions::default(),
        };
        let mut best = search.best(&at_own_scale(), self.progress);
        if best.1 < LEAST_CORRELATION {
            let mut scaled = search.best(&at_other_scales(), self.progress);
            search.refine(&mut scaled);
            if scaled.1 > best.1 {
                best = scaled;
            }
        }
        if best.1 < LEAST_CORRELATION { Ok(None) } else { self.of(&Align::By(best.0), &best.0) }
    }
}

fn seen_from(view: &View, camera_from_world: Isometry3<f64>) -> View {
    View { camera: Camera { camera_from_world, ..view.camera.clone() }, ..view.clone() }
}

fn median_psnr<'a>(fits: impl Iterator<Item = &'a ViewFit>) -> f64 {
    upper_median(fits.map(|fit| fit.psnr_db).collect()).unwrap_or_default()
}

/// At most about `most` of the Gaussians, evenly from the whole file, enlarged so that they still cover what all of them do.
fn thinned(cloud: &Gaussians, most: usize) -> Gaussians {
    let step = cloud.len().div_ceil(most).max(1);
    let mut thinned = cloud.clone();
    if step > 1 {
        thinned.retain(&(0..cloud.len()).map(|i| i % step == 0).collect::<Vec<_>>());
        let larger = 0.5 * (step as f32).ln();
        thinned.log_scales.iter_mut().flatten().for_each(|scale| *scale += larger);
    }
    thinned
}

struct Search<'a> {
    /// The splat as it is drawn for every candidate.
    coarse: Gaussians,
    /// As it is drawn for the best.
    cloud: Gaussians,
    /// Centres of some of the object's Gaussians.
    samples: Vec<Point3<f64>>,
    /// With their cameras before any conversion.
    views: Vec<Small>,
    options: RenderOptions<'a>,
}

impl Search<'_> {
    /// The conversion whose views correlate best, and their correlation.
    fn best(&self, candidates: &[Conversion], progress: Progress) -> (Conversion, f64) {
        let possible: Vec<&Conversion> = candidates.iter().filter(|conversion| self.shows_object(conversion)).collect();
        let first = &self.views[..self.views.len().min(FIRST_VIEWS)];
        let bar = progress.bar("align", possible.len() as u64).with_message("conversions tried");
        let tried = |conversion: &Conversion| {
            let correlation = self.correlation(conversion, &self.coarse, first);
            bar.inc(1);
            (*conversion, correlation)
        };
        let mut ranked: Vec<(Conversion, f64)> = possible.into_iter().map(tried).collect();
        bar.finish_and_clear();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        ranked.truncate(FINALISTS);
        let finals = ranked.into_iter().map(|(c, _)| (c, self.correlation(&c, &self.cloud, &self.views)));
        // Ties go to the first, since simpler conversions come first in the lists.
        finals.fold((Conversion::default(), f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best })
    }

    fn correlation(&self, conversion: &Conversion, cloud: &Gaussians, views: &[Small]) -> f64 {
        let of_view = |view: &Small| {
            correlation(&view.picture, &picture(cloud, &converted(&view.camera, conversion), &self.options))
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
            let conversion_at = |log: f64| Conversion { scale: rounded(log.exp()), ..best.0 };
            let (a, b) = (conversion_at(left), conversion_at(right));
            let (of_a, of_b) =
                (self.correlation(&a, &self.cloud, &self.views), self.correlation(&b, &self.cloud, &self.views));
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
                all.push(Conversion { reading, camera_flip, world, ..Conversion::default() });
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

/// Describes a conversion in words.
fn meaning(align: &Align, conversion: &Conversion) -> String {
    let mut parts = Vec::new();
    if matches!(align, Align::Gsplat(_)) {
        return "the splat is in the frame that gsplat's trainer computes from cameras and points (normalize_world_space)".to_owned();
    }
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
    if conversion.similarity != Similarity3::identity() {
        let (angle, scale) =
            (conversion.similarity.isometry.rotation.angle().to_degrees(), conversion.similarity.scaling());
        parts.push(format!(
            "the splat's world is that of the cameras turned by {angle:.0} degrees, scaled by {scale:.4} and shifted"
        ));
    }
    parts.join("; ")
}
