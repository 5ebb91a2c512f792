//! The scene on disk: its key is a hash of its files; its artifact is the list of the chosen views.

use std::borrow::Cow;
use std::iter;

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::error::Result;
use crate::inspect;
use crate::scene::{Options, ScaleChoice, Up};
use crate::units::MetricScale;
use crate::workdir::{Artifact, WorkDir, WorkDirError};

use super::open::without_paths;
use super::{Done, Job, OpenScene, Row, never};
use crate::pipeline::hasher::{Hasher, file_digest};

/// The content of `views.json`.
#[derive(Serialize)]
struct ViewsFile<'a> {
    /// Number of Gaussians of the object.
    gaussians: usize,
    scale: Option<&'a MetricScale>,
    up: &'a Up,
    /// How photos and splat disagree; `None` if they agree.
    misfit: Option<&'a str>,
    views: Vec<ViewEntry<'a>>,
}

/// The part of `views.json` that is read again.
#[derive(Deserialize)]
struct StoredViews {
    scale: Option<MetricScale>,
    #[serde(default)]
    misfit: Option<String>,
}

#[derive(Serialize)]
struct ViewEntry<'a> {
    name: &'a str,
    /// Relative to the scene's folder if it lies in it.
    image: Cow<'a, str>,
    /// In the input's frame, as the splat.
    #[serde(flatten)]
    camera: Camera,
}

pub(super) const ROW: Row =
    Row { inputs: &[], options: &["scene"], result: Artifact::Views, key: |open, _| key(open), is_stale: never, run };

/// The hash covers every byte of the files and of the chosen photos, which photos there are, which way is up, and the scale
/// that a data set states; modification times and how the paths are written do not matter.
pub fn key(open: &OpenScene) -> Result<String> {
    let (scene, options) = (&open.scene, &open.options.scene);
    let names: Vec<&str> = scene.views.iter().map(|view| view.name.as_str()).collect();
    let mut hasher =
        Hasher::new("scene").with_json(&without_paths(options)).with_json(&names).with_json(&scene.object_source);
    hasher = hasher.with_json(&scene.up.direction);
    if let (ScaleChoice::Auto, Some(stated)) = (&options.scale, &scene.scale) {
        hasher = hasher.with_json(stated);
    }
    let photos =
        open.views.iter().flat_map(|view| iter::once(&view.image).chain(view.mask.as_ref().map(|mask| &mask.path)));
    let searched = scene.views.iter().filter(|_| options.scale.is_in_photos()).map(|view| &view.image);
    for path in scene.files.iter().chain(photos).chain(searched) {
        hasher = hasher.with(&file_digest(path)?);
    }
    Ok(hasher.hex())
}

/// A hash of all that the Gaussians and the cameras depend on, which the choice of views and the scale do not change.
pub(super) fn gaussians_key(open: &OpenScene) -> Result<String> {
    let Options { views, view_list, scale, .. } = Options::default();
    let options = Options { views, view_list, scale, ..without_paths(&open.options.scene) };
    let mut hasher = Hasher::new("gaussians").with_json(&options).with_json(&open.scene.object_source);
    hasher = hasher.with_json(&open.scene.up.direction);
    for path in &open.scene.files {
        hasher = hasher.with(&file_digest(path)?);
    }
    Ok(hasher.hex())
}

fn run(open: &OpenScene, _: &Job) -> Result<Done> {
    let (scene, options) = (&open.scene, &open.options.scene);
    let views = open.views.iter().map(|view| ViewEntry {
        name: &view.name,
        // JSON has only Unicode.
        image: view.image.strip_prefix(&open.folder).unwrap_or(&view.image).to_string_lossy(),
        camera: scene.camera_in_input(&view.camera),
    });
    let mut warnings = scene.warnings.clone();
    let in_photos = scene.scale_in_photos(&options.scale)?.map(|(scale, of_scale)| {
        warnings.extend(of_scale);
        scale
    });
    // Views that are rendered from the splat or the mesh fit it.
    let misfit = match scene.views_to_render(options) {
        None => inspect::misfit(scene, &open.views)?,
        Some(_) => None,
    };
    warnings.extend(misfit.clone());
    let file = ViewsFile {
        gaussians: scene.gaussians.len(),
        scale: in_photos.as_ref().or(scene.scale.as_ref()),
        up: &scene.up,
        misfit: misfit.as_deref(),
        views: views.collect(),
    };
    open.work.write_json(Artifact::Views, &file)?;
    Ok(Done::writing([Artifact::Views]).warning(warnings).noting(scene.notes.clone()))
}

/// The metric scale of the scene: stated, measured, or found in the photos.
pub(super) fn scale(open: &OpenScene) -> Result<Option<MetricScale>, WorkDirError> {
    if open.options.scene.scale.is_in_photos() { stored_scale(&open.work) } else { Ok(open.scene.scale.clone()) }
}

/// The scale in `views.json`.
pub fn stored_scale(work: &WorkDir) -> Result<Option<MetricScale>, WorkDirError> {
    Ok(work.read_json::<StoredViews>(Artifact::Views)?.scale)
}

/// How photos and splat disagree, as in `views.json`; `None` if they agree.
pub fn misfit(open: &OpenScene) -> Result<Option<String>, WorkDirError> {
    Ok(open.work.read_json::<StoredViews>(Artifact::Views)?.misfit)
}
