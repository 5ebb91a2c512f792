//! The files of segments, which scenes and single pictures have alike: one label map per view and `segments.json`, both
//! written as soon as a view is done.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{Context, Result, UsageError};
use crate::segment::formats::{Format, coco};
use crate::segment::sam::model_digest;
use crate::segment::{self, LabelMap, Segment, Segmenter, ViewSegments};
use crate::setup;
use crate::words::progress::Progress;
use crate::workdir::{Artifact, Checksum, WorkDir, WorkDirError};

use super::hasher::Hasher;

/// The content of `segments/segments.json`, by view.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct SegmentsFile {
    /// File name of the picture, if it is a single one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    pub views: BTreeMap<String, ViewEntry>,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct ViewEntry {
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

/// More segments than ever lie in each other.
const DEEPEST: usize = 100;

/// True if the segments are numbered from 1 on, and each lies in one with a lower number if it lies in any, and in no more than
/// [`DEEPEST`]. A work folder may come from anyone, and whoever follows the parents of a segment must come to an end soon.
pub fn are_nested(segments: &[Segment]) -> bool {
    let mut depths = vec![0; segments.len() + 1];
    (1..).zip(segments).all(|(number, segment)| {
        let is_numbered = usize::from(segment.id) == number && segment.parent < segment.id;
        if is_numbered {
            depths[number] = depths[usize::from(segment.parent)] + 1;
        }
        is_numbered && depths[number] <= DEEPEST
    })
}

/// True if the map shows no other segments than these.
pub fn shows_only(map: &LabelMap, segments: &[Segment]) -> bool {
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
        // Another version of gprop seals entries in another way.
        let (entry, artifact) = (self.views.remove(view).filter(|entry| entry.key == key)?, Artifact::LabelMap(view));
        if !entry.is_whole(view) {
            work.warn_changed(&Artifact::Segments.path(), REMEDY);
            return None;
        }
        // A missing label map is recreated without a warning.
        let png = work.read(artifact).ok()?;
        if Checksum::of(&png) != entry.map {
            work.warn_changed(&artifact.path(), REMEDY);
            return None;
        }
        Some((entry, png))
    }

    /// Writes the label map of a view and adds its entry to `segments.json`.
    pub fn save(&mut self, work: &WorkDir, done: &ViewSegments, key: String) -> Result<()> {
        let png = done.map.to_png().with_context(|| format!("view {}", done.view))?;
        work.write(Artifact::LabelMap(&done.view), &png)?;
        self.views.insert(done.view.clone(), ViewEntry::new(&done.view, key, done.segments.clone(), &png));
        Ok(work.write_json(Artifact::Segments, self)?)
    }
}

/// The `segments.json` of an earlier run; empty, with a warning, if gprop did not write it.
pub fn stored_segments(work: &WorkDir) -> SegmentsFile {
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

/// Identifies the models that make the masks: those of the catalogue by their pins, the user's by their content.
pub fn models_key(setup: &setup::Options) -> String {
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
pub fn check_formats(formats: &[Format]) -> Result<(), UsageError> {
    if formats.contains(&Format::Npy) && formats.contains(&Format::Langsplat) {
        return Err(UsageError("--also: npy and langsplat write the same files (VIEW_s.npy); give one of them".into()));
    }
    Ok(())
}

/// Removes the segments of views that are about to be segmented anew in the other formats; one file holds those of all
/// views.
pub fn remove_other_formats(work: &WorkDir, views: &[&str]) -> Result<(), WorkDirError> {
    let arrays = views.iter().map(|view| Artifact::LabelArray(view));
    arrays.chain([Artifact::Coco]).try_for_each(|artifact| work.remove(artifact))
}

/// Writes the label maps in the other formats that were requested. `photos` are the file names of the views' photos.
pub fn write_other_formats<'a>(
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
