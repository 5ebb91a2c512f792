//! Segmentation on disk: one label map per view and `segments.json`, both written as soon as a view is done.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;

use super::scene::gaussians_key;
use super::{Done, Job, OpenScene, Row, Stage, Stored, never};
use crate::camera::Intrinsics;
use crate::error::Result;
use crate::parallel;
use crate::pipeline::hasher::{Hasher, file_digest};
use crate::pipeline::segment_files::{
    SegmentsFile, are_nested, models_key, open_segmenter, remove_other_formats, shows_only, stored_segments,
    write_other_formats,
};
use crate::scene::{ObjectSource, Upright, View};
use crate::segment::formats::{file_of_view, import_view, within};
use crate::segment::{LabelMap, Segmentation, ViewSegments, segment_views};
use crate::workdir::Artifact;

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene],
    options: &["segment", "setup"],
    result: Artifact::Segments,
    key: |open, inputs| Ok(hash_of_segments(open, inputs)?.with_json(&open.options.segment.also).hex()),
    is_stale: never,
    run,
};

/// Hashes of everything that the segments of each view depend on, by the view's name.
type ViewKeys<'a> = BTreeMap<&'a str, String>;

/// A hasher that has taken in everything that the segments depend on.
fn hash_of_segments(open: &OpenScene, inputs: Hasher) -> Result<Hasher> {
    let mut hasher = inputs.with_json(&open.options.segment.deciding()).with(open.get::<Models>()?.0.as_bytes());
    if let Some(folder) = &open.options.segment.segments {
        for view in &open.views {
            hasher = hasher.with(&imported_digest(folder, &view.name)?);
        }
    }
    Ok(hasher)
}

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let (work, options) = (&open.work, &open.options.segment);
    let keys = view_keys(open)?;
    let mut file = if job.anew { SegmentsFile::default() } else { finished_views(open, &keys) };
    let left: Vec<&str> =
        open.views.iter().map(|view| view.name.as_str()).filter(|name| !file.views.contains_key(*name)).collect();
    if !left.is_empty() && !imports_from_work_folder(open) {
        remove_other_formats(work, &left)?;
    }
    match &options.segments {
        Some(folder) => import(open, folder, &left, &keys, &mut file)?,
        None if left.is_empty() => {}
        None => segment(open, &left, &keys, &mut file)?,
    }
    let views = &open.get::<Segmentation>()?.views;
    let also = write_other_formats(work, &options.also, views, &photo_names(open))?;
    let label_maps = open.views.iter().map(|view| Artifact::LabelMap(&view.name));
    let warnings = views.iter().filter_map(|view| warning_about(open, view)).collect();
    let done = Done::writing(label_maps.chain([Artifact::Segments]).chain(also)).warning(warnings);
    // Later stages read none of the other formats.
    Ok(Done { digest: Some(hash_of_segments(open, job.inputs.clone())?.hex()), ..done })
}

/// Finds the segments of the named views with SAM.
fn segment(open: &OpenScene, names: &[&str], keys: &ViewKeys, file: &mut SegmentsFile) -> Result<()> {
    let options = &open.options.segment;
    let segmenter = open_segmenter(&open.options.setup, options, open.progress())?;
    let load = |name: &str| Ok(open.photo(view(open, name))?);
    let file = Mutex::new(file);
    let save = |done: &ViewSegments| -> Result<()> {
        let mut file = file.lock().expect("a thread that panicked ended the process");
        file.save(&open.work, done, keys[done.view.as_str()].clone())?;
        Ok(open.progress().check()?)
    };
    segment_views(&segmenter, names, &load, options, open.progress(), &save)?;
    Ok(())
}

/// Takes the masks of the named views from a folder.
fn import(open: &OpenScene, folder: &Path, names: &[&str], keys: &ViewKeys, file: &mut SegmentsFile) -> Result<()> {
    for name in names {
        let intrinsics = &view(open, name).camera.intrinsics;
        let size = (intrinsics.width, intrinsics.height);
        let level = open.options.segment.flat_level();
        let mut imported = import_view(folder, name, size, level)?;
        // The masks are of everything that the photo shows.
        if open.scene.object_source == ObjectSource::Standing {
            imported = within(&imported, &open.photo(view(open, name))?.foreground, level)?;
        }
        file.save(&open.work, &imported, keys[name].clone())?;
    }
    Ok(())
}

/// True if `--segments` names the folder into which label maps are written: its other formats are then the user's.
fn imports_from_work_folder(open: &OpenScene) -> bool {
    let written = open.work.path(Artifact::Segments);
    let real = |path: &Path| path.canonicalize().ok();
    open.options.segment.segments.as_deref().is_some_and(|folder| real(folder) == written.parent().and_then(real))
}

/// The photos' paths, relative to the scene's folder if they lie in it, otherwise only their file names.
fn photo_names(open: &OpenScene) -> Vec<String> {
    let relative = |view: &View| {
        let path = view.image.strip_prefix(&open.folder).ok();
        let name = path.map(Path::as_os_str).or(view.image.file_name()).unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    open.views.iter().map(relative).collect()
}

/// A warning about a view's segments for the user, if there is one.
fn warning_about(open: &OpenScene, view: &ViewSegments) -> Option<String> {
    let Some(folder) = &open.options.segment.segments else { return view.warning() };
    view.segments.is_empty().then(|| {
        format!(
            "the label map of view {} in --segments {folder:?} has only background, so the view has no segments; \
             check the file, or choose other views with --view-list",
            view.view
        )
    })
}

/// The segments of the chosen views.
impl Stored for Segmentation {
    const STAGE: Stage = Stage::Segment;

    fn load(open: &OpenScene) -> Result<Self> {
        let work = &open.work;
        let mut file: SegmentsFile = work.read_json(Artifact::Segments)?;
        let views = open.views.iter().map(|view| -> Result<ViewSegments> {
            let artifact = Artifact::LabelMap(&view.name);
            let map = LabelMap::from_png(&work.read(artifact)?).map_err(|problem| work.damaged(artifact, problem))?;
            let entry = file.views.remove(&view.name);
            let missing = || work.damaged(Artifact::Segments, format!("it has no view {}", view.name));
            let segments = entry.ok_or_else(missing)?.segments;
            if !are_nested(&segments) {
                let problem = format!("the segments of view {} are not numbered as gprop numbers them", view.name);
                return Err(work.damaged(Artifact::Segments, problem).into());
            }
            let Intrinsics { width, height, .. } = view.camera.intrinsics;
            if (map.width, map.height) != (width, height) || !shows_only(&map, &segments) {
                let problem = "it does not fit the photo or the view's segments in segments.json";
                return Err(work.damaged(artifact, problem).into());
            }
            Ok(ViewSegments { view: view.name.clone(), map, segments })
        });
        Ok(Self { views: views.collect::<Result<_>>()? })
    }
}

/// The chosen views that an earlier run finished and that are still valid.
fn finished_views(open: &OpenScene, keys: &ViewKeys) -> SegmentsFile {
    let mut good = SegmentsFile::default();
    let mut file = stored_segments(&open.work);
    for view in &open.views {
        if let Some((entry, _)) = file.take(&open.work, &view.name, &keys[view.name.as_str()]) {
            good.views.insert(view.name.clone(), entry);
        }
    }
    good
}

fn view<'a>(open: &'a OpenScene, name: &str) -> &'a View {
    open.views.iter().find(|view| view.name == name).expect("only chosen views are segmented")
}

/// The keys of the chosen views.
fn view_keys(open: &OpenScene) -> Result<ViewKeys<'_>> {
    let (gaussians, models) = (gaussians_key(open)?, open.get::<Models>()?);
    // In parallel, because some photos are decoded.
    let keys: Vec<Result<String>> = parallel::map(&open.views, |view| view_key(open, view, &gaussians, &models.0));
    open.views.iter().zip(keys).map(|(view, key)| Ok((view.name.as_str(), key?))).collect()
}

/// The hash of everything that a view's segments depend on: its photo, the options and the models, but not the other
/// views. If the foreground is rendered from the Gaussians, these count too (`gaussians`).
fn view_key(open: &OpenScene, view: &View, gaussians: &str, models: &str) -> Result<String> {
    let intrinsics = &view.camera.intrinsics;
    let mut hasher = Hasher::new("view")
        .with(&file_digest(&view.image)?)
        .with_json(&(intrinsics.width, intrinsics.height, view.upright == Upright::Turned))
        .with_json(&open.options.segment.deciding());
    if let Some(folder) = &open.options.segment.segments {
        if open.scene.object_source == ObjectSource::Standing {
            hasher = hasher.with(gaussians.as_bytes()).with_json(&view.camera);
        }
        return Ok(hasher.with(&imported_digest(folder, &view.name)?).hex());
    }
    match &view.mask {
        Some(mask) => {
            let read = (&mask.color, mask.orientation.to_exif());
            hasher = hasher.with(&file_digest(&mask.path)?).with_json(&read);
        }
        None if view.coverage()?.is_none() => hasher = hasher.with(gaussians.as_bytes()).with_json(&view.camera),
        None => {}
    }
    Ok(hasher.with(models.as_bytes()).hex())
}

/// Identifies the models that make the masks, if any do. The user's own are read only once: they may have gigabytes.
struct Models(String);

impl Stored for Models {
    /// They are known once the options are, and stay the same if the segments are made anew.
    const STAGE: Stage = Stage::Scene;

    fn load(open: &OpenScene) -> Result<Self> {
        let imports = open.options.segment.segments.is_some();
        Ok(Self(if imports { String::new() } else { models_key(&open.options.setup) }))
    }
}

/// SHA-256 of the file that a view's masks come from.
fn imported_digest(folder: &Path, view: &str) -> Result<[u8; 32]> {
    Ok(file_digest(&file_of_view(folder, view)?)?)
}

#[cfg(test)]
mod tests {
    use image::{Rgba, RgbaImage};

    use super::*;
    use crate::Pipeline;
    use crate::scene::{Mask, MaskColor};

    #[test]
    fn the_splat_counts_where_it_gives_the_foreground() {
        let hammer = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
        let folder = tempfile::tempdir().unwrap();
        let pipeline = Pipeline::builder(hammer).out(folder.path().join("out")).open().unwrap();
        let open = pipeline.opened();
        let with_alpha = &open.views[0];
        let opaque = View { image: folder.path().join("opaque.png"), ..with_alpha.clone() };
        let intrinsics = &with_alpha.camera.intrinsics;
        let white = RgbaImage::from_pixel(intrinsics.width, intrinsics.height, Rgba([255; 4]));
        white.save(&opaque.image).unwrap();
        let masked = View { mask: Some(Mask::new(opaque.image.clone())), ..opaque.clone() };
        let key = |view: &View, scene: &str| view_key(open, view, scene, "models").unwrap();
        for (view, from_splat) in [(with_alpha, false), (&masked, false), (&opaque, true)] {
            assert_eq!(key(view, "a splat") != key(view, "another"), from_splat, "{:?}", view.image);
        }
        let turned = View { upright: Upright::Turned, ..masked.clone() };
        assert_ne!(key(&turned, ""), key(&masked, ""));
        let mut black = Mask::new(opaque.image.clone());
        black.color = MaskColor::Black;
        assert_ne!(key(&View { mask: Some(black), ..opaque.clone() }, ""), key(&masked, ""));
    }
}
