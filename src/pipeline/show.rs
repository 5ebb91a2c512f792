//! Pictures and films for `gprop show`.

use std::collections::BTreeMap;

use super::segment_files::open_segmenter;
use super::stages::OpenScene;
use super::stages::questions::fullest_view;
use super::stages::subjects::FoundSubjects;
use super::stages::vote::{ShowsMost, draw, object};
use crate::error::{Result, UsageError};
use crate::film;
use crate::pictures::figure::Shown;
use crate::pictures::turntable::Turntable;
use crate::pictures::{png, segmented};
use crate::query::{Answers, Outcome, SubjectId};
use crate::scene::{self, View};
use crate::vote::MaterialField;

/// The field as seen by a view of the scene, even one that did not vote, as PNG; by default the chosen view that shows
/// most of the object. The scene must be voted on.
pub fn field(open: &OpenScene, shown: Shown, view: Option<&str>) -> Result<Vec<u8>> {
    let view = found(view, open.get::<ShowsMost>()?.view(open), &open.scene.views)?;
    Ok(png(&draw(open, shown, view, &*open.get::<MaterialField>()?)?)?)
}

/// The materials that the answers about one chosen view give its segments or parts, beside those that the vote gives
/// the Gaussians, as PNG; by default the view that shows most of the object. The scene must be voted on.
pub fn vote(open: &OpenScene, view: Option<&str>) -> Result<Vec<u8>> {
    let (field, answers) = (open.get::<MaterialField>()?, open.get::<Answers>()?);
    let view = found(view, open.get::<ShowsMost>()?.view(open), &open.views)?;
    let index = open.views.iter().position(|chosen| chosen.name == view.name).unwrap_or(0);
    let about = FoundSubjects::of(open)?;
    let map = match &about {
        FoundSubjects::Parts(found) => &found.maps[index],
        FoundSubjects::Segments(segmentation) => &segmentation.views[index].map,
    };
    let outcomes = answers.by_subject();
    let material = |id: u16| match outcomes.get(&(&*view.name, SubjectId::of(about.about(), id)))? {
        Outcome::Answered(answer) => Some(answer.material.clone()),
        Outcome::Failed(_) => None,
    };
    // A piece without an answer of its own has that of its part.
    let part_of = |id: u16| match &about {
        FoundSubjects::Parts(found) => found.part_of(id),
        FoundSubjects::Segments(_) => id,
    };
    let most = map.labels.iter().max().copied().unwrap_or(0);
    let answered: BTreeMap<u16, String> =
        (1..=most).filter_map(|id| Some((id, material(id).or_else(|| material(part_of(id)))?))).collect();
    let photo = open.photo(view)?;
    Ok(png(&segmented::before_and_after(&view.camera, &photo, map, &answered, object(open, &field)?))?)
}

/// The segments of one view at each of SAM's levels, found anew, as PNG; by default of the chosen view that shows most of
/// the object.
pub fn levels(open: &OpenScene, view: Option<&str>) -> Result<Vec<u8>> {
    let fullest = fullest_view(open).map(|index| &open.views[index]);
    let view = found(view, fullest, &open.scene.views)?;
    let segmenter = open_segmenter(&open.options.setup, &open.options.segment, open.progress())?;
    let photo = open.photo(view)?;
    let levels = segmenter.segment_levels(&photo, &open.options.segment)?;
    Ok(png(&segmented::levels(&view.camera, &photo, &levels))?)
}

/// The object on a turntable, as a film. The scene must be voted on.
pub fn turntable(open: &OpenScene, shown: Shown, format: film::Format) -> Result<Vec<u8>> {
    let (field, film) = (open.get::<MaterialField>()?, open.options.simulate.viewpoint.film);
    let turntable = Turntable::new(shown, object(open, &field)?, film);
    let bar = open.progress().bar("film", turntable.count() as u64);
    let bytes = format.encode(film.fps, turntable.count(), |index| {
        bar.inc(1);
        turntable.picture(index)
    });
    bar.finish_and_clear();
    Ok(bytes?)
}

/// The view called `name` among `views`; `fallback` if no name is given.
fn found<'a>(name: Option<&str>, fallback: Option<&'a View>, views: &'a [View]) -> Result<&'a View, UsageError> {
    match name {
        None => fallback.ok_or_else(|| UsageError("there is no view to show".to_owned())),
        Some(name) => match scene::index_of(views, name) {
            Ok(index) => Ok(&views[index]),
            Err(unknown) => Err(UsageError(format!("--view: {unknown}"))),
        },
    }
}
