//! Checks whether photos, cameras and Gaussians agree: lists the contents of a scene folder and compares each photo
//! with the splat seen from its camera.
//!
//! 1. [`compare`]: PSNR and mask overlap view by view.
//! 2. [`verdict`]: whether the photos fit their own cameras better than those of other views.
//! 3. [`diagnose`]: if they do not, which conversion would make them fit: gsplat's, one of the usual ones, or any other
//!    [`similarity`].
//! 4. [`text`] and [`page`]: the result on one screen, or as a page with the pictures side by side, on which a box around the object
//!    can be dragged ([`outline`]).
//!
//! [`misfit()`] looks at a few views only; every run does that before anything else.

mod compare;
mod diagnose;
mod misfit;
mod outline;
mod page;
mod quaternions;
mod similarity;
mod text;
mod verdict;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use nalgebra::Point3;
use serde::Serialize;
use tempfile::TempDir;

use crate::error::UsageError;
use crate::files::write::{self, Folder};
use crate::from_splat::{photo_with_foreground, render_views};
use crate::gaussians::Gaussians;
use crate::scene::{
    self, Bounds, Flaw, ForegroundSource, MeshCounts, ObjectSource, Options, Scene, SceneError, Up, View, robust_bounds,
};
use crate::units::MetricScale;
use crate::words::output::one_line;
use crate::words::progress::Progress;
use diagnose::Diagnosis;
pub use diagnose::{Doubtful, Suggestion};
pub use misfit::misfit;
pub use page::to_html;
pub use text::to_text;
use verdict::Verdict;

/// Maximum number of views compared; for a longer capture, they are spread over all directions.
const MOST_VIEWS: NonZeroUsize = NonZeroUsize::new(60).expect("sixty is not zero");

/// The contents of a scene folder and how well they fit together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    pub name: String,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
    /// Number of all Gaussians of the splat.
    pub gaussians: usize,
    /// Number of the object's Gaussians.
    pub object_gaussians: usize,
    pub object_source: ObjectSource,
    /// What the mesh consists of, if the scene is one; its views are drawn of it.
    pub mesh: Option<MeshCounts>,
    pub sh_degree: u8,
    pub antialiased: bool,
    /// The object's box in the input's frame.
    pub extent: Extent,
    /// Which way is up in the input's frame.
    pub up: Up,
    /// Why that is in doubt, if it is.
    pub up_in_doubt: Option<String>,
    /// The sides of the object's box in the world's frame, where z is up, in scene units.
    pub upright_size: [f64; 3],
    /// `None` if the metric scale is unknown.
    pub scale: Option<MetricScale>,
    pub cameras: Option<Cameras>,
    /// The source of the photos' foreground; `None` without photos.
    pub foreground: Option<ForegroundSource>,
    pub views: Vec<ViewFit>,
    /// Whether photos and Gaussians line up; `None` without photos.
    pub aligned: Option<bool>,
    /// The conversion that would align them, instead of that in the options, if they do not line up.
    pub suggestion: Option<Suggestion>,
    /// The similarity that fits best, if none is suggested and one was searched for: no more than a guess.
    pub doubtful: Option<Doubtful>,
}

/// The object's bounding box without strays, scene units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Extent {
    pub min: [f64; 3],
    pub max: [f64; 3],
    pub size: [f64; 3],
}

impl From<Bounds> for Extent {
    fn from(bounds: Bounds) -> Self {
        Self { min: bounds.min.coords.into(), max: bounds.max.coords.into(), size: bounds.size().into() }
    }
}

/// A summary of the cameras.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cameras {
    pub count: usize,
    /// Width and height in pixels of the first one's photo.
    pub first_size: [u32; 2],
    /// fx and fy of the first one in pixels.
    pub first_focal: [f64; 2],
    /// Whether any lens has distortion.
    pub distorted: bool,
    /// Least and greatest distance from the middle of the object, scene units.
    pub distance: [f64; 2],
}

/// How one photo fits the splat seen from its camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewFit {
    pub name: String,
    /// Peak signal-to-noise ratio of the whole picture in dB, both over white. If the splat shows the object alone, a
    /// photo with a mask is white outside it.
    pub psnr_db: f64,
    /// Intersection over union of the photo's foreground and the area that the object's Gaussians cover; `None` if the
    /// photo has no foreground of its own.
    pub mask_iou: Option<f64>,
    /// What is wrong with the photo; such a one is not chosen for segments and votes, except by `--view-list`.
    pub flaw: Option<Flaw>,
    /// [`compare::overlap`], for the verdict.
    #[serde(skip)]
    overlap: Option<f64>,
}

/// The arguments of `gprop inspect`.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    /// Folder with a splat, and with photos and cameras if there are any; or a mesh.
    pub scene: PathBuf,
    /// Also write a self-contained HTML page: photos and splat side by side, and a box around the object to drag, which becomes
    /// an --object-box.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    #[command(flatten)]
    pub options: Options,
}

/// An error of `gprop inspect`.
#[derive(Debug, thiserror::Error)]
pub enum InspectError {
    #[error("{0}")]
    Scene(#[from] SceneError),
    #[error("{0}")]
    Page(#[from] UsageError),
}

/// The result of an inspection that found photos and splat in different frames.
#[derive(Debug, Clone, thiserror::Error)]
#[error("photos and splat do not line up; {0}")]
pub struct NotAligned(String);

/// The result of an inspection that found photos and splat to agree, but not which way is up.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct UpInDoubt(String);

impl Inspection {
    /// Fails if the evidence about up is contradictory.
    ///
    /// # Errors
    /// [`UpInDoubt`], which says what to do.
    pub fn require_up(&self) -> Result<(), UpInDoubt> {
        self.up_in_doubt.clone().map_or(Ok(()), |why| Err(UpInDoubt(why)))
    }

    /// Fails if photos and Gaussians do not line up.
    ///
    /// # Errors
    /// [`NotAligned`], which says what to try.
    pub fn require_aligned(&self) -> Result<(), NotAligned> {
        let advice = match (&self.suggestion, &self.doubtful) {
            (Some(found), _) => format!("add --align {} to every command", found.align),
            (None, Some(_)) => "the best conversion that was found is doubtful; see above".to_owned(),
            (None, None) => "no conversion was found that fixes it; see above".to_owned(),
        };
        if self.aligned == Some(false) { Err(NotAligned(advice)) } else { Ok(()) }
    }
}

/// Runs `gprop inspect`: returns the inspection, also as text, and writes the page if asked for. If `only_chosen` is true,
/// only the views that the options choose are compared.
///
/// # Errors
/// [`SceneError`] as in [`inspect`], or an error if the page cannot be written.
pub fn command(args: &Args, only_chosen: bool, progress: Progress) -> Result<(Inspection, String), InspectError> {
    let (inspection, shown) = inspect_and_draw(&args.scene, &args.options, only_chosen, progress)?;
    let mut text = to_text(&inspection);
    if let Some(path) = &args.html {
        let page = to_html(&inspection, &shown.scene, &shown.views)?;
        write::file(path, |out| out.write_all(page.as_bytes()))
            .map_err(|reason| UsageError(format!("--html: cannot write {path:?}: {reason}")))?;
        text.push_str(&format!("page        {}\n", one_line(&path.to_string_lossy())));
    }
    Ok((inspection, text))
}

/// Inspects the scene in `folder`, with or without photos: the views of `--view-list`, or else views from all directions.
///
/// # Errors
/// [`SceneError`] if there is no splat, or if a file of the scene is broken.
pub fn inspect(folder: &Path, options: &Options, progress: Progress) -> Result<Inspection, SceneError> {
    inspect_and_draw(folder, options, false, progress).map(|(inspection, _)| inspection)
}

/// What the page shows: the scene and the views that were compared.
struct ShownOnPage {
    scene: Scene,
    views: Vec<View>,
    /// The pictures that were drawn of a mesh, which go when nothing needs them any more.
    _pictures: Option<TempDir>,
}

/// As [`inspect`], but if `only_chosen` is true, only the views that the options choose are compared. Also returns what
/// the page needs.
fn inspect_and_draw(
    folder: &Path,
    options: &Options,
    only_chosen: bool,
    progress: Progress,
) -> Result<(Inspection, ShownOnPage), SceneError> {
    let mut scene = load(folder, options, progress)?;
    let pictures = draw_mesh(&mut scene, options)?;
    if let Some((scale, warnings)) = scene.scale_in_photos(&options.scale)? {
        scene.scale = Some(scale);
        scene.warnings.extend(warnings);
    }
    let views = if only_chosen || !options.view_list.is_empty() {
        scene.chosen_views(options)?
    } else {
        scene.spread_views(MOST_VIEWS)
    };
    let mut fits = compare::compare(&scene, &views, progress)?;
    // What was chosen for being sound is not judged again: among sharp photos, the least sharp would seem blurred.
    if !only_chosen || !options.view_list.is_empty() {
        fits.iter_mut().zip(scene.flaws(&views)?).for_each(|(fit, flaw)| fit.flaw = flaw);
    }
    scene.warnings.extend(quaternions::warning(&scene, &views, &fits, options)?);
    // Views that are drawn of the mesh line up with what is sampled on it.
    let verdict = if scene.mesh.is_none() { verdict::of(&scene, &views, &fits, progress)? } else { None };
    let Diagnosis { suggestion, doubtful } = match &verdict {
        Some(verdict) if !verdict.aligned => diagnosis(&scene, &views, &fits, verdict, progress)?,
        _ => Diagnosis::default(),
    };
    let foreground = views.first().map(|view| photo_with_foreground(&scene, view)).transpose()?;
    let inspection = Inspection {
        name: scene.name.clone(),
        notes: scene.notes.clone(),
        warnings: scene.warnings.clone(),
        gaussians: scene.gaussians.len() + scene.surroundings.len(),
        object_gaussians: scene.gaussians.len(),
        object_source: scene.object_source,
        mesh: scene.mesh.as_ref().map(|mesh| mesh.counts()),
        sh_degree: scene.gaussians.sh_degree,
        antialiased: scene.gaussians.antialiased,
        extent: robust_bounds(scene.gaussians_as_read()).into(),
        up: scene.up,
        up_in_doubt: scene.up_in_doubt.clone(),
        upright_size: scene.object_bounds().size().into(),
        scale: scene.scale.clone(),
        cameras: cameras(&scene),
        foreground: foreground.map(|photo| photo.foreground_source),
        views: fits,
        aligned: verdict.map(|verdict| verdict.aligned),
        suggestion,
        doubtful,
    };
    Ok((inspection, ShownOnPage { scene, views, _pictures: pictures }))
}

/// How views that do not line up could be brought to: what is to be found brings the cameras into the splat's own frame.
fn diagnosis(
    scene: &Scene,
    views: &[View],
    fits: &[ViewFit],
    verdict: &Verdict,
    progress: Progress,
) -> Result<Diagnosis, SceneError> {
    let in_input = |view: &View| View { camera: scene.camera_in_input(&view.camera), ..view.clone() };
    let views: Vec<View> = views.iter().map(in_input).collect();
    diagnose::suggest(&scene.in_input_frame(), &views, fits, verdict, progress)
}

/// Draws the views of a mesh into a folder of their own; nothing for other scenes.
fn draw_mesh(scene: &mut Scene, options: &Options) -> Result<Option<TempDir>, SceneError> {
    let Some(count) = scene.views_to_render(options).filter(|_| scene.mesh.is_some()) else { return Ok(None) };
    let cannot = |reason| SceneError::Io { path: std::env::temp_dir(), reason };
    let pictures = tempfile::tempdir().map_err(cannot)?;
    let write_to = Folder::open(pictures.path()).map_err(cannot)?;
    render_views(scene, count.get(), pictures.path(), Some(&write_to)).map_err(cannot)?;
    Ok(Some(pictures))
}

/// Loads the scene, without views if it has no cameras or no photos.
fn load(folder: &Path, options: &Options, progress: Progress) -> Result<Scene, SceneError> {
    let without_views = |reason: SceneError| {
        let options = Options { render_views: Some(NonZeroUsize::MIN), ..options.clone() };
        let mut scene = scene::load_with_progress(folder, &options, progress)?;
        scene.warnings.push(reason.to_string());
        Ok(scene)
    };
    match scene::load_with_progress(folder, options, progress) {
        Err(reason @ (SceneError::NoCameras { .. } | SceneError::NoPhotos { .. })) => without_views(reason),
        outcome => outcome,
    }
}

fn cameras(scene: &Scene) -> Option<Cameras> {
    let first = scene.views.first()?.camera.intrinsics;
    let center = scene.object_bounds().center();
    let distances = scene.views.iter().map(|view| (view.camera.center_in_world() - center).norm());
    Some(Cameras {
        count: scene.views.len(),
        first_size: [first.width, first.height],
        first_focal: [first.fx, first.fy],
        distorted: scene.views.iter().any(|view| !view.camera.intrinsics.distortion.is_none()),
        distance: [distances.clone().fold(f64::INFINITY, f64::min), distances.fold(0.0, f64::max)],
    })
}

/// Centres of some hundreds of the object's Gaussians, in the world frame.
fn samples(gaussians: &Gaussians) -> Vec<Point3<f64>> {
    const SAMPLES: usize = 300;
    let step = (gaussians.len() / SAMPLES).max(1);
    (0..gaussians.len()).step_by(step).map(|i| gaussians.center(i)).collect()
}
