//! Separates the object's Gaussians from those of the room around it.
//!
//! The user may give a box around the object. Otherwise, if the photos have alpha or masks, the splat is taken to show
//! the object alone; if not, the object is the densest cluster that the cameras look at (`cluster`).

pub(super) mod cluster;
pub mod outliers;
pub(super) mod up;

use nalgebra::Point3;
use serde::Serialize;

use super::{Options, SceneError, View};
use crate::gaussians::Gaussians;
use crate::scene::photos::ForegroundSource;

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
    pub source: ObjectSource,
    pub note: String,
}

/// Separates the object's Gaussians from the rest.
pub(super) fn separate(gaussians: Gaussians, views: &[View], options: &Options) -> Result<Separated, SceneError> {
    let count = gaussians.len();
    let whole = |gaussians, note: &str| Separated {
        object: gaussians,
        surroundings: Gaussians::default(),
        source: ObjectSource::Whole,
        note: format!("object: all Gaussians{note}"),
    };
    if let Some(given) = &options.object_box {
        let inside = |i: &usize| {
            let center: Point3<f64> = gaussians.center(*i);
            given.0.min.iter().zip(given.0.max.iter()).zip(center.iter()).all(|((low, high), v)| low <= v && v <= high)
        };
        let kept: Vec<bool> = (0..count).map(|i| inside(&i)).collect();
        if !kept.contains(&true) {
            let bounds = super::robust_bounds(&gaussians);
            let (low, high) = (bounds.min.coords.into(), bounds.max.coords.into());
            return Err(SceneError::EmptyBox { given: given.to_string(), low, high });
        }
        return Ok(split(gaussians, &kept, ObjectSource::Box, "in --object-box"));
    }
    if views.is_empty() {
        return Ok(whole(gaussians, ""));
    }
    match own_foreground(views)? {
        ForegroundSource::Alpha => return Ok(whole(gaussians, "; the photos' alpha is the foreground")),
        ForegroundSource::Mask => return Ok(whole(gaussians, "; the masks are the foreground")),
        _ => {}
    }
    let cameras: Vec<_> = views.iter().map(|view| view.camera.camera_from_world).collect();
    match cluster::around_focus(&gaussians, &cameras) {
        Some(kept) => Ok(split(
            gaussians,
            &kept,
            ObjectSource::Cluster,
            "in the densest cluster that the cameras look at, since the photos have neither alpha nor masks (--object-box \
             overrides)",
        )),
        None => Ok(whole(gaussians, "; the photos have neither alpha nor masks, and no cluster stands out")),
    }
}

/// The source of the photos' foreground: of the first, the middle and the last photo, the first one that has a
/// foreground decides.
fn own_foreground(views: &[View]) -> Result<ForegroundSource, SceneError> {
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

fn split(gaussians: Gaussians, kept: &[bool], source: ObjectSource, how: &str) -> Separated {
    let mut surroundings = gaussians.clone();
    let others: Vec<bool> = kept.iter().map(|kept| !kept).collect();
    surroundings.retain(&others);
    let mut object = gaussians;
    let count = object.len();
    object.retain(kept);
    let note = format!("object: {} of {count} Gaussians, those {how}", object.len());
    Separated { object, surroundings, source, note }
}
