//! Segmentation on disk: one label map per view and `segments.json`, both written as soon as a view is done.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;

use anyhow::{Context, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;
use crate::error::UsageError;
use crate::from_splat::photo_with_foreground;
use crate::scene::{Upright, View};
use crate::segment::formats::{Format, coco, file_of_view, import_view};
use crate::segment::sam::model_digest;
use crate::segment::{LabelMap, Segment, Segmentation, Segmenter, ViewSegments, segment_views};
use crate::words::progress::Progress;
use crate::workdir::{Artifact, Checksum, WorkDir, WorkDirError};
use crate::{segment, setup};

use super::record::Hasher;
use super::scene::file_digest;
use super::{Done, Pipeline, Stage, get_or_load};

/// The content of `segments/segments.json`, by view.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct SegmentsFile {
    /// File name of the picture, if it is a single one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    pub views: BTreeMap<String, ViewEntry>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct ViewEntry {
    /// Hash of everything that the view's segments depend on; if it differs, the view is segmented again.
    pub key: String,
    pub segments: Vec<Segment>,
    /// Checksum of the label map's file.
    pub map: Checksum,
    /// Hash of the entry with the view's name.
    pub seal: String,
}

impl ViewEntry {
    /// The entry of a view whose label map is `png`.
    pub fn new(view: &str, key: String, segments: Vec<Segment>, png: &[u8]) -> Self {
        let map = Checksum::of(png);
        Self { seal: seal(view, &key, &segments, &map), key, segments, map }
    }

    /// True if the entry belongs to the view, is unchanged, and numbers its segments as gprop does.
    fn is_whole(&self, view: &str) -> bool {
        self.seal == seal(view, &self.key, &self.segments, &self.map) && are_nested(&self.segments)
    }
}

/// True if the segments are numbered from 1 on, and each lies in one with a lower number if it lies in any. A work folder
/// may come from anyone, and whoever follows the parents of a segment must come to an end.
fn are_nested(segments: &[Segment]) -> bool {
    let is_nested =
        |(number, segment): (usize, &Segment)| usize::from(segment.id) == number && segment.parent < segment.id;
    (1..).zip(segments).all(is_nested)
}

/// True if the map shows no other segments than these.
pub(super) fn shows_only(map: &LabelMap, segments: &[Segment]) -> bool {
    map.labels.iter().all(|&label| usize::from(label) <= segments.len())
}

fn seal(view: &str, key: &str, segments: &[Segment], map: &Checksum) -> String {
    Hasher::new("segments").with(view.as_bytes()).with(key.as_bytes()).with_json(&segments).with_json(map).hex()
}

impl SegmentsFile {
    /// Removes and returns the entry of a view whose key is `key`, with its label map's file, if both are as they were
    /// written; warns if one of them was changed.
    pub fn take(&mut self, work: &WorkDir, view: &str, key: &str) -> Option<(ViewEntry, Vec<u8>)> {
        const REMEDY: &str = "the affected view is segmented again";
        let (entry, artifact) = (self.views.remove(view)?, Artifact::LabelMap(view));
        if !entry.is_whole(view) {
            work.warn_changed(&Artifact::Segments.path(), REMEDY);
            return None;
        }
        // A missing label map is recreated without a warning.
        let png = work.read(artifact).ok().filter(|_| entry.key == key)?;
        if Checksum::of(&png) != entry.map {
            work.warn_changed(&artifact.path(), REMEDY);
            return None;
        }
        Some((entry, png))
    }
}

/// The `segments.json` of an earlier run; empty, with a warning, if gprop did not write it.
pub(super) fn stored_segments(work: &WorkDir) -> SegmentsFile {
    match work.read_json(Artifact::Segments) {
        Ok(file) => file,
        Err(error) => {
            if matches!(error, WorkDirError::Damaged { .. }) {
                work.warn_changed(&Artifact::Segments.path(), "all views are segmented again");
            }
            SegmentsFile::default()
        }
    }
}

/// Hashes of everything that the segments of each view depend on, by the view's name.
type ViewKeys<'a> = BTreeMap<&'a str, String>;

impl Pipeline {
    pub(super) fn segment_key(&self) -> Result<String> {
        Ok(self.hash_of_segments()?.with_json(&self.options.segment.also).hex())
    }

    /// A hasher that has taken in everything that the segments depend on.
    fn hash_of_segments(&self) -> Result<Hasher> {
        let hasher = self.key_after_inputs(Stage::Segment).with_json(&self.options.segment.deciding());
        let mut hasher = hasher.with(self.masks_key().as_bytes());
        if let Some(folder) = &self.options.segment.segments {
            for view in &self.views {
                hasher = hasher.with(&imported_digest(folder, &view.name)?);
            }
        }
        Ok(hasher)
    }

    pub(super) fn do_segment(&self) -> Result<Done> {
        let keys = self.view_keys()?;
        let mut file = self.finished_views(&keys);
        let open: Vec<&str> =
            self.views.iter().map(|view| view.name.as_str()).filter(|name| !file.views.contains_key(*name)).collect();
        if !open.is_empty() && !self.imports_from_work_folder() {
            remove_other_formats(&self.work, &open)?;
        }
        match &self.options.segment.segments {
            Some(folder) => self.import_open(folder, &open, &keys, &mut file)?,
            None if open.is_empty() => {}
            None => self.segment_open(&open, &keys, &mut file)?,
        }
        let views = &self.segmentation()?.views;
        let also = write_other_formats(&self.work, &self.options.segment.also, views, &self.photo_names())?;
        let label_maps = self.views.iter().map(|view| Artifact::LabelMap(&view.name));
        let warnings = views.iter().filter_map(|view| self.warning_about(view)).collect();
        let done = Done::writing(label_maps.chain([Artifact::Segments]).chain(also)).warning(warnings);
        // Later stages read none of the other formats.
        Ok(Done { digest: Some(self.hash_of_segments()?.hex()), ..done })
    }

    fn segment_open(&self, open: &[&str], keys: &ViewKeys, file: &mut SegmentsFile) -> Result<()> {
        let segmenter = open_segmenter(&self.options.setup, &self.options.segment, self.progress)?;
        let load = |name: &str| Ok(photo_with_foreground(&self.scene, self.view(name))?);
        let file = Mutex::new(file);
        let save = |done: &ViewSegments| {
            let mut file = file.lock().expect("a thread that panicked ended the process");
            self.save_view(done, keys[done.view.as_str()].clone(), &mut file)
        };
        segment_views(&segmenter, open, &load, &self.options.segment, self.progress, &save)?;
        Ok(())
    }

    /// Takes the masks of the open views from a folder.
    fn import_open(&self, folder: &Path, open: &[&str], keys: &ViewKeys, file: &mut SegmentsFile) -> Result<()> {
        for name in open {
            let intrinsics = &self.view(name).camera.intrinsics;
            let size = (intrinsics.width, intrinsics.height);
            let imported = import_view(folder, name, size, self.options.segment.flat_level())?;
            self.save_view(&imported, keys[name].clone(), file)?;
        }
        Ok(())
    }

    /// True if `--segments` names the folder into which label maps are written: its other formats are then the user's.
    fn imports_from_work_folder(&self) -> bool {
        let written = self.work.path(Artifact::Segments);
        let real = |path: &Path| path.canonicalize().ok();
        self.options.segment.segments.as_deref().is_some_and(|folder| real(folder) == written.parent().and_then(real))
    }

    /// The photos' paths, relative to the scene's folder if they lie in it, otherwise only their file names.
    fn photo_names(&self) -> Vec<String> {
        let relative = |view: &View| {
            let path = view.image.strip_prefix(&self.folder).ok();
            let name = path.map(Path::as_os_str).or(view.image.file_name()).unwrap_or_default();
            name.to_string_lossy().into_owned()
        };
        self.views.iter().map(relative).collect()
    }

    /// A warning about a view's segments for the user, if there is one.
    fn warning_about(&self, view: &ViewSegments) -> Option<String> {
        let Some(folder) = &self.options.segment.segments else { return view.warning() };
        view.segments.is_empty().then(|| {
            format!(
                "the label map of view {} in --segments {folder:?} has only background, so the view has no segments; \
                 check the file, or choose other views with --view-list",
                view.view
            )
        })
    }

    fn save_view(&self, done: &ViewSegments, key: String, file: &mut SegmentsFile) -> Result<()> {
        let png = done.map.to_png().with_context(|| format!("view {}", done.view))?;
        self.work.write(Artifact::LabelMap(&done.view), &png)?;
        file.views.insert(done.view.clone(), ViewEntry::new(&done.view, key, done.segments.clone(), &png));
        Ok(self.work.write_json(Artifact::Segments, file)?)
    }

    /// The segments of the chosen views.
    pub(super) fn segmentation(&self) -> Result<&Segmentation> {
        get_or_load(&self.segmentation, || {
            let mut file: SegmentsFile = self.work.read_json(Artifact::Segments)?;
            let views = self.views.iter().map(|view| -> Result<ViewSegments> {
                let artifact = Artifact::LabelMap(&view.name);
                let map = LabelMap::from_png(&self.work.read(artifact)?)
                    .map_err(|problem| self.work.damaged(artifact, problem))?;
                let entry = file.views.remove(&view.name);
                let missing = || self.work.damaged(Artifact::Segments, format!("it has no view {}", view.name));
                let segments = entry.ok_or_else(missing)?.segments;
                if !are_nested(&segments) {
                    let problem = format!("the segments of view {} are not numbered as gprop numbers them", view.name);
                    return Err(self.work.damaged(Artifact::Segments, problem).into());
                }
                let Intrinsics { width, height, .. } = view.camera.intrinsics;
                if (map.width, map.height) != (width, height) || !shows_only(&map, &segments) {
                    let problem = "it does not fit the photo or the view's segments in segments.json";
                    return Err(self.work.damaged(artifact, problem).into());
                }
                Ok(ViewSegments { view: view.name.clone(), map, segments })
            });
            Ok(Segmentation { views: views.collect::<Result<_>>()? })
        })
    }

    /// The chosen views that an earlier run finished and that are still valid.
    fn finished_views(&self, keys: &ViewKeys) -> SegmentsFile {
        let mut good = SegmentsFile::default();
        if self.must_redo(Stage::Segment) {
            return good;
        }
        let mut file = stored_segments(&self.work);
        for view in &self.views {
            if let Some((entry, _)) = file.take(&self.work, &view.name, &keys[view.name.as_str()]) {
                good.views.insert(view.name.clone(), entry);
            }
        }
        good
    }

    fn view(&self, name: &str) -> &View {
        self.views.iter().find(|view| view.name == name).expect("only chosen views are segmented")
    }

    /// The keys of the chosen views.
    fn view_keys(&self) -> Result<ViewKeys<'_>> {
        let (gaussians, masks) = (self.gaussians_key()?, self.masks_key());
        // In parallel, because some photos are decoded.
        let keys: Vec<Result<String>> =
            self.views.par_iter().map(|view| self.view_key(view, &gaussians, masks)).collect();
        self.views.iter().zip(keys).map(|(view, key)| Ok((view.name.as_str(), key?))).collect()
    }

    /// The hash of everything that a view's segments depend on: its photo, the options and the models (`masks`), but not
    /// the other views. If the foreground is rendered from the Gaussians, these count too (`gaussians`).
    fn view_key(&self, view: &View, gaussians: &str, masks: &str) -> Result<String> {
        let intrinsics = &view.camera.intrinsics;
        let mut hasher = Hasher::new("view")
            .with(&file_digest(&view.image)?)
            .with_json(&(intrinsics.width, intrinsics.height, view.upright == Upright::Turned))
            .with_json(&self.options.segment.deciding());
        if let Some(folder) = &self.options.segment.segments {
            return Ok(hasher.with(&imported_digest(folder, &view.name)?).hex());
        }
        match &view.mask {
            Some(mask) => hasher = hasher.with(&file_digest(mask)?),
            None if view.coverage()?.is_none() => hasher = hasher.with(gaussians.as_bytes()).with_json(&view.camera),
            None => {}
        }
        Ok(hasher.with(masks.as_bytes()).hex())
    }

    /// Identifies the models that make the masks, if any do. The user's own are read only once: they may have gigabytes.
    fn masks_key(&self) -> &str {
        let imports = self.options.segment.segments.is_some();
        self.models.get_or_init(|| if imports { String::new() } else { models_key(&self.options.setup) })
    }
}

/// Identifies the models that make the masks: those of the catalogue by their pins, the user's by their content.
pub(super) fn models_key(setup: &setup::Options) -> String {
    let own = [&setup.sam_encoder, &setup.sam_decoder];
    let mut hasher = Hasher::new("models").with(setup::catalog::SAM.requirement.as_bytes());
    for path in own.into_iter().flatten() {
        // A file that cannot be read is reported by the set-up, with its remedy.
        hasher = hasher.with(&model_digest(path).unwrap_or_default());
    }
    hasher.hex()
}

/// Opens SAM with the given options, downloading it if need be.
pub fn open_segmenter(setup: &setup::Options, options: &segment::Options, progress: Progress) -> Result<Segmenter> {
    let models = setup::obtain(setup, progress)?;
    let segmenter = Segmenter::new(&models, options.decoder, rayon::current_num_threads())?;
    if !options.cache_embeddings {
        return Ok(segmenter);
    }
    Ok(segmenter.caching_embeddings(&setup::embeddings_folder()?, &models)?)
}

/// Checks that no two of the formats write the same files.
pub(super) fn check_formats(formats: &[Format]) -> Result<(), UsageError> {
    if formats.contains(&Format::Npy) && formats.contains(&Format::Langsplat) {
        return Err(UsageError("--also: npy and langsplat write the same files (VIEW_s.npy); give one of them".into()));
    }
    Ok(())
}

/// Removes the segments of views that are about to be segmented anew in the other formats; one file holds those of all
/// views.
pub(super) fn remove_other_formats(work: &WorkDir, views: &[&str]) -> Result<(), WorkDirError> {
    let arrays = views.iter().map(|view| Artifact::LabelArray(view));
    arrays.chain([Artifact::Coco]).try_for_each(|artifact| work.remove(artifact))
}

/// Writes the label maps in the other formats that were requested. `photos` are the file names of the views' photos.
pub(super) fn write_other_formats<'a>(
    work: &WorkDir,
    formats: &[Format],
    views: &'a [ViewSegments],
    photos: &[String],
) -> Result<Vec<Artifact<'a>>> {
    let mut written = Vec::new();
    for format in formats {
        if let Some(planes) = format.npy_planes() {
            for segments in views {
                let artifact = Artifact::LabelArray(&segments.view);
                work.write_with(artifact, |out| segments.map.write_npy(planes, out))?;
                written.push(artifact);
            }
        } else {
            work.write_json(Artifact::Coco, &coco(views, photos))?;
            written.push(Artifact::Coco);
        }
    }
    Ok(written)
}

/// SHA-256 of the file that a view's masks come from.
fn imported_digest(folder: &Path, view: &str) -> Result<[u8; 32]> {
    Ok(file_digest(&file_of_view(folder, view)?)?)
}

#[cfg(test)]
mod tests {
    use image::{Rgba, RgbaImage};

    use super::*;

    #[test]
    fn the_splat_counts_where_it_gives_the_foreground() {
        let hammer = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
        let folder = tempfile::tempdir().unwrap();
        let pipeline = Pipeline::builder(hammer).out(folder.path().join("out")).open().unwrap();
        let with_alpha = &pipeline.views[0];
        let opaque = View { image: folder.path().join("opaque.png"), ..with_alpha.clone() };
        let intrinsics = &with_alpha.camera.intrinsics;
        let white = RgbaImage::from_pixel(intrinsics.width, intrinsics.height, Rgba([255; 4]));
        white.save(&opaque.image).unwrap();
        let masked = View { mask: Some(opaque.image.clone()), ..opaque.clone() };
        let key = |view: &View, scene: &str| pipeline.view_key(view, scene, "models").unwrap();
        for (view, from_splat) in [(with_alpha, false), (&masked, false), (&opaque, true)] {
            assert_eq!(key(view, "a splat") != key(view, "another"), from_splat, "{:?}", view.image);
        }
        let turned = View { upright: Upright::Turned, ..masked.clone() };
        assert_ne!(key(&turned, ""), key(&masked, ""));
    }
}
