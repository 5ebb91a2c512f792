//! nerfstudio's `dataparser_transforms.json`: the transform from the world of the input cameras to the frame that
//! nerfstudio trains in, which is the frame of the splat it exports: x_splat = scale * (transform x_world), so x_world
//! = transform^-1 (x_splat / scale).
//!
//! gprop's world is the splat's, whose spherical harmonics must not be rotated, so the cameras are moved to the splat's
//! frame. nerfstudio's transform starts from the world before `applied_transform` and `applied_scale`; those of
//! transforms.json are undone first.

use std::path::Path;

use nalgebra::Similarity3;
use serde::Deserialize;

use super::align::moved;
use super::transforms::rigid;
use super::{Applied, Capture, bytes_of};
use crate::files::json;
use crate::scene::SceneError;

pub(crate) const FILE: &str = "dataparser_transforms.json";

#[derive(Deserialize)]
struct Transforms {
    transform: Vec<Vec<f64>>,
    scale: f64,
}

/// Reads the file at `path`; the result maps the world of the input cameras to the splat's.
pub(in crate::scene) fn read(path: &Path) -> Result<Similarity3<f64>, SceneError> {
    let parsed = parse(&bytes_of(path)?).map_err(|reason| SceneError::Json { path: path.to_owned(), reason })?;
    parsed.ok_or_else(|| SceneError::NotASimilarity { path: path.to_owned(), key: "transform and scale" })
}

/// Reads the file from memory; `None` if its transform is not a similarity.
///
/// # Errors
/// If it is not a JSON file of this form.
pub fn parse(bytes: &[u8]) -> Result<Option<Similarity3<f64>>, json::Problem> {
    let transforms: Transforms = json::parse(bytes)?;
    let scale = Some(transforms.scale).filter(|scale| scale.is_normal() && *scale > 0.0);
    let similarity = rigid(&transforms.transform).zip(scale);
    Ok(similarity.map(|(rigid, scale)| Similarity3::from_scaling(scale) * Similarity3::from_isometry(rigid, 1.0)))
}

/// Brings the cameras into the splat's frame; `splat_from_input` is the result of [`read`]. The transform that
/// nerfstudio writes is its transform of the cameras after `applied`, times `applied`; its scale is likewise multiplied
/// by the applied one.
pub(in crate::scene) fn follow(capture: &mut Capture, splat_from_input: &Similarity3<f64>) {
    let Applied { transform, scale } = capture.applied;
    let splat_from_cameras = Similarity3::from_scaling(1.0 / scale) * (splat_from_input * transform.inverse());
    for frame in &mut capture.frames {
        frame.camera_from_world = moved(&frame.camera_from_world, &splat_from_cameras);
    }
}
