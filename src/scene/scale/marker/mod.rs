//! The scale from a printed marker: a square of known size in some of the photos.
//!
//! In order:
//! 1. [`quads`] finds dark quadrilaterals in each photo, at all sizes;
//! 2. [`edges`] locates their edges and corners to a fraction of a pixel;
//! 3. [`decode`] reads which marker of [`families`] each is;
//! 4. [`triangulate`] places the corners in the scene, from all views that agree.
//!
//! [`board`] draws a marker for printing. The crates that detect markers were not used: kornia-apriltag 0.2 and
//! aprilgrid bring a second linear-algebra library (faer), and the former brings some 65 crates in all; aruco-rs 0.1
//! knows no AprilTag.

pub mod board;
mod decode;
mod detect;
mod edges;
mod families;
mod plane;
mod quads;
mod triangulate;

use std::collections::{BTreeMap, BTreeSet};

use crate::parallel;
use crate::scene::{MOST_ERROR, SceneError, View};
use crate::units::{MetricScale, Range, ScaleSource};
use detect::{Detection, detect};
use edges::Lens;
pub use families::Marker;
use plane::Plane;
use triangulate::{Sighting, corners};

/// Why a marker gives no scale.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MarkerProblem {
    #[error(
        "none of the {views} photos shows this marker{}; it must lie flat, without folds, and be evenly lit, with a white margin \
         of at least one of its cells, and at least 30 pixels wide in the photos. `gprop scale board` draws one", others(.found)
    )]
    Unseen { views: usize, found: Vec<(String, usize)> },
    #[error("only view {view} shows this marker; at least two photos, taken from different places, must show it")]
    Once { view: String },
    #[error(
        "this marker seems to be at different places in the views {}: at most {agreeing} of {} agree. It must not move between \
         the photos; check with `gprop inspect` that the cameras are right",
        listed(.views),
        .views.len()
    )]
    Scattered { views: Vec<String>, agreeing: usize },
}

/// How many views a message lists by name.
const LISTED: usize = 12;

fn listed(views: &[String]) -> String {
    let named = views.iter().take(LISTED).map(String::as_str).collect::<Vec<_>>().join(", ");
    if views.len() > LISTED { format!("{named} and {} more", views.len() - LISTED) } else { named }
}

fn others(found: &[(String, usize)]) -> String {
    let listed: Vec<String> = found.iter().map(|(marker, views)| format!("{marker} in {views} of them")).collect();
    if listed.is_empty() {
        String::new()
    } else {
        format!(" (other markers of its family are seen: {})", listed.join(", "))
    }
}

/// The scale that a marker gives.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundMarker {
    pub scale: MetricScale,
    /// Which views were left out because they disagree.
    pub warning: Option<String>,
}

/// The least share of an edge's change that is within a quarter of a cell of it. For a blur with a standard deviation of a
/// quarter of a cell, it is erf(1 / sqrt(2)) = 0.68; beyond, the cells inside show through at the edge and shift it.
const LEAST_SHARPNESS: f64 = 0.68;
/// With at least this many sharp views, the others are left out.
const FEWEST_SHARP: usize = 3;

/// Finds `marker`, whose side is `side_m` metres long, in the photos of `views`: all of them, at full resolution.
///
/// # Errors
/// [`SceneError::Scale`] if the marker is not seen or the views disagree; an error if a photo cannot be decoded.
pub fn find(marker: Marker, side_m: f64, views: &[View]) -> Result<FoundMarker, SceneError> {
    let refused = |problem: MarkerProblem| SceneError::Scale {
        given: format!("{marker}={side_m}"),
        problem: problem.to_string(),
    };
    let named = |sighting: &Sighting| views[sighting.view].name.clone();
    let sightings = sharpest(sightings(marker, views, &refused)?);
    let mut showing: Vec<String> = sightings.iter().map(named).collect();
    showing.dedup();
    let found = corners(&sightings);
    let agreeing = found.as_ref().map_or(1, |found| found.agreeing.len());
    let Some(found) = found.filter(|_| 2 * agreeing >= showing.len()) else {
        return Err(refused(MarkerProblem::Scattered { views: showing, agreeing }));
    };
    let error = found.side_error.min(MOST_ERROR * found.side);
    let provenance = format!(
        "marker {marker}, seen in {agreeing} views: {side_m} m for {:.6} scene units, within {:.2} %",
        found.side,
        100.0 * error / found.side
    );
    let scale = MetricScale {
        meters_per_unit: side_m / found.side,
        source: ScaleSource::Marker,
        provenance,
        range: Some(Range::new(side_m / (found.side + error), side_m / (found.side - error))),
    };
    let warning = (!found.disagreeing.is_empty()).then(|| {
        let off: Vec<String> = found.disagreeing.iter().map(|(at, off)| format!("{} ({off:.1} px)", named(&sightings[*at]))).collect();
        format!(
            "in these views, the marker {marker} is not where the other {agreeing} views see it: {}; they do not count for the \
             scale. It may be partly hidden there, or their cameras are wrong",
            off.join(", ")
        )
    });
    Ok(FoundMarker { scale, warning })
}

/// Where the views see the marker, by view.
///
/// # Errors
/// If a photo cannot be decoded; what `refused` makes of the problem if fewer than two views see it.
fn sightings<'a>(
    marker: Marker,
    views: &'a [View],
    refused: &dyn Fn(MarkerProblem) -> SceneError,
) -> Result<Vec<Sighting<'a>>, SceneError> {
    let look = |view: &View| -> Result<Vec<Detection>, SceneError> {
        let plane = Plane::of(&view.photo()?.rgb);
        Ok(detect(&plane, &Lens(view.camera.intrinsics), marker.family))
    };
    let seen = parallel::try_map(views, look)?;
    let mut sightings = Vec::new();
    let mut others: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for (view, detections) in seen.into_iter().enumerate() {
        for detection in detections {
            if detection.id == marker.id {
                sightings.push(Sighting { view, camera: &views[view].camera, detection });
            } else {
                others.entry(detection.id).or_default().insert(view);
            }
        }
    }
    let Some(first) = sightings.first().map(|sighting| sighting.view) else {
        let found = others.into_iter().map(|(id, views)| (marker.sibling(id).to_string(), views.len())).collect();
        return Err(refused(MarkerProblem::Unseen { views: views.len(), found }));
    };
    if sightings.iter().all(|sighting| sighting.view == first) {
        return Err(refused(MarkerProblem::Once { view: views[first].name.clone() }));
    }
    Ok(sightings)
}

/// The sightings of the views that show the marker sharply; all of them if these are too few.
fn sharpest(mut sightings: Vec<Sighting>) -> Vec<Sighting> {
    let sharp = sightings.iter().filter(|sighting| sighting.detection.sharpness >= LEAST_SHARPNESS);
    let sharp: BTreeSet<usize> = sharp.map(|sighting| sighting.view).collect();
    if sharp.len() >= FEWEST_SHARP {
        sightings.retain(|sighting| sharp.contains(&sighting.view));
    }
    sightings
}
