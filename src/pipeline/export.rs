//! The parts in the formats of other programs.

use std::path::Path;

use tracing::warn;

use crate::error::Result;
use crate::export::{
    self, Asset, Colliders, Counterface, Credits, Exported, Format, Formats, GlbLook, Links, Model, Origin,
};
use crate::grasp::GraspError;
use crate::grasp::candidates::Candidate;
use crate::units::MetricScale;
use crate::words::readable::significant;

use super::Pipeline;
use super::stages::Stage;
use super::stages::grasp::Grasped;
use super::stages::parts::{metric_parts, samples_of, scale, weighed_field};
use super::stages::questions::answered_by;
use crate::parts::Interior;

/// What to export.
#[derive(Debug, Clone, Copy)]
pub struct ExportOptions<'a> {
    pub formats: Formats<'a>,
    /// The colliders of [`Format::Asset`].
    pub colliders: Colliders,
    /// How many samples [`Format::Belief`] has.
    pub samples: usize,
    pub origin: Origin,
    /// Where the object stands by default, m.
    pub at: [f64; 3],
    /// Whether a URDF's object hangs on a floating joint.
    pub floating: bool,
    pub links: Links,
    /// Whether soft parts deform in formats that can.
    pub deformable: bool,
    pub glb_look: GlbLook,
    /// Whether an MJCF comes with the Gaussians of each body.
    pub mjcf_splats: bool,
    /// Names of the geoms of a gripper's pads, for MJCF.
    pub pad_geoms: &'a [String],
    /// The surface with which frictions are.
    pub friction: Counterface,
    pub credits: &'a Credits,
}

/// Writes the object into `folder` once the parts are done.
pub fn export(pipeline: &mut Pipeline, options: &ExportOptions, folder: &Path) -> Result<Exported> {
    let ExportOptions { formats, colliders, samples, origin, at, floating, links, glb_look, .. } = *options;
    let ExportOptions { deformable, mjcf_splats, pad_geoms, friction, credits, .. } = *options;
    let has_grasps = formats.may_be(Format::has_grasps);
    let grasps = if has_grasps { places_to_grasp(pipeline)? } else { Vec::new() };
    let open = pipeline.opened();
    let parts = metric_parts(open)?;
    let splat = open.scene.files.first().and_then(|path| path.file_name());
    let source = splat.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let cameras = open.scene.cameras();
    let scale = scale(open)?;
    let samples = if formats.may_be(|format| format == Format::Belief) { samples_of(open, samples)? } else { None };
    let samples = samples.unwrap_or_default();
    let library = open.options.materials.library()?;
    let answered_by = answered_by(open);
    let model = Model {
        name: &open.scene.name,
        gaussians: &open.scene.gaussians,
        as_read: open.scene.gaussians_as_read(),
        world_from_input: open.scene.up.world_from_input(),
        field: &*weighed_field(open)?,
        interior: &*open.get::<Interior>()?,
        scale: scale.as_ref(),
        parts: parts.as_deref(),
        support: open.scene.support.as_ref(),
        samples: &samples,
        cameras: &cameras,
        grasps: &grasps,
        on_steel: (friction == Counterface::Steel).then_some(&*library),
        origin,
        at: at.into(),
        floating,
        links,
        deformable,
        glb_look,
        mjcf_splats,
        pad_geoms,
        credits,
        source: &source,
        answered_by: &answered_by,
        inputs: &open.scene.files,
        asset: open.scene.mesh.as_deref().map(|mesh| Asset { mesh, colliders }),
    };
    if let (true, Some(asset), Some(scale)) =
        (formats.may_be(|format| format == Format::Asset), model.asset, model.scale)
    {
        warn_of_unit(&asset, scale);
    }
    let exported = export::export_body(&model, formats, folder)?;
    exported.notes.iter().for_each(|note| warn!("{note}"));
    Ok(exported)
}

/// Where to grasp the object, best first. An object that cannot be grasped can still be exported.
fn places_to_grasp(pipeline: &mut Pipeline) -> Result<Vec<Candidate>> {
    if metric_parts(pipeline.opened())?.is_none() {
        return Ok(Vec::new());
    }
    let done = pipeline.also(Stage::Grasp).and_then(|()| pipeline.opened().get::<Grasped>());
    match done {
        Ok(grasped) => {
            if grasped.0.is_none() {
                warn!("the export names no place to grasp at; `gprop grasp` says why");
            }
            Ok(grasped.0.as_ref().map_or_else(Vec::new, |report| report.candidates.clone()))
        }
        Err(error) if error.downcast_ref::<GraspError>().is_some() || !pipeline.opened().work.is_writable() => {
            warn!("the export names no place to grasp at: {error}");
            Ok(Vec::new())
        }
        Err(error) => Err(error),
    }
}

/// A glTF is in metres for every program that reads it.
fn warn_of_unit(asset: &Asset, scale: &MetricScale) {
    let stated = asset.mesh.painted.mesh.meters_per_unit;
    if stated.is_some_and(|stated| stated != scale.meters_per_unit) {
        warn!(
            "glTF is in metres, and --scale says that a unit of this file is {} m: programs that read it will show another size than \
             the one that was weighed; scale the file itself",
            significant(scale.meters_per_unit)
        );
    }
}
