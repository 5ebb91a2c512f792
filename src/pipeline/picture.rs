//! Processes one picture instead of a scene: its segments, their materials, and a map of the materials. This is the
//! first half of the method, for which a single view is enough.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use tracing::info;

use crate::error::UsageError;
use crate::materials::MaterialLibrary;
use crate::pictures::material_map;
use crate::progress::Progress;
use crate::query::Answers;
use crate::query::question::About;
use crate::query::rounds::Subject;
use crate::scene::Photo;
use crate::segment::{self, LabelMap, Segment, SegmentError, ViewSegments, segment_views};
use crate::workdir::{self, Artifact, WorkDir, WorkDirError};

use super::query::write_sheets;
use super::query_session::{QuerySession, QueryView, Subjects, check_recordings};
use super::record::Hasher;
use super::scene::file_digest;
use super::segment::{
    SegmentsFile, ViewEntry, check_formats, models_key, open_segmenter, stored_segments, write_other_formats,
};
use super::{Options, png};

/// A picture being segmented and queried.
pub struct Picture {
    work: WorkDir,
    options: Options,
    library: Cow<'static, MaterialLibrary>,
    photo: Photo,
    /// Width and height of the stored picture after it is turned upright.
    size: (u32, u32),
    /// The segments in pixels of `photo`, which is smaller than the picture if the picture is huge.
    segments: ViewSegments,
    progress: Progress,
}

/// The view name of the picture.
fn view_name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The picture's work folder: by default beside it, with a name derived from it.
///
/// # Errors
/// If it is a link that the user did not name.
fn work_folder(path: &Path, out: Option<&Path>) -> Result<PathBuf, WorkDirError> {
    workdir::named_or(out, path.with_extension(workdir::DEFAULT_NAME))
}

impl Picture {
    /// Reads the picture in `path`, with its foreground from `mask` or its alpha, and finds its segments; segments from
    /// an earlier run are reused if they are still valid.
    pub fn open(
        path: &Path,
        mask: Option<&Path>,
        out: Option<&Path>,
        options: Options,
        progress: Progress,
    ) -> Result<Self> {
        if options.segment.segments.is_some() {
            return Err(UsageError(
                "--segments is for the views of a scene; gprop finds a picture's segments itself".to_owned(),
            )
            .into());
        }
        check_formats(&options.segment.also)?;
        let (photo, size) = Photo::open(path, mask)?;
        let work = WorkDir::open(&work_folder(path, out)?)?;
        let key = segments_key(path, mask, &options)?;
        let view = view_name(path);
        let segments = match segmented_before(&work, &view, &key) {
            Some(segments) => at_size(segments, photo.rgb.dimensions()),
            None => segment(&work, &view, key, (&photo, size), &options, progress)?,
        };
        if let Some(warning) = segments.warning() {
            tracing::warn!("{warning}");
        }
        Ok(Self { work, library: options.materials.library()?, options, photo, size, segments, progress })
    }

    /// True if an earlier run found the picture's segments and they are still valid; does not create or change
    /// anything.
    pub fn is_segmented(path: &Path, mask: Option<&Path>, out: Option<&Path>, options: &Options) -> Result<bool> {
        Photo::open(path, mask)?;
        let (folder, key) = (work_folder(path, out)?, segments_key(path, mask, options)?);
        Ok(folder.exists() && segmented_before(&WorkDir::open(&folder)?, &view_name(path), &key).is_some())
    }

    /// Writes the segments in the other formats that were requested, and returns them in pixels of the picture.
    pub fn segments(&self) -> Result<ViewSegments> {
        let segments = [at_size(self.segments.clone(), self.size)];
        write_other_formats(&self.work, &self.options.segment.also, &segments)?;
        let [segments] = segments;
        Ok(segments)
    }

    /// The queries of the picture's segments; recordings are in the work folder.
    ///
    /// # Errors
    /// If prompts or recordings cannot be read, or the picture has no foreground.
    pub fn query_session(&self) -> Result<QuerySession<'_>> {
        if self.segments.segments.is_empty() {
            let view = &self.segments.view;
            return Err(UsageError(format!("{view} has no foreground: its alpha or its mask is empty")).into());
        }
        let maps = vec![Cow::Borrowed(&self.segments.map)];
        let view = QueryView { name: &self.segments.view, photo: self.photo.clone(), maps };
        let subjects = self.segments.segments.iter().map(|segment| Subject::segment(0, segment.id)).collect();
        let home = self.work.root();
        check_recordings(home, &self.work, self.options.scene.read_scope(home))?;
        let (query, network) = (&self.options.query, self.options.setup.network());
        let subjects = Subjects { views: vec![view], subjects, ask_views: 1, about: About::Segments, size_in: None };
        QuerySession::new(query, subjects, &self.library, home, &self.work, network, self.progress)
    }

    /// Answers the queries and draws the material map.
    pub fn run(&self) -> Result<Answers> {
        let (answers, _) = self.query_session()?.answer_all(&|round| Ok(write_sheets(&self.work, round)?))?;
        self.work.write(Artifact::Answers, answers.to_jsonl().as_bytes())?;
        answers.require_any()?;
        let map = material_map::draw(&self.photo, &self.segments.map, &answers);
        self.work.write(Artifact::MaterialMap, &png(&map)?)?;
        Ok(answers)
    }

    /// The work folder.
    pub fn work(&self) -> &WorkDir {
        &self.work
    }
}

/// Hash of everything that the segments depend on.
fn segments_key(path: &Path, mask: Option<&Path>, options: &Options) -> Result<String> {
    let mut hasher =
        Hasher::new("picture").with_json(&options.segment.deciding()).with(models_key(&options.setup).as_bytes());
    for file in [Some(path), mask].into_iter().flatten() {
        hasher = hasher.with(&file_digest(file)?);
    }
    Ok(hasher.hex())
}

fn segmented_before(work: &WorkDir, view: &str, key: &str) -> Option<ViewSegments> {
    let (entry, png) = stored_segments(work).take(work, view, key)?;
    let map = LabelMap::from_png(&png).ok()?;
    info!("the segments found earlier are still valid");
    Some(ViewSegments { view: view.to_owned(), map, segments: entry.segments })
}

/// Finds the segments and writes them in pixels of the picture, whose size is `size`; returns them in pixels of
/// `photo`.
fn segment(
    work: &WorkDir,
    view: &str,
    key: String,
    (photo, size): (&Photo, (u32, u32)),
    options: &Options,
    progress: Progress,
) -> Result<ViewSegments> {
    let segmenter = open_segmenter(&options.setup, &options.segment, progress)?;
    let flat = segment::Options { level: Some(options.segment.flat_level()), ..options.segment.clone() };
    let load = |_: &str| Ok::<_, SegmentError>(photo.clone());
    let found = segment_views(&segmenter, &[view], &load, &flat, progress, &|_| Ok(()))?;
    let found = found.views.into_iter().next().context("one picture has one view")?;
    let written = at_size(found.clone(), size);
    let png = written.map.to_png()?;
    work.write(Artifact::LabelMap(view), &png)?;
    let entry = ViewEntry::new(view, key, written.segments, &png);
    work.write_json(Artifact::Segments, &SegmentsFile { views: [(view.to_owned(), entry)].into() })?;
    Ok(found)
}

/// The segments, scaled to another size of the picture.
fn at_size(found: ViewSegments, (width, height): (u32, u32)) -> ViewSegments {
    let small = (found.map.width, found.map.height);
    if small == (width, height) {
        return found;
    }
    let map = found.map.resized(width, height);
    let segments = found.segments.into_iter().map(|segment| segment_at_size(segment, &map, small)).collect();
    ViewSegments { map, segments, ..found }
}

fn segment_at_size(segment: Segment, map: &LabelMap, before: (u32, u32)) -> Segment {
    let scale = |value: u32, to: u32, from: u32| (u64::from(value) * u64::from(to)).div_ceil(u64::from(from)) as u32;
    let area = map.labels.iter().filter(|&&label| label == segment.id).count() as u32;
    let [x, y, width, height] = segment.bbox;
    let bbox = [
        scale(x, map.width, before.0),
        scale(y, map.height, before.1),
        scale(width, map.width, before.0),
        scale(height, map.height, before.1),
    ];
    Segment { area, bbox, ..segment }
}
