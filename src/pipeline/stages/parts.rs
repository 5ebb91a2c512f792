//! Parts on disk: in metres and kilograms if the scale is known, otherwise in scene units and without masses; and the
//! object's inside, which later stages fill with material.

use std::sync::Arc;

use image::GrayImage;
use serde::Serialize;

use crate::error::Result;
use crate::parallel;
use crate::parts::samples::{self, Sample};
use crate::parts::{self, Interior, Known, Options, Parts, PartsError, PartsResult, Possibilities, Shape};
use crate::scene::View;
use crate::scene::mesh::solid::Measured;
use crate::units::{Estimate, MetricScale, Range};
use crate::workdir::Artifact;

use super::consensus::{FoundParts, Unasked};
use super::recognized::Recognized;
use super::{Done, Job, OpenScene, Row, Stage, Stored, never, recognise, shared_scale};
use crate::pipeline::hasher::{Hasher, file_digest};
use crate::vote::{FieldPart, MaterialField};

/// The content of `parts.json` if the metric scale is unknown.
#[derive(Serialize)]
struct UnscaledFile<'a> {
    /// A note that the scale is missing and how to give it.
    scale: String,
    object: Option<()>,
    parts: [(); 0],
    /// In scene units.
    shapes: &'a [Shape],
}

/// The scale of the scene, if it has one, as the `parts` of the object that was weighed correct it; else the one that
/// follows from the weighing.
pub fn scale_after_weighing(known: Option<MetricScale>, parts: Option<&Parts>) -> Option<MetricScale> {
    let Some(known) = known else { return parts?.scale() };
    let found = parts.and_then(|parts| parts.meters_per_unit).filter(|_| known.range.is_some());
    Some(match found {
        Some(Estimate { low, mid, high }) => {
            let by_mass = if mid == known.meters_per_unit { "" } else { ", corrected by the known mass" };
            let provenance = known.provenance + by_mass;
            MetricScale { meters_per_unit: mid, range: Some(Range::new(low, high)), provenance, ..known }
        }
        None => known,
    })
}

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Query, Stage::Vote],
    options: &["parts"],
    result: Artifact::Parts,
    key,
    is_stale: never,
    run,
};

fn key(open: &OpenScene, inputs: Hasher) -> Result<String> {
    let mut hasher = inputs.with_json(&own_options(open));
    if let Some(scale) = shared_scale::required(open)? {
        hasher = hasher.with_json(&scale);
    }
    let views = &open.scene.views;
    for view in parts::carving_views(views.len(), &open.options.parts).map(|view| &views[view]) {
        for path in view.mask.iter().map(|mask| &mask.path).chain([&view.image]) {
            hasher = hasher.with(&file_digest(path)?);
        }
        if let Some(mask) = &view.mask {
            hasher = hasher.with_json(&(&mask.color, mask.orientation.to_exif()));
        }
    }
    Ok(hasher.with(&Interior::VERSION.to_le_bytes()).hex())
}

/// The options, of which a weight is that of this object.
fn own_options(open: &OpenScene) -> Options {
    Options { known_mass: shared_scale::own_reading(&open.options), ..open.options.parts.clone() }
}

fn run(open: &OpenScene, _: &Job) -> Result<Done> {
    let (work, scale) = (&open.work, recognise::scale(open)?);
    let result = measured(open, scale.as_ref())?;
    let mut warnings = result.warnings.clone();
    match result.metric() {
        Ok(parts) => work.write_json(Artifact::Parts, parts)?,
        Err(error) => {
            let file = UnscaledFile { scale: error.to_string(), object: None, parts: [], shapes: &result.shapes };
            work.write_json(Artifact::Parts, &file)?;
            warnings.push(error.to_string());
        }
    }
    work.write_with(Artifact::Interior, |out| result.interior.write(out))?;
    Ok(Done::writing([Artifact::Parts, Artifact::Interior]).warning(warnings).noting(result.notes))
}

fn measured(open: &OpenScene, scale: Option<&MetricScale>) -> Result<PartsResult> {
    let gaussians = &open.scene.gaussians;
    let field = open.get::<MaterialField>()?;
    let possible = possibilities(open, &field)?;
    let known = Known { scale, possible: possible.as_ref() };
    match below_thin(open, &field)? {
        Some(below) => {
            let result = shaped(open, &parts::folded(&field, &below), known)?;
            Ok(result.with_thin(gaussians, &field, &below, scale))
        }
        None => shaped(open, &field, known),
    }
}

/// The parts of this field of the scene.
fn shaped(open: &OpenScene, field: &MaterialField, known: Known) -> Result<PartsResult> {
    let (gaussians, options) = (&open.scene.gaussians, &own_options(open));
    if let Some(mesh) = open.scene.mesh.as_ref().filter(|_| options.volume.takes_mesh()) {
        let mesh = Measured::of(&mesh.painted.mesh.surface).map_err(PartsError::from)?;
        return Ok(parts::parts_of_mesh(gaussians, field, &mesh, known, options)?);
    }
    let (cameras, coverage) = (open.scene.cameras(), coverage(&open.scene.views, options)?);
    let views = parts::Views { cameras: &cameras, coverage: &coverage };
    Ok(parts::parts(gaussians, field, views, known, options, open.progress())?)
}

/// For every Gaussian of a part that was found where the answer about the object names something without a number, the label of the part
/// from which it was cut; `None` if nothing was found.
fn below_thin(open: &OpenScene, field: &MaterialField) -> Result<Option<Vec<Option<u32>>>> {
    let recognized = open.get::<Recognized>()?;
    let Some(recognized) = &recognized.0 else { return Ok(None) };
    let found = &open.get::<FoundParts>()?.found;
    if found.is_empty() {
        return Ok(None);
    }
    let first = recognized.recognition.first_of_part();
    let label_of = |region: u16| {
        let part = u32::from(*first.get(&region)?);
        (0u32..).zip(&field.parts).find(|(_, of)| of.id == part).map(|(label, _)| label)
    };
    let before = &open.get::<Unasked>()?.0.of_gaussian;
    let below = |(label, region): (&u32, &u16)| {
        let id = field.parts[*label as usize].id;
        let of = found.iter().find(|of| u32::from(of.id) == id)?;
        label_of(*region).or_else(|| of.cut_from.first().and_then(|region| label_of(*region)))
    };
    Ok(Some(field.part_index.iter().zip(before).map(below).collect()))
}

/// What the object and its parts may be, if that was asked.
fn possibilities(open: &OpenScene, field: &MaterialField) -> Result<Option<Possibilities>> {
    let recognized = open.get::<Recognized>()?;
    Ok(recognized.0.as_ref().map(|recognized| Possibilities::new(recognized, field, &open.library)))
}

/// For each view, the share of each pixel of its photo that the object covers; `None` if it is unknown or the view is
/// not used for carving.
fn coverage(views: &[View], options: &Options) -> Result<Vec<Option<GrayImage>>> {
    let chosen: Vec<usize> = parts::carving_views(views.len(), options).collect();
    let of_chosen: Vec<_> = parallel::try_map(&chosen, |&view| views[view].coverage())?;
    let mut coverage = vec![None; views.len()];
    chosen.into_iter().zip(of_chosen).for_each(|(view, of_view)| coverage[view] = of_view);
    Ok(coverage)
}

/// For each cell of the object's inside, the part that fills it.
impl Stored for Interior {
    const STAGE: Stage = Stage::Parts;

    fn load(open: &OpenScene) -> Result<Self> {
        let bytes = open.work.read(Artifact::Interior)?;
        let (cells, parts) = (open.options.parts.volume_cells, open.get::<MaterialField>()?.parts.len());
        let interior = Self::from_bytes(&bytes, cells, parts);
        Ok(interior.map_err(|error| open.work.damaged(Artifact::Interior, error))?)
    }
}

/// The metric scale: the scene's, or the one that follows from the mass of the object, which also corrects a scale of
/// the scene that is not exact.
pub fn scale(open: &OpenScene) -> Result<Option<MetricScale>> {
    let parts = match shared_scale::own_reading(&open.options) {
        Some(_) => metric_parts(open)?,
        None => None,
    };
    Ok(scale_after_weighing(recognise::scale(open)?, parts.as_deref()))
}

/// The material field with the densities that a weighing of the object has corrected.
pub fn weighed_field(open: &OpenScene) -> Result<Arc<MaterialField>> {
    let field = open.get::<MaterialField>()?;
    let Some(parts) = metric_parts(open)?.filter(|parts| parts.are_weighed()) else { return Ok(field) };
    let possible = possibilities(open, &field)?;
    let mut weighed = Arc::unwrap_or_clone(field);
    if let (Some(possible), Some(belief)) = (possible, &parts.belief) {
        weighed.parts = possible.parts_taken(&weighed, &belief.taken(&weighed.parts));
    }
    parts.set_densities(&mut weighed.parts);
    Ok(Arc::new(weighed))
}

/// `count` samples of what is believed of the object; `None` if the scale is unknown.
pub fn samples_of(open: &OpenScene, count: usize) -> Result<Option<Vec<Sample>>> {
    let Some(parts) = metric_parts(open)? else { return Ok(None) };
    let field = open.get::<MaterialField>()?;
    let possible = possibilities(open, &field)?;
    let labels = |id: u32| -> Vec<FieldPart> {
        let ways: Vec<FieldPart> = possible.iter().flat_map(|of| of.ways_of(id)).cloned().collect();
        if ways.is_empty() { field.parts.iter().filter(|part| part.id == id).cloned().collect() } else { ways }
    };
    Ok(Some(samples::samples(&parts, &labels, count)))
}

/// The parts in metres and kilograms; `None` if the scale is unknown.
pub fn metric_parts(open: &OpenScene) -> Result<Option<Arc<Parts>>> {
    if recognise::scale(open)?.is_none() && shared_scale::own_reading(&open.options).is_none() {
        return Ok(None);
    }
    Ok(Some(open.get()?))
}

impl Stored for Parts {
    const STAGE: Stage = Stage::Parts;

    fn load(open: &OpenScene) -> Result<Self> {
        Ok(open.work.read_json(Artifact::Parts)?)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::units::ScaleSource;

    #[test]
    fn a_scale_that_the_mass_corrects_says_so() {
        let known = MetricScale {
            meters_per_unit: 0.12,
            source: ScaleSource::BoundingBox,
            provenance: "z side of the object's box: 0.12 m for 1.000000 scene units, within 2.00 %".to_owned(),
            range: Some(Range::new(0.1176, 0.1224)),
        };
        let (one, center, inertia) = (Estimate::exactly(1.0), [0.0; 3], [[0.0; 3]; 3]);
        let parts_at = |meters_per_unit: Estimate| -> Parts {
            let object = json!({
                "volume_m3": one, "mass_kg": one, "center_of_mass_m": center, "inertia_kg_m2": inertia,
            });
            let parts = json!({ "object": object, "parts": [], "meters_per_unit": meters_per_unit, "warnings": [] });
            serde_json::from_value(parts).unwrap()
        };
        let after = |scale| scale_after_weighing(Some(known.clone()), Some(&parts_at(scale))).unwrap();
        let corrected = after(Estimate::new(0.117, 0.118, 0.119));
        let provenance = format!("{}, corrected by the known mass", known.provenance);
        assert_eq!((corrected.meters_per_unit, corrected.provenance), (0.118, provenance));
        assert_eq!(after(Estimate::new(0.1176, 0.12, 0.1224)), known, "a mass that is impossible corrects nothing");
    }
}
