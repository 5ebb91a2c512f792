//! Processes one picture instead of a scene: its segments, their materials, and a map of the materials. This is the
//! first half of the method, for which a single view is enough.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use tracing::info;

use crate::consensus::AskAbout;
use crate::error::{Result, UsageError};
use crate::materials::MaterialLibrary;
use crate::pictures::{material_map, png};
use crate::query::Answers;
use crate::query::ask::rounds::Subject;
use crate::scene::Photo;
use crate::segment::{self, LabelMap, SegmentError, ViewSegments, segment_views};
use crate::words::progress::Progress;
use crate::workdir::{self, Artifact, WorkDir, WorkDirError};

use super::hasher::{Hasher, file_digest};
use super::options::Options;
use super::segment_files::{
    SegmentsFile, ViewEntry, check_formats, models_key, open_segmenter, remove_other_formats, shows_only,
    stored_segments, write_other_formats,
};
use crate::query::session::{Folders, QuerySession, QueryView, Subjects, WholeViews, check_recordings, write_sheets};

/// A picture being segmented and queried.
pub struct Picture {
    work: WorkDir,
    options: Options,
    library: Cow<'static, MaterialLibrary>,
    /// Its file's name.
    name: String,
    photo: Photo,
    /// Width and height of the stored picture after it is turned upright.
    size: (u32, u32),
    /// The segments in pixels of `photo`, which is smaller than the picture if the picture is huge.
    segments: ViewSegments,
    progress: Progress<'static>,
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The view name of the picture in the file `name`.
fn view_name(name: &str) -> String {
    Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
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
        progress: Progress<'static>,
    ) -> Result<Self> {
        check_options(&options)?;
        let (photo, size) = Photo::open(path, mask)?;
        let work = WorkDir::open(&work_folder(path, out)?)?;
        let (name, key) = (file_name(path), segments_key(path, mask, &options)?);
        let segments = match segmented_before(&work, &name, &key)? {
            Some(segments) => at_size(segments, photo.rgb.dimensions()),
            None => {
                let found = segment(&photo, &view_name(&name), &options, progress)?;
                write_segments(&work, &name, key, at_size(found.clone(), size))?;
                found
            }
        };
        if let Some(warning) = segments.warning() {
            tracing::warn!("{warning}");
        }
        Ok(Self { work, library: options.materials.library()?, options, name, photo, size, segments, progress })
    }

    /// True if an earlier run found the picture's segments and they are still valid; does not create or change
    /// anything.
    pub fn is_segmented(path: &Path, mask: Option<&Path>, out: Option<&Path>, options: &Options) -> Result<bool> {
        check_options(options)?;
        Photo::open(path, mask)?;
        let (folder, key) = (work_folder(path, out)?, segments_key(path, mask, options)?);
        Ok(folder.exists() && segmented_before(&WorkDir::open_to_read(&folder)?, &file_name(path), &key)?.is_some())
    }

    /// Writes the segments in the other formats that were requested, and returns them in pixels of the picture.
    pub fn segments(&self) -> Result<ViewSegments> {
        let segments = [at_size(self.segments.clone(), self.size)];
        write_other_formats(&self.work, &self.options.segment.also, &segments, std::slice::from_ref(&self.name))?;
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
        let (query, network) = (&self.options.query, self.options.setup.network());
        check_recordings(query, home, &self.work, self.options.scene.read_scope(home))?;
        let subjects = Subjects {
            views: vec![view],
            subjects,
            ask_views: 1,
            about: AskAbout::Segments,
            whole: WholeViews::default(),
            regions: Vec::new(),
            found: Vec::new(),
            budget: None,
        };
        let folders = Folders { home, work: &self.work };
        QuerySession::new(query, subjects, &self.library, folders, network, self.progress)
    }

    /// Answers the queries and draws the material map.
    pub fn run(&self) -> Result<Answers> {
        let answers = self.query_session()?.answer_parts(None, &|round| Ok(write_sheets(&self.work, round)?))?.answers;
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

/// Refuses options that do not fit a picture.
fn check_options(options: &Options) -> Result<(), UsageError> {
    let problem = if options.segment.segments.is_some() {
        "--segments is for the views of a scene; gprop finds a picture's segments itself"
    } else if options.scene.masks.is_some() {
        "--masks is for the views of a scene; give `gprop query` the mask of a picture with --mask"
    } else {
        return check_formats(&options.segment.also);
    };
    Err(UsageError(problem.to_owned()))
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

/// The segments of the picture in the file `name` that an earlier run found; `None` if there are none, they are no
/// longer valid, or the picture had another name then.
///
/// # Errors
/// If the work folder holds the results of another picture or of a scene, which would be overwritten.
fn segmented_before(work: &WorkDir, name: &str, key: &str) -> Result<Option<ViewSegments>, UsageError> {
    let mut stored = stored_segments(work);
    if stored.picture.is_none() && !stored.views.is_empty() {
        return Err(UsageError(format!(
            "the work folder {:?} holds the results of a scene, not of {name:?}: name another folder with --out",
            work.root()
        )));
    }
    if let Some(other) = stored.picture.as_deref().filter(|other| *other != name) {
        // The key covers the picture's content but not its name.
        if stored.views.values().any(|entry| entry.key == key) {
            return Ok(None);
        }
        return Err(UsageError(format!(
            "the work folder {:?} holds the results of {other:?}, not of {name:?}: name another folder with --out, or, if the \
             picture was only renamed, repeat the options of that run",
            work.root()
        )));
    }
    let view = view_name(name);
    let Some((entry, png)) = stored.take(work, &view, key) else { return Ok(None) };
    let Ok(map) = LabelMap::from_png(&png) else { return Ok(None) };
    if !shows_only(&map, &entry.segments) {
        return Ok(None);
    }
    info!("the segments found earlier are still valid");
    Ok(Some(ViewSegments { view, map, segments: entry.segments }))
}

/// Finds the segments of the photo, which is the only view, with the name `view`.
fn segment(photo: &Photo, view: &str, options: &Options, progress: Progress) -> Result<ViewSegments> {
    let segmenter = open_segmenter(&options.setup, &options.segment, progress)?;
    let flat = segment::Options { level: Some(options.segment.flat_level()), ..options.segment.clone() };
    let load = |_: &str| Ok::<_, SegmentError>(photo.clone());
    let found = segment_views(&segmenter, &[view], &load, &flat, progress, &|_| Ok(()))?;
    Ok(found.views.into_iter().next().expect("one picture has one view"))
}

/// Writes the segments of the picture in the file `name`, in pixels of the picture, over those of an earlier name.
fn write_segments(work: &WorkDir, name: &str, key: String, written: ViewSegments) -> Result<()> {
    let view = view_name(name);
    remove_other_formats(work, &[&view])?;
    for (other, entry) in stored_segments(work).views.iter().filter(|(other, _)| **other != view) {
        remove_results(work, other, entry)?;
    }
    let png = written.map.to_png()?;
    work.write(Artifact::LabelMap(&view), &png)?;
    let entry = ViewEntry::new(&view, key, written.segments, &png);
    let file = SegmentsFile { picture: Some(name.to_owned()), views: [(view, entry)].into() };
    Ok(work.write_json(Artifact::Segments, &file)?)
}

/// Removes what was written under the name that a renamed picture had.
fn remove_results(work: &WorkDir, view: &str, entry: &ViewEntry) -> Result<(), WorkDirError> {
    remove_other_formats(work, &[view])?;
    let sheets = entry.segments.iter().map(|segment| Artifact::Sheet(view, segment.id));
    sheets.chain([Artifact::LabelMap(view)]).try_for_each(|artifact| work.remove(artifact))
}

/// The segments, scaled to another size of the picture.
fn at_size(found: ViewSegments, (width, height): (u32, u32)) -> ViewSegments {
    if (found.map.width, found.map.height) == (width, height) { found } else { found.resized(width, height) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::{Level, Segment};

    /// Writes the results of the picture `name`, whose segments have this key, into a work folder.
    fn write_results(folder: &Path, name: &str, key: String) {
        let work = WorkDir::open(folder).unwrap();
        let view = view_name(name);
        let map = LabelMap { width: 1, height: 1, labels: vec![1] };
        let segments = vec![Segment {
            id: 1,
            area: 1,
            bbox: [0, 0, 1, 1],
            predicted_iou: 0.9,
            stability_score: 0.9,
            level: Level::Middle,
            parent: 0,
        }];
        let png = map.to_png().unwrap();
        work.write(Artifact::LabelMap(&view), &png).unwrap();
        let entry = ViewEntry::new(&view, key, segments, &png);
        let file = SegmentsFile { picture: Some(name.to_owned()), views: [(view, entry)].into() };
        work.write_json(Artifact::Segments, &file).unwrap();
    }

    #[test]
    fn a_work_folder_is_of_one_picture() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("mug.gprop");
        write_results(&root, "mug.jpg", "key".to_owned());
        let work = WorkDir::open(&root).unwrap();
        assert!(segmented_before(&work, "mug.jpg", "key").unwrap().is_some());
        assert!(segmented_before(&work, "mug.jpg", "changed").unwrap().is_none());
        let refused = segmented_before(&work, "mug.png", "another's").unwrap_err().to_string();
        assert!(["mug.jpg", "mug.png", "--out"].iter().all(|part| refused.contains(part)), "{refused}");
        assert!(segmented_before(&work, "cup.jpg", "key").unwrap().is_none(), "renamed, so it is segmented again");
    }

    #[test]
    fn the_results_of_a_scene_are_not_those_of_a_picture() {
        let folder = tempfile::tempdir().unwrap();
        write_results(folder.path(), "mug.jpg", "key".to_owned());
        let work = WorkDir::open(folder.path()).unwrap();
        let of_scene = SegmentsFile { picture: None, ..stored_segments(&work) };
        work.write_json(Artifact::Segments, &of_scene).unwrap();
        let refused = segmented_before(&work, "mug.jpg", "key").unwrap_err().to_string();
        assert!(["of a scene", "mug.jpg", "--out"].iter().all(|part| refused.contains(part)), "{refused}");
    }

    #[test]
    fn a_renamed_picture_leaves_nothing_under_its_old_name() {
        let folder = tempfile::tempdir().unwrap();
        write_results(folder.path(), "mug.jpg", "key".to_owned());
        let work = WorkDir::open(folder.path()).unwrap();
        work.write(Artifact::Sheet("mug", 1), b"sheet").unwrap();
        let stored = stored_segments(&work);
        remove_results(&work, "mug", &stored.views["mug"]).unwrap();
        assert!([Artifact::LabelMap("mug"), Artifact::Sheet("mug", 1)].iter().all(|of| work.size(*of).is_none()));
    }

    /// A work folder may come with a picture from anyone: its segments lie in each other without end.
    #[test]
    fn segments_that_lie_in_each_other_are_found_again() {
        let folder = tempfile::tempdir().unwrap();
        write_results(folder.path(), "mug.jpg", "key".to_owned());
        let work = WorkDir::open(folder.path()).unwrap();
        let png = work.read(Artifact::LabelMap("mug")).unwrap();
        let mut stored = stored_segments(&work);
        let mut segments = stored.views.remove("mug").unwrap().segments;
        segments[0].parent = 1;
        stored.views.insert("mug".to_owned(), ViewEntry::new("mug", "key".to_owned(), segments, &png));
        work.write_json(Artifact::Segments, &stored).unwrap();
        assert!(segmented_before(&work, "mug.jpg", "key").unwrap().is_none());
    }

    #[test]
    fn asking_whether_a_picture_is_segmented_writes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dot.png");
        image::RgbImage::new(1, 1).save(&path).unwrap();
        let options = Options::default();
        let is_segmented = || Picture::is_segmented(&path, None, None, &options).unwrap();
        assert!(!is_segmented());
        let root = folder.path().join("dot.gprop");
        assert!(!root.exists());
        write_results(&root, "dot.png", segments_key(&path, None, &options).unwrap());
        let files = || {
            let mut names: Vec<_> = std::fs::read_dir(&root).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        std::fs::remove_file(root.join(".lock")).unwrap();
        std::fs::write(root.join(".tmp-of-another"), "").unwrap();
        let before = files();
        assert!(is_segmented());
        assert_eq!(files(), before);
    }
}
