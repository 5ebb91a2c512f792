//! Parts on disk: in metres and kilograms if the scale is known, otherwise in scene units and without masses; and the
//! object's inside, which later stages fill with material.

use std::borrow::Cow;

use anyhow::Result;
use image::GrayImage;
use rayon::prelude::*;
use serde::Serialize;

use crate::parts::{self, Interior, Parts, Shape};
use crate::scene::View;
use crate::units::{Estimate, MetricScale, Range};
use crate::vote::MaterialField;
use crate::workdir::Artifact;

use super::scene::file_digest;
use super::{Done, Pipeline, Stage, get_or_load};

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
pub(super) fn scale_after_weighing(known: Option<MetricScale>, parts: Option<&Parts>) -> Option<MetricScale> {
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

impl Pipeline {
    pub(super) fn parts_key(&self) -> Result<String> {
        let mut hasher = self.key_after_inputs(Stage::Parts).with_json(&self.options.parts);
        for view in self.carving_views() {
            for path in view.mask.iter().chain([&view.image]) {
                hasher = hasher.with(&file_digest(path)?);
            }
        }
        Ok(hasher.with(&Interior::VERSION.to_le_bytes()).hex())
    }

    fn carving_views(&self) -> impl Iterator<Item = &View> {
        parts::carving_views(self.scene.views.len(), &self.options.parts).map(|view| &self.scene.views[view])
    }

    /// For each view of the scene, the share of each pixel of its photo that the object covers; `None` if it is unknown
    /// or the view is not used for carving.
    fn coverage(&self) -> Result<Vec<Option<GrayImage>>> {
        let views = &self.scene.views;
        let chosen: Vec<usize> = parts::carving_views(views.len(), &self.options.parts).collect();
        let of_chosen: Vec<_> = chosen.par_iter().map(|&view| views[view].coverage()).collect::<Result<_, _>>()?;
        let mut coverage = vec![None; views.len()];
        chosen.into_iter().zip(of_chosen).for_each(|(view, of_view)| coverage[view] = of_view);
        Ok(coverage)
    }

    pub(super) fn do_parts(&self) -> Result<Done> {
        let cameras = self.scene.cameras();
        let (gaussians, scale) = (&self.scene.gaussians, self.scene.scale.as_ref());
        let result = parts::parts(
            gaussians,
            self.stored_field()?,
            &cameras,
            &self.coverage()?,
            scale,
            &self.options.parts,
            self.progress,
        )?;
        let mut warnings = result.warnings.clone();
        match result.metric() {
            Ok(parts) => self.work.write_json(Artifact::Parts, parts)?,
            Err(error) => {
                let file = UnscaledFile { scale: error.to_string(), object: None, parts: [], shapes: &result.shapes };
                self.work.write_json(Artifact::Parts, &file)?;
                warnings.push(error.to_string());
            }
        }
        self.work.write_with(Artifact::Interior, |out| result.interior.write(out))?;
        Ok(Done::writing([Artifact::Parts, Artifact::Interior]).warning(warnings).noting(result.notes))
    }

    /// For each cell of the object's inside, the part that fills it.
    pub(super) fn interior(&self) -> Result<&Interior> {
        get_or_load(&self.interior, || {
            let bytes = self.work.read(Artifact::Interior)?;
            let (cells, parts) = (self.options.parts.volume_cells, self.stored_field()?.labels.len());
            let interior = Interior::from_bytes(&bytes, cells, parts);
            Ok(interior.map_err(|error| self.work.damaged(Artifact::Interior, error))?)
        })
    }

    /// The metric scale: the scene's, or the one that follows from the mass of the object, which also corrects a scale of
    /// the scene that is not exact.
    pub(crate) fn metric_scale(&self) -> Result<Option<MetricScale>> {
        let parts = match self.options.parts.known_mass {
            Some(_) => self.stored_parts()?,
            None => None,
        };
        Ok(scale_after_weighing(self.scene.scale.clone(), parts.as_ref()))
    }

    /// The material field with the densities that a weighing of the object has corrected.
    pub(super) fn weighed_field(&self) -> Result<Cow<'_, MaterialField>> {
        let field = self.stored_field()?;
        match self.stored_parts()?.filter(Parts::are_weighed) {
            Some(parts) => {
                let mut field = field.clone();
                parts.set_densities(&mut field.labels);
                Ok(Cow::Owned(field))
            }
            None => Ok(Cow::Borrowed(field)),
        }
    }

    /// The parts in metres and kilograms; `None` if the scale is unknown.
    pub(super) fn stored_parts(&self) -> Result<Option<Parts>> {
        if self.scene.scale.is_none() && self.options.parts.known_mass.is_none() {
            return Ok(None);
        }
        Ok(Some(self.work.read_json(Artifact::Parts)?))
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
        let with = |meters_per_unit: Estimate| -> Parts {
            let object = json!({
                "volume_m3": one, "mass_kg": one, "center_of_mass_m": center, "inertia_kg_m2": inertia,
            });
            let parts = json!({ "object": object, "parts": [], "meters_per_unit": meters_per_unit, "warnings": [] });
            serde_json::from_value(parts).unwrap()
        };
        let after = |scale| scale_after_weighing(Some(known.clone()), Some(&with(scale))).unwrap();
        let corrected = after(Estimate::new(0.117, 0.118, 0.119));
        let provenance = format!("{}, corrected by the known mass", known.provenance);
        assert_eq!((corrected.meters_per_unit, corrected.provenance), (0.118, provenance));
        assert_eq!(after(Estimate::new(0.1176, 0.12, 0.1224)), known, "a mass that is impossible corrects nothing");
    }
}
