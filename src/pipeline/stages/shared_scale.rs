//! The metric scale of a capture with several objects, if it follows from what was found out about one or all of them: from the
//! weight of one, or from the sizes that a model judged. It is known only once these objects have been looked at, after their own
//! scenes were opened, so it is looked up in their work folders, which lie side by side.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Result, UsageError};
use crate::objects;
use crate::parts::{MassReading, Parts, belief_together};
use crate::pipeline::options::Options;
use crate::scene::{ObjectChoice, ObjectNumber, ScaleChoice};
use crate::units::{Estimate, MetricScale, Range, ScaleSource};
use crate::words::readable::significant;
use crate::workdir::{self, Artifact};

use super::OpenScene;

/// Refuses the weight of one of several objects if this is the only one.
pub fn check(options: &Options) -> Result<(), UsageError> {
    let named = options.parts.known_mass.and_then(|reading| reading.object);
    match (named, options.scene.object) {
        (Some(named), ObjectChoice::Auto) => Err(UsageError(format!(
            "--known-mass {named}=MASS is about one of several objects, and here the scene is taken as one: add --object, or leave \
             out {named}="
        ))),
        _ => Ok(()),
    }
}

/// The reading of a kitchen scale that is about this object.
pub fn own_reading(options: &Options) -> Option<MassReading> {
    options.parts.known_mass.filter(|reading| match (reading.object, options.scene.object) {
        (Some(weighed), ObjectChoice::One(own)) => weighed == own,
        (_, _) => true,
    })
}

/// The object from whose weight the scale follows, and the weight, if that is another one.
pub fn weighed_other(options: &Options) -> Option<(ObjectNumber, f64)> {
    let MassReading { object: Some(weighed), kg } = options.parts.known_mass? else { return None };
    let is_other = matches!(options.scene.object, ObjectChoice::One(own) if own != weighed);
    (is_other && options.scene.scale == ScaleChoice::Auto).then_some((weighed, kg))
}

/// The scale from other objects, as far as they have been run; `None` if it follows from this scene alone.
pub fn of(open: &OpenScene) -> Option<MetricScale> {
    of_object(open.work.root(), &open.options).filter(|_| open.scene.scale.is_none())
}

/// The same for the object with this work folder.
pub fn of_object(work: &Path, options: &Options) -> Option<MetricScale> {
    match (&options.scene.scale, options.scene.object) {
        (ScaleChoice::Estimate, ObjectChoice::One(_)) => estimated(work),
        (ScaleChoice::Auto, _) => {
            let (weighed, kg) = weighed_other(options)?;
            from_weight(&work.with_file_name(weighed.to_string()), weighed, kg)
        }
        _ => None,
    }
}

/// The scale at which the object with this work folder weighs as much; `None` if no run found it.
fn from_weight(work: &Path, weighed: ObjectNumber, kg: f64) -> Option<MetricScale> {
    workdir::refuse_link(work, workdir::OUT).ok()?;
    let parts: Parts = workdir::read_json(&work.join(Artifact::Parts.path())).ok()?;
    parts.known_mass.as_ref().filter(|known| known.is_possible && known.reading_kg == kg)?;
    let scale = parts.scale()?;
    let Range { low, high } = scale.range?;
    let [low, high] = [low, high].map(significant);
    let provenance = format!("from the known mass of {weighed}, {} kg: {low} to {high} m", significant(kg));
    Some(MetricScale { provenance, ..scale })
}

/// What a model judged of the sizes of all objects beside that with this work folder, and of its own.
fn estimated(work: &Path) -> Option<MetricScale> {
    let folders = work.parent().map(objects::folders_in).unwrap_or_default();
    let mut scales: Vec<MetricScale> = folders.values().filter_map(|folder| estimate_in(folder)).collect();
    let ranges: Vec<Range> = scales.iter().filter_map(|scale| scale.range).collect();
    if ranges.len() < 2 {
        return scales.pop();
    }
    let Estimate { low, mid, high } = belief_together(&ranges);
    let [low_text, high_text] = [low, high].map(significant);
    let provenance = format!(
        "estimated: from what a model takes {} objects for and how long it judges them, a unit is {low_text} to {high_text} m",
        ranges.len()
    );
    let range = Some(Range::new(low, high));
    Some(MetricScale { meters_per_unit: mid, source: ScaleSource::Estimated, provenance, range })
}

/// What is read of `size.json`.
#[derive(Deserialize)]
struct Judged {
    scale: Option<MetricScale>,
}

/// What a model judged of the size of the object with this work folder; `None` if it was not asked or did not say.
fn estimate_in(work: &Path) -> Option<MetricScale> {
    workdir::read_json::<Judged>(&work.join(Artifact::Size.path())).ok()?.scale
}

/// The scale, which must be known if it follows from the weight of another object.
///
/// # Errors
/// If that object has not been weighed.
pub fn required(open: &OpenScene) -> Result<Option<MetricScale>> {
    let shared = of(open);
    match weighed_other(&open.options) {
        Some((weighed, kg)) if shared.is_none() && open.scene.scale.is_none() => Err(UsageError(format!(
            "the metric scale follows from the mass of {weighed}, which has not been weighed: run it first, with --object {weighed} \
             --known-mass {weighed}={kg}; its warnings say if no scale makes it weigh as much"
        ))
        .into()),
        _ => Ok(shared),
    }
}
