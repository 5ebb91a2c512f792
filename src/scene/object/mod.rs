//! Separates the object's Gaussians from those of the room around it.
//!
//! The user may give a box around the object. Otherwise, if the photos have alpha or masks, the splat is taken to show
//! the object alone; if not, the object is the densest cluster that the cameras look at (`cluster`), above what
//! it stands on (`support`).

pub(super) mod cluster;
pub mod outliers;
pub(super) mod support;

use nalgebra::Point3;
use serde::Serialize;

use super::{ObjectBox, SceneError, View};
use crate::gaussians::Gaussians;
use crate::scene::photos::ForegroundSource;
use support::{Focus, Plane, poses};

/// How the object was separated from its surroundings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectSource {
    /// Not separated: all Gaussians belong to the object, since the photos show it alone or there are no photos.
    Whole,
    /// `--object-box`.
    Box,
    /// The densest cluster that the cameras look at.
    Cluster,
}

/// A cloud split into the object and its surroundings.
pub(super) struct Separated {
    pub object: Gaussians,
    pub surroundings: Gaussians,
    /// For each of all Gaussians, whether it is the object's.
    pub kept: Vec<bool>,
    pub source: ObjectSource,
    pub note: String,
}

/// What separates the object from the rest.
pub(super) struct Means<'a> {
    pub object_box: Option<&'a ObjectBox>,
    /// The same Gaussians in the input's frame, which is that of the box, if it is another.
    pub as_read: Option<&'a Gaussians>,
    pub support: Option<&'a Plane>,
}

/// Separates the object's Gaussians from the rest.
pub(super) fn separate(gaussians: Gaussians, views: &[View], means: &Means) -> Result<Separated, SceneError> {
    let count = gaussians.len();
    let whole = |gaussians, note: &str| Separated {
        object: gaussians,
        surroundings: Gaussians::default(),
        kept: vec![true; count],
        source: ObjectSource::Whole,
        note: format!("object: all Gaussians{note}"),
    };
    if let Some(given) = means.object_box {
        let kept = in_box(given, means.as_read.unwrap_or(&gaussians))?;
        return Ok(split(gaussians, kept, ObjectSource::Box, "in --object-box"));
    }
    if views.is_empty() {
        return Ok(whole(gaussians, ""));
    }
    match own_foreground(views)? {
        ForegroundSource::Alpha => return Ok(whole(gaussians, "; the photos' alpha is the foreground")),
        ForegroundSource::Mask => return Ok(whole(gaussians, "; the masks are the foreground")),
        _ => {}
    }
    let focus = Focus::of(&gaussians, &poses(views));
    match focus.and_then(|focus| cluster::around(&focus, means.support, count)) {
        Some(kept) => Ok(split(
            gaussians,
            kept,
            ObjectSource::Cluster,
            "in the densest cluster that the cameras look at, since the photos have neither alpha nor masks (--object-box \
             overrides)",
        )),
        None => Ok(whole(gaussians, "; the photos have neither alpha nor masks, and no cluster stands out")),
    }
}

/// For each Gaussian, whether its centre is in the box.
fn in_box(given: &ObjectBox, gaussians: &Gaussians) -> Result<Vec<bool>, SceneError> {
    let inside = |i: usize| {
        let center: Point3<f64> = gaussians.center(i);
        given.0.min.iter().zip(given.0.max.iter()).zip(center.iter()).all(|((low, high), v)| low <= v && v <= high)
    };
    let kept: Vec<bool> = (0..gaussians.len()).map(inside).collect();
    if !kept.contains(&true) {
        let bounds = super::robust_bounds(gaussians);
        let (low, high) = (bounds.min.coords.into(), bounds.max.coords.into());
        return Err(SceneError::EmptyBox { given: given.to_string(), low, high });
    }
    Ok(kept)
}

/// The source of the photos' foreground: of the first, the middle and the last photo, the first one that has a
/// foreground decides.
pub(super) fn own_foreground(views: &[View]) -> Result<ForegroundSource, SceneError> {
    let mut sampled = vec![0, views.len() / 2, views.len() - 1];
    sampled.dedup();
    for index in sampled {
        let source = views[index].photo()?.foreground_source;
        if source != ForegroundSource::Whole {
            return Ok(source);
        }
    }
    Ok(ForegroundSource::Whole)
}

fn split(gaussians: Gaussians, kept: Vec<bool>, source: ObjectSource, how: &str) -> Separated {
    let mut surroundings = gaussians.clone();
    let others: Vec<bool> = kept.iter().map(|kept| !kept).collect();
    surroundings.retain(&others);
    let mut object = gaussians;
    let count = object.len();
    object.retain(&kept);
    let note = format!("object: {} of {count} Gaussians, those {how}", object.len());
    Separated { object, surroundings, kept, source, note }
}
