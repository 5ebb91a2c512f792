//! Separates the object's Gaussians from those of the room around it.
//!
//! The user may give a box around the object, or choose one of the things that stand on a table (`standing`). Otherwise, if
//! the photos have alpha or masks, the splat is taken to show the object alone; if not, the object is the densest cluster that
//! the cameras look at (`cluster`), above what it stands on (`support`).

pub(super) mod choice;
pub(super) mod cluster;
pub mod outliers;
pub(super) mod photo_point;
pub(super) mod standing;
pub(super) mod support;

use nalgebra::Point3;
use serde::Serialize;

use super::{ObjectBox, SceneError, View};
use crate::gaussians::Gaussians;
use crate::scene::photos::ForegroundSource;
use choice::{ObjectChoice, ObjectNumber};
use standing::Standing;
use support::{Focus, Plane, poses};

/// How the object was separated from its surroundings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectSource {
    /// Not separated: all Gaussians belong to the object, since the photos show it alone or there are no photos.
    Whole,
    /// `--object-box`.
    Box,
    /// `--object`, or the only thing that stands on the support.
    Standing,
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
    /// How many objects there are, if the user chose none of several.
    pub unchosen: Option<usize>,
}

/// What separates the object from the rest.
pub(super) struct Means<'a> {
    pub object: ObjectChoice,
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
        unchosen: None,
    };
    if let Some(given) = means.object_box {
        let kept = in_box(given, means.as_read.unwrap_or(&gaussians))?;
        return Ok(split(gaussians, kept, ObjectSource::Box, "in --object-box"));
    }
    match means.object {
        ObjectChoice::One(number) => return one_of(gaussians, views, means, number),
        ObjectChoice::All => return Err(SceneError::AllObjects),
        ObjectChoice::Auto => {}
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
    let standing = focus.as_ref().zip(means.support).map(|(focus, support)| standing::find(&gaussians, focus, support));
    let cluster = focus.and_then(|focus| cluster::around(&focus, means.support, count));
    if let Some(kept) = standing.as_ref().and_then(|standing| only_one(standing, cluster.as_deref())) {
        let how = "of the one thing that stands on the surface (--object-box overrides)";
        return Ok(split(gaussians, kept, ObjectSource::Standing, how));
    }
    let unchosen = standing.map(|standing| standing.count).filter(|count| *count > 1);
    match cluster {
        Some(kept) => {
            let how = "in the densest cluster that the cameras look at, since the photos have neither alpha nor masks \
                       (--object-box overrides)";
            Ok(Separated { unchosen, ..split(gaussians, kept, ObjectSource::Cluster, how) })
        }
        None => Ok(whole(gaussians, "; the photos have neither alpha nor masks, and no cluster stands out")),
    }
}

/// The Gaussians of the one thing that stands on the support, if most of the densest cluster, if there is one, belongs to it: more
/// exact than the cluster, which ends where the support begins.
fn only_one(standing: &Standing, cluster: Option<&[bool]>) -> Option<Vec<bool>> {
    let kept: Vec<bool> = standing.object_of_gaussian.iter().map(|object| *object == 1).collect();
    let is_cluster = |cluster: &[bool]| {
        let own = kept.iter().zip(cluster).filter(|(kept, in_cluster)| **kept && **in_cluster).count();
        2 * own > cluster.iter().filter(|in_cluster| **in_cluster).count()
    };
    (standing.count == 1 && cluster.is_none_or(is_cluster)).then_some(kept)
}

/// What stands on the support, if there is one.
///
/// # Errors
/// If there is no support, or the photos show the object alone.
pub(super) fn standing(gaussians: &Gaussians, views: &[View], support: Option<&Plane>) -> Result<Standing, SceneError> {
    if views.is_empty() {
        return Err(SceneError::NoSupport("there are no photos"));
    }
    if own_foreground(views)? != ForegroundSource::Whole {
        return Err(SceneError::NoSupport("alpha or masks of the photos say what the object is"));
    }
    let focus = Focus::of(gaussians, &poses(views));
    let focus = focus.ok_or(SceneError::NoSupport("the cameras do not look at a common place"))?;
    let support = support.ok_or(SceneError::NoSupport("no surface on which they could stand was found"))?;
    Ok(standing::find(gaussians, &focus, support))
}

/// Separates the object with this number.
fn one_of(gaussians: Gaussians, views: &[View], means: &Means, number: ObjectNumber) -> Result<Separated, SceneError> {
    let found = standing(&gaussians, views, means.support)?;
    let kept: Vec<bool> = found.object_of_gaussian.iter().map(|of| *of == number.get()).collect();
    if number.get() as usize > found.count {
        return Err(SceneError::NoSuchObject { given: number, count: found.count });
    }
    Ok(split(gaussians, kept, ObjectSource::Standing, &format!("of {number}, which stands on the surface")))
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
    Separated { object, surroundings, kept, source, note, unchosen: None }
}
