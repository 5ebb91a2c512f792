//! Searches for a similarity (rotation, shift and scale) that brings the cameras into the splat's frame, if no rule says
//! what it is.
//!
//! 1. [`extent`]: where the object is and how large, in the cameras' world and in the splat.
//! 2. Rotations spread over all of them, each with the shift and scale that bring the two extents together, are drawn small
//!    and compared with a few photos.
//! 3. The shift and scale of the best are corrected by the outlines in the pictures.
//! 4. The best are [refined](refine) on larger and larger pictures, fewer at each size, until the difference from the photos
//!    no longer falls.
//!
//! What is found is a candidate: the caller decides on the photos themselves whether it explains them.

mod extent;
mod refine;

use nalgebra::{Point3, Similarity3, Translation3, Vector3};
use rayon::prelude::*;

use super::verdict::{Small, correlation, picture, small_views};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::all_rotations;
use crate::render::{RenderOptions, render};
use crate::scene::cameras::align::moved;
use crate::scene::{Scene, SceneError, View};
use extent::Extent;

/// With fewer views, a scale cannot be told from a distance.
const LEAST_VIEWS: usize = 3;

/// Neighbours among these are about 20 degrees apart; in pictures so small that everything is blurred, a refinement finds the
/// right rotation from there.
const ROTATIONS: usize = 1500;

/// A round of the search: the size of its pictures, and what remains after it.
struct Round {
    /// Longest side of the pictures in pixels.
    side: u32,
    views: usize,
    gaussians: usize,
    /// Number of candidates that are refined in this round.
    candidates: usize,
    /// Maximum number of steps of each refinement.
    steps: usize,
}

/// The first round also ranks all rotations.
const ROUNDS: [Round; 5] = [
    Round { side: 16, views: 4, gaussians: 1_000, candidates: 64, steps: 6 },
    Round { side: 32, views: 4, gaussians: 2_000, candidates: 16, steps: 6 },
    Round { side: 64, views: 4, gaussians: 4_000, candidates: 5, steps: 6 },
    Round { side: 128, views: 6, gaussians: 15_000, candidates: 2, steps: 5 },
    Round { side: 256, views: 6, gaussians: 60_000, candidates: 1, steps: 5 },
];

/// Number of rotations whose shift and scale are corrected.
const CORRECTED: usize = 256;

/// A similarity from the world of the cameras to the splat's, and how well it fits.
#[derive(Clone, Copy)]
struct Candidate {
    similarity: Similarity3<f64>,
    /// Mean correlation of the photos with the splat, -1 to 1.
    correlation: f64,
}

/// The best similarity from each way to find the extents, the surest way first, each sought as it is asked for. The cameras of
/// `views` are as in their file.
pub(super) fn search(
    scene: &Scene,
    views: &[View],
) -> Result<impl Iterator<Item = Similarity3<f64>> + use<>, SceneError> {
    let cloud = scene.whole_cloud();
    let rounds: Vec<Pictures> =
        ROUNDS.iter().map(|round| Pictures::new(&cloud, scene, views, round)).collect::<Result<_, _>>()?;
    let mut pairs = extent::pairs(scene, &cloud, &rounds[0].views)?;
    if views.len() < LEAST_VIEWS {
        pairs.clear();
    }
    Ok(pairs.into_iter().filter_map(move |pair| best(&rounds, &pair)))
}

/// The best similarity if the two extents of `pair` are about the same thing.
fn best(rounds: &[Pictures], pair: &extent::Pair) -> Option<Similarity3<f64>> {
    let mut candidates = rounds[0].ranked(starts(pair).collect(), CORRECTED);
    if pair.are_outlines {
        let corrected =
            candidates.par_iter().map(|candidate| rounds[0].corrected(candidate.similarity, &pair.in_splat));
        candidates.extend(rounds[0].ranked(corrected.collect(), CORRECTED));
        candidates.sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
    }
    for (pictures, round) in rounds.iter().zip(&ROUNDS) {
        candidates.truncate(round.candidates);
        let refined = candidates.par_iter().map(|candidate| {
            refine::refine(&pictures.cloud, &pictures.views, candidate.similarity, &pair.in_splat, round.steps)
        });
        candidates = pictures.ranked(refined.collect(), round.candidates);
    }
    candidates.first().map(|candidate| candidate.similarity)
}

/// All rotations at all scales of the pair, each with the shift that brings the centres together.
fn starts(pair: &extent::Pair) -> impl Iterator<Item = Similarity3<f64>> {
    let scale = pair.in_splat.radius / pair.of_cameras.radius;
    all_rotations(ROTATIONS).flat_map(move |rotation| {
        pair.factors.iter().map(move |factor| {
            let turned = Similarity3::from_parts(Translation3::identity(), rotation, scale * factor);
            Similarity3::from_parts(
                (pair.in_splat.center - turned * pair.of_cameras.center).into(),
                rotation,
                scale * factor,
            )
        })
    })
}

/// The small photos of a round, and the splat to compare with them.
struct Pictures {
    cloud: Gaussians,
    views: Vec<Small>,
}

impl Pictures {
    fn new(cloud: &Gaussians, scene: &Scene, views: &[View], round: &Round) -> Result<Self, SceneError> {
        Ok(Self { cloud: thinned(cloud, round.gaussians), views: small_views(scene, views, round.side, round.views)? })
    }

    /// The best `count` of the similarities, best first; ties keep their order.
    fn ranked(&self, similarities: Vec<Similarity3<f64>>, count: usize) -> Vec<Candidate> {
        let candidate =
            |similarity: Similarity3<f64>| Candidate { similarity, correlation: self.correlation(&similarity) };
        let mut candidates: Vec<Candidate> = similarities.into_par_iter().map(candidate).collect();
        candidates.sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
        candidates.truncate(count);
        candidates
    }

    fn correlation(&self, similarity: &Similarity3<f64>) -> f64 {
        let of_view = |view: &Small| {
            let drawn = picture(&self.cloud, &seen_from(&view.camera, similarity), &RenderOptions::default());
            correlation(&view.picture, &drawn)
        };
        self.views.iter().map(of_view).sum::<f64>() / self.views.len() as f64
    }

    /// The similarity with its shift and scale changed so that the splat's outlines lie over the photos'.
    fn corrected(&self, similarity: Similarity3<f64>, object: &Extent) -> Similarity3<f64> {
        let mut offsets = extent::Offsets::default();
        for view in &self.views {
            let camera = seen_from(&view.camera, &similarity);
            let drawn = render(&self.cloud, &camera, &RenderOptions::default());
            let width = drawn.width as usize;
            let photo = view.outline.as_deref().and_then(|outline| extent::Blob::of(outline, width));
            if let (Some(photo), Some(drawn)) = (photo, extent::Blob::of(&drawn.alpha, width)) {
                offsets.add(&camera, object.center, &photo, &drawn);
            }
        }
        let Some((shift, factor)) = offsets.shift_and_factor() else { return similarity };
        // The splat stays; the cameras move the other way, and closer if it is to look larger.
        let about_center = scaling_about(object.center, 1.0 / factor);
        Similarity3::from_parts(Translation3::from(-shift), nalgebra::UnitQuaternion::identity(), 1.0)
            * about_center
            * similarity
    }
}

/// The camera after the similarity.
fn seen_from(camera: &Camera, similarity: &Similarity3<f64>) -> Camera {
    Camera { camera_from_world: moved(&camera.camera_from_world, similarity), ..camera.clone() }
}

fn scaling_about(center: Point3<f64>, factor: f64) -> Similarity3<f64> {
    let shift: Vector3<f64> = center.coords * (1.0 - factor);
    Similarity3::from_parts(shift.into(), nalgebra::UnitQuaternion::identity(), factor)
}

/// At most about `most` of the Gaussians, evenly from the whole file, enlarged so that they still cover what all of them do.
pub(super) fn thinned(cloud: &Gaussians, most: usize) -> Gaussians {
    let step = cloud.len().div_ceil(most).max(1);
    let mut thinned = cloud.clone();
    if step > 1 {
        thinned.retain(&(0..cloud.len()).map(|i| i % step == 0).collect::<Vec<_>>());
        let larger = 0.5 * (step as f32).ln();
        thinned.log_scales.iter_mut().flatten().for_each(|scale| *scale += larger);
    }
    thinned
}
