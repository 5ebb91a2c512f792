//! Pictures and films for `gprop show`.

use std::collections::BTreeMap;

use anyhow::Result;

use super::segment::open_segmenter;
use super::{Pipeline, png};
use crate::error::UsageError;
use crate::film;
use crate::from_splat::photo_with_foreground;
use crate::pictures::figure::Shown;
use crate::pictures::turntable::Turntable;
use crate::pictures::{framing, segmented};
use crate::query::Outcome;
use crate::scene::{self, View};

impl Pipeline {
    /// The field as seen by a view of the scene, even one that did not vote, as PNG; by default the chosen view that
    /// shows most of the object. The scene must be voted on.
    pub(crate) fn show(&self, shown: Shown, view: Option<&str>) -> Result<Vec<u8>> {
        let field = self.stored_field()?;
        let view = found(view, self.showing_view(field), &self.scene.views)?;
        png(&self.draw(shown, view, field)?)
    }

    /// The materials that the answers about one chosen view give its segments or parts, beside those that the vote gives
    /// the Gaussians, as PNG; by default the view that shows most of the object. The scene must be voted on.
    pub(crate) fn show_vote(&self, view: Option<&str>) -> Result<Vec<u8>> {
        let (field, answers) = (self.stored_field()?, self.stored_answers()?);
        let view = found(view, self.showing_view(field), &self.views)?;
        let index = self.views.iter().position(|chosen| chosen.name == view.name).unwrap_or(0);
        let parts = self.found_parts()?;
        let map = match parts {
            Some(found) => &found.maps[index],
            None => &self.segmentation()?.views[index].map,
        };
        let material = |id: u16| {
            let of_id = answers.segments.iter().find(|answer| answer.view == view.name && answer.segment == id);
            match &of_id?.outcome {
                Outcome::Answered(answer) => Some(answer.material.clone()),
                Outcome::Failed(_) => None,
            }
        };
        // A piece without an answer of its own has that of its part.
        let part_of = |id: u16| parts.map_or(id, |found| found.part_of(id));
        let most = map.labels.iter().max().copied().unwrap_or(0);
        let answered: BTreeMap<u16, String> =
            (1..=most).filter_map(|id| Some((id, material(id).or_else(|| material(part_of(id)))?))).collect();
        let object = self.object(field);
        let photo = photo_with_foreground(&self.scene, view)?;
        png(&segmented::before_and_after(&view.camera, &photo, (map, &answered), object))
    }

    /// The segments of one view at each of SAM's levels, found anew, as PNG; by default of the chosen view that shows most
    /// of the object.
    pub(crate) fn show_levels(&self, view: Option<&str>) -> Result<Vec<u8>> {
        let fullest = self.fullest_view().map(|index| &self.views[index]);
        let view = found(view, fullest, &self.scene.views)?;
        let segmenter = open_segmenter(&self.options.setup, &self.options.segment, self.progress)?;
        let photo = photo_with_foreground(&self.scene, view)?;
        let levels = segmenter.segment_levels(&photo, &self.options.segment)?;
        png(&segmented::levels(&view.camera, &photo, &levels))
    }

    /// The index of the chosen view that shows most of the object, regardless of its parts.
    pub(super) fn fullest_view(&self) -> Option<usize> {
        let cameras = self.views.iter().map(|view| &view.camera);
        framing::shows_most(cameras, &self.scene.gaussians, &vec![0; self.scene.gaussians.len()])
    }

    /// The object on a turntable, as a film. The scene must be voted on.
    pub(crate) fn turntable(&self, shown: Shown, format: film::Format) -> Result<Vec<u8>> {
        let film = self.options.simulate.viewpoint.film;
        let turntable = Turntable::new(shown, self.object(self.stored_field()?), film);
        let bar = self.progress.bar("film", turntable.count() as u64);
        let bytes = format.encode(film.fps, turntable.count(), |index| {
            bar.inc(1);
            turntable.picture(index)
        });
        bar.finish_and_clear();
        Ok(bytes?)
    }
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
