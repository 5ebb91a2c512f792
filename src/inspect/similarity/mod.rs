//! Searches for a similarity (rotation, shift and scale) that brings the cameras into the splat's frame, if no rule says
//! what it is.
//!
//! 1. [`anchor`]: guesses of all but the rotation, from what the cameras look at and where the splat is finest.
//! 2. [`templates`]: the rotations that fit each guess best, from small pictures of the splat from all sides.
//! 3. [`refine`]: the best of them all are refined on larger and sharper pictures, fewer at each size; of those that have
//!    become the same, one is kept.
//!
//! [`pictures`] reduces and blurs the photos, [`merge`] the splat. Every third photo is held apart from the search: on these
//! the best placement is judged, against the best one that is not the same.

mod anchor;
mod merge;
mod pictures;
mod refine;
mod templates;

use nalgebra::Similarity3;
use rayon::prelude::*;

use super::compare::EQUAL_DB;
use super::verdict::Small;
use crate::gaussians::Gaussians;
use crate::numeric::upper_median;
use crate::scene::{Scene, SceneError, View};
use crate::words::progress::{Bar, Progress};
use anchor::{Anchor, anchors};
use merge::merged;
use pictures::{LARGEST, Reduced, blur, drawn};
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
}

/// Minimum lead of the best placement over the next, in dB of PSNR: half of the squared error. What was seen of it is little:
/// right placements of objects and of a room led by 10 dB or more, of splats thinned to a quarter by 4.4 or more, and the best
/// of two splats that were another object's by 0.1 at most.
const LEAST_LEAD_DB: f64 = 3.0;

impl Found {
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

const ROUNDS: [Round; 5] = [
    Round { side: 24, passes: 6, views: 4, gaussians: 500, candidates: 64, steps: 5 },
    Round { side: 32, passes: 3, views: 6, gaussians: 1_500, candidates: 16, steps: 8 },
    Round { side: 48, passes: 2, views: 6, gaussians: 4_000, candidates: 6, steps: 7 },
    Round { side: 96, passes: 2, views: 6, gaussians: 8_000, candidates: 2, steps: 6 },
    Round { side: LARGEST, passes: 1, views: 4, gaussians: MOST_GAUSSIANS, candidates: 1, steps: 6 },
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
        let few: Vec<usize> = spread(indices, MOST_PHOTOS).copied().collect();
        few.into_par_iter().map(|index| Reduced::new(scene, &views[index])).collect()
    };
    let cloud = scene.whole_cloud();
    let search = Search { cloud: &cloud, photos: reduced(&seen)?, apart: reduced(&apart)? };
    Ok(search.best(progress))
}

/// At most `most` of the values, evenly spread.
fn spread<T>(values: &[T], most: usize) -> impl Iterator<Item = &T> {
    values.iter().step_by(values.len().div_ceil(most).max(1))
}

struct Search<'a> {
    cloud: &'a Gaussians,
    photos: Vec<Reduced>,
    /// The photos that are held apart.
    apart: Vec<Reduced>,
}

impl Search<'_> {
    fn best(&self, progress: Progress) -> Option<Found> {
        let anchors = anchors(self.cloud, &self.photos);
        let finest = merged(self.cloud, MOST_GAUSSIANS);
        let templates = Templates::new(&finest, &self.photos, anchors.first()?)?;
        let refined: usize = ROUNDS.iter().map(|round| round.candidates).sum();
        let bar = progress.bar("align", (anchors.len() + refined) as u64).with_message("placements tried");
        let mut found = ranked(&anchors, &templates, &bar);
        let mut next = None;
        for round in &ROUNDS {
            found = self.refined(&found, round, &finest, &anchors[0]);
            bar.inc(round.candidates as u64);
            let best = found.first()?;
            // If all have become one, the last other that there was.
            next = found.get(1).copied().or(next.filter(|next| !are_same(best, next, &anchors[0])));
        }
        bar.finish_and_clear();
        let best = found.first()?.similarity;
        let next_psnr_db = next.map(|next| self.psnr_apart_db(&next.similarity));
        Some(Found { similarity: best, psnr_db: self.psnr_apart_db(&best), next_psnr_db })
    }

    /// The best of `starts` after this round, those that have become the same only once, best first.
    fn refined(&self, starts: &[Fitted], round: &Round, finest: &Gaussians, anchor: &Anchor) -> Vec<Fitted> {
        let cloud = merged(finest, round.gaussians);
        let view = |photo: &Reduced| {
            let mut small = photo.at(round.side);
            blur(&mut small.picture, small.camera.intrinsics.width as usize, round.passes);
            small
        };
        let views: Vec<Small> = spread(&self.photos, round.views).map(view).collect();
        let (center, radius) = (anchor.place, anchor.radius);
        let problem = Problem { cloud: &cloud, views: &views, passes: round.passes, center, radius };
        let refine = |start: &Fitted| problem.refined(start.similarity, round.steps);
        let best: Vec<&Fitted> = starts.iter().take(round.candidates).collect();
        distinct(best.into_par_iter().map(refine).collect(), round.candidates, anchor)
    }

    fn psnr_apart_db(&self, similarity: &Similarity3<f64>) -> f64 {
        let psnr_db = |photo: &Reduced| {
            let small = photo.at(LARGEST);
            let drawn = drawn(self.cloud, &small.camera, similarity);
            let sum: f64 = drawn.iter().zip(&small.picture).map(|(a, b)| f64::from(a - b).powi(2)).sum();
            (-10.0 * (sum / drawn.len().max(1) as f64).log10()).min(EQUAL_DB)
        };
        upper_median(self.apart.par_iter().map(psnr_db).collect()).unwrap_or_default()
    }
}

/// Starts from all anchors, best first; their errors are negative scores.
fn ranked(anchors: &[Anchor], templates: &Templates, bar: &Bar) -> Vec<Fitted> {
    let mut starts = Vec::new();
    for anchor in anchors {
        let scored = templates.scored(anchor).into_iter();
        let fitted = scored.map(|one| Fitted { similarity: anchor.similarity(one.rotation), error: -one.score });
        starts.extend(distinct(fitted.collect(), FROM_ANCHOR, anchor));
        bar.inc(1);
    }
    distinct(starts, ROUNDS[0].candidates, &anchors[0])
}

/// The best `count` of those that are not the same, best first; ties keep their order.
fn distinct(mut fitted: Vec<Fitted>, count: usize, anchor: &Anchor) -> Vec<Fitted> {
    fitted.sort_by(|a, b| a.error.total_cmp(&b.error));
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
