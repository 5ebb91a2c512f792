//! One picture instead of a scene: its parts, what they are made of, and a map of it. The first half of the method, for
//! which a single view is enough.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use tracing::info;

use crate::exit::UsageError;
use crate::materials::MaterialLibrary;
use crate::progress::Progress;
use crate::query::Answers;
use crate::report::material_map;
use crate::scene::Photo;
use crate::segment::{LabelMap, Segmenter, ViewSegments, segment_views};
use crate::setup;
use crate::workdir::{Artifact, WorkDir};

use super::Options;
use super::desk::{Desk, DeskView};
use super::query::write_sheets;
use super::record::Hasher;
use super::scene::file_digest;
use super::segment::{SegmentsFile, ViewEntry, models_key};

/// The picture's name among views.
const VIEW: &str = "picture";

/// A picture on its way through segmentation and queries.
pub struct Picture {
    work: WorkDir,
    options: Options,
    library: Cow<'static, MaterialLibrary>,
    photo: Photo,
    segments: ViewSegments,
    progress: Progress,
}

/// The picture's work folder: beside it and of its name, where the user names none.
fn work_folder(path: &Path, out: Option<&Path>) -> PathBuf {
    out.map_or_else(|| path.with_extension(crate::workdir::DEFAULT_NAME), Path::to_owned)
}

impl Picture {
    /// Reads the picture in `path`, its foreground by `mask` or its alpha, and finds its parts; those that an earlier run
    /// found are taken where they are still good.
    pub fn open(
        path: &Path,
        mask: Option<&Path>,
        out: Option<&Path>,
        options: Options,
        progress: Progress,
    ) -> Result<Self> {
        let photo = Photo::open(path, mask)?;
        let work = WorkDir::open(&work_folder(path, out))?;
        let key = segments_key(path, mask, &options)?;
        let segments = match segmented_before(&work, &key) {
            Some(segments) => segments,
            None => segment(&work, key, &photo, &options, progress)?,
        };
        if let Some(warning) = segments.warning() {
            tracing::warn!("{warning}");
        }
        if segments.parts.is_empty() {
            return Err(UsageError(format!("{path:?} has no foreground: its alpha or its mask is empty")).into());
        }
        Ok(Self { work, library: options.materials.library()?, options, photo, segments, progress })
    }

    /// Whether an earlier run found the picture's parts and they are still good; makes and does nothing.
    pub fn is_segmented(path: &Path, mask: Option<&Path>, out: Option<&Path>, options: &Options) -> Result<bool> {
        Photo::open(path, mask)?;
        let folder = work_folder(path, out);
        Ok(folder.exists() && segmented_before(&WorkDir::open(&folder)?, &segments_key(path, mask, options)?).is_some())
    }

    /// The queries of the picture's parts; recordings lie in the work folder.
    pub fn desk(&self) -> Result<Desk<'_>> {
        let view = DeskView { name: &self.segments.view, photo: self.photo.clone(), segments: &self.segments };
        Desk::new(&self.options.query, vec![view], &self.library, self.work.root(), &self.work, self.progress)
    }

    /// Answers the queries and draws the map of materials.
    pub fn run(&self) -> Result<Answers> {
        let desk = self.desk()?;
        let queries = desk.queries()?;
        write_sheets(&self.work, &queries)?;
        let answers = desk.run(&queries)?.answers;
        self.work.write(Artifact::Answers, answers.to_jsonl().as_bytes())?;
        answers.require_any()?;
        let map = material_map::draw(&self.photo, &self.segments.map, &answers);
        let mut png = std::io::Cursor::new(Vec::new());
        map.write_to(&mut png, image::ImageFormat::Png).context("the material map does not encode")?;
        self.work.write(Artifact::MaterialMap, png.get_ref())?;
        Ok(answers)
    }

    /// The work folder.
    pub fn work(&self) -> &WorkDir {
        &self.work
    }
}

/// What the parts depend on.
fn segments_key(path: &Path, mask: Option<&Path>, options: &Options) -> Result<String> {
    let mut hasher = Hasher::new(VIEW).with_json(&options.segment).with(models_key(&options.setup).as_bytes());
    for file in [Some(path), mask].into_iter().flatten() {
        hasher = hasher.with(&file_digest(file).with_context(|| format!("cannot read {file:?}"))?);
    }
    Ok(hasher.hex())
}

fn segmented_before(work: &WorkDir, key: &str) -> Option<ViewSegments> {
    let mut file: SegmentsFile = work.read_json(Artifact::Segments).ok()?;
    let entry = file.views.remove(VIEW).filter(|entry| entry.key == key)?;
    let map = LabelMap::from_png(&work.read(Artifact::LabelMap(VIEW)).ok()?).ok()?;
    info!("the parts found earlier are still good");
    Some(ViewSegments { view: VIEW.to_owned(), map, parts: entry.parts })
}

fn segment(work: &WorkDir, key: String, photo: &Photo, options: &Options, progress: Progress) -> Result<ViewSegments> {
    let models = setup::obtain(&options.setup, progress)?;
    let segmenter = Segmenter::new(&models, rayon::current_num_threads())?;
    let load = |_: &str| Ok(photo.clone());
    let found = segment_views(&segmenter, &[VIEW], &load, &options.segment, progress, &|_| Ok(()))?;
    let segments = found.views.into_iter().next().context("one picture has one view")?;
    work.write(Artifact::LabelMap(VIEW), &segments.map.to_png()?)?;
    let entry = ViewEntry { key, parts: segments.parts.clone() };
    work.write_json(Artifact::Segments, &SegmentsFile { views: [(VIEW.to_owned(), entry)].into() })?;
    Ok(segments)
}
