//! Searches for a similarity (rotation, shift and scale) that brings the cameras into the splat's frame, if no rule says
//! what it is.
//!
//! 1. [`anchor`]: guesses of all but the rotation, from what the cameras look at and where the splat is finest.
//! 2. [`templates`]: the rotations that fit each guess best, from small pictures of the splat from all sides.
//! 3. [`refine`]: the best of them all are refined on larger and sharper pictures, fewer at each size; of those that have
//!    become the same, one is kept, and the next best takes its place.
//!
//! [`pictures`] reduces and blurs the photos, [`merge`] the splat. Every third photo is held apart from the search: on these
//! the best placement is judged, against the best one that is not the same.

mod anchor;
mod merge;
mod pictures;
mod refine;
mod templates;

use nalgebra::{Point3, Similarity3};

use super::compare::EQUAL_DB;
use super::samples;
use super::verdict::Small;
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::{evenly, upper_median};
use crate::parallel;
use crate::scene::{Scene, SceneError, View};
use crate::words::progress::{Bar, Progress};
use anchor::{Anchor, anchors};
use merge::merged;
use pictures::{LARGEST, Reduced, after, blur, drawn};
use refine::{Fitted, Problem};
use templates::Templates;

/// The best placement of the cameras in the splat's world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    /// From the cameras' world to the splat's.
    pub similarity: Similarity3<f64>,
    /// Median PSNR, in dB, of the reduced photos that the search has not seen.
    pub psnr_db: f64,
    /// The same with the next best placement; `None` if there is no other.
    pub next_psnr_db: Option<f64>,
    /// Median distance, in pixels of the largest pictures, by which it moves points of the object there.
    pub moved_px: f64,
}

/// Minimum lead of the best placement over the next, in dB of PSNR: half of the squared error. What was seen of it is little:
/// right placements of objects and of a room led by 10 dB or more, of splats thinned to a quarter, which fit their photos badly
/// even there, by 2 to 5, and the best of two splats that were another object's by 0.1 at most.
const LEAST_LEAD_DB: f64 = 3.0;

/// Derivatives are differences over about a pixel of the largest pictures ([`refine`]): less than that is not resolved.
const LEAST_MOVE_PX: f64 = 1.0;

impl Found {
    /// Whether it differs from where the cameras are now.
    pub fn moves_object(&self) -> bool {
        self.moved_px >= LEAST_MOVE_PX
    }

    /// Whether the placement is clearly better than any other.
    pub fn is_clear(&self) -> bool {
        self.next_psnr_db.is_none_or(|next| self.psnr_db >= next + LEAST_LEAD_DB)
    }

    /// How well it fits the photos that the search has not seen, in words.
    pub fn judgement(&self) -> String {
        let next =
            self.next_psnr_db.map_or(String::new(), |next| format!(", {next:.1} dB with the next best placement"));
        format!("on small photos that the search has not seen, the PSNR is {:.1} dB{next}", self.psnr_db)
    }
}

/// Three photos are searched with, one judges: with fewer, a scale cannot be told from a distance.
const LEAST_VIEWS: usize = 4;
/// Of so many photos in order, the last is held apart.
const HELD_APART: usize = 3;
/// Maximum number of photos searched with, and of those held apart.
const MOST_PHOTOS: usize = 12;

/// Number of rotations taken from each anchor.
const FROM_ANCHOR: usize = 16;

/// A round of the refinement.
struct Round {
    /// Longest side of its pictures in pixels.
    side: u32,
    /// How often they are blurred.
    passes: usize,
    views: usize,
    gaussians: usize,
    /// Number of candidates that are refined.
    candidates: usize,
    /// Maximum number of steps of each.
    steps: usize,
}

/// Maximum number of Gaussians that the search draws.
const MOST_GAUSSIANS: usize = 40_000;
/// The same for derivatives.
const SKETCH_GAUSSIANS: usize = 4_000;

/// The next best placement is refined as far as the best, which it may turn out to be.
const ROUNDS: [Round; 5] = [
    Round { side: 24, passes: 6, views: 4, gaussians: 500, candidates: 64, steps: 5 },
    Round { side: 32, passes: 3, views: 6, gaussians: 1_500, candidates: 16, steps: 8 },
    Round { side: 48, passes: 2, views: 6, gaussians: 4_000, candidates: 6, steps: 7 },
    Round { side: 96, passes: 2, views: 6, gaussians: 8_000, candidates: 2, steps: 6 },
    Round { side: LARGEST, passes: 1, views: 4, gaussians: MOST_GAUSSIANS, candidates: 2, steps: 6 },
];

/// Two placements are one if they differ by less than each of these: the rotation in radians, the shift in radii of the
/// object, the logarithm of the scale.
const SAME_ROTATION: f64 = 0.25;
const SAME_SHIFT: f64 = 0.25;
const SAME_SCALE: f64 = 0.2;

/// The best placement; `None` if there are too few photos, or if they do not look at one thing. The cameras of `views` are as
/// in their file.
pub(super) fn search(scene: &Scene, views: &[View], progress: Progress) -> Result<Option<Found>, SceneError> {
    if views.len() < LEAST_VIEWS {
        return Ok(None);
    }
    let is_apart = |index: &usize| index % HELD_APART == HELD_APART - 1;
    let (apart, seen): (Vec<usize>, Vec<usize>) = (0..views.len()).partition(is_apart);
    let reduced = |indices: &[usize]| -> Result<Vec<Reduced>, SceneError> {
        let few: Vec<usize> = evenly(indices, MOST_PHOTOS).copied().collect();
        parallel::try_map(&few, |index| Reduced::new(scene, &views[*index]))
    };
    let cloud = scene.whole_cloud();
    let search = Search { cloud: &cloud, photos: reduced(&seen)?, apart: reduced(&apart)? };
    let Some(best) = search.best(progress) else { return Ok(None) };
    Ok(Some(Found {
        similarity: best.similarity,
        psnr_db: search.psnr_apart_db(&best.similarity),
        next_psnr_db: best.next.map(|next| search.psnr_apart_db(&next)),
        moved_px: search.moved_px(scene, &best.similarity),
    }))
}

/// The placement that fits the photos best, and the next best.
struct Best {
    similarity: Similarity3<f64>,
    next: Option<Similarity3<f64>>,
}

struct Search<'a> {
    cloud: &'a Gaussians,
    photos: Vec<Reduced>,
    /// The photos that are held apart.
    apart: Vec<Reduced>,
}

impl Search<'_> {
    fn best(&self, progress: Progress) -> Option<Best> {
        let anchors = anchors(self.cloud, &self.photos);
        let finest = merged(self.cloud, MOST_GAUSSIANS);
        let templates = Templates::new(&finest, &self.photos, anchors.first()?)?;
        let refined: usize = ROUNDS.iter().map(|round| round.candidates).sum();
        let bar = progress.bar("align", (anchors.len() + refined) as u64).with_message("placements tried");
        let mut found = ranked(&anchors, &templates, &bar);
        for round in &ROUNDS {
            found = self.refined(&found, round, &finest, &anchors[0]);
            bar.inc(round.candidates as u64);
        }
        bar.finish_and_clear();
        Some(Best { similarity: found.first()?.similarity, next: found.get(1).map(|next| next.similarity) })
    }

    /// The best of `starts` after this round, best first, those that have become the same only once; then the others, which it
    /// leaves as they are.
    fn refined(&self, starts: &[Fitted], round: &Round, finest: &Gaussians, anchor: &Anchor) -> Vec<Fitted> {
        let cloud = merged(finest, round.gaussians);
        let view = |photo: &Reduced| {
            let mut small = photo.at(round.side);
            blur(&mut small.picture, small.camera.intrinsics.width as usize, round.passes);
            small
        };
        let views: Vec<Small> = evenly(&self.photos, round.views).map(view).collect();
        let (center, radius) = (anchor.place, anchor.radius);
        let sketch = merged(&cloud, SKETCH_GAUSSIANS);
        let problem = Problem { cloud: &cloud, sketch: &sketch, views: &views, passes: round.passes, center, radius };
        let (best, others) = starts.split_at(round.candidates.min(starts.len()));
        let refined = parallel::map(best, |start| problem.refined(start.similarity, round.steps));
        let mut found = sorted(refined);
        found.extend(others);
        distinct(found, starts.len(), anchor)
    }

    fn psnr_apart_db(&self, similarity: &Similarity3<f64>) -> f64 {
        let psnr_db = |photo: &Reduced| {
            let small = photo.at(LARGEST);
            let drawn = drawn(self.cloud, &small.camera, similarity);
            let sum: f64 = drawn.iter().zip(&small.picture).map(|(a, b)| f64::from(a - b).powi(2)).sum();
            (-10.0 * (sum / drawn.len().max(1) as f64).log10()).min(EQUAL_DB)
        };
        upper_median(parallel::map(&self.apart, psnr_db)).unwrap_or_default()
    }

    /// The median distance, in pixels of the reduced photos, between points of the object as the cameras show them now and
    /// after the similarity; points that only one of the two shows are infinitely far.
    fn moved_px(&self, scene: &Scene, similarity: &Similarity3<f64>) -> f64 {
        let points = samples(&scene.gaussians);
        let moved_in = |camera: &Camera| -> Vec<f64> {
            let camera_from_world = scene.conversion.apply(&camera.camera_from_world);
            let (before, after) = (Camera { camera_from_world, ..camera.clone() }, after(camera, similarity));
            let pixel = |camera: &Camera, point: &Point3<f64>| camera.pixel(camera.point_in_camera(*point));
            let distance = |point| match (pixel(&before, point), pixel(&after, point)) {
                (Some(before), Some(after)) => Some((after - before).norm()),
                (None, None) => None,
                _ => Some(f64::INFINITY),
            };
            points.iter().filter_map(distance).collect()
        };
        let photos = self.photos.iter().chain(&self.apart);
        upper_median(photos.flat_map(|photo| moved_in(&photo.camera)).collect()).unwrap_or(f64::INFINITY)
    }
}

/// Starts from all anchors, best first; their errors are negative scores.
fn ranked(anchors: &[Anchor], templates: &Templates, bar: &Bar) -> Vec<Fitted> {
    let mut starts = Vec::new();
    for anchor in anchors {
        let scored = templates.scored(anchor).into_iter();
        let fitted = scored.map(|one| Fitted { similarity: anchor.similarity(one.rotation), error: -one.score });
        starts.extend(distinct(sorted(fitted.collect()), FROM_ANCHOR, anchor));
        bar.inc(1);
    }
    distinct(sorted(starts), ROUNDS[0].candidates, &anchors[0])
}

/// Best first; ties keep their order.
fn sorted(mut fitted: Vec<Fitted>) -> Vec<Fitted> {
    fitted.sort_by(|a, b| a.error.total_cmp(&b.error));
    fitted
}

/// The first `count` of those that are not the same.
fn distinct(fitted: Vec<Fitted>, count: usize, anchor: &Anchor) -> Vec<Fitted> {
    let mut kept: Vec<Fitted> = Vec::with_capacity(count);
    for one in fitted {
        if kept.len() == count {
            break;
        }
        if kept.iter().all(|other| !are_same(&one, other, anchor)) {
            kept.push(one);
        }
    }
    kept
}

fn are_same(a: &Fitted, b: &Fitted, anchor: &Anchor) -> bool {
    let (a, b, focus) = (&a.similarity, &b.similarity, anchor.focus);
    a.isometry.rotation.angle_to(&b.isometry.rotation) < SAME_ROTATION
        && (a * focus - b * focus).norm() < SAME_SHIFT * anchor.radius
        && (a.scaling() / b.scaling()).ln().abs() < SAME_SCALE
}
