//! The questions about an open scene: what they show, who has answered them, and what their answers depend on.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::camera::Camera;
use crate::consensus::{self, AskAbout};
use crate::error::{Error, Result};
use crate::files::{self, json};
use crate::pictures::framing;
use crate::pipeline::OBJECT;
use crate::pipeline::hasher::{Hasher, file_digest};
use crate::query::ask::budget::Budget;
use crate::query::ask::hints;
use crate::query::recorded::{Answerer, QuestionId};
use crate::query::session::{self, Folders, NumberedView, QuerySession, QueryView, Subjects, WholeViews};
use crate::query::{Bare, Hints, LabelSet, Options, Preview, QueryError, Sha256Hex};
use crate::scene::{ObjectChoice, ScaleChoice, View};
use crate::segment::LabelMap;
use crate::words::readable::significant;
use crate::words::shell;

use super::consensus::Unasked;
use super::subjects::FoundSubjects;
use super::{OpenScene, scene};

/// What a recording was asked.
#[derive(Deserialize)]
struct Asked {
    asked: QuestionId,
}

/// Hash of all that the answers to questions depend on, with all recordings, or only those of questions whose answers have one of these
/// schemas. The hasher has taken in the results of the stages before.
pub(super) fn key(open: &OpenScene, inputs: Hasher, schemas: Option<&[Sha256Hex]>) -> Result<String> {
    let options = &open.options.query;
    // The content of these files and folders counts, not how their paths are written.
    let labels = options.labels.clone().filter(|labels| !matches!(labels, LabelSet::File(_)));
    let without_paths = Options { prompts: None, recordings: None, lmm_body: None, labels, ..options.clone() };
    let candidates = session::candidates(options, &open.library)?;
    let mut hasher = inputs
        .with_json(&without_paths)
        .with_json(&open.options.consensus)
        .with_json(&candidates.families())
        .with_json(&candidates.materials())
        .with_json(&open.library.fillings())
        .with_json(&session::prompts(options)?.sha256());
    if let Some(fields) = &options.lmm_body {
        hasher = hasher.with(&file_digest(fields).unwrap_or_default());
    }
    let has_schema = |path: &Path, schemas: &[Sha256Hex]| {
        let recording = files::read(path).ok().and_then(|bytes| json::read::<Asked>(&bytes).ok());
        recording.is_some_and(|of| schemas.contains(&of.asked.schema_sha256))
    };
    for folder in session::recording_folders(options, open.home_of_recordings()) {
        let found = recordings_in(&folder).into_iter();
        for path in found.filter(|path| schemas.is_none_or(|schemas| has_schema(path, schemas))) {
            hasher = hasher
                .with(path.file_name().unwrap_or_default().as_encoded_bytes())
                .with(&file_digest(&path).unwrap_or_default());
        }
    }
    Ok(hasher.hex())
}

/// The queries of the chosen views, under `options`, which need not be the run's; the parts must have been found.
pub fn session_of<'a>(open: &'a OpenScene, about: &'a FoundSubjects, options: &'a Options) -> Result<QuerySession<'a>> {
    session_after(open, about, options, None)
}

/// As [`session_of`], after earlier questions of the run, whose budget this is.
pub(super) fn session_after<'a>(
    open: &'a OpenScene,
    about: &'a FoundSubjects,
    options: &'a Options,
    budget: Option<Budget>,
) -> Result<QuerySession<'a>> {
    let views =
        open.views.iter().enumerate().map(|(number, view)| {
            Ok(QueryView { name: &view.name, photo: open.photo(view)?, maps: about.maps(number) })
        });
    let views: Vec<QueryView> = views.collect::<Result<_>>()?;
    let (subjects, ask_views) = about.subjects(open);
    let asks_size = open.options.scene.scale == ScaleChoice::Estimate;
    let fullest = fullest_view(open);
    let recognition = match open.options.consensus.ask {
        AskAbout::Object => numbered_sides(open, fullest)?,
        AskAbout::Parts | AskAbout::Segments => Vec::new(),
    };
    let outer_size = outer_size(open)?;
    // Without a scale, nothing follows from what a thing may weigh.
    let asks_mass = !recognition.is_empty() && outer_size.is_some();
    let whole = WholeViews {
        size: fullest.filter(|_| asks_size),
        recognition,
        direct: if asks_mass { sides_of_guess(open, fullest) } else { Vec::new() },
        outer_size,
        bare: if open.scene.support.is_some() { Bare::First } else { Bare::No },
        hints: hints(open, options),
    };
    let regions = if whole.recognition.is_empty() { Vec::new() } else { about.regions(open)? };
    let (about, found) = (about.about(), about.found());
    asking(open, options, Subjects { views, subjects, ask_views, about, whole, regions, found, budget })
}

/// The sides of the object in the question what it is, with the parts as they are before anyone is asked.
fn numbered_sides(open: &OpenScene, fullest: Option<usize>) -> Result<Vec<NumberedView<'_>>> {
    let unasked = open.get::<Unasked>()?;
    let maps: Vec<&LabelMap> = unasked.0.maps.iter().collect();
    let numbered = |view: usize| NumberedView { view, map: Cow::Owned(maps[view].clone()) };
    Ok(sides(open, fullest, &maps, MOST_SIDES).into_iter().map(numbered).collect())
}

/// The question for the mass of the object alone, as the photos show it.
pub fn direct_session<'a>(open: &'a OpenScene) -> Result<QuerySession<'a>> {
    let view = |view: &'a View| Ok(QueryView { name: &view.name, photo: open.photo(view)?, maps: Vec::new() });
    let views = open.views.iter().map(view).collect::<Result<_>>()?;
    let whole = WholeViews {
        direct: sides_of_guess(open, fullest_view(open)),
        outer_size: outer_size(open)?,
        ..WholeViews::default()
    };
    let subjects = Subjects {
        views,
        subjects: Vec::new(),
        ask_views: 1,
        about: AskAbout::Object,
        whole,
        regions: Vec::new(),
        found: Vec::new(),
        budget: None,
    };
    asking(open, &open.options.query, subjects)
}

fn asking<'a>(open: &'a OpenScene, options: &'a Options, subjects: Subjects<'a>) -> Result<QuerySession<'a>> {
    let (home, network) = (open.home_of_recordings(), open.options.setup.network());
    session::check_recordings(options, home, &open.work, open.options.scene.read_scope(home))?;
    let folders = Folders { home, work: &open.work };
    QuerySession::new(options, subjects, &open.library, folders, network, open.progress())
}

/// Sides of the object in the question what it is: more would show each too small.
const MOST_SIDES: usize = 4;
/// Photos in the question for its mass alone: as many as people take to show a thing.
const SIDES_OF_GUESS: usize = 3;

/// Up to `most` of the chosen views that show the object, divided as `maps` say, from all sides; `first`, the one that shows most
/// of it, comes first. None without that.
fn sides(open: &OpenScene, first: Option<usize>, maps: &[&LabelMap], most: usize) -> Vec<usize> {
    let cameras: Vec<&Camera> = open.views.iter().map(|view| &view.camera).collect();
    let center = open.scene.object_bounds().center();
    first.map_or_else(Vec::new, |first| consensus::sides::sides(&cameras, center, maps, first, most))
}

/// The views in the question for the mass of the object alone.
fn sides_of_guess(open: &OpenScene, first: Option<usize>) -> Vec<usize> {
    sides(open, first, &vec![&LabelMap::default(); open.views.len()], SIDES_OF_GUESS)
}

/// The outer size of the object in words, if the scale is known before anyone is asked: a model knows what such things weigh.
fn outer_size(open: &OpenScene) -> Result<Option<String>> {
    const CM_PER_M: f64 = 100.0;
    Ok(scene::scale(open)?.map(|scale| {
        let in_cm = |side| significant(side * scale.meters_per_unit * CM_PER_M);
        let [a, b, c] = open.scene.least_box().map(in_cm);
        format!("outer size {a} x {b} x {c} cm")
    }))
}

/// What the file of a mesh calls things, if the user wants the model to know.
fn hints(open: &OpenScene, options: &Options) -> Option<String> {
    let mesh = open.scene.mesh.as_ref().filter(|_| options.hints == Hints::Names)?;
    hints::paragraph(&mesh.names_in_file())
}

/// Estimates what a query would send, and its cost.
pub fn preview(open: &OpenScene) -> Result<Preview> {
    let about = FoundSubjects::of(open)?;
    let session = session_of(open, &about, &open.options.query)?;
    Ok(session.preview(&session.queries()?))
}

/// The index of the chosen view that shows most of the object, regardless of its parts.
pub fn fullest_view(open: &OpenScene) -> Option<usize> {
    let cameras = open.views.iter().map(|view| &view.camera);
    framing::shows_most(cameras, &open.scene.gaussians, &vec![0; open.scene.gaussians.len()])
}

/// The error, with commands that name the scene if it names any.
pub(super) fn about_scene(error: Error, open: &OpenScene) -> Error {
    match error.downcast::<QueryError>() {
        Ok(missing) => {
            let scene = shell::path(&open.path);
            let typed = match open.options.scene.object {
                ObjectChoice::One(number) => format!("{scene} --{OBJECT} {number}"),
                ObjectChoice::Auto | ObjectChoice::All => scene,
            };
            missing.about(&typed).into()
        }
        Err(other) => other,
    }
}

/// The recordings in a folder, sorted; none if it cannot be read.
fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<_> = entries.filter(|path| path.extension().is_some_and(|end| end == "json")).collect();
    found.sort();
    found
}

/// The names of all whose answers are recorded with the scene and may have been used, in order.
pub fn answered_by(open: &OpenScene) -> Vec<String> {
    let options = &open.options.query;
    let folders = session::recording_folders(options, open.home_of_recordings());
    let model_of =
        |path: PathBuf| json::read::<Answerer>(&files::read(&path).ok()?).ok().map(|answerer| answerer.model);
    let models: BTreeSet<String> =
        folders.iter().flat_map(|folder| recordings_in(folder)).filter_map(model_of).collect();
    let may_answer = |model: &String| options.lmm_model.as_ref().is_none_or(|asked| asked == model);
    models.into_iter().filter(may_answer).collect()
}
